/* A slave for hosts of FMI 3.0: the functions of the standard, each implemented by one of instance.h.

   Without early return. A slave that samples (CLOCK_INTERVAL) has an input clock, which says in event mode when it does;
   without event mode its parameters say so. One with PARTITIONS is for scheduled execution, too, with a clock for
   each. */

#include <stdbool.h>
#include <stdint.h>

typedef bool Truth;

enum { HAS_TIME = 1 };

#define NAME(name) "fmi3" #name

#include "instance.h"

#define FMI(name) fmi3##name

#if defined(CLOCK_INTERVAL)
enum { HAS_CLOCK = 1, HAS_PARTITIONS = 0, ALL_CLOCKS = 1 };
static const double first_intervals[] = {CLOCK_INTERVAL};
#elif defined(PARTITIONS)
enum { HAS_CLOCK = 0, HAS_PARTITIONS = 1, SAMPLE_PERIOD = 0, ALL_CLOCKS = PARTITIONS };
#define first_intervals partition_intervals
#else
enum { HAS_CLOCK = 0, HAS_PARTITIONS = 0, SAMPLE_PERIOD = 0, ALL_CLOCKS = 0 };
static const double first_intervals[CLOCKS];
#endif

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

static void begin_in(Instance *m, Mode mode)
{
    m->state.mode = mode;
    memcpy(m->state.interval, first_intervals, sizeof m->state.interval);
}

/* -- life cycle ------------------------------------------------------------------------------------------------- */

EXPORT Text fmi3GetVersion(void);
Text fmi3GetVersion(void) { return "3.0"; }

typedef void (*LogMessage)(void *environment, Status status, Text category, Text message);
typedef void (*Callback)(void);

static Whole *created(Text name, Text token, bool logs, void *environment, LogMessage log, Text refusal)
{
    Whole *whole;
    if (!name || !token || refusal || strcmp(token, GUID) != 0) {
        if (log)
            log(environment, ERROR, "logStatusError",
                refusal ? refusal : "instantiationToken: expected " GUID ", that of this FMU");
        return NULL;
    }
    whole = (Whole *)create(sizeof *whole, name, logs);
    if (!whole)
        return NULL;
    whole->host.log = log;
    whole->host.environment = environment;
    whole->instance.host = &whole->host;
    begin_in(&whole->instance, NO_EVENTS);
    return whole;
}

EXPORT void *fmi3InstantiateCoSimulation(Text, Text, Text, bool, bool, bool, bool, References, size_t, void *,
                                         LogMessage, Callback);
void *fmi3InstantiateCoSimulation(Text name, Text token, Text resources, bool visible, bool logs, bool events,
                                  bool early_return, References intermediate, size_t n, void *environment,
                                  LogMessage log, Callback intermediate_update)
{
    Text refusal = events && !ALL_CLOCKS ? "eventModeUsed: expected false, this FMU has no event mode" : NULL;
    Whole *whole = created(name, token, logs, environment, log, refusal);
    (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)n, (void)intermediate_update;
    if (whole)
        whole->instance.state.mode = events ? EVENT_MODE : NO_EVENTS;
    return whole;
}

EXPORT void *fmi3InstantiateModelExchange(Text, Text, Text, bool, bool, void *, LogMessage);
void *fmi3InstantiateModelExchange(Text name, Text token, Text resources, bool visible, bool logs, void *environment,
                                   LogMessage log)
{
    Text refusal = STATES ? NULL : "fmi3InstantiateModelExchange: this FMU is for co-simulation";
    Whole *whole = created(name, token, logs, environment, log, refusal);
    (void)resources, (void)visible;
    if (whole) {
        whole->instance.exchanges = 1;
        whole->instance.state.mode = EVENT_MODE;
    }
    return whole;
}

EXPORT void *fmi3InstantiateScheduledExecution(Text, Text, Text, bool, bool, void *, LogMessage, Callback, Callback,
                                               Callback);
