/* A small FMU in C: x' = gain u while `on`, of FMI 2.0 or, with FMI3, of FMI 3.0. Macros give it one habit each. */
#include <fenv.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define API __attribute__((visibility("default")))
enum { U, Y, GAIN, ON, HIGH, COUNT, MODE, LABEL, TIME = 10, MOST };
enum { OK, WARNING, DISCARD, ERROR };

typedef void (*Log2)(void *, const char *, int, const char *, const char *, ...);
typedef void (*Log3)(void *, int, const char *, const char *);
typedef struct { Log2 log; void *allocate, *release, *finished, *environment; } Callbacks;

#ifndef TRUTH
#define TRUTH 1
#endif

#ifndef MOST_IS
#define MOST_IS INT64_MAX
#endif

typedef struct { double u[2], x[2], gain, next, reached; int on, mode, count, ended; char label[32]; } State;
typedef struct { State s; double stop; char name[64]; Log2 log2; Log3 log3; void *environment; } Model;

/* What libraries of its own would keep for the whole process, copies of this one included. */
static int instances_of_this_process(void) {
    int pid = 0, count = 0;
    const char *kept = getenv(KEPT);
    if (kept != NULL && sscanf(kept, "%d %d", &pid, &count) == 2 && pid != getpid()) count = 0;
    char text[64];
    snprintf(text, sizeof text, "%d %d", (int)getpid(), count + 1);
    setenv(KEPT, text, 1);
    return count;
}

static void start(State *s) {
    memset(s, 0, sizeof *s);
    s->gain = 1.0;
    s->on = s->mode = 1;
}

static void say(Model *m, int status, int level, double share) {
    if (m->log2) m->log2(m->environment, m->name, status, "logStatus", "%s: level %d is %g%% of it", m->name, level, share);
    if (m->log3) m->log3(m->environment, status, "logStatus", "level is too high");
}

static Model *instance(const char *name) {
    int before = instances_of_this_process();
#ifdef ONCE
    if (before > 0) return NULL;
#endif
    Model *m = calloc(1, sizeof *m);
    snprintf(m->name, sizeof m->name, "%s", name);
    start(&m->s);
#ifdef STATICS
    m->s.x[0] = m->s.x[1] = before;
#endif
#ifdef PRINTS
    printf("SMALL FMU, version 1\n");
#endif
    return m;
}

static int reset(Model *m) {
    State old = m->s;
    start(&m->s);
#ifdef BROKEN_RESET
    memcpy(m->s.x, old.x, sizeof old.x);
#endif
#ifdef STICKY_PARAMETER
    m->s.gain = old.gain;
#endif
    return OK;
}

static void forget(Model *m) {
#ifdef LOSES
    m->s.gain = 1.0;
    m->s.label[0] = 0;
#endif
}

static void begin(Model *m, bool defined, double tolerance, double t) {
    m->s.next = m->s.reached = t;
#ifdef TELLS_TOLERANCE
    m->s.x[0] = defined ? tolerance : -1.0;
#endif
#ifdef TELLS_START
    m->s.x[0] = t;
#endif
}

static void set_gain(Model *m, double gain) {
#ifndef IGNORES
    m->s.gain = gain;
#endif
}

