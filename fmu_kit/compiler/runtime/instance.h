/* An instance of a slave for any version of FMI: order of calls, values, states, messages.

   places.h, tables.h and functions.h beside this file are specific to the slave: its memory, its variables, and its
   computations. quadcosim generates them from the slave's Python; nothing here depends on the model. An instance is
   one piece of memory, made by `create` and never grown; instances share nothing.

   The file of a version of FMI includes this one, and has the functions that a host calls. Before the include it
   defines Truth, the type of a Boolean, HAS_TIME, whether the time is a variable, and NAME(name), the full name of a
   function as a text; after it Host, the callbacks of the host, and `send_message`. */

#include <stdlib.h>
#include <string.h>

#include "integers.h"
#include "mathematics.h"
#include "text.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED, FAILED, PHASES } Phase;
typedef enum { NO_EVENTS, STEP_MODE, EVENT_MODE, CONTINUOUS_MODE, SCHEDULED } Mode; /* of a host that handles events */
typedef enum { NO_TICK, TICKS, SAMPLED } Tick; /* TICKS: values are to be computed before any is read */
typedef enum { LOG_WARNING, LOG_ERROR, LOG_DIVERGENCE, CATEGORIES } Category;
enum { LONGEST_TEXT = 1024 };

typedef const char *Text;
typedef const unsigned *References;
typedef struct Host Host;

#include "places.h"
#include "tables.h"

#if defined(PARTITIONS)
enum { CLOCKS = PARTITIONS };
#else
enum { CLOCKS = 1 };
#endif

/* What is no variable of the slave, by value reference: the derivative of each continuous state; those states that are
   none of the variables; of FMI 3.0 the time, and the clock if it samples. */
enum { FIRST_RATE = VARIABLES, FIRST_KEPT = FIRST_RATE + STATES, TIME = FIRST_KEPT + KEPT_STATES, CLOCK };

static const Text categories[CATEGORIES] = {"logStatusWarning", "logStatusError", "divergence"};

/* The FMU to which a state belongs. */
typedef struct {
    char format[16], guid[48], model[64];
    int reals;
} Owner;

/* The saved state: all that a step depends on. */
typedef struct {
    Owner owner;
    double memory[PLACES];
    double time;     /* of the last communication point */
    double reached;  /* start time of the next step; not a number before the first: any */
    double stop;     /* stop time; infinite if none is defined */
    double interval[CLOCKS];
    double since; /* in model exchange the time of the last event */
#if defined(PARTITIONS)
    unsigned char ticks[PARTITIONS]; /* the clocks that tick, in event mode */
#endif
    unsigned warned; /* bits of the warnings that were sent */
    Phase phase;
    Mode mode;
    Tick tick; /* of the clock, in event mode; SAMPLED: its outputs are computed. Of model exchange: a value was set */
} State;

/* Its bytes, for the host. */
typedef struct {
    State state;
    uint64_t checksum;
} Serialised;

typedef struct {
    State state;
    char failure[LONGEST_TEXT]; /* why the last call failed */
    char draft[LONGEST_TEXT];   /* a message that is being written */
    q_text text;                /* the draft as a text of text.h */
    Text name;                  /* stored behind the instance, in the same piece of memory */
    const Host *host;
    int logs[CATEGORIES];
    double *tangents; /* of the memory, while derivatives are computed */
    int exchanges;    /* it is for model exchange */
    double rates[RATES + 1]; /* the derivatives of the states, and the time of the next event */
} Instance;

/* -- messages --------------------------------------------------------------------------------------------------- */

/* Send a message to the host. */
static void send_message(const Instance *m, Status status, Text category, Text message);

static void log_message(const Instance *m, Status status, Category category, Text message)
{
    if (m->logs[category])
        send_message(m, status, categories[category], message);
}

static void text_begin(Instance *m) { m->text = q_text_in(m->draft, sizeof m->draft); }
static void text_add(Instance *m, Text text) { q_text_string(&m->text, text); }
static void text_real(Instance *m, double x) { q_text_repr(&m->text, x); }
static void text_integer(Instance *m, double x) { q_text_fixed(&m->text, x == 0.0 ? 0.0 : x, 0); }

static int fail(Instance *m, int error)
{
    memcpy(m->failure, m->draft, sizeof m->failure);
    return error;
}