void *fmi3InstantiateScheduledExecution(Text name, Text token, Text resources, bool visible, bool logs,
                                        void *environment, LogMessage log, Callback update, Callback lock,
                                        Callback unlock)
{
    Text refusal = HAS_PARTITIONS ? NULL : "fmi3InstantiateScheduledExecution: this FMU is for co-simulation";
    Whole *whole = created(name, token, logs, environment, log, refusal);
    (void)resources, (void)visible, (void)update, (void)lock, (void)unlock;
    if (whole)
        whole->instance.state.mode = SCHEDULED;
    return whole;
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
    if (HAS_CLOCK && m->state.mode != NO_EVENTS && !m->exchanges)
        m->state.memory[SAMPLE_PERIOD] = 0.0; /* a sample at every tick */
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
    Mode mode;
    INSTANCE;
    mode = m->state.mode == NO_EVENTS || m->state.mode == SCHEDULED ? m->state.mode : EVENT_MODE;
    begin(m);
    begin_in(m, mode);
    return OK;
}

/* -- values ----------------------------------------------------------------------------------------------------- */

static Status are_as_many(Instance *m, size_t references, size_t values)
{
    if (references == values)
        return OK;
    return refuse_with(m, "nValues: expected as many values as value references, for all variables are scalars", "", "");
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

ACCESS(Float64, get_reals, set_reals, double)
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
NO_VARIABLES(GetIntervalFraction, uint64_t *counters, uint64_t *resolutions, int *qualifiers)
NO_VARIABLES(SetIntervalFraction, const uint64_t *counters, const uint64_t *resolutions)
NO_VARIABLES(GetShiftFraction, uint64_t *counters, uint64_t *resolutions)
NO_VARIABLES(SetShiftFraction, const uint64_t *counters, const uint64_t *resolutions)

/* -- clocks ----------------------------------------------------------------------------------------------------- */

enum { INTERVAL_CHANGED = 2 };

static Status expect_clock(Instance *m, References vr, size_t n, int is_time)
{
    for (size_t i = 0; i < n; i++)
        if (vr[i] < CLOCK || vr[i] >= CLOCK + ALL_CLOCKS)
            return refuse_with(m, "value references: expected those of clocks", "", "");
    return is_time ? OK : refuse_with(m, "clock: expected ticks in event mode, and its interval set before steps", "", "");
}

CALL(GetClock, References vr, size_t n, bool *values)
{
    INSTANCE;
    for (size_t i = 0; i < n; i++)
        values[i] = m->state.tick != NO_TICK;
    return expect_clock(m, vr, n, 1);
}

CALL(SetClock, References vr, size_t n, const bool *values)
{
    INSTANCE;
    if (expect_clock(m, vr, n, !n || m->state.mode == EVENT_MODE) != OK)
        return ERROR;
    for (size_t i = 0; i < n; i++) {
        if (!values[i] || m->state.tick == SAMPLED)
            continue;
        m->state.tick = TICKS;
#if defined(PARTITIONS)
        m->state.ticks[vr[i] - CLOCK] = 1;
#endif
    }
    return OK;
}

CALL(GetIntervalDecimal, References vr, size_t n, double *intervals, int *qualifiers)
{
    INSTANCE;
    if (expect_clock(m, vr, n, 1) != OK)
        return ERROR;
    for (size_t i = 0; i < n; i++)
        intervals[i] = m->state.interval[vr[i] - CLOCK], qualifiers[i] = INTERVAL_CHANGED;
    return OK;
}

CALL(SetIntervalDecimal, References vr, size_t n, const double *intervals)
{
    INSTANCE;
    if (expect_clock(m, vr, n, !n || m->state.phase == INSTANTIATED || m->state.phase == INITIALIZATION) != OK)
        return ERROR;
    for (size_t i = 0; i < n; i++) {
        if (!(intervals[i] > 0.0) || !q_isfinite(intervals[i]))
            return refuse_with(m, "interval of the clock: expected a positive number", "", "");
        m->state.interval[vr[i] - CLOCK] = intervals[i];
    }
    return OK;
}

CALL(SetShiftDecimal, References vr, size_t n, const double *shifts)
{
    INSTANCE;
    (void)shifts; /* it samples whenever the clock ticks */
    return expect_clock(m, vr, n, !n || m->state.phase == INSTANTIATED || m->state.phase == INITIALIZATION);
}

CALL(GetShiftDecimal, References vr, size_t n, double *shifts)
{
    INSTANCE;
    for (size_t i = 0; i < n; i++)
        shifts[i] = 0.0;
    return expect_clock(m, vr, n, 1);
}

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
WITHOUT_PLAIN(EnterConfigurationMode)
WITHOUT_PLAIN(ExitConfigurationMode)

/* -- model exchange ---------------------------------------------------------------------------------------------- */

#include "exchange.h"

CALL(GetContinuousStateDerivatives, double *values, size_t n)
{
    INSTANCE;
    OF_STATES(GetContinuousStateDerivatives, n);
    return get_of_states(m, values, n, 1);
}

CALL(GetNumberOfContinuousStates, size_t *n)
{
    INSTANCE;
    *n = STATES;
    return OK;
}

CALL(GetNumberOfEventIndicators, size_t *n)
{
    INSTANCE;
    *n = 0;
    return OK;
}

CALL(CompletedIntegratorStep, bool no_set_state, bool *event, bool *terminate)
{
    INSTANCE;
    (void)no_set_state;
    IN_CONTINUOUS_TIME(CompletedIntegratorStep);
    *event = *terminate = false;
    return OK;
}

/* -- event mode, for a host that asked for it ------------------------------------------------------------------- */

#define IN_MODE(name, condition) \
    if (m->state.mode == NO_EVENTS || m->state.mode == SCHEDULED) \
        return NOT_OFFERED(name); \
    if (m->state.phase != STEPPING || !(condition)) \
        return refuse_with(m, "fmi3" #name ": not allowed in this mode", "", "")

PLAIN(EnterEventMode)
{
    INSTANCE;
    IN_MODE(EnterEventMode, m->state.mode == STEP_MODE || m->state.mode == CONTINUOUS_MODE);
    m->state.mode = EVENT_MODE;
    return OK;
}

PLAIN(EnterStepMode)
{
    INSTANCE;
    IN_MODE(EnterStepMode, m->state.mode == EVENT_MODE && m->state.tick == NO_TICK && !m->exchanges);
    m->state.mode = STEP_MODE;
    return OK;
}

PLAIN(EvaluateDiscreteStates)
{
    int error;
    INSTANCE;
    IN_MODE(EvaluateDiscreteStates, m->state.mode == EVENT_MODE);
    error = m->state.tick == TICKS ? compute(m) : 0;
    return error ? refuse(m, error) : OK;
}

CALL(UpdateDiscreteStates, bool *again, bool *terminate, bool *nominals, bool *continuous, bool *has_next, double *next)
{
    int error, follows = 0;
    INSTANCE;
    IN_MODE(UpdateDiscreteStates, m->state.mode == EVENT_MODE);
    if (m->state.tick == TICKS && (error = compute(m)))
        return refuse(m, error);
    m->state.tick = NO_TICK;
    *again = *terminate = *nominals = *continuous = *has_next = false;
    *next = 0.0;
    if (!m->exchanges)
        return OK;
    if (update_at_event(m, next, &follows) != OK)
        return ERROR;
    *has_next = follows;
    return OK;
}

#if defined(PARTITIONS)
CALL(ActivateModelPartition, unsigned clock, double t)
{
    int error;
    INSTANCE;
    if (m->state.mode != SCHEDULED || m->state.phase != STEPPING)
        return refuse_with(m, "fmi3ActivateModelPartition: not allowed in this mode", "", "");
    if (expect_clock(m, &clock, 1, 1) != OK)
        return ERROR;
    if ((error = model_run_task(m, clock - CLOCK)))
        return refuse(m, error);
    m->state.time = t;
    return OK;
}
#else
WITHOUT(ActivateModelPartition, unsigned clock, double t)
#endif
