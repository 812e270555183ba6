/* FMUs for model exchange (FMI 2.0, FMI 3.0), and for co-simulation in event mode and scheduled execution (FMI 3.0):
   several models in one library, chosen by their GUID. A state or input is a Float64 (Real), value reference VR. */

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Value references: time is 0, X and DX two each, Y is p·u + q·w + x, of a curve p·u³ + q·w² + START, C counts. */
enum { T, X1, X2, DX1, DX2, U, W, P, Q, Y, START, PERIOD, COUNT = 20, UPDATES, MISUSED, TICKS, CLOCK = 30, JOBS = 40 };

typedef struct {
    double v[11];
    int ticking[2], ticks[2], misused; /* of the clocked law: its clocks, how often they ticked, accesses without them */
    int jobs[4]; /* of three partitions, and of all */
    double period;
    int count, updates, kind, mode; /* mode 0: before the end of initialisation, 1: event mode, 2: between events */
    double next;
} Model;

static const char *kinds[] = {"integrator", "ball", "stair", "oscillator", "gain", "curve", "restless", "busy", "law", "clocks", NULL};
enum { INTEGRATOR, BALL, STAIR, OSCILLATOR, GAIN, CURVE, RESTLESS, BUSY, LAW, CLOCKS };

static int states_of(const Model *m) { return m->kind == STAIR || m->kind == GAIN || m->kind == CURVE || m->kind >= BUSY ? 0 : 2; }
static int crossings_of(const Model *m) { return m->kind == BALL || m->kind == RESTLESS; }

static void *make(const char *guid) {
    for (int i = 0; kinds[i]; i++)
        if (!strcmp(kinds[i], guid)) {
            Model *m = calloc(1, sizeof *m);
            m->kind = i, m->count = 1, m->next = INFINITY;
            m->v[START] = i == OSCILLATOR ? 2 : 1;
            m->v[P] = i == BALL ? .7 : i == LAW ? -1 : 1;
            m->v[Q] = i == LAW ? -1 : 0;
            return m;
        }
    return NULL;
}

static void evaluate(Model *m) {
    double *v = m->v;
    if (m->kind == CLOCKS) return;
    if (!m->mode) v[X1] = v[START];
    v[Y] = v[P] * v[U] + v[Q] * v[W] + (m->kind == GAIN || m->kind == LAW ? 0 : v[X1]);
    if (m->kind == CURVE) v[Y] = v[P] * v[U] * v[U] * v[U] + v[Q] * v[W] * v[W] + v[START];
    v[DX1] = v[X2];
    if (m->kind == BALL) v[DX2] = v[X2] == 0 && v[X1] <= DBL_MIN ? 0 : -9.81;
    else if (m->kind == OSCILLATOR) v[DX2] = v[P] * (1 - v[X1] * v[X1]) * v[X2] - v[X1];
    else v[DX2] = v[U];
}

static void update(Model *m, bool *again, bool *ends, bool *has_next, double *next) {
    double *v = m->v;
    *again = *ends = false;
    m->updates++;
    for (int i = 0; i < 2; i++) m->ticks[i] += m->ticking[i], m->ticking[i] = 0;
    if (m->kind == STAIR) {
        while (v[T] + 1e-15 * (1 + v[T]) >= m->count) m->count++;
        m->next = m->count;
        *ends = m->count > 10;
    } else if (m->kind == BALL && v[X1] <= 0 && v[X2] < 0) {
        v[X1] = DBL_MIN, v[X2] = -v[P] * v[X2];
        m->count++;
        if (v[X2] < .1) v[X2] = 0;
    } else if (m->kind == RESTLESS) {
        *again = v[X1] <= 0;
    } else if (m->kind == BUSY) {
        m->next = v[T];
    }
    *has_next = isfinite(m->next), *next = m->next;
    evaluate(m);
}

