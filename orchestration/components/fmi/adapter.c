/* An FMU in event mode or for model exchange, of FMI 2.0 or FMI 3.0, behind the functions of plain co-simulation: a
   step, and getting and setting values. Modes, events and the solver are in here. adapted.py has the structure.

   now is the time that the FMU has reached [s]. Setting values that differ from those it has enters event mode; the
   next call that gets values or steps leaves it. An event happens at its own time within a step, and is noted. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

/* Statuses of FMI. */
#define OK 0
#define WARNING 1
#define DISCARD 2
#define ERROR 3

/* Why a call fails that is none of the FMU's own failures. */
enum { NOTHING, ENDLESS_UPDATES, ENDLESS_EVENTS, NO_STEP, ENDLESS_STEPS, NO_ROOM };

/* The types of values; the last is the Boolean of FMI 2.0. */
enum { Float64, Float32, Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Boolean, Boolean2 };

#define MOST_UPDATES 1000
#define MOST_EVENTS 10000 /* in one step */
#define MOST_STEPS 10000000

typedef struct { /* a variable that has a value while its clocks tick; its value is that of their last tick */
    int64_t type, reference, count, clocks; /* clocks: a bit for each */
    void *values;
} Clocked;

typedef struct { /* values that are set when the next sample begins */
    int64_t type, references_count, count;
    void *references, *values;
} Waiting;

typedef struct { /* inputs that are set by one call, and follow lines: each at its place, by its column of the table */
    int64_t type, references_count, count, inputs;
    void *references, *values;
    const int64_t *places, *columns;
} Followed;

typedef struct {
    void *fmu; /* the instance */
    int64_t version;
    void *enter_event, *leave_event, *update;
    void *step;     /* of co-simulation; NULL: model exchange, or */
    void *activate; /* the partition of its only clock, of scheduled execution: an adapter for each, with one instance */
    void *set_time, *set_states, *get_states, *derivatives, *indicators, *nominals, *completed;
    void *get[12], *set[12];
    int64_t states, crossings; /* numbers of continuous states and event indicators */
    double *x, *y, *k, *nominal, *z, *z_next;
    double tolerance;
    double now, next; /* [s], next: the time of the next time event; infinite: there is none */
    double h;         /* [s] the next step of the solver; 0: it begins */
    double error;     /* of the last step of the solver, 1 is the tolerance */
    int64_t running, in_event, fresh, ends, problem;
    int64_t events; /* all that have happened */
    double *noted;  /* [s] the times of the last of them */
    int64_t noted_count, noted_room;
    int64_t evaluations;
    void *buffer;
    size_t buffer_size;
    /* periodic input clocks: each step begins with a sample, but for one that leads to the first sample */
    void *set_clock;
    int64_t clocks, clock[64], ratio[64], shift[64]; /* one ticks at samples k ≡ shift modulo ratio */
    int64_t samples, starts_late;
    void *solver; /* in place of that in here */
    Clocked *clocked;
    int64_t clocked_count;
    Waiting *waiting;
    int64_t waiting_count, waiting_room;
    /* lines that inputs follow within a step of model exchange, through rows of a table */
    double start; /* [s] the time of the FMU at 0 of the table */
    double from;  /* [s] there a jump has happened, as where a step begins */
    const double *rows_time, *rows;
    int64_t rows_count, columns_count;
    Followed *followed;
    int64_t followed_count;
} Adapter;

typedef struct {
    const char *name;
    int64_t size;
} Size;

#define SIZE_OF(structure) {#structure, sizeof(structure)}
EXPORT const Size sizes[] = {SIZE_OF(Adapter), SIZE_OF(Clocked), SIZE_OF(Waiting), SIZE_OF(Followed), SIZE_OF(Size), {0}};

