/* A slave for hosts of FMI 3.0: the functions of the standard, each implemented by one of instance.h.

   For co-simulation, without event mode, clocks and early return. */

#include <stdbool.h>
#include <stdint.h>

typedef bool Truth;

#include "instance.h"

#define FMI(name) fmi3##name

enum { TIME = VARIABLES }; /* the independent variable, after all others */

struct Host {
    void (*log)(void *environment, Status status, Text category, Text message);
    void *environment;
};

typedef struct {
    Instance instance;
    Host host;
} Whole;

static void send_message(const Instance *m, Status status, Text category, Text message)
{
    if (m->host->log)
        m->host->log(m->host->environment, status, category, message);
}

/* -- life cycle ------------------------------------------------------------------------------------------------- */

EXPORT Text fmi3GetVersion(void);
Text fmi3GetVersion(void) { return "3.0"; }

typedef void (*LogMessage)(void *environment, Status status, Text category, Text message);
typedef void (*Callback)(void);

EXPORT void *fmi3InstantiateCoSimulation(Text, Text, Text, bool, bool, bool, bool, References, size_t, void *,
                                         LogMessage, Callback);
void *fmi3InstantiateCoSimulation(Text name, Text token, Text resources, bool visible, bool logs, bool events,
                                  bool early_return, References intermediate, size_t n, void *environment,
                                  LogMessage log, Callback intermediate_update)
{
    Whole *whole;
    (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)n, (void)intermediate_update;
    if (!name || !token || events || strcmp(token, GUID) != 0) {
        if (log)
            log(environment, ERROR, "logStatusError",
                events ? "eventModeUsed: expected false, this FMU has no event mode"
                       : "instantiationToken: expected " GUID ", that of this FMU");
        return NULL;
    }
    whole = (Whole *)create(sizeof *whole, name, logs);
    if (!whole)
        return NULL;
    whole->host.log = log;
    whole->host.environment = environment;
    whole->instance.host = &whole->host;
    return whole;
}

EXPORT void *fmi3InstantiateModelExchange(Text, Text, Text, bool, bool, void *, LogMessage);
void *fmi3InstantiateModelExchange(Text name, Text token, Text resources, bool visible, bool logs, void *environment,
                                   LogMessage log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logs;
    if (log)
        log(environment, ERROR, "logStatusError", "fmi3InstantiateModelExchange: this FMU is for co-simulation");
    return NULL;
}

EXPORT void *fmi3InstantiateScheduledExecution(Text, Text, Text, bool, bool, void *, LogMessage, Callback, Callback,
                                               Callback);
void *fmi3InstantiateScheduledExecution(Text name, Text token, Text resources, bool visible, bool logs,
                                        void *environment, LogMessage log, Callback update, Callback lock,
                                        Callback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logs, (void)update, (void)lock, (void)unlock;
    if (log)
        log(environment, ERROR, "logStatusError", "fmi3InstantiateScheduledExecution: this FMU is for co-simulation");
    return NULL;
}

EXPORT void fmi3FreeInstance(void *);
void fmi3FreeInstance(void *c) { free(c); }

CALL(SetDebugLogging, bool on, size_t n, const Text *categories)
{
    INSTANCE;
    return set_logging(m, on, n, categories);
}

CALL(EnterInitializationMode, bool has_tolerance, double tolerance, double start_time, bool has_stop, double stop)
{
    INSTANCE;
    (void)has_tolerance, (void)tolerance;
    return set_times(m, start_time, has_stop, stop) == OK ? enter_initialization(m) : ERROR;
}

PLAIN(ExitInitializationMode)
{
    INSTANCE;
    return exit_initialization(m);
}

