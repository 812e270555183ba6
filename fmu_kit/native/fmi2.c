/* A slave as FMI 2.0 for co-simulation asks for it: calls in their order, values, states, messages.

   tables.h and functions.h, which lie beside this file, have what differs from slave to slave: what it says of its
   variables, and what it computes. Both are written by quadcosim from the slave's Python; nothing here depends on what
   the model is. An instance is one piece of memory, made by fmi2Instantiate and never grown; nothing is shared
   between instances. */

#include <stdlib.h>
#include <string.h>

#include "mathematics.h"
#include "text.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED, FAILED, PHASES } Phase;
enum { CO_SIMULATION = 1, LONGEST_NAME = 256, LONGEST_TEXT = 1024 };

typedef const char *Text;
typedef const unsigned *References;
typedef struct {
    void (*logger)(void *environment, Text instance, Status status, Text category, Text message, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, Status);
    void *environment;
} Callbacks;

#include "tables.h"

/* What fmi2GetFMUstate saves: all that a step depends on. */
typedef struct {
    char model[sizeof GUID]; /* whose state it is */
    double memory[PLACES];
    unsigned warned; /* bits of the warnings that were given */
    Phase phase;
} State;

typedef struct {
    State state;
    char failure[LONGEST_TEXT]; /* why the last call failed */
    char draft[LONGEST_TEXT];   /* a message that is being written */
    q_text text;                /* the same, as text.h has it */
    char name[LONGEST_NAME];
    const Callbacks *callbacks;
    int logs, filtered, wants_warnings;
    double *tangents; /* of the memory, while derivatives are computed */
} Instance;

/* -- messages --------------------------------------------------------------------------------------------------- */

static void text_begin(Instance *m) { m->text = q_text_in(m->draft, sizeof m->draft); }
static void text_add(Instance *m, Text text) { q_text_string(&m->text, text); }
static void text_real(Instance *m, double x) { q_text_repr(&m->text, x); }
static void text_integer(Instance *m, double x) { q_text_fixed(&m->text, x == 0.0 ? 0.0 : x, 0); }

static int fail(Instance *m, int error)
{
    memcpy(m->failure, m->draft, sizeof m->failure);
    return error;
}

/* A message is a printf format, and some hosts fill none in: percent signs are doubled, and there are no arguments. */
static void tell(const Instance *m, Status status, Text category, Text message)
{
    char format[2 * LONGEST_TEXT], *to = format;
    if (!m->callbacks->logger)
        return;
    for (Text from = message; *from; from++) {
        *to++ = *from;
        if (*from == '%')
            *to++ = '%';
    }
    *to = '\0';
    m->callbacks->logger(m->callbacks->environment, m->name, status, category, format);
}

static void warn(Instance *m)
{
    if (m->logs && (!m->filtered || m->wants_warnings))
        tell(m, WARNING, "logStatusWarning", m->draft);
}

#include "functions.h"

/* After a failure the instance can be freed, reset, or set to a state that was saved before. */
static Status refuse(Instance *m, int error)
{
    m->state.phase = FAILED;
    tell(m, ERROR, error == DIVERGENCE ? "divergence" : "logStatusError", m->failure);
    return ERROR;
}

static Status refuse_with(Instance *m, Text before, Text middle, Text after)
{
    text_begin(m);
    text_add(m, before);
    text_add(m, middle);
    text_add(m, after);
    fail(m, 0);
    return refuse(m, 0);
}

static Status expect(Instance *m, Call call)
{
    Text refusal = refused_call[call][m->state.phase];
    return refusal ? refuse_with(m, refusal, "", "") : OK;
}

/* -- life ------------------------------------------------------------------------------------------------------- */

static void start(Instance *m)
{
    memset(&m->state, 0, sizeof m->state);
    memcpy(m->state.model, GUID, sizeof GUID);
    memcpy(m->state.memory, starts, sizeof starts);
    m->state.phase = INSTANTIATED;
}

EXPORT Text fmi2GetTypesPlatform(void);
Text fmi2GetTypesPlatform(void) { return "default"; }

EXPORT Text fmi2GetVersion(void);
Text fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(Text, int, Text, Text, const Callbacks *, int, int);
void *fmi2Instantiate(Text name, int kind, Text guid, Text location, const Callbacks *callbacks, int visible, int logs)
{
    static const Instance none;
    Instance *m;
    (void)location, (void)visible;
    if (!callbacks || !name || !guid || kind != CO_SIMULATION || strcmp(guid, GUID) != 0) {
        if (callbacks && callbacks->logger && name && guid)
            callbacks->logger(callbacks->environment, name, ERROR, "logStatusError",
                              kind == CO_SIMULATION ? "GUID = %s: expected %s, that of this FMU"
                                                    : "fmuType of %s: expected fmi2CoSimulation of %s", guid, GUID);
        return NULL;
    }
    m = malloc(sizeof *m);
    if (!m)
        return NULL;
    *m = none;
    m->callbacks = callbacks;
    m->logs = logs;
    {
        q_text copy = q_text_in(m->name, sizeof m->name);
        q_text_string(&copy, name);
    }
    start(m);
    return m;
}