Q_ONE void warn(Instance *m) { log_message(m, WARNING, LOG_WARNING, m->draft); }

#include "functions.h"

/* After a failure the instance can be freed, reset, or set to a state that was saved before. */
static Status refuse(Instance *m, int error)
{
    m->state.phase = FAILED;
    log_message(m, ERROR, error == DIVERGENCE ? LOG_DIVERGENCE : LOG_ERROR, m->failure);
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

static Status refuse_numbers(Instance *m, size_t n, const double *x, const Text *around)
{
    text_begin(m);
    text_add(m, around[0]);
    for (size_t i = 0; i < n; i++) {
        text_real(m, x[i]);
        text_add(m, around[i + 1]);
    }
    fail(m, 0);
    return refuse(m, 0);
}

static Status expect(Instance *m, Call call)
{
    Text refusal = refused_call[call][m->state.phase];
    return refusal ? refuse_with(m, refusal, "", "") : OK;
}

/* Switch some categories, or all if none are named. */
static Status set_logging(Instance *m, int on, size_t n, const Text *selected)
{
    for (int k = 0; k < CATEGORIES; k++) {
        m->logs[k] = on && n == 0;
        for (size_t i = 0; i < n; i++)
            if (selected[i] && strcmp(selected[i], categories[k]) == 0)
                m->logs[k] = on;
    }
    return OK;
}

/* -- life cycle ------------------------------------------------------------------------------------------------- */

static Owner owner(void)
{
    Owner of = {"quadcosim state", "", "", REALS};
    q_text guid = q_text_in(of.guid, sizeof of.guid), model = q_text_in(of.model, sizeof of.model);
    q_text_string(&guid, GUID);
    q_text_string(&model, MODEL);
    return of;
}

static void begin(Instance *m)
{
    memset(&m->state, 0, sizeof m->state);
    m->state.owner = owner();
    memcpy(m->state.memory, starts, sizeof starts);
    m->state.reached = Q_NAN;
    m->state.stop = Q_INFINITY;
    m->state.phase = INSTANTIATED;
    m->state.mode = m->exchanges ? EVENT_MODE : NO_EVENTS;
}

/* An instance, at the start of memory of this size or more; NULL if there is no memory. */
static Instance *create(size_t size, Text name, int logs)
{
    Instance *m = calloc(1, size + strlen(name) + 1);
    if (!m)
        return NULL;
    m->name = strcpy((char *)m + size, name);
    m->logs[LOG_ERROR] = m->logs[LOG_DIVERGENCE] = 1; /* until the host says otherwise: most say nothing */
    m->logs[LOG_WARNING] = logs;
    begin(m);
    return m;
}

static Status set_times(Instance *m, double t, int has_stop, double stop)
{
    if (expect(m, SETUP_EXPERIMENT) != OK)
        return ERROR;
    if (!q_isfinite(t))
        return refuse_numbers(m, 1, &t, bad_start_time);
    if (has_stop && !(stop >= t))
        return refuse_numbers(m, 2, (double[]){stop, t}, bad_stop_time);
    m->state.memory[KEPT_START_TIME] = t;
    m->state.time = t;
    m->state.stop = has_stop ? stop : Q_INFINITY;
    return OK;
}

static Status enter_initialization(Instance *m)
{
    if (expect(m, ENTER_INITIALIZATION_MODE) != OK)
        return ERROR;
    m->state.phase = INITIALIZATION;
    return OK;
}

/* The derivatives at the time and state that it has; in model exchange, with what else follows from these. */
static int find_rates(Instance *m)
{
    int error = 0;
    (void)m;
#if STATES
    if (m->exchanges && m->state.phase == STEPPING) {
        m->state.tick = NO_TICK;
        return model_derive(m, m->state.time, m->state.since, m->rates);
    }
    Instance copy = *m;
    if ((error = model_derive(&copy, m->state.time, m->state.time, m->rates)))
        memcpy(m->failure, copy.failure, sizeof m->failure);
#endif
    return error;
}

static Status exit_initialization(Instance *m)
{
    int error;
    if (expect(m, EXIT_INITIALIZATION_MODE) != OK)
        return ERROR;
    if ((error = model_enter_stepping(m)))
        return refuse(m, error);
    m->state.phase = STEPPING;
    m->state.since = m->state.time;
    return m->exchanges && (error = find_rates(m)) ? refuse(m, error) : OK;
}

/* A step begins where the last one ended, and does not end past the stop time; mirrors `_expect_in_time`. */
static Status expect_in_time(Instance *m, double t, double h)
{
    const double size = h > q_fabs(t) ? h : q_fabs(t), slack = TIME_TOLERANCE * (size > 1.0 ? size : 1.0);
    if (q_fabs(t - m->state.reached) > slack)
        return refuse_numbers(m, 2, (double[]){t, m->state.reached}, bad_time);
    if (t + h - m->state.stop > slack)
        return refuse_numbers(m, 3, (double[]){h, t, m->state.stop}, bad_end);
    return OK;
}

static Status advance(Instance *m, double t, double h)
{
    int error;
    if (expect(m, DO_STEP) != OK || expect_in_time(m, t, h) != OK)
        return ERROR;
    if (m->state.mode >= EVENT_MODE)
        return refuse_with(m, NAME(DoStep) ": expected step mode, of co-simulation", "", "");
    if (m->state.mode == NO_EVENTS && (error = model_do_step(m, t, h)))
        return refuse(m, error);
    m->state.time = m->state.reached = t + h;
    return OK;
}

/* The sample of a tick of the clock, held until the next one; in model exchange, what follows from values that were set. */
static int compute(Instance *m)
{
    if (m->exchanges)
        return find_rates(m);
    m->state.tick = SAMPLED;
#if defined(PARTITIONS)
    for (unsigned i = 0; i < PARTITIONS; i++) {
        const int error = m->state.ticks[i] ? model_run_task(m, i) : 0;
        m->state.ticks[i] = 0;
        if (error)
            return error;
    }
    return 0;
#else
    return model_do_step(m, m->state.time, m->state.interval[0]);
#endif
}

static Status end(Instance *m)
{
    if (expect(m, TERMINATE) != OK)
        return ERROR;
    m->state.phase = TERMINATED;
    return OK;
}

/* -- values ----------------------------------------------------------------------------------------------------- */

/* Whether a reference is that of a Real that is no variable of the slave. */
static int is_beside(unsigned vr)
{
    return vr >= FIRST_RATE && vr < TIME + HAS_TIME;
}

static Status refuse_references(Instance *m, References vr, size_t n, Type type)
{
    int first = 1;
    text_begin(m);
    text_add(m, wrong_type[type][0]);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < VARIABLES ? types[vr[i]] == type : type == REAL && is_beside(vr[i]))
            continue;
        text_add(m, first ? "" : ", ");
        text_integer(m, vr[i]);
        first = 0;
    }
    text_add(m, wrong_type[type][1]);
    fail(m, 0);
    return refuse(m, 0);
}