static int step(Model *m, double t, double h) {
#ifdef FIXED_STEP
    if (fabs(h - 0.01) > 1e-12) return ERROR;
#endif
#ifdef CRASHES
    abort();
#endif
#ifdef ENDS /* what it does from 0.045 s on */
    if (t > 0.045) { ENDS; }
#endif
#ifdef WARNS
    if (m->s.count == 0) say(m, WARNING, 7, 50.0);
#endif
#ifdef SAYS
    if (m->log2) m->log2(m->environment, m->name, ERROR, "logStatus", SAYS);
    if (m->log3) m->log3(m->environment, ERROR, "logStatus", SAYS);
    return ERROR;
#endif
#ifdef REFUSES
    say(m, ERROR, 7, 50.0);
    return ERROR;
#endif
#ifdef PRINTS
    printf("stepping\n");
#endif
#ifdef SLOW
    usleep(1000);
#endif
#ifdef STRICT
    if (fabs(t - m->s.next) > 1e-9) {
        say(m, ERROR, 7, 50.0);
        return ERROR;
    }
#endif
    m->s.next = m->s.reached = t + h;
#ifdef DISCARDS_FROM /* it does no step beyond that time */
    m->s.reached = t;
    if (t + h > DISCARDS_FROM) return DISCARD;
#endif
#ifdef ENDS_AT /* and with it the run */
    m->s.ended = t + h > ENDS_AT - 1e-12;
    if (m->s.ended) m->s.reached = ENDS_AT, h = ENDS_AT - t;
#endif
#ifdef THIRDS /* of which each is rounded */
    for (int i = 0; i < 2; i++) m->s.x[i] += h / 3.0;
#endif
    for (int i = 0; m->s.on && i < 2; i++) m->s.x[i] += h * m->s.gain * m->s.u[i] * (m->s.mode == 2 ? -1.0 : 1.0);
    m->s.count++;
#ifdef PRINTS_PROCESS
    m->s.count = getpid();
#endif
    return OK;
}

#ifndef FMI3

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }
API int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) { return OK; }
API void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *place, const Callbacks *callbacks,
                          int visible, int logging) {
    Model *m = instance(name);
    if (m == NULL) {
        callbacks->log(callbacks->environment, name, ERROR, "logStatus", "%s: there is one already", name);
        return NULL;
    }
    m->log2 = callbacks->log;
    m->environment = callbacks->environment;
    return m;
}
API void fmi2FreeInstance(void *c) {
#ifdef CRASHES_WHEN_FREED
    abort();
#endif
    free(c);
}
API int fmi2SetupExperiment(void *c, int defined, double tolerance, double t, int ends, double stop) {
    begin(c, defined, tolerance, t);
    return OK;
}
API int fmi2EnterInitializationMode(void *c) {
#ifdef EXITS_AT_START
    exit(0);
#endif
    forget(c);
    return OK;
}
API int fmi2ExitInitializationMode(void *c) { return OK; }
API int fmi2Terminate(void *c) { return OK; }
API int fmi2Reset(void *c) { return reset(c); }
API int fmi2DoStep(void *c, double t, double h, int no_set) {
    int status = step(c, t, h);
    return ((Model *)c)->s.ended ? DISCARD : status;
}
API int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    *value = ((Model *)c)->s.ended;
    return kind == 3 ? OK : ERROR;
}
API int fmi2GetRealStatus(void *c, int kind, double *value) {
    *value = ((Model *)c)->s.reached;
    return kind == 2 ? OK : ERROR;
}

API int fmi2GetReal(void *c, const unsigned vr[], size_t n, double v[]) {
    State *s = &((Model *)c)->s;
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == U ? s->u[0] : vr[i] == Y ? s->x[0] : s->gain;
    return OK;
}
API int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++)
        if (vr[i] == U) ((Model *)c)->s.u[0] = v[i];
        else set_gain(c, v[i]);
    return OK;
}
API int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int v[]) {
    State *s = &((Model *)c)->s;
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == COUNT ? s->count : s->mode;
    return OK;
}
API int fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int v[]) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->s.mode = v[i];
    return OK;
}
API int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int v[]) {
    State *s = &((Model *)c)->s;
    for (size_t i = 0; i < n; i++) v[i] = TRUTH * (vr[i] == ON ? s->on : s->x[0] > 0.045);
    return OK;
}
API int fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int v[]) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->s.on = v[i];
    return OK;
}
API int fmi2GetString(void *c, const unsigned vr[], size_t n, const char *v[]) {
    for (size_t i = 0; i < n; i++) v[i] = ((Model *)c)->s.label;
    return OK;
}
API int fmi2SetString(void *c, const unsigned vr[], size_t n, const char *const v[]) {
    for (size_t i = 0; i < n; i++) snprintf(((Model *)c)->s.label, sizeof ((Model *)c)->s.label, "%s", v[i]);
    return OK;
}

