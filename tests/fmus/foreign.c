/* A small FMU in C, as other tools make them: a first-order lag of its input. Macros give it one fault or habit each. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

typedef struct { double x, u, tau; } State;
typedef struct { State s; char name[64]; const Callbacks *callbacks; int ends; double stop; } Model;

static void start(State *s) { s->x = 0.0; s->u = 1.0; s->tau = 0.1; }

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) { return 0; }

void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *place, const Callbacks *callbacks,
                      int visible, int logging) {
    Model *m = calloc(1, sizeof *m);
    snprintf(m->name, sizeof m->name, "%s", name);
    m->callbacks = callbacks;
    start(&m->s);
#ifdef EXIT_AT_ONCE
    exit(0);
#endif
#ifdef FORKS
    if (fork() == 0) { setsid(); for (;;) sleep(1); }
#endif
#ifdef TALKS
    static char line[1 << 16];
    memset(line, 'x', sizeof line);
    for (int i = 0; i < 1600; i++) fwrite(line, 1, sizeof line, stderr);
#endif
#ifdef HOARDS
    for (int i = 0; i < 4096; i++) memset(malloc(1 << 20), 1, 1 << 20);
#endif
    return m;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int defined, double tolerance, double t, int ends, double stop) {
    ((Model *)c)->ends = ends, ((Model *)c)->stop = stop;
    return 0;
}
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) {
    start(&((Model *)c)->s);
    return 0;
}

static double *value(Model *m, unsigned vr) { return vr == 0 ? &m->s.u : vr == 1 ? &m->s.x : &m->s.tau; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double v[]) {
    for (size_t i = 0; i < n; i++) v[i] = *value(c, vr[i]);
    return 0;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) *value(c, vr[i]) = v[i];
    return 0;
}
int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int v[]) { return 0; }
int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int v[]) { return 0; }
int fmi2GetString(void *c, const unsigned vr[], size_t n, const char *v[]) { return 0; }
int fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int v[]) { return 0; }
int fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int v[]) { return 0; }
int fmi2SetString(void *c, const unsigned vr[], size_t n, const char *const v[]) { return 0; }

int fmi2DoStep(void *c, double t, double h, int no_set) {
    Model *m = c;
#ifndef ENDLESS
    if (m->ends && t + h > m->stop + 1e-9) return 3;
#endif
#ifdef REFUSES
    m->callbacks->logger(m->callbacks->environment, m->name, 3, "logStatusError", "%s: %d of %g at 100%%", m->name, 7, t);
    return 3;
#endif
#ifdef EXITS
    exit(0);
#endif
#ifdef SLOW
    usleep(SLOW);
#endif
    m->s.x += (m->s.u - m->s.x) * h / (m->s.tau + h);
#ifdef CREEPS
    if (t > 50 * h) m->s.tau += h;
#endif
#ifdef LEAKS
    static double *volatile lost;
    lost = malloc(64);
#endif
#ifdef UNWRITTEN
    volatile double *work = malloc(123 * sizeof *work);
    m->s.x += 1e-9 * work[61];
    free((void *)work);
#endif
#ifdef NOISY
    m->s.x += 1e-3 * rand() / RAND_MAX;
#endif
    return 0;
}
int fmi2GetBooleanStatus(void *c, int kind, int *v) { *v = 0; return 0; }

int fmi2GetFMUstate(void *c, void **state) {
    *state = realloc(*state, sizeof(State));
    memcpy(*state, &((Model *)c)->s, sizeof(State));
    return 0;
}
int fmi2SetFMUstate(void *c, void *state) {
    memcpy(&((Model *)c)->s, state, sizeof(State));
#ifdef SHIFT
    ((Model *)c)->s.x *= 1.0 + SHIFT;
#endif
    return 0;
}
int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return 0; }
int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) { *size = sizeof(State); return 0; }
int fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t n) { memcpy(bytes, state, n); return 0; }
int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t n, void **state) {
    *state = malloc(n);
    memcpy(*state, bytes, n);
    return 0;
}

/* What FMI asks for and nobody here calls */
int fmi2CancelStep(void *c) { return 0; }
int fmi2GetStatus(void *c, int kind, int *v) { return 0; }
int fmi2GetRealStatus(void *c, int kind, double *v) { return 0; }
int fmi2GetIntegerStatus(void *c, int kind, int *v) { return 0; }
int fmi2GetStringStatus(void *c, int kind, const char **v) { return 0; }
int fmi2SetRealInputDerivatives(void *c, const unsigned vr[], size_t n, const int o[], const double v[]) { return 0; }
int fmi2GetRealOutputDerivatives(void *c, const unsigned vr[], size_t n, const int o[], double v[]) { return 0; }
int fmi2GetDirectionalDerivative(void *c, const unsigned a[], size_t n, const unsigned b[], size_t m, const double v[],
                                 double dv[]) {
    return 0;
}