static int have_type(References vr, size_t n, Type type)
{
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= VARIABLES || types[vr[i]] != type)
            return 0;
    return 1;
}

/* Compute the values to be read: where they are to be, and in initialisation mode if others were set since they were computed. */
static int bring_up_to_date(Instance *m, References vr, size_t n)
{
    if (m->state.tick == TICKS)
        return compute(m);
    if (m->state.phase != INITIALIZATION || m->state.memory[KEPT_STALE] == 0.0)
        return 0;
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= VARIABLES || !(kinds[vr[i]] & GIVEN))
            return model_enter_stepping(m);
    return 0;
}

/* Whether a value may be set now. */
static Status expect_settable(Instance *m, unsigned vr, Type type)
{
    Text refusal;
    if (!have_type(&vr, 1, type))
        return refuse_references(m, &vr, 1, type);
    if ((refusal = refused_setting[vr][m->state.phase]))
        return refuse_with(m, refusal, "", "");
    if (m->state.tick == SAMPLED)
        return refuse_with(m, "inputs: expected before any value is read at a tick", "", "");
    if (!(kinds[vr] & INPUT) || m->state.phase != STEPPING)
        m->state.memory[KEPT_STALE] = 1.0;
    if (m->exchanges && m->state.phase == STEPPING)
        m->state.tick = TICKS;
    return OK;
}

/* A computed value may be beyond the range of the interface. */
static int as_int(double x) { return x >= 2147483647.0 ? 2147483647 : x > -2147483648.0 ? (int)x : -2147483647 - 1; }