EXPORT void fmi2FreeInstance(void *);
void fmi2FreeInstance(void *c) { free(c); }

#define CALL(name, ...) \
    EXPORT Status fmi2##name(void *c, __VA_ARGS__); \
    Status fmi2##name(void *c, __VA_ARGS__)
#define PLAIN(name) \
    EXPORT Status fmi2##name(void *c); \
    Status fmi2##name(void *c)
#define INSTANCE \
    Instance *m = c; \
    if (!m) \
        return ERROR

CALL(SetDebugLogging, int on, size_t n, const Text *categories)
{
    INSTANCE;
    m->logs = on;
    m->filtered = n > 0;
    m->wants_warnings = 0;
    for (size_t i = 0; i < n; i++) {
        if (categories[i] && strcmp(categories[i], "logStatusWarning") == 0)
            m->wants_warnings = 1;
    }
    return OK;
}

CALL(SetupExperiment, int has_tolerance, double tolerance, double start_time, int has_stop, double stop)
{
    INSTANCE;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    if (expect(m, SETUP_EXPERIMENT) != OK)
        return ERROR;
    if (!q_isfinite(start_time)) {
        text_begin(m);
        text_add(m, bad_start_time[0]);
        text_real(m, start_time);
        text_add(m, bad_start_time[1]);
        fail(m, 0);
        return refuse(m, 0);
    }
    m->state.memory[SELF_START_TIME] = start_time;
    return OK;
}

PLAIN(EnterInitializationMode)
{
    INSTANCE;
    if (expect(m, ENTER_INITIALIZATION_MODE) != OK)
        return ERROR;
    m->state.phase = INITIALIZATION;
    return OK;
}

PLAIN(ExitInitializationMode)
{
    int error;
    INSTANCE;
    if (expect(m, EXIT_INITIALIZATION_MODE) != OK)
        return ERROR;
    if ((error = enter_stepping(m)))
        return refuse(m, error);
    m->state.phase = STEPPING;
    return OK;
}

CALL(DoStep, double t, double h, int no_set_state)
{
    double done;
    int error;
    INSTANCE;
    (void)no_set_state;
    if (expect(m, DO_STEP) != OK)
        return ERROR;
    error = do_step(m, t, h, &done);
    return error ? refuse(m, error) : OK;
}

PLAIN(Terminate)
{
    INSTANCE;
    m->state.phase = TERMINATED;
    return OK;
}

PLAIN(Reset)
{
    INSTANCE;
    start(m);
    return OK;
}

/* -- values ----------------------------------------------------------------------------------------------------- */

static Status refuse_references(Instance *m, References vr, size_t n, Type type)
{
    int first = 1;
    text_begin(m);
    text_add(m, wrong_type[type][0]);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < VARIABLES && types[vr[i]] == type)
            continue;
        text_add(m, first ? "" : ", ");
        text_integer(m, vr[i]);
        first = 0;
    }
    text_add(m, wrong_type[type][1]);
    fail(m, 0);
    return refuse(m, 0);
}

static int are_of(References vr, size_t n, Type type)
{
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= VARIABLES || types[vr[i]] != type)
            return 0;
    return 1;
}

/* In initialisation mode, compute what is asked for anew if values were set that it has not seen. */
static int bring_up_to_date(Instance *m, References vr, size_t n)
{
    if (m->state.phase != INITIALIZATION || m->state.memory[SELF_STALE] == 0.0)
        return 0;
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= VARIABLES || !(kinds[vr[i]] & GIVEN))
            return enter_stepping(m);
    return 0;
}

/* Before a value is set: whether it may be now. */
static Status settle(Instance *m, unsigned vr, Type type)
{
    Text refusal;
    if (!are_of(&vr, 1, type))
        return refuse_references(m, &vr, 1, type);
    if ((refusal = refused_setting[vr][m->state.phase]))
        return refuse_with(m, refusal, "", "");
    if (!(kinds[vr] & INPUT) || m->state.phase != STEPPING)
        m->state.memory[SELF_STALE] = 1.0;
    return OK;
}

static double as_it_is(double x) { return x; }

/* What a model has computed may be beyond what the interface can pass. */
static int as_int(double x) { return x >= 2147483647.0 ? 2147483647 : x > -2147483648.0 ? (int)x : -2147483647 - 1; }