static int get(Model *m, const uint32_t *r, size_t n, double *out) {
    evaluate(m);
    for (size_t i = 0; i < n; i++) {
        if (m->kind == LAW && r[i] == Y && !m->ticking[0]) m->misused++;
        out[i] = r[i] == PERIOD ? m->period : m->v[r[i]];
    }
    return 0;
}
static int set(Model *m, const uint32_t *r, size_t n, const double *in) {
    if (m->mode == 2 && m->kind != INTEGRATOR) return 3; /* between events nothing is set, but what the solver follows */
    for (size_t i = 0; i < n; i++) {
        if (m->kind == LAW && m->mode && (r[i] == U || r[i] == W) && !m->ticking[0]) m->misused++;
        m->v[r[i]] = in[i];
    }
    return 0;
}
static int get_whole(Model *m, const uint32_t *r, size_t n, int32_t *out) {
    for (size_t i = 0; i < n; i++)
        out[i] = r[i] >= JOBS ? m->jobs[r[i] - JOBS] : r[i] == COUNT ? m->count : r[i] == UPDATES ? m->updates : r[i] == MISUSED ? m->misused : m->ticks[r[i] - TICKS];
    return 0;
}
static int enter(Model *m, int from, int to) {
    if (m->mode != from) return 3;
    m->mode = to;
    return 0;
}
/* Of curves and the integrator, but not of its outputs that are states; count says how often. */
static int differentiate(Model *m, const uint32_t *of, size_t n, uint32_t r, double seed, double *out) {
    m->count++;
    for (size_t i = 0; i < n; i++) {
        if (m->kind == CURVE) out[i] = seed * (r == U ? 3 * m->v[P] * m->v[U] * m->v[U] : 2 * m->v[Q] * m->v[W]);
        else if (of[i] == Y) out[i] = seed * (r == U ? m->v[P] : r == W ? m->v[Q] : r == X1);
        else out[i] = seed * ((of[i] == DX1 && r == X2) || (of[i] == DX2 && r == U));
    }
    return m->mode == 2 || !m->mode ? 0 : 3;
}
static int indicate(Model *m, double *z, size_t n) {
    if (n) z[0] = m->v[X1];
    return 0;
}

/* -- FMI 3.0 ------------------------------------------------------------------------------------------------------- */

void *fmi3InstantiateModelExchange(const char *n, const char *token, const char *r, bool v, bool l, void *e, void *log) {
    return make(token);
}
void *fmi3InstantiateCoSimulation(
    const char *n, const char *token, const char *r, bool v, bool l, bool events, bool early, const uint32_t *of,
    size_t count, void *e, void *log, void *intermediate) {
    return make(token);
}
void *fmi3InstantiateScheduledExecution(
    const char *n, const char *token, const char *r, bool v, bool l, void *e, void *log, void *up, void *lock, void *un) {
    return make(token);
}
/* A job: what it computes has u, its time, and how many jobs there were; not finite for w < -1. */
int fmi3ActivateModelPartition(Model *m, uint32_t clock, double t) {
    if (m->mode != 1) return 3;
    m->jobs[clock - CLOCK]++, m->jobs[3]++;
    m->v[Y] = (m->v[U] + t + 1000 * m->jobs[3]) * sqrt(1 + m->v[W]);
    return 0;
}
void fmi3FreeInstance(void *m) { free(m); }
const char *fmi3GetVersion(void) { return "3.0"; }
int fmi3SetDebugLogging(void *m, bool on, size_t n, const char *const *c) { return 0; }
int fmi3EnterInitializationMode(Model *m, bool d, double tolerance, double start, bool has_stop, double stop) {
    m->v[T] = start;
    return 0;
}
int fmi3ExitInitializationMode(Model *m) { evaluate(m); return enter(m, 0, 1); }
int fmi3EnterEventMode(Model *m) { return enter(m, 2, 1); }
int fmi3EnterContinuousTimeMode(Model *m) { return enter(m, 1, 2); }
int fmi3EnterStepMode(Model *m) { return enter(m, 1, 2); }
int fmi3Terminate(Model *m) { return 0; }
int fmi3Reset(Model *m) {
    Model *fresh = make(kinds[m->kind]);
    *m = *fresh;
    free(fresh);
    return 0;
}
int fmi3GetFloat64(Model *m, const uint32_t *r, size_t n, double *out, size_t c) { return get(m, r, n, out); }
int fmi3SetFloat64(Model *m, const uint32_t *r, size_t n, const double *in, size_t c) { return set(m, r, n, in); }
int fmi3GetInt32(Model *m, const uint32_t *r, size_t n, int32_t *out, size_t c) { return get_whole(m, r, n, out); }
int fmi3UpdateDiscreteStates(Model *m, bool *again, bool *ends, bool *nominals, bool *values, bool *has, double *next) {
    *nominals = *values = false;
    if (m->mode != 1) return 3;
    update(m, again, ends, has, next);
    return 0;
}
int fmi3GetDirectionalDerivative(
    Model *m, const uint32_t *of, size_t n, const uint32_t *by, size_t k, const double *seed, size_t s, double *out,
    size_t c) {
    return differentiate(m, of, n, *by, *seed, out);
}
int fmi3SetTime(Model *m, double t) { m->v[T] = t; return 0; }
int fmi3SetContinuousStates(Model *m, const double *x, size_t n) { memcpy(m->v + X1, x, n * 8); return 0; }
int fmi3GetContinuousStates(Model *m, double *x, size_t n) { memcpy(x, m->v + X1, n * 8); return 0; }
int fmi3GetContinuousStateDerivatives(Model *m, double *x, size_t n) {
    evaluate(m);
    memcpy(x, m->v + DX1, n * 8);
    return 0;
}
int fmi3GetNominalsOfContinuousStates(Model *m, double *x, size_t n) {
    for (size_t i = 0; i < n; i++) x[i] = 1;
    return 0;
}
int fmi3GetEventIndicators(Model *m, double *z, size_t n) { return indicate(m, z, n); }
int fmi3GetNumberOfContinuousStates(Model *m, size_t *n) { *n = states_of(m); return 0; }
int fmi3GetNumberOfEventIndicators(Model *m, size_t *n) { *n = crossings_of(m); return 0; }
int fmi3CompletedIntegratorStep(Model *m, bool f, bool *event, bool *ends) { *event = *ends = false; return 0; }
/* The stair in co-simulation: it returns early at its events. */
int fmi3DoStep(Model *m, double t, double h, bool f, bool *event, bool *ends, bool *early, double *reached) {
    *event = *early = *ends = false;
    if (m->mode != 2 || fabs(t - m->v[T]) > 1e-9) return 3;
    m->v[T] = *reached = t + h;
    return 0;
}
int fmi3GetFMUState(Model *m, void **s) { *s = memcpy(*s ? *s : malloc(sizeof *m), m, sizeof *m); return 0; }
int fmi3SetFMUState(Model *m, void *s) { memcpy(m, s, sizeof *m); return 0; }
int fmi3FreeFMUState(Model *m, void **s) { free(*s); *s = NULL; return 0; }
int fmi3SerializedFMUStateSize(Model *m, void *s, size_t *n) { *n = sizeof *m; return 0; }
int fmi3SerializeFMUState(Model *m, void *s, uint8_t *to, size_t n) { memcpy(to, s, n); return 0; }
int fmi3DeserializeFMUState(Model *m, const uint8_t *from, size_t n, void **s) {
    *s = memcpy(malloc(n), from, n);
    return 0;
}