#define GET(name, type, ctype, converted) \
    static Status get_##name(Instance *m, References vr, size_t n, ctype *value) \
    { \
        int error = bring_up_to_date(m, vr, n); \
        if (error) \
            return refuse(m, error); \
        if (!have_type(vr, n, type)) \
            return refuse_references(m, vr, n, type); \
        for (size_t i = 0; i < n; i++) \
            value[i] = (ctype)converted(m->state.memory[vr[i]]); \
        return OK; \
    }

#define SET(name, type, ctype, number) \
    static Status set_##name(Instance *m, References vr, size_t n, const ctype *value) \
    { \
        for (size_t i = 0; i < n; i++) { \
            if (expect_settable(m, vr[i], type) != OK) \
                return ERROR; \
            m->state.memory[vr[i]] = number; \
        } \
        return OK; \
    }

GET(integers, INTEGER, int, as_int)
GET(booleans, BOOLEAN, Truth, as_int)
SET(integers, INTEGER, int, value[i])
SET(booleans, BOOLEAN, Truth, value[i] != 0)

static Status get_reals(Instance *m, References vr, size_t n, double *value)
{
    int error = bring_up_to_date(m, vr, n), has_rates = 0;
    if (error)
        return refuse(m, error);
    if (have_type(vr, n, REAL)) {
        for (size_t i = 0; i < n; i++)
            value[i] = m->state.memory[vr[i]];
        return OK;
    }
    for (size_t i = 0; i < n; i++) {
        if (!have_type(vr + i, 1, REAL) && !is_beside(vr[i]))
            return refuse_references(m, vr, n, REAL);
        has_rates |= vr[i] >= FIRST_RATE && vr[i] < FIRST_KEPT;
    }
    if (has_rates && m->state.phase != INSTANTIATED && m->state.phase != FAILED && (error = find_rates(m)))
        return refuse(m, error);
    for (size_t i = 0; i < n; i++)
        value[i] = vr[i] < VARIABLES    ? m->state.memory[vr[i]]
                   : vr[i] < FIRST_KEPT ? m->rates[state_rates[vr[i] - FIRST_RATE]]
                   : vr[i] < TIME       ? m->state.memory[kept_places[vr[i] - FIRST_KEPT]]
                                        : m->state.time;
    return OK;
}

static Status set_reals(Instance *m, References vr, size_t n, const double *value)
{
    for (size_t i = 0; i < n; i++) {
        if (expect_settable(m, vr[i], REAL) != OK)
            return ERROR;
        if (!q_isfinite(value[i]))
            return refuse_numbers(m, 1, &value[i], bad_value[vr[i]]);
        m->state.memory[vr[i]] = value[i];
    }
    return OK;
}

/* -- states ------------------------------------------------------------------------------------------------------ */

/* Make a printable text of arbitrary bytes. */
static void make_printable(char *text, size_t size)
{
    text[size - 1] = '\0';
    for (; *text; text++)
        if (*text < ' ' || *text > '~')
            *text = '?';
}

/* Whether bytes begin like a state of this FMU; otherwise refuse them with the message of the slave in Python. */
static Status expect_own_state(Instance *m, const void *bytes, size_t size)
{
    const Owner mine = m->state.owner;
    Owner found;
    if (size < sizeof found || memcmp(bytes, mine.format, sizeof mine.format) != 0)
        return refuse_with(m, foreign_state[0], "None, 0", foreign_state[1]);
    memcpy(&found, bytes, sizeof found);
    if (memcmp(&found, &mine, sizeof mine) == 0)
        return OK;
    make_printable(found.guid, sizeof found.guid);
    make_printable(found.model, sizeof found.model);
    if (strcmp(found.model, mine.model) == 0 && found.reals == mine.reals)
        return refuse_with(m, "FMU state (GUID) = ", found.guid, ": expected " GUID ", that of this FMU");
    text_begin(m);
    text_add(m, foreign_state[0]);
    text_add(m, "'");
    text_add(m, found.model);
    text_add(m, "', ");
    text_integer(m, found.reals);
    text_add(m, foreign_state[1]);
    fail(m, 0);
    return refuse(m, 0);
}

static Status save(Instance *m, void **state)
{
    if (!state)
        return refuse_with(m, "FMU state: expected a place for it", "", "");
    if (!*state && !(*state = malloc(sizeof(State))))
        return refuse_with(m, "FMU state: no memory for it", "", "");
    memcpy(*state, &m->state, sizeof(State));
    return OK;
}