CALL(DoStep, double t, double h, bool no_set_state, bool *event, bool *terminate, bool *early, double *last)
{
    Status status;
    INSTANCE;
    (void)no_set_state;
    status = advance(m, t, h);
    *event = *terminate = *early = false;
    *last = m->state.time;
    return status;
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

static Status are_as_many(Instance *m, size_t references, size_t values)
{
    if (references == values)
        return OK;
    return refuse_with(m, "nValues: expected as many values as value references, for all variables are scalars", "", "");
}

/* Get Reals, among which may be the time. */
static Status get_reals_and_time(Instance *m, References vr, size_t n, double *value)
{
    for (size_t from = 0, to; from < n; from = to + 1) {
        for (to = from; to < n && vr[to] != TIME;)
            to++;
        if (get_reals(m, vr + from, to - from, value + from) != OK)
            return ERROR;
        if (to < n)
            value[to] = m->state.time;
    }
    return OK;
}

GET(enumerations, ENUMERATION, int64_t, as_int)
SET(enumerations, ENUMERATION, int64_t, (double)value[i])

#define ACCESS(kind, get, set, ctype) \
    CALL(Get##kind, References vr, size_t n, ctype *value, size_t values) \
    { \
        INSTANCE; \
        return are_as_many(m, n, values) == OK ? get(m, vr, n, value) : ERROR; \
    } \
    CALL(Set##kind, References vr, size_t n, const ctype *value, size_t values) \
    { \
        INSTANCE; \
        return are_as_many(m, n, values) == OK ? set(m, vr, n, value) : ERROR; \
    }

ACCESS(Float64, get_reals_and_time, set_reals, double)
ACCESS(Int32, get_integers, set_integers, int32_t)
ACCESS(Boolean, get_booleans, set_booleans, bool)
ACCESS(Int64, get_enumerations, set_enumerations, int64_t)

/* Functions of types that no variable has; some hosts call them with no references. */
#define NO_VARIABLES(name, ...) \
    CALL(name, References vr, size_t n, __VA_ARGS__) \
    { \
        INSTANCE; \
        (void)vr; \
        return n ? refuse_with(m, "fmi3" #name ": this FMU has no such variables", "", "") : OK; \
    }
#define NONE_OF(kind, ctype) \
    NO_VARIABLES(Get##kind, ctype *values, size_t n_values) \
    NO_VARIABLES(Set##kind, const ctype *values, size_t n_values)

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* of functions that refuse all calls */
#endif

NONE_OF(Float32, float)
NONE_OF(Int8, int8_t)
NONE_OF(UInt8, uint8_t)
NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t)
NONE_OF(UInt32, uint32_t)
NONE_OF(UInt64, uint64_t)
NONE_OF(String, Text)
NO_VARIABLES(GetBinary, size_t *sizes, const uint8_t **values, size_t n_values)
NO_VARIABLES(SetBinary, const size_t *sizes, const uint8_t *const *values, size_t n_values)
NO_VARIABLES(GetClock, bool *values)
NO_VARIABLES(SetClock, const bool *values)
NO_VARIABLES(GetIntervalDecimal, double *intervals, int *qualifiers)
NO_VARIABLES(SetIntervalDecimal, const double *intervals)
NO_VARIABLES(GetIntervalFraction, uint64_t *counters, uint64_t *resolutions, int *qualifiers)
NO_VARIABLES(SetIntervalFraction, const uint64_t *counters, const uint64_t *resolutions)
NO_VARIABLES(GetShiftDecimal, double *shifts)
NO_VARIABLES(SetShiftDecimal, const double *shifts)
NO_VARIABLES(GetShiftFraction, uint64_t *counters, uint64_t *resolutions)
NO_VARIABLES(SetShiftFraction, const uint64_t *counters, const uint64_t *resolutions)

/* -- states ------------------------------------------------------------------------------------------------------ */

CALL(GetFMUState, void **state)
{
    INSTANCE;
    return save(m, state);
}

CALL(SetFMUState, void *state)
{
    INSTANCE;
    return restore(m, state);
}

CALL(FreeFMUState, void **state)
{
    INSTANCE;
    return free_state(state);
}

CALL(SerializedFMUStateSize, void *state, size_t *size)
{
    INSTANCE;
    return size_of_bytes(m, size);
}

CALL(SerializeFMUState, void *state, uint8_t *bytes, size_t size)
{
    INSTANCE;
    return to_bytes(m, state, bytes, size);
}

CALL(DeserializeFMUState, const uint8_t *bytes, size_t size, void **state)
{
    INSTANCE;
    return from_bytes(m, bytes, size, state);
}

/* -- derivatives ------------------------------------------------------------------------------------------------- */

CALL(GetDirectionalDerivative, References z, size_t nz, References v, size_t nv, const double *dv, size_t n_dv,
     double *dz, size_t n_dz)
{
    INSTANCE;
    if (are_as_many(m, nv, n_dv) != OK || are_as_many(m, nz, n_dz) != OK)
        return ERROR;
    return derive(m, z, nz, v, nv, dv, dz);
}

/* -- functions that this FMU does not offer ----------------------------------------------------------------------- */

#define NOT_OFFERED(name) refuse_with(m, "fmi3" #name ": not offered by this FMU", "", "")
#define WITHOUT(name, ...) \
    CALL(name, __VA_ARGS__) \
    { \
        INSTANCE; \
        return NOT_OFFERED(name); \
    }
#define WITHOUT_PLAIN(name) \
    PLAIN(name) \
    { \
        INSTANCE; \
        return NOT_OFFERED(name); \
    }

WITHOUT(GetAdjointDerivative, References z, size_t nz, References v, size_t nv, const double *dz, size_t n_dz,
        double *dv, size_t n_dv)
WITHOUT(GetNumberOfVariableDependencies, unsigned vr, size_t *n)
WITHOUT(GetVariableDependencies, unsigned vr, size_t *elements, unsigned *independents, size_t *of_independents,
        int *dependency_kinds, size_t n)
WITHOUT(GetOutputDerivatives, References vr, size_t n, const int32_t *orders, double *values, size_t n_values)
WITHOUT(UpdateDiscreteStates, bool *again, bool *terminate, bool *nominals, bool *continuous, bool *has_next, double *next)
WITHOUT_PLAIN(EnterConfigurationMode)
WITHOUT_PLAIN(ExitConfigurationMode)
WITHOUT_PLAIN(EnterEventMode)
WITHOUT_PLAIN(EnterStepMode)
WITHOUT_PLAIN(EvaluateDiscreteStates)

/* Functions of model exchange and scheduled execution: some hosts require every function of the standard. */
WITHOUT(SetTime, double t)
WITHOUT(SetContinuousStates, const double *x, size_t n)
WITHOUT(GetContinuousStates, double *x, size_t n)
WITHOUT(GetContinuousStateDerivatives, double *dx, size_t n)
WITHOUT(GetNominalsOfContinuousStates, double *nominals, size_t n)
WITHOUT(GetNumberOfContinuousStates, size_t *n)
WITHOUT(GetEventIndicators, double *z, size_t n)
WITHOUT(GetNumberOfEventIndicators, size_t *n)
WITHOUT(CompletedIntegratorStep, bool no_set_state, bool *event, bool *terminate)
WITHOUT(ActivateModelPartition, unsigned clock, double t)
WITHOUT_PLAIN(EnterContinuousTimeMode)