int fmi3SetClock(Model *m, const uint32_t *r, size_t n, const bool *on) {
    if (m->mode != 1) return 3;
    for (size_t i = 0; i < n; i++) m->ticking[r[i] - CLOCK] = on[i];
    return 0;
}
int fmi3SetIntervalDecimal(Model *m, const uint32_t *r, size_t n, const double *interval) {
    m->period = *interval;
    return m->mode ? 3 : 0;
}
int fmi3SetShiftDecimal(Model *m, const uint32_t *r, size_t n, const double *shift) {
    return m->mode || !*shift ? 3 : 0; /* that of 0 is declared, and not to be set */
}

/* -- FMI 2.0 ------------------------------------------------------------------------------------------------------- */

typedef struct {
    int again, ends, nominals, values, has_next;
    double next;
} Info;

void *fmi2Instantiate(const char *n, int kind, const char *guid, const char *r, const void *f, int v, int l) {
    return kind == 0 ? make(guid) : NULL;
}
void fmi2FreeInstance(void *m) { free(m); }
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
int fmi2SetDebugLogging(void *m, int on, size_t n, const char *const *c) { return 0; }
int fmi2SetupExperiment(Model *m, int d, double tolerance, double start, int has_stop, double stop) {
    m->v[T] = start;
    return 0;
}
int fmi2EnterInitializationMode(Model *m) { return 0; }
int fmi2ExitInitializationMode(Model *m) { return fmi3ExitInitializationMode(m); }
int fmi2EnterEventMode(Model *m) { return enter(m, 2, 1); }
int fmi2EnterContinuousTimeMode(Model *m) { return enter(m, 1, 2); }
int fmi2Terminate(Model *m) { return 0; }
int fmi2Reset(Model *m) { return fmi3Reset(m); }
int fmi2GetReal(Model *m, const uint32_t *r, size_t n, double *out) { return get(m, r, n, out); }
int fmi2SetReal(Model *m, const uint32_t *r, size_t n, const double *in) { return set(m, r, n, in); }
int fmi2GetInteger(Model *m, const uint32_t *r, size_t n, int32_t *out) { return get_whole(m, r, n, out); }
int fmi2NewDiscreteStates(Model *m, Info *info) {
    bool again, ends, has_next;
    if (m->mode != 1) return 3;
    update(m, &again, &ends, &has_next, &info->next);
    info->again = again, info->ends = ends, info->has_next = has_next, info->nominals = info->values = 0;
    return 0;
}
int fmi2GetDirectionalDerivative(
    Model *m, const uint32_t *of, size_t n, const uint32_t *by, size_t k, const double *seed, double *out) {
    return differentiate(m, of, n, *by, *seed, out);
}
int fmi2SetTime(Model *m, double t) { return fmi3SetTime(m, t); }
int fmi2SetContinuousStates(Model *m, const double *x, size_t n) { return fmi3SetContinuousStates(m, x, n); }
int fmi2GetContinuousStates(Model *m, double *x, size_t n) { return fmi3GetContinuousStates(m, x, n); }
int fmi2GetDerivatives(Model *m, double *x, size_t n) { return fmi3GetContinuousStateDerivatives(m, x, n); }
int fmi2GetNominalsOfContinuousStates(Model *m, double *x, size_t n) {
    return fmi3GetNominalsOfContinuousStates(m, x, n);
}
int fmi2GetEventIndicators(Model *m, double *z, size_t n) { return indicate(m, z, n); }
int fmi2CompletedIntegratorStep(Model *m, int f, int *event, int *ends) { *event = *ends = 0; return 0; }
int fmi2GetFMUstate(Model *m, void **s) { return fmi3GetFMUState(m, s); }
int fmi2SetFMUstate(Model *m, void *s) { return fmi3SetFMUState(m, s); }
int fmi2FreeFMUstate(Model *m, void **s) { return fmi3FreeFMUState(m, s); }
int fmi2SerializedFMUstateSize(Model *m, void *s, size_t *n) { return fmi3SerializedFMUStateSize(m, s, n); }
int fmi2SerializeFMUstate(Model *m, void *s, uint8_t *to, size_t n) { return fmi3SerializeFMUState(m, s, to, n); }
int fmi2DeSerializeFMUstate(Model *m, const uint8_t *from, size_t n, void **s) {
    return fmi3DeserializeFMUState(m, from, n, s);
}

