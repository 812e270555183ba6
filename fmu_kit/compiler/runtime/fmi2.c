/* A slave for hosts of FMI 2.0: the functions of the standard, each implemented by one of instance.h. */

typedef int Truth;

enum { HAS_TIME = 0 };

#define NAME(name) "fmi2" #name

#include "instance.h"

#define FMI(name) fmi2##name

enum { MODEL_EXCHANGE, CO_SIMULATION };

struct Host {
    void (*logger)(void *environment, Text instance, Status status, Text category, Text message, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, Status);
    void *environment;
};

/* A message is a printf format, which some hosts do not fill in: percent signs are doubled, and it has no arguments. */
static void send_message(const Instance *m, Status status, Text category, Text message)
{
    char format[2 * LONGEST_TEXT], *to = format;
    if (!m->host->logger)
        return;
    for (Text from = message; *from; from++) {
        *to++ = *from;
        if (*from == '%')
            *to++ = '%';
    }
    *to = '\0';
    m->host->logger(m->host->environment, m->name, status, category, format);
}

/* -- life cycle ------------------------------------------------------------------------------------------------- */

EXPORT Text fmi2GetTypesPlatform(void);
Text fmi2GetTypesPlatform(void) { return "default"; }

EXPORT Text fmi2GetVersion(void);
Text fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(Text, int, Text, Text, const Host *, int, int);
void *fmi2Instantiate(Text name, int kind, Text guid, Text location, const Host *host, int visible, int logs)
{
    Instance *m;
    (void)location, (void)visible;
    const int is_offered = kind == CO_SIMULATION || (kind == MODEL_EXCHANGE && STATES);
    if (!host || !name || !guid || !is_offered || strcmp(guid, GUID) != 0) {
        if (host && host->logger && name && guid)
            host->logger(host->environment, name, ERROR, "logStatusError",
                         is_offered ? "GUID = %s: expected %s, that of this FMU"
                                    : "fmuType of %s: expected fmi2CoSimulation of %s", guid, GUID);
        return NULL;
    }
    m = create(sizeof *m, name, logs);
    if (!m)
        return NULL;
    m->host = host;
    m->exchanges = kind == MODEL_EXCHANGE;
    begin(m);
    return m;
}

EXPORT void fmi2FreeInstance(void *);
void fmi2FreeInstance(void *c) { free(c); }

CALL(SetDebugLogging, int on, size_t n, const Text *categories)
{
    INSTANCE;
    return set_logging(m, on, n, categories);
}

CALL(SetupExperiment, int has_tolerance, double tolerance, double start_time, int has_stop, double stop)
{
    INSTANCE;
    (void)has_tolerance, (void)tolerance;
    return set_times(m, start_time, has_stop, stop);
}

PLAIN(EnterInitializationMode)
{
    INSTANCE;
    return enter_initialization(m);
}

PLAIN(ExitInitializationMode)
{
    INSTANCE;
    return exit_initialization(m);
}

CALL(DoStep, double t, double h, int no_set_state)
{
    INSTANCE;
    (void)no_set_state;
    return advance(m, t, h);
}

PLAIN(Terminate)
{
    INSTANCE;
    return end(m);
}

PLAIN(Reset)
{
    INSTANCE;
    begin(m);
    return OK;
}

/* -- values ----------------------------------------------------------------------------------------------------- */

#define ACCESS(kind, name, ctype) \
    CALL(Get##kind, References vr, size_t n, ctype *value) \
    { \
        INSTANCE; \
        return get_##name(m, vr, n, value); \
    } \
    CALL(Set##kind, References vr, size_t n, const ctype *value) \
    { \
        INSTANCE; \
        return set_##name(m, vr, n, value); \
    }

ACCESS(Real, reals, double)
ACCESS(Integer, integers, int)
ACCESS(Boolean, booleans, Truth)

CALL(GetString, References vr, size_t n, Text *value)
{
    INSTANCE;
    (void)value;
    return n ? refuse_references(m, vr, n, STRING) : OK;
}

CALL(SetString, References vr, size_t n, const Text *value)
{
    INSTANCE;
    (void)value;
    return n ? refuse_references(m, vr, n, STRING) : OK;
}

/* -- states ------------------------------------------------------------------------------------------------------ */

CALL(GetFMUstate, void **state)
{
    INSTANCE;
    return save(m, state);
}

CALL(SetFMUstate, void *state)
{
    INSTANCE;
    return restore(m, state);
}

CALL(FreeFMUstate, void **state)
{
    INSTANCE;
    return free_state(state);
}

CALL(SerializedFMUstateSize, void *state, size_t *size)
{
    INSTANCE;
    (void)state;
    return size_of_bytes(m, size);
}

CALL(SerializeFMUstate, void *state, char *bytes, size_t size)
{
    INSTANCE;
    return to_bytes(m, state, bytes, size);
}

CALL(DeSerializeFMUstate, const char *bytes, size_t size, void **state)
{
    INSTANCE;
    return from_bytes(m, bytes, size, state);
}

/* -- derivatives ------------------------------------------------------------------------------------------------- */

CALL(GetDirectionalDerivative, References z, size_t nz, References v, size_t nv, const double *dv, double *dz)
{
    INSTANCE;
    return derive(m, z, nz, v, nv, dv, dz);
}

/* -- model exchange ----------------------------------------------------------------------------------------------- */

#include "exchange.h"

typedef struct {
    int again, terminate, nominals, continuous, has_next;
    double next;
} Update;

CALL(GetDerivatives, double *values, size_t n)
{
    INSTANCE;
    OF_STATES(GetDerivatives, n);
    return get_of_states(m, values, n, 1);
}

PLAIN(EnterEventMode)
{
    INSTANCE;
    IN_CONTINUOUS_TIME(EnterEventMode);
    m->state.mode = EVENT_MODE;
    return OK;
}

CALL(NewDiscreteStates, Update *found)
{
    INSTANCE;
    IN_EXCHANGE(NewDiscreteStates, m->state.phase == STEPPING && m->state.mode == EVENT_MODE);
    *found = (Update){0};
    return update_at_event(m, &found->next, &found->has_next);
}

CALL(CompletedIntegratorStep, int no_set_state, int *event, int *terminate)
{
    INSTANCE;
    (void)no_set_state;
    IN_CONTINUOUS_TIME(CompletedIntegratorStep);
    *event = *terminate = 0;
    return OK;
}

/* -- functions that this FMU does not offer ----------------------------------------------------------------------- */

CALL(SetRealInputDerivatives, References vr, size_t n, const int *order, const double *value)
{
    INSTANCE;
    (void)vr, (void)n, (void)order, (void)value;
    return refuse_with(m, "fmi2SetRealInputDerivatives: not offered by this FMU", "", "");
}

CALL(GetRealOutputDerivatives, References vr, size_t n, const int *order, double *value)
{
    INSTANCE;
    (void)vr, (void)n, (void)order, (void)value;
    return refuse_with(m, "fmi2GetRealOutputDerivatives: not offered by this FMU", "", "");
}

PLAIN(CancelStep)
{
    INSTANCE;
    return refuse_with(m, "fmi2CancelStep: no step is ever under way", "", "");
}

#define STATUS(name, ctype) \
    CALL(Get##name, int kind, ctype *value) \
    { \
        (void)c, (void)kind, (void)value; \
        return DISCARD; \
    }

STATUS(Status, Status)
STATUS(RealStatus, double)
STATUS(IntegerStatus, int)
STATUS(BooleanStatus, int)
STATUS(StringStatus, Text)