#define GET(kind, type, ctype, converted) \
    CALL(Get##kind, References vr, size_t n, ctype *value) \
    { \
        int error; \
        INSTANCE; \
        if ((error = bring_up_to_date(m, vr, n))) \
            return refuse(m, error); \
        if (!are_of(vr, n, type)) \
            return refuse_references(m, vr, n, type); \
        for (size_t i = 0; i < n; i++) \
            value[i] = converted(m->state.memory[vr[i]]); \
        return OK; \
    }

#define SET(kind, type, ctype, number) \
    CALL(Set##kind, References vr, size_t n, const ctype *value) \
    { \
        INSTANCE; \
        for (size_t i = 0; i < n; i++) { \
            if (settle(m, vr[i], type) != OK) \
                return ERROR; \
            m->state.memory[vr[i]] = number; \
        } \
        return OK; \
    }

GET(Real, REAL, double, as_it_is)
GET(Integer, INTEGER, int, as_int)
GET(Boolean, BOOLEAN, int, as_int)
SET(Integer, INTEGER, int, value[i])
SET(Boolean, BOOLEAN, int, value[i] != 0)

CALL(SetReal, References vr, size_t n, const double *value)
{
    INSTANCE;
    for (size_t i = 0; i < n; i++) {
        if (settle(m, vr[i], REAL) != OK)
            return ERROR;
        if (!q_isfinite(value[i])) {
            text_begin(m);
            text_add(m, bad_value[vr[i]][0]);
            text_real(m, value[i]);
            text_add(m, bad_value[vr[i]][1]);
            fail(m, 0);
            return refuse(m, 0);
        }
        m->state.memory[vr[i]] = value[i];
    }
    return OK;
}

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
    if (!*state && !(*state = malloc(sizeof(State))))
        return refuse_with(m, "fmi2GetFMUstate: no memory for a state", "", "");
    memcpy(*state, &m->state, sizeof(State));
    return OK;
}

CALL(SetFMUstate, void *state)
{
    INSTANCE;
    if (!state || memcmp(state, GUID, sizeof GUID) != 0)
        return refuse_with(m, "FMU state: expected one of this FMU", "", "");
    memcpy(&m->state, state, sizeof(State));
    return OK;
}

CALL(FreeFMUstate, void **state)
{
    INSTANCE;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return OK;
}

CALL(SerializedFMUstateSize, void *state, size_t *size)
{
    INSTANCE;
    (void)state;
    *size = sizeof(State);
    return OK;
}

CALL(SerializeFMUstate, void *state, char *bytes, size_t size)
{
    INSTANCE;
    if (!state || size < sizeof(State))
        return refuse_with(m, "fmi2SerializeFMUstate: expected a state and room for it", "", "");
    memcpy(bytes, state, sizeof(State));
    return OK;
}

CALL(DeSerializeFMUstate, const char *bytes, size_t size, void **state)
{
    INSTANCE;
    State read;
    if (size != sizeof(State) || memcmp(bytes, GUID, sizeof GUID) != 0)
        return refuse_with(m, "FMU state: expected the bytes of one of this FMU", "", "");
    memcpy(&read, bytes, sizeof read);
    if ((unsigned)read.phase >= PHASES)
        return refuse_with(m, "FMU state (phase): expected one of this FMU", "", "");
    if (!*state && !(*state = malloc(sizeof(State))))
        return refuse_with(m, "fmi2DeSerializeFMUstate: no memory for a state", "", "");
    memcpy(*state, &read, sizeof read);
    return OK;
}

/* -- derivatives -------------------------------------------------------------------------------------------------- */

/* While initialising, outputs are computed from what was set; between steps they stay as they are, whatever is set. */
CALL(GetDirectionalDerivative, References z, size_t nz, References v, size_t nv, const double *dv, double *dz)
{
    double tangents[PLACES] = {0.0};
    Instance copy;
    int error;
    INSTANCE;
    if (!are_of(z, nz, REAL))
        return refuse_references(m, z, nz, REAL);
    if (!are_of(v, nv, REAL))
        return refuse_references(m, v, nv, REAL);
    if (m->state.phase == INITIALIZATION) {
        copy = *m;
        copy.tangents = tangents;
        for (size_t i = 0; i < nv; i++)
            tangents[v[i]] = dv[i];
        if ((error = enter_stepping_with_tangents(&copy))) {
            memcpy(m->failure, copy.failure, sizeof m->failure);
            return refuse(m, error);
        }
    }
    for (size_t i = 0; i < nz; i++)
        dz[i] = tangents[z[i]];
    return OK;
}

/* -- what FMI asks for and this FMU does not offer ---------------------------------------------------------------- */

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
