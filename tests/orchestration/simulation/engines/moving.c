/* An FMU whose outputs have in each when and with what it was stepped; its habits are parameters. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define API __attribute__((visibility("default")))
enum { INPUTS = 32, Y = 32, Z = 33, PLACE = 34, FAILS_AT = 35, NAN_AT = 36, WARNS_AT = 37, BEGUN = 40, COUNT };
typedef void (*Log)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Log log; void *allocate, *release, *finished, *environment; } Callbacks;
typedef struct { double v[COUNT]; Log log; void *environment; } Model;

static void start(Model *m) {
    memset(m->v, 0, sizeof m->v);
    m->v[FAILS_AT] = m->v[NAN_AT] = m->v[WARNS_AT] = 1e9;
}

static void say(Model *m, int status, const char *text) { m->log(m->environment, "moving", status, "log", text); }

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }
API int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) { return 0; }
API void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *place, const Callbacks *callbacks,
                          int visible, int logging) {
    Model *m = calloc(1, sizeof *m);
    m->log = callbacks->log, m->environment = callbacks->environment;
    start(m);
    return m;
}
API void fmi2FreeInstance(void *c) { free(c); }
API int fmi2SetupExperiment(void *c, int defined, double tolerance, double t, int ends, double stop) { return 0; }
API int fmi2EnterInitializationMode(void *c) { return 0; }
static void begin(Model *m) { m->v[Y] = 0.25 * m->v[PLACE], m->v[Z] = m->v[Y] + 0.125; }
API int fmi2ExitInitializationMode(void *c) {
    begin(c), ((Model *)c)->v[BEGUN] = 1.0;
    return 0;
}
API int fmi2Terminate(void *c) { return 0; }
API int fmi2Reset(void *c) { start(c); return 0; }
API int fmi2DoStep(void *c, double t, double h, int no_set) {
    Model *m = c;
    double told = 0.0;
    for (int i = 0; i < INPUTS; i++) told += (i + 1) * m->v[i];
    m->v[Y] = t < m->v[NAN_AT] ? sin(t + 2 * h + told) : NAN;
    m->v[Z] = sin(2 * (t + 2 * h) + told + 0.125);
    if (t >= m->v[WARNS_AT]) say(m, 1, "this is late");
    if (t < m->v[FAILS_AT]) return 0;
    say(m, 3, "there is no more");
    return 3;
}
API int fmi2GetReal(void *c, const unsigned vr[], size_t n, double v[]) {
    if (((Model *)c)->v[BEGUN] == 0.0) begin(c);
    for (size_t i = 0; i < n; i++) v[i] = ((Model *)c)->v[vr[i]];
    return 0;
}
API int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->v[vr[i]] = v[i];
    return 0;
}
API int fmi2GetFMUstate(void *c, void **state) {
    *state = malloc(sizeof ((Model *)c)->v);
    memcpy(*state, ((Model *)c)->v, sizeof ((Model *)c)->v);
    return 0;
}
API int fmi2SetFMUstate(void *c, void *state) { memcpy(((Model *)c)->v, state, sizeof ((Model *)c)->v); return 0; }
API int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return 0; }
API int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) { *size = sizeof ((Model *)c)->v; return 0; }
API int fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t n) { memcpy(bytes, state, n); return 0; }
API int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t n, void **state) {
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return 0;
}

#define UNUSED(name) API int name(void) { return 3; }
UNUSED(fmi2GetInteger)
UNUSED(fmi2SetInteger)
UNUSED(fmi2GetBoolean)
UNUSED(fmi2SetBoolean)
UNUSED(fmi2GetString)
UNUSED(fmi2SetString)
UNUSED(fmi2CancelStep)
UNUSED(fmi2GetStatus)
UNUSED(fmi2GetRealStatus)
UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetBooleanStatus)
UNUSED(fmi2GetStringStatus)
UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives)
UNUSED(fmi2GetDirectionalDerivative)