/* What FMI asks for and nobody here calls. */
#define UNUSED(name) int name(void) { return 3; }
UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString)
UNUSED(fmi2SetBoolean)
UNUSED(fmi2SetInteger)
UNUSED(fmi2SetString)
UNUSED(fmi3EnterConfigurationMode)
UNUSED(fmi3EvaluateDiscreteStates)
UNUSED(fmi3ExitConfigurationMode)
UNUSED(fmi3GetAdjointDerivative)
UNUSED(fmi3GetBinary)
UNUSED(fmi3GetBoolean)
UNUSED(fmi3GetClock)
UNUSED(fmi3GetFloat32)
UNUSED(fmi3GetInt16)
UNUSED(fmi3GetInt64)
UNUSED(fmi3GetInt8)
UNUSED(fmi3GetIntervalDecimal)
UNUSED(fmi3GetIntervalFraction)
UNUSED(fmi3GetNumberOfVariableDependencies)
UNUSED(fmi3GetOutputDerivatives)
UNUSED(fmi3GetShiftDecimal)
UNUSED(fmi3GetShiftFraction)
UNUSED(fmi3GetString)
UNUSED(fmi3GetUInt16)
UNUSED(fmi3GetUInt32)
UNUSED(fmi3GetUInt64)
UNUSED(fmi3GetUInt8)
UNUSED(fmi3GetVariableDependencies)
UNUSED(fmi3SetBinary)
UNUSED(fmi3SetBoolean)
UNUSED(fmi3SetFloat32)
UNUSED(fmi3SetInt16)
UNUSED(fmi3SetInt32)
UNUSED(fmi3SetInt64)
UNUSED(fmi3SetInt8)
UNUSED(fmi3SetIntervalFraction)
UNUSED(fmi3SetShiftFraction)
UNUSED(fmi3SetString)
UNUSED(fmi3SetUInt16)
UNUSED(fmi3SetUInt32)
UNUSED(fmi3SetUInt64)
UNUSED(fmi3SetUInt8)
