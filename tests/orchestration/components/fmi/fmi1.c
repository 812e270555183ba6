/* A small FMU of FMI 1.0: x' = gain u while it is on; y = x, high = x > 0.1, twice = 2 u as it was at the last call. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define API(name) __attribute__((visibility("default"))) int Old_fmi##name
enum { U, Y, GAIN, ON, HIGH, TWICE, SPAN, LIMIT };
enum { OK, WARNING, DISCARD, ERROR, FATAL };

typedef struct Model Model;
typedef void (*Log)(Model *, const char *, int, const char *, const char *, ...);
typedef struct { Log log; void *(*allocate)(size_t, size_t); void (*release)(void *); void *finished; } Callbacks;
struct Model { double u, x, gain, twice, span, limit, now; char on, initialised, name[32]; Callbacks callbacks; };

static void start(Model *m) { m->u = m->x = m->twice = m->span = m->now = 0, m->gain = 1, m->limit = 1e9, m->on = 1, m->initialised = 0; }

__attribute__((visibility("default"))) Model *Old_fmiInstantiateSlave(const char *name, const char *guid, const char *place,
    const char *mime, double timeout, char visible, char interactive, Callbacks callbacks, char logging) {
    if (strcmp(guid, "old") || strcmp(mime, "application/x-fmu-sharedlibrary")) return NULL;
    Model *m = callbacks.allocate(1, sizeof *m);
    m->callbacks = callbacks;
    strncpy(m->name, name, sizeof m->name - 1);
    start(m);
    return m;
}
API(InitializeSlave)(Model *m, double begin, char defined, double end) {
    if (m->initialised) return ERROR;
    m->initialised = 1, m->now = begin, m->span = defined ? end - begin : -1, m->twice = 2 * m->u;
    return OK;
}
API(DoStep)(Model *m, double t, double h, char fresh) {
    if (!m->initialised || fresh != 1 || fabs(t - m->now) > 1e-9) return ERROR;
    if (t + h > m->limit + 1e-9) {
        m->callbacks.log(m, m->name, DISCARD, "step", "%s stands at %g", m->name, t);
        return DISCARD;
    }
    if (m->on) m->x += m->gain * m->u * h;
    m->now = t + h, m->twice = 2 * m->u;
    return OK;
}
API(ResetSlave)(Model *m) { start(m); return OK; }
API(TerminateSlave)(Model *m) { return OK; }
__attribute__((visibility("default"))) void Old_fmiFreeSlaveInstance(Model *m) { m->callbacks.release(m); }

API(GetReal)(Model *m, const uint32_t *r, size_t n, double *v) {
    if (!m->initialised) return ERROR;
    for (size_t i = 0; i < n; i++)
        v[i] = r[i] == U ? m->u : r[i] == Y ? m->x : r[i] == GAIN ? m->gain : r[i] == SPAN ? m->span : r[i] == TWICE ? m->twice : m->limit;
    return OK;
}
API(SetReal)(Model *m, const uint32_t *r, size_t n, const double *v) {
    for (size_t i = 0; i < n; i++) {
        if (r[i] != U && m->initialised) return ERROR;
        *(r[i] == U ? &m->u : r[i] == Y ? &m->x : r[i] == GAIN ? &m->gain : &m->limit) = v[i];
    }
    return OK;
}
API(GetBoolean)(Model *m, const uint32_t *r, size_t n, char *v) {
    if (!m->initialised) return ERROR;
    for (size_t i = 0; i < n; i++) v[i] = r[i] == ON ? m->on : m->x > 0.1;
    return OK;
}
API(SetBoolean)(Model *m, const uint32_t *r, size_t n, const char *v) {
    for (size_t i = 0; i < n; i++) m->on = v[i];
    return OK;
}
API(GetRealStatus)(Model *m, int kind, double *v) { *v = m->now; return kind == 2 ? OK : DISCARD; }

/* What this FMU has no use of. */
API(GetInteger)(void) { return ERROR; }
API(SetInteger)(void) { return ERROR; }
API(GetString)(void) { return ERROR; }
API(SetString)(void) { return ERROR; }
API(SetDebugLogging)(void) { return OK; }
API(SetRealInputDerivatives)(void) { return ERROR; }
API(GetRealOutputDerivatives)(void) { return ERROR; }
API(CancelStep)(void) { return ERROR; }
API(GetStatus)(void) { return DISCARD; }
API(GetIntegerStatus)(void) { return DISCARD; }
API(GetBooleanStatus)(void) { return DISCARD; }
API(GetStringStatus)(void) { return DISCARD; }
__attribute__((visibility("default"))) const char *Old_fmiGetVersion(void) { return "1.0"; }
__attribute__((visibility("default"))) const char *Old_fmiGetTypesPlatform(void) { return "standard32"; }