API int fmi2GetFMUstate(void *c, void **state) {
#ifdef ENDS_WHEN_SAVED
    ENDS_WHEN_SAVED;
#endif
    *state = realloc(*state, sizeof(State));
    memcpy(*state, &((Model *)c)->s, sizeof(State));
    return OK;
}
API int fmi2SetFMUstate(void *c, void *state) { memcpy(&((Model *)c)->s, state, sizeof(State)); return OK; }
API int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return OK; }
API int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) { *size = sizeof(State); return OK; }
API int fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t n) { memcpy(bytes, state, n); return OK; }
API int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t n, void **state) {
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return OK;
}

/* What FMI asks for and nobody here calls */
#define UNUSED(name) API int name(void) { return ERROR; }
UNUSED(fmi2CancelStep)
UNUSED(fmi2GetStatus)
UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetStringStatus)
UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives)
UNUSED(fmi2GetDirectionalDerivative)

#else

API const char *fmi3GetVersion(void) { return "3.0"; }
API int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const names[]) { return OK; }
API void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *place, bool visible, bool logging,
                                      bool event_mode, bool early_return, const unsigned required[], size_t n,
                                      void *environment, Log3 log, void *intermediate) {
    Model *m = instance(name);
    if (m == NULL) return NULL;
    m->log3 = log;
    m->environment = environment;
    m->stop = INFINITY;
    return m;
}
API void fmi3FreeInstance(void *c) { free(c); }
API int fmi3EnterInitializationMode(void *c, bool defined, double tolerance, double t, bool ends, double stop) {
    begin(c, defined, tolerance, t);
    forget(c);
    ((Model *)c)->stop = ends ? stop : INFINITY;
    return OK;
}
API int fmi3ExitInitializationMode(void *c) { return OK; }
API int fmi3Terminate(void *c) { return OK; }
API int fmi3Reset(void *c) { return reset(c); }
API int fmi3DoStep(void *c, double t, double h, bool no_set, bool *event, bool *ends, bool *early, double *last) {
    *event = *early = *ends = false;
#ifdef HEEDS_STOP
    if (t + h > ((Model *)c)->stop + 1e-9) return ERROR;
#endif
    int status = step(c, t, h);
    *ends = ((Model *)c)->s.ended;
    *last = ((Model *)c)->s.reached;
#ifdef NEEDS_EVENTS
    *event = true;
#endif
#ifdef RETURNS_EARLY
    *early = true;
#endif
#ifdef LOSES_TIME
    *last = NAN;
#endif
    return status;
}

API int fmi3GetFloat64(void *c, const unsigned vr[], size_t n, double v[], size_t m) {
    State *s = &((Model *)c)->s;
    for (size_t i = 0; i < n; i++)
        if (vr[i] == TIME) *v++ = s->reached;
        else memcpy(v, vr[i] == U ? s->u : s->x, sizeof s->u), v += 2;
    return OK;
}
API int fmi3SetFloat64(void *c, const unsigned vr[], size_t n, const double v[], size_t m) {
    memcpy(((Model *)c)->s.u, v, m * sizeof *v);
    return OK;
}
API int fmi3GetFloat32(void *c, const unsigned vr[], size_t n, float v[], size_t m) { *v = ((Model *)c)->s.gain; return OK; }
API int fmi3SetFloat32(void *c, const unsigned vr[], size_t n, const float v[], size_t m) { set_gain(c, *v); return OK; }
API int fmi3GetBoolean(void *c, const unsigned vr[], size_t n, bool v[], size_t m) {
    State *s = &((Model *)c)->s;
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == ON ? s->on : s->x[0] > 0.045;
    return OK;
}
API int fmi3SetBoolean(void *c, const unsigned vr[], size_t n, const bool v[], size_t m) { ((Model *)c)->s.on = *v; return OK; }
API int fmi3GetUInt8(void *c, const unsigned vr[], size_t n, uint8_t v[], size_t m) { *v = ((Model *)c)->s.count; return OK; }
API int fmi3GetInt64(void *c, const unsigned vr[], size_t n, int64_t v[], size_t m) {
    State *s = &((Model *)c)->s;
    *v = vr[0] == MOST ? MOST_IS : s->mode;
    return OK;
}
API int fmi3SetInt64(void *c, const unsigned vr[], size_t n, const int64_t v[], size_t m) { ((Model *)c)->s.mode = *v; return OK; }