typedef int Call(void *);
typedef int SetNumber(void *, double);
typedef int GetNumbers(void *, double *, size_t);
typedef int SetNumbers(void *, const double *, size_t);
typedef int Access2(void *, const uint32_t *, size_t, void *);
typedef int Access3(void *, const uint32_t *, size_t, void *, size_t);
typedef int Step(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int Update2(void *, void *);
typedef int Update3(void *, bool *, bool *, bool *, bool *, bool *, double *);
typedef int Solver(double, bool *);
typedef int SetClock(void *, const uint32_t *, size_t, const bool *);
typedef int Activate(void *, uint32_t, double);
typedef int Completed2(void *, int, int *, int *);
typedef int Completed3(void *, bool, bool *, bool *);

static int fail(Adapter *a, int problem) {
    a->problem = problem;
    return ERROR;
}

/* Whether two times are the same nanosecond, and whether one is no later than the other. */
static bool same(double a, double b) { return rint(a * 1e9) == rint(b * 1e9); }
static bool is_due(double a, double b) { return rint(a * 1e9) <= rint(b * 1e9); }

static const size_t bytes[] = {8, 4, 1, 1, 2, 2, 4, 4, 8, 8, sizeof(bool), sizeof(int)};

static int call(Adapter *a, void *function, const uint32_t *references, size_t n, void *values, size_t count) {
    if (a->version == 3) return ((Access3 *)function)(a->fmu, references, n, values, count);
    return ((Access2 *)function)(a->fmu, references, n, values);
}

/* -- inputs along lines -------------------------------------------------------------------------------------------- */

/* The number of rows before a time of the FMU, or also of that time. */
static int64_t rows_before(const Adapter *a, double time, bool also) {
    int64_t low = 0, high = a->rows_count;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (also ? a->rows_time[middle] <= time : a->rows_time[middle] < time) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* Set the inputs that follow lines to their values at t, those of the sources in Python to the bit. */
static int follow(Adapter *a, double t) {
    if (!a->followed_count) return OK;
    double time = t - a->start, instant = rint(time * 1e9) / 1e9;
    if (fabs(time - instant) < 1e-15 * (1 + fabs(t))) time = instant;
    int64_t i = rows_before(a, time, t <= a->from) - 1, last = a->rows_count - 2;
    i = i < 0 ? 0 : i > last ? last : i;
    double share = (time - a->rows_time[i]) / (a->rows_time[i + 1] - a->rows_time[i]);
    share = fmin(fmax(share, 0), 1);
    const double *row = a->rows + i * a->columns_count, *next = row + a->columns_count;
    int status = OK;
    for (Followed *f = a->followed; status <= WARNING && f < a->followed + a->followed_count; f++) {
        for (int64_t j = 0; j < f->inputs; j++) {
            int64_t c = f->columns[j];
            double value = share == 1 && i < last ? next[c] : row[c] + share * (next[c] - row[c]);
            if (f->type == Float32) ((float *)f->values)[f->places[j]] = (float)value;
            else ((double *)f->values)[f->places[j]] = value;
        }
        status = call(a, a->set[f->type], f->references, (size_t)f->references_count, f->values, (size_t)f->count);
    }
    return status;
}

static int set_time(Adapter *a, double t) {
    int status = ((SetNumber *)a->set_time)(a->fmu, t);
    return status > WARNING ? status : follow(a, t);
}

/* -- events -------------------------------------------------------------------------------------------------------- */

static int enter_event(Adapter *a) {
    if (a->in_event) return OK;
    int status = ((Call *)a->enter_event)(a->fmu);
    if (status <= WARNING) a->in_event = 1;
    return status;
}

static int update(Adapter *a, bool *again) {
    bool ends, nominals, values, has_next;
    double next;
    int status;
    if (a->version == 3) {
        status = ((Update3 *)a->update)(a->fmu, again, &ends, &nominals, &values, &has_next, &next);
    } else {
        struct {
            int again, ends, nominals, values, has_next;
            double next;
        } info = {0};
        status = ((Update2 *)a->update)(a->fmu, &info);
        *again = info.again, ends = info.ends, nominals = info.nominals, has_next = info.has_next, next = info.next;
    }
    if (status > WARNING) return status;
    a->next = has_next ? next : INFINITY;
    a->ends |= ends;
    if (nominals && a->nominals) return ((GetNumbers *)a->nominals)(a->fmu, a->nominal, (size_t)a->states);
    return status;
}

/* Read what the solver continues from. */
static int read_states(Adapter *a) {
    a->fresh = 1;
    int status = a->states ? ((GetNumbers *)a->get_states)(a->fmu, a->x, (size_t)a->states) : OK;
    if (status > WARNING || !a->crossings) return status;
    return ((GetNumbers *)a->indicators)(a->fmu, a->z, (size_t)a->crossings);
}

/* Leave event mode, if it is in it. */
static int conclude(Adapter *a) {
    if (!a->in_event) return OK;
    bool again = true;
    int status;
    for (int i = 0; again && !a->ends; i++) {
        if (i == MOST_UPDATES) return fail(a, ENDLESS_UPDATES);
        if ((status = update(a, &again)) > WARNING) return status;
    }
    if (a->ends) return OK;
    if ((status = ((Call *)a->leave_event)(a->fmu)) > WARNING) return status;
    a->in_event = 0;
    return a->step ? OK : read_states(a);
}

static int handle_event(Adapter *a) {
    if (a->noted_count == a->noted_room) {
        int64_t room = 2 * a->noted_room + 64;
        double *noted = realloc(a->noted, (size_t)room * sizeof(double));
        if (!noted) return fail(a, NO_ROOM);
        a->noted = noted, a->noted_room = room;
    }
    a->noted[a->noted_count++] = a->now;
    a->events++;
    int status = enter_event(a);
    return status > WARNING ? status : conclude(a);
}

/* The time events that are due, which may be half a nanosecond ahead. */
static int handle_time_events(Adapter *a, int64_t most) {
    while (!a->ends && is_due(a->next, a->now)) {
        if (a->events >= most) return fail(a, ENDLESS_EVENTS);
        int status = OK;
        if (a->next > a->now) {
            a->now = a->next;
            if (a->set_time) status = set_time(a, a->now);
        }
        if (status > WARNING || (status = handle_event(a)) > WARNING) return status;
    }
    return OK;
}

/* -- values ------------------------------------------------------------------------------------------------------- */

static Clocked *clocked_of(Adapter *a, int type, uint32_t reference) {
    for (Clocked *c = a->clocked; c < a->clocked + a->clocked_count; c++)
        if (c->type == type && c->reference == reference) return c;
    return NULL;
}

static int get(Adapter *a, int type, const uint32_t *references, size_t n, void *values, size_t count) {
    int status = conclude(a);
    bool some = false;
    for (size_t i = 0; i < n && a->clocked_count; i++) some |= clocked_of(a, type, references[i]) != NULL;
    if (status > WARNING || !some) return status > WARNING ? status : call(a, a->get[type], references, n, values, count);
    size_t each = count / n;
    for (size_t i = 0; i < n; i++) {
        void *into = (char *)values + i * each * bytes[type];
        Clocked *c = clocked_of(a, type, references[i]);
        if (c) memcpy(into, c->values, each * bytes[type]);
        else if ((status = call(a, a->get[type], references + i, 1, into, each)) > WARNING) return status;
    }
    return status;
}

/* Keep values for the next sample, in place of earlier ones of the same variables. */
static int keep(Adapter *a, int type, const uint32_t *references, size_t n, const void *values, size_t count) {
    Waiting *w = a->waiting, *end = w + a->waiting_count;
    size_t size = n * sizeof *references;
    while (w < end && (w->type != type || w->references_count != (int64_t)n || memcmp(w->references, references, size))) w++;
    if (w == end) {
        if (a->waiting_count == a->waiting_room) {
            int64_t room = 2 * a->waiting_room + 8;
            Waiting *more = realloc(a->waiting, (size_t)room * sizeof *w);
            if (!more) return fail(a, NO_ROOM);
            a->waiting = more, a->waiting_room = room;
        }
        w = a->waiting + a->waiting_count;
        *w = (Waiting){type, (int64_t)n, (int64_t)count, malloc(size), malloc(count * bytes[type])};
        if (!w->references || !w->values) return fail(a, NO_ROOM);
        memcpy(w->references, references, size);
        a->waiting_count++;
    }
    memcpy(w->values, values, count * bytes[type]);
    return OK;
}

static void forget(Adapter *a) {
    for (Waiting *w = a->waiting; w < a->waiting + a->waiting_count; w++) free(w->references), free(w->values);
    a->waiting_count = 0;
}

static int set(Adapter *a, int type, const uint32_t *references, size_t n, void *values, size_t count) {
    if (a->activate || (a->running && a->clocks)) {
        int status = keep(a, type, references, n, values, count);
        if (a->running || status > WARNING) return status;
    } else if (a->running) {
        size_t size = count * bytes[type];
        if (size > a->buffer_size) {
            void *buffer = realloc(a->buffer, size);
            if (!buffer) return fail(a, NO_ROOM);
            a->buffer = buffer, a->buffer_size = size;
        }
        int status = call(a, a->get[type], references, n, a->buffer, count);
        if (status > WARNING || !memcmp(a->buffer, values, size) || a->ends) return status;
        if ((status = enter_event(a)) > WARNING) return status;
    }
    return call(a, a->set[type], references, n, values, count);
}

static int set_waiting(Adapter *a) {
    int status = OK;
    for (Waiting *w = a->waiting; status <= WARNING && w < a->waiting + a->waiting_count; w++)
        status = call(a, a->set[w->type], w->references, (size_t)w->references_count, w->values, (size_t)w->count);
    return status;
}

/* A sample: clocks tick, inputs are set, and what has a value while they tick is read, all before the update. */
static int sample(Adapter *a) {
    uint32_t ticking[64];
    bool on[64];
    int64_t ticks = 0, which = 0;
    int status = enter_event(a);
    for (int64_t i = 0; i < a->clocks; i++)
        if (a->samples >= a->shift[i] && (a->samples - a->shift[i]) % a->ratio[i] == 0) {
            ticking[ticks] = (uint32_t)a->clock[i], on[ticks++] = true;
            which |= (int64_t)1 << i;
        }
    a->samples++;
    if (status <= WARNING && ticks) status = ((SetClock *)a->set_clock)(a->fmu, ticking, (size_t)ticks, on);
    if (status <= WARNING) status = set_waiting(a);
    forget(a);
    for (Clocked *c = a->clocked; status <= WARNING && c < a->clocked + a->clocked_count; c++) {
        uint32_t reference = (uint32_t)c->reference;
        if (c->clocks & which) status = call(a, a->get[c->type], &reference, 1, c->values, (size_t)c->count);
    }
    return status > WARNING ? status : conclude(a);
}

/* A job of a partition begins at t, with its inputs: another one may have set variables that they share. */
static int run_partition(Adapter *a, double t) {
    int status = set_waiting(a);
    return status > WARNING ? status : ((Activate *)a->activate)(a->fmu, (uint32_t)a->clock[0], t);
}

/* -- model exchange ------------------------------------------------------------------------------------------------ */

/* Put the FMU at a time with these states. */
static int put(Adapter *a, double t, const double *x) {
    int status = set_time(a, t);
    if (status > WARNING || !a->states) return status;
    return ((SetNumbers *)a->set_states)(a->fmu, x, (size_t)a->states);
}

static int evaluate(Adapter *a, double t, const double *x, double *into) {
    int status = put(a, t, x);
    a->evaluations++;
    if (status > WARNING || !a->states) return status;
    return ((GetNumbers *)a->derivatives)(a->fmu, into, (size_t)a->states);
}

/* The method of Dormand and Prince, of order 5, with an error of order 4. */
static const double C[6] = {.2, .3, .8, 8. / 9, 1, 1}, WEIGHTS[6][6] = {
    {.2},
    {3. / 40, 9. / 40},
    {44. / 45, -56. / 15, 32. / 9},
    {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
    {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656},
    {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84},
}, ERRORS[7] = {71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40};

static double scale(const Adapter *a, int64_t i, double x) { return a->tolerance * (a->nominal[i] + fabs(x)); }

/* Attempt a step of the length h from x, where the derivatives are known: to y, with its error. One that the FMU
   discards, or that is not finite, has an infinite one. */
static int attempt(Adapter *a, double h) {
    int64_t n = a->states;
    a->error = INFINITY;
    for (int stage = n ? 0 : 5; stage < 6; stage++) {
        for (int64_t i = 0; i < n; i++) {
            double sum = 0;
            for (int j = 0; j <= stage; j++) sum += WEIGHTS[stage][j] * a->k[j * n + i];
            a->y[i] = a->x[i] + h * sum;
        }
        int status = evaluate(a, a->now + C[stage] * h, a->y, a->k + (stage + 1) * n);
        if (status == DISCARD) return OK;
        if (status > WARNING) return status;
    }
    double error = 0;
    for (int64_t i = 0; i < n; i++) {
        double sum = 0;
        for (int j = 0; j < 7; j++) sum += ERRORS[j] * a->k[j * n + i];
        double one = fabs(h * sum) / scale(a, i, fmax(fabs(a->x[i]), fabs(a->y[i])));
        if (!isfinite(one) || !isfinite(a->y[i])) return OK;
        error = fmax(error, one);
    }
    a->error = error;
    return OK;
}

/* The fifth root, of the same bits everywhere, which pow has not. */
static double fifth_root(double x) {
    int exponent;
    frexp(x, &exponent);
    double root = ldexp(1, exponent / 5);
    for (int i = 0; i < 12; i++) root = (4 * root + x / (root * root * root * root)) / 5;
    return root;
}

/* A first step: a hundredth of that which changes the states by their size. */
static double first_step(const Adapter *a) {
    double size = 0, rate = 0;
    for (int64_t i = 0; i < a->states; i++) {
        size = fmax(size, fabs(a->x[i]) / scale(a, i, a->x[i]));
        rate = fmax(rate, fabs(a->k[i]) / scale(a, i, a->x[i]));
    }
    return size > 1e-5 && rate > 1e-5 ? .01 * size / rate : 1e-6;
}

/* Whether an indicator has changed its sign up to where the FMU is. */
static int look(Adapter *a, bool *crosses) {
    *crosses = false;
    if (!a->crossings) return OK;
    int status = ((GetNumbers *)a->indicators)(a->fmu, a->z_next, (size_t)a->crossings);
    for (int64_t i = 0; i < a->crossings; i++) *crosses |= (a->z[i] > 0) != (a->z_next[i] > 0);
    return status;
}

/* The length of the shortest step that has the first crossing of one of length h, by steps from the same states. */
static int locate(Adapter *a, double *h) {
    double low = 0, high = *h;
    bool crosses;
    int status;
    while (high - low > 1e-15 * (1 + fabs(a->now))) {
        double middle = .5 * (low + high);
        if (middle <= low || middle >= high) break;
        if ((status = attempt(a, middle)) > WARNING || (status = look(a, &crosses)) > WARNING) return status;
        if (crosses) high = middle;
        else low = middle;
    }
    *h = high;
    if ((status = attempt(a, high)) > WARNING) return status;
    return look(a, &crosses);
}

/* The FMU is told that a step is accepted; whether it needs event mode. */
static int complete(Adapter *a, bool *event) {
    *event = false;
    if (!a->completed) return OK;
    bool ends = false;
    int status;
    if (a->version == 3) {
        status = ((Completed3 *)a->completed)(a->fmu, true, event, &ends);
    } else {
        int event2 = 0, ends2 = 0;
        status = ((Completed2 *)a->completed)(a->fmu, 1, &event2, &ends2);
        *event = event2, ends = ends2;
    }
    a->ends |= ends;
    return status;
}

/* The same by another solver, which puts the FMU at the time that it reaches, and sets now. */
static int solve_elsewhere(Adapter *a, double until) {
    bool crosses = false, event;
    int status = ((Solver *)a->solver)(until, &crosses);
    if (status > WARNING || (status = complete(a, &event)) > WARNING) return status;
    return (crosses || event) && !a->ends ? handle_event(a) : OK;
}

/* One step of the solver, no further than `until`, or an attempt that was too long; events of its end. */
static int solve(Adapter *a, double until) {
    int64_t n = a->states;
    double rest = until - a->now, h = rest;
    bool crosses, event;
    int status;
    if (a->fresh && (status = evaluate(a, a->now, a->x, a->k)) > WARNING) return status;
    a->fresh = 0;
    if (n) {
        h = a->h > 0 ? a->h : first_step(a);
        if (h >= rest || rest - h < 1e-12 * (1 + fabs(a->now))) h = rest;
    }
    if ((status = attempt(a, h)) > WARNING) return status;
    if (n) {
        double grow = !isfinite(a->error) ? .2 : a->error > 1e-30 ? fmin(5, fmax(.2, .9 / fifth_root(a->error))) : 5;
        if (a->error > 1) {
            a->h = grow * h;
            return a->h < 1e-15 * (1 + fabs(a->now)) ? fail(a, NO_STEP) : OK;
        }
        a->h = h < rest || grow < 1 ? grow * h : fmax(a->h, grow * h);
    }
    if ((status = look(a, &crosses)) > WARNING) return status;
    double length = h;
    if (crosses && (status = locate(a, &length)) > WARNING) return status;
    a->now = length == rest ? until : a->now + length;
    memcpy(a->x, a->y, (size_t)n * sizeof(double));
    memcpy(a->k, a->k + 6 * n, (size_t)n * sizeof(double));
    memcpy(a->z, a->z_next, (size_t)a->crossings * sizeof(double));
    if ((status = put(a, a->now, a->x)) > WARNING || (status = complete(a, &event)) > WARNING) return status;
    return (crosses || event) && !a->ends ? handle_event(a) : OK;
}

/* -- a step -------------------------------------------------------------------------------------------------------- */

/* The step of co-simulation to `until`, which may end before. */
static int cosimulate(Adapter *a, double until, int *idle) {
    bool event = false, ends = false, early = false;
    double reached = until, before = a->now;
    int status = ((Step *)a->step)(a->fmu, a->now, until - a->now, true, &event, &ends, &early, &reached);
    if (status > WARNING || ends) {
        a->now = reached, a->ends |= ends;
        return status;
    }
    a->now = early ? reached : until;
    *idle = a->now > before || event ? 0 : *idle + 1;
    if (*idle == MOST_UPDATES) return fail(a, NO_STEP);
    return event ? handle_event(a) : status;
}

/* Let the inputs that jump at the row reached do so, as an event that is not noted. */
static int pass_jump(Adapter *a, int64_t row) {
    if (row + 1 >= a->rows_count || a->rows_time[row] != a->rows_time[row + 1]) return OK;
    a->from = a->now;
    int status = enter_event(a);
    if (status > WARNING || (status = follow(a, a->now)) > WARNING) return status;
    return conclude(a);
}

/* Step from t by h, with the arguments of fmi3DoStep. */
EXPORT int
step(Adapter *a, double t, double h, bool unused, bool *event, bool *ends, bool *early, double *reached) {
    (void)unused;
    double end = t + h;
    int64_t most = a->events + MOST_EVENTS;
    int idle = 0, status = conclude(a);
    *event = *early = *ends = false, *reached = end;
    if (!same(a->now, t)) a->now = t, a->fresh = 1;
    if (a->solver) a->fresh = 1;
    a->from = a->now;
    if (a->activate) {
        status = a->starts_late ? OK : run_partition(a, t);
        a->starts_late = 0, a->now = end;
        return status;
    }
    if (a->starts_late) a->starts_late = 0;
    else if (a->clocks && !a->ends && status <= WARNING) status = sample(a);
    for (int64_t i = 0; status <= WARNING; i++) {
        if ((status = handle_time_events(a, most)) > WARNING || a->ends || a->now >= end) break;
        double until = same(a->next, end) ? fmax(a->next, end) : fmin(a->next, end);
        int64_t row = rows_before(a, rint((a->now - a->start) * 1e9) / 1e9, true);
        bool cuts = row < a->rows_count && !is_due(until, a->start + a->rows_time[row]);
        if (cuts) until = a->start + a->rows_time[row];
        if (i == MOST_STEPS) status = fail(a, ENDLESS_STEPS);
        else if (a->events >= most) status = fail(a, ENDLESS_EVENTS);
        else if (a->step) status = cosimulate(a, until, &idle);
        else status = a->solver ? solve_elsewhere(a, until) : solve(a, until);
        if (cuts && status <= WARNING && !a->ends && a->now == until) status = pass_jump(a, row);
    }
    if (a->ends || status > WARNING) *ends = a->ends && status <= WARNING, *reached = a->now;
    return status;
}

/* -- the functions for values --------------------------------------------------------------------------------------- */

#define OF_FMI3(type, c) \
    EXPORT int fmi3Get##type(Adapter *a, const uint32_t *r, size_t n, c *v, size_t m) { return get(a, type, r, n, v, m); } \
    EXPORT int fmi3Set##type(Adapter *a, const uint32_t *r, size_t n, c *v, size_t m) { return set(a, type, r, n, v, m); }
#define OF_FMI2(name, type, c) \
    EXPORT int fmi2Get##name(Adapter *a, const uint32_t *r, size_t n, c *v) { return get(a, type, r, n, v, n); } \
    EXPORT int fmi2Set##name(Adapter *a, const uint32_t *r, size_t n, c *v) { return set(a, type, r, n, v, n); }

OF_FMI3(Float64, double)
OF_FMI3(Float32, float)
OF_FMI3(Int8, int8_t)
OF_FMI3(UInt8, uint8_t)
OF_FMI3(Int16, int16_t)
OF_FMI3(UInt16, uint16_t)
OF_FMI3(Int32, int32_t)
OF_FMI3(UInt32, uint32_t)
OF_FMI3(Int64, int64_t)
OF_FMI3(UInt64, uint64_t)
OF_FMI3(Boolean, bool)
OF_FMI2(Real, Float64, double)
OF_FMI2(Integer, Int32, int32_t)
OF_FMI2(Boolean, Boolean2, int)

/* -- a run --------------------------------------------------------------------------------------------------------- */

/* Initialisation has ended at `now`, which leaves the FMU in event mode. */
EXPORT int begin(Adapter *a) {
    a->running = 1, a->in_event = !a->activate;
    if (a->nominals) {
        int status = ((GetNumbers *)a->nominals)(a->fmu, a->nominal, (size_t)a->states);
        if (status > WARNING) return status;
    }
    return conclude(a);
}

/* Leave event mode before the state is saved. */
EXPORT int settle(Adapter *a) { return conclude(a); }

/* The state of the FMU has been restored: one outside of event mode. */
EXPORT int restored(Adapter *a) {
    a->running = 1, a->in_event = 0, a->noted_count = 0;
    int status = a->nominals ? ((GetNumbers *)a->nominals)(a->fmu, a->nominal, (size_t)a->states) : OK;
    return status > WARNING || a->step ? status : read_states(a);
}

/* Values that wait for a sample, when a state is restored, and what one of them takes. */
EXPORT void empty(Adapter *a) { forget(a); }
EXPORT int keep_values(Adapter *a, int type, const void *references, size_t n, const void *values, size_t count) {
    return keep(a, type, references, n, values, count);
}
EXPORT int set_followed(Adapter *a, double t) { return follow(a, t); }
EXPORT size_t size_of(int type) { return bytes[type]; }

EXPORT void release(Adapter *a) {
    forget(a);
    free(a->noted), free(a->buffer), free(a->waiting);
    a->noted = NULL, a->buffer = NULL, a->waiting = NULL;
    a->noted_count = a->noted_room = a->waiting_room = 0, a->buffer_size = 0;
}