static Status restore(Instance *m, const void *state)
{
    if (expect_own_state(m, state, state ? sizeof(State) : 0) != OK)
        return ERROR;
    memcpy(&m->state, state, sizeof(State));
    if (m->exchanges && m->state.phase == STEPPING)
        m->state.tick = TICKS;
    return OK;
}

static Status free_state(void **state)
{
    if (state) {
        free(*state);
        *state = NULL;
    }
    return OK;
}

/* A checksum that changes with any single byte, and almost certainly with swapped or lost bytes (FNV-1a, 64 bits). */
static uint64_t checksum_of(const State *state)
{
    const unsigned char *bytes = (const unsigned char *)state;
    uint64_t found = 0xcbf29ce484222325u;
    for (size_t i = 0; i < sizeof *state; i++)
        found = (found ^ bytes[i]) * 0x100000001b3u;
    return found;
}

static Status size_of_bytes(Instance *m, size_t *size)
{
    if (!size)
        return refuse_with(m, "FMU state (size of its bytes): expected a place for it", "", "");
    *size = sizeof(Serialised);
    return OK;
}

static Status to_bytes(Instance *m, const void *state, void *bytes, size_t size)
{
    Serialised serialised;
    if (!state || !bytes || size < sizeof serialised)
        return refuse_with(m, "FMU state: expected one, and room for its bytes", "", "");
    memcpy(&serialised.state, state, sizeof serialised.state);
    serialised.checksum = checksum_of(&serialised.state);
    memcpy(bytes, &serialised, sizeof serialised);
    return OK;
}

static Status from_bytes(Instance *m, const void *bytes, size_t size, void **state)
{
    Serialised found;
    if (!state)
        return refuse_with(m, "FMU state: expected a place for it", "", "");
    if (expect_own_state(m, bytes, bytes ? size : 0) != OK)
        return ERROR;
    if (size != sizeof found)
        return refuse_with(m, "FMU state (its bytes): expected all of them", "", "");
    memcpy(&found, bytes, sizeof found);
    if (found.checksum != checksum_of(&found.state))
        return refuse_with(m, damaged_state, "", "");
    if ((unsigned)found.state.phase >= PHASES)
        return refuse_with(m, "FMU state (phase): expected one of this FMU", "", "");
    if (!*state && !(*state = malloc(sizeof(State))))
        return refuse_with(m, "FMU state: no memory for it", "", "");
    memcpy(*state, &found.state, sizeof found.state);
    return OK;
}

/* -- derivatives ------------------------------------------------------------------------------------------------- */

/* During initialisation, outputs depend on the values that were set; between steps they depend on nothing. Those of
   model exchange are not offered. */
static Status derive(Instance *m, References z, size_t nz, References v, size_t nv, const double *dv, double *dz)
{
    double tangents[PLACES] = {0.0};
    Instance copy;
    int error;
    if (!have_type(z, nz, REAL))
        return refuse_references(m, z, nz, REAL);
    if (!have_type(v, nv, REAL))
        return refuse_references(m, v, nv, REAL);
    if (m->exchanges)
        return refuse_with(m, "directional derivatives: not offered in model exchange", "", "");
    if (m->state.phase == INITIALIZATION) {
        copy = *m;
        copy.tangents = tangents;
        for (size_t i = 0; i < nv; i++)
            tangents[v[i]] = dv[i];
        if ((error = tangents_enter_stepping(&copy))) {
            memcpy(m->failure, copy.failure, sizeof m->failure);
            return refuse(m, error);
        }
    }
    for (size_t i = 0; i < nz; i++)
        dz[i] = tangents[z[i]];
    return OK;
}

/* -- the functions that a host calls ----------------------------------------------------------------------------- */

/* The version of FMI defines FMI(name), the full name of a function. */
#define CALL(name, ...) \
    EXPORT Status FMI(name)(void *c, __VA_ARGS__); \
    Status FMI(name)(void *c, __VA_ARGS__)
#define PLAIN(name) \
    EXPORT Status FMI(name)(void *c); \
    Status FMI(name)(void *c)
#define INSTANCE \
    Instance *m = c; \
    if (!m) \
        return ERROR