API int fmi3GetFMUState(void *c, void **state) {
    *state = realloc(*state, sizeof(State));
    memcpy(*state, &((Model *)c)->s, sizeof(State));
    return OK;
}
API int fmi3SetFMUState(void *c, void *state) { memcpy(&((Model *)c)->s, state, sizeof(State)); return OK; }
API int fmi3FreeFMUState(void *c, void **state) { free(*state); *state = NULL; return OK; }
API int fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) { *size = sizeof(State); return OK; }
API int fmi3SerializeFMUState(void *c, void *state, uint8_t bytes[], size_t n) { memcpy(bytes, state, n); return OK; }
API int fmi3DeserializeFMUState(void *c, const uint8_t bytes[], size_t n, void **state) {
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return OK;
}

/* What FMI asks for and nobody here calls */
#define UNUSED(name) API int name(void) { return ERROR; }
UNUSED(fmi3ActivateModelPartition)
UNUSED(fmi3CompletedIntegratorStep)
UNUSED(fmi3EnterConfigurationMode)
UNUSED(fmi3EnterContinuousTimeMode)
UNUSED(fmi3EnterEventMode)
UNUSED(fmi3EnterStepMode)
UNUSED(fmi3EvaluateDiscreteStates)
UNUSED(fmi3ExitConfigurationMode)
UNUSED(fmi3GetAdjointDerivative)
UNUSED(fmi3GetBinary)
UNUSED(fmi3GetClock)
UNUSED(fmi3GetContinuousStateDerivatives)
UNUSED(fmi3GetContinuousStates)
UNUSED(fmi3GetDirectionalDerivative)
UNUSED(fmi3GetEventIndicators)
UNUSED(fmi3GetInt16)
UNUSED(fmi3GetInt32)
UNUSED(fmi3GetInt8)
UNUSED(fmi3GetIntervalDecimal)
UNUSED(fmi3GetIntervalFraction)
UNUSED(fmi3GetNominalsOfContinuousStates)
UNUSED(fmi3GetNumberOfContinuousStates)
UNUSED(fmi3GetNumberOfEventIndicators)
UNUSED(fmi3GetNumberOfVariableDependencies)
UNUSED(fmi3GetOutputDerivatives)
UNUSED(fmi3GetShiftDecimal)
UNUSED(fmi3GetShiftFraction)
UNUSED(fmi3GetString)
UNUSED(fmi3GetUInt16)
UNUSED(fmi3GetUInt32)
UNUSED(fmi3GetUInt64)
UNUSED(fmi3GetVariableDependencies)
UNUSED(fmi3InstantiateModelExchange)
UNUSED(fmi3InstantiateScheduledExecution)
UNUSED(fmi3SetBinary)
UNUSED(fmi3SetClock)
UNUSED(fmi3SetContinuousStates)
UNUSED(fmi3SetInt16)
UNUSED(fmi3SetInt32)
UNUSED(fmi3SetInt8)
UNUSED(fmi3SetIntervalDecimal)
UNUSED(fmi3SetIntervalFraction)
UNUSED(fmi3SetShiftDecimal)
UNUSED(fmi3SetShiftFraction)
UNUSED(fmi3SetString)
UNUSED(fmi3SetTime)
UNUSED(fmi3SetUInt16)
UNUSED(fmi3SetUInt32)
UNUSED(fmi3SetUInt64)
UNUSED(fmi3SetUInt8)
UNUSED(fmi3UpdateDiscreteStates)

#endif
