/* The loop of one run of FMUs, which are called by their function pointers, with its rows and events. Python owns all
   memory, begins and ends a run, and reports failures. The processing of an instant is in instants.h. */

#define QUADCOSIM_LANES 1
#include "lanes.h"

#include <fenv.h>
#include <math.h>
#include <string.h>

#include "condition.h"
#include "structures.h"

#define q_round rint

#include "instants.h"

#define WARNING 1 /* the worst status of a successful call */

EXPORT const Size sizes[] = {SIZES, SIZE_OF(Operation), {0}};

typedef int Access(void *, const uint32_t *, size_t, void *);
typedef int CountedAccess(void *, const uint32_t *, size_t, void *, size_t);
typedef int Step2(void *, double, double, int);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

/* -- the rounding mode --------------------------------------------------------------------------------------------- */

/* The observable mode of this thread's arithmetic: how numbers are rounded, and whether subnormal numbers are treated
   as zero. */
static int mode(void) {
    static const volatile double one = 1.0, little = 0x1p-60, smallest = 0x1p-1022, half = 0.5, tiny = 0x1p-1074;
    return (one + little != one) | (one - little != one) << 1 | (-one - little != -one) << 2 |
           (smallest * half == 0.0) << 3 | (tiny * one == 0.0) << 4;
}

/* After each call of an FMU: restore the mode if a foreign one has changed it. */
static void called(Loop *l, int64_t index) {
    Component *c = &l->components[index];
    l->calling = -1;
    if (!c->foreign || mode() == l->mode) return;
    fesetenv(l->environment);
    c->moved = 1;
}

/* -- values -------------------------------------------------------------------------------------------------------- */

static double from(const Part *part, int64_t i) {
    const void *b = part->buffer;
    switch (part->type) {
    case FLOAT32: return ((const float *)b)[i];
    case INT8: return ((const int8_t *)b)[i];
    case UINT8: return ((const uint8_t *)b)[i];
    case INT16: return ((const int16_t *)b)[i];
    case UINT16: return ((const uint16_t *)b)[i];
    case INT32: return ((const int32_t *)b)[i];
    case BOOLEAN32: return ((const int32_t *)b)[i] != 0;
    case UINT32: return ((const uint32_t *)b)[i];
    case INT64: return (double)((const int64_t *)b)[i];
    case UINT64: return (double)((const uint64_t *)b)[i];
    case BOOL: return ((const bool *)b)[i];
    default: return ((const double *)b)[i];
    }
}

static void into(const Part *part, int64_t i, double x) {
    void *b = part->buffer;
    switch (part->type) {
    case FLOAT32: ((float *)b)[i] = (float)x; break;
    case INT8: ((int8_t *)b)[i] = (int8_t)x; break;
    case UINT8: ((uint8_t *)b)[i] = (uint8_t)x; break;
    case INT16: ((int16_t *)b)[i] = (int16_t)x; break;
    case UINT16: ((uint16_t *)b)[i] = (uint16_t)x; break;
    case INT32: ((int32_t *)b)[i] = (int32_t)x; break;
    case UINT32: ((uint32_t *)b)[i] = (uint32_t)x; break;
    case INT64: ((int64_t *)b)[i] = (int64_t)x; break;
    case UINT64: ((uint64_t *)b)[i] = (uint64_t)x; break;
    case BOOL: ((bool *)b)[i] = x != 0.0; break;
    case BOOLEAN32: ((int32_t *)b)[i] = x != 0.0; break;
    default: ((double *)b)[i] = x;
    }
}

static int whole(const Part *part) { return part->type >= INT8 && part->type <= UINT64; }

/* Whether `x` is the value of a part, not one that is rounded. */
static int is_exact(const Part *part, int64_t i, double x) {
    if (part->type == INT64) return x <= part->high && (int64_t)x == ((const int64_t *)part->buffer)[i];
    if (part->type == UINT64) return x <= part->high && (uint64_t)x == ((const uint64_t *)part->buffer)[i];
    return 1;
}

/* Whether the type of a part holds a number. */
static int holds(const Part *part, double x) {
    if (whole(part)) x = rint(x);
    return !(whole(part) || part->type == FLOAT32) || (x >= part->low && x <= part->high);
}

static int call(Loop *l, const Part *part) {
    l->calling = part->component;
    int status = part->counts_values
        ? ((CountedAccess *)part->function)(part->fmu, part->references, part->count, part->buffer, part->values)
        : ((Access *)part->function)(part->fmu, part->references, part->count, part->buffer);
    called(l, part->component);
    if (status <= WARNING) return 0;
    l->failed = part, l->component = part->component, l->failed_status = status;
    return FAILED;
}

static int refuse(Loop *l, const Part *part) {
    l->failed = part, l->component = part->component;
    return REFUSED;
}

static int read_all(Loop *l, const Transfer *transfer) {
    for (int64_t i = 0; i < transfer->count; i++) {
        const Part *part = &transfer->parts[i];
        int code = call(l, part);
        if (code) return code;
        for (int64_t j = 0; part->asked && j < part->size; j++) {
            double x = transfer->array[part->asked[j]] = from(part, part->places[j]);
            if (!is_exact(part, part->places[j], x)) return refuse(l, part);
        }
    }
    return 0;
}

static int write_all(Loop *l, const Transfer *transfer) {
    for (int64_t i = 0; i < transfer->count; i++) {
        const Part *part = &transfer->parts[i];
        if (part->asked) {
            for (int64_t j = 0; j < part->size; j++)
                if (!holds(part, transfer->array[part->asked[j]])) return refuse(l, part);
            for (int64_t j = 0; j < part->size; j++) {
                double x = transfer->array[part->asked[j]];
                into(part, part->places[j], whole(part) ? rint(x) : x);
            }
        }
        int code = call(l, part);
        if (code) return code;
    }
    return 0;
}

/* -- the functions that an instant calls --------------------------------------------------------------------------- */

static void end_if(Loop *l, int64_t outcome, const Instant *now) {
    if (outcome) end_some(l, 1, outcome, l->component, now);
}

static void set(Loop *l, Channel *c, Lanes lanes, const double *value, const Instant *now) {
    memcpy(c->write.array, value, (size_t)c->size * sizeof(double));
    end_if(l, write_all(l, &c->write), now);
}

static int make_room(Channel *c, int lane) { return 0; } /* the buffer holds all messages of a schedule */

static void step(Loop *l, int64_t index, Lanes lanes, q_real begin, q_real length, int64_t until, const Instant *now) {
    Component *c = &l->components[index];
    int status, is_done;
    begin += c->start_time;
    l->component = l->calling = index, l->end = begin + length;
    if (c->version == 3) {
        status = ((Step3 *)c->step)(c->fmu, begin, length, true, c->event, c->ends, c->early, c->reached);
        is_done = status <= WARNING && !*c->event && !*c->ends && !*c->early;
    } else {
        status = ((Step2 *)c->step)(c->fmu, begin, length, 1);
        is_done = status <= WARNING;
    }
    called(l, index);
    if (!is_done) {
        if (l->stopped(status, until)) {
            end_some(l, lanes, STOPPED, index, now);
            return;
        }
        l->is_over = 1;
    }
    if (*c->messages_waiting) l->collect(index);
}

static void read_outputs(Loop *l, int64_t index, Lanes lanes, const Instant *now) {
    const Component *c = &l->components[index];
    end_if(l, read_all(l, &c->read), now);
    for (int64_t i = 0; i < c->connected; i++)
        if (!isfinite(c->outputs[i])) end_some(l, lanes, NOT_FINITE, index, now);
}

static void feed(Loop *l, const Component *c, Lanes lanes, const Instant *now) {
    for (int64_t i = 0; i < c->feeds.count && l->alive; i++) {
        const Feed *feed = &l->feeds[c->feeds.items[i]];
        memcpy(feed->write.array, feed->values + l->tracks->at * feed->size, (size_t)feed->size * sizeof(double));
        end_if(l, write_all(l, &feed->write), now);
    }
}

static void look(Loop *l, Lanes lanes, const Instant *now) {
    const double *sources = l->watched + l->tracks->at * l->watched_size;
    if (l->condition && !may_hold(l->condition, l->condition_length, now->t, l->row, sources)) return;
    if (l->look(now->t)) end_some(l, lanes, DIVERGED, 0, now);
}

static void note(Loop *l, int kind, const Messages *m, const Instant *now) {
    const Message *x = m->message;
    if (kind == MEASURED || x->sent > l->tracks->stop) return; /* noted when the sample reads it */
    int64_t *event = kind == ARRIVED ? l->arrived + 4 * l->arrived_count++ : l->events + 4 * l->event_count++;
    event[0] = kind == ARRIVED ? now->time[0] : x->sent, event[1] = kind, event[2] = x->connection, event[3] = x->k;
}

/* -- a run --------------------------------------------------------------------------------------------------------- */

static void record(Loop *l, const Instant *now) {
    memcpy(l->events + 4 * l->event_count, l->arrived, (size_t)l->arrived_count * 4 * sizeof(int64_t));
    l->event_count += l->arrived_count;
    l->row[0] = now->t;
    double *row = l->rows + l->row_count++ * l->stride;
    memcpy(row, l->row, (size_t)l->width * sizeof(double));
    if (l->in_rows)
        memcpy(row + l->width, l->watched + l->tracks->at * l->watched_size, (size_t)l->in_rows * sizeof(double));
}

/* Process the instants of the schedule up to the count of the track; the result states why it ended. */
EXPORT int run(Loop *l) {
    Track *track = l->tracks;
    Instant now = {.lanes = 0};
    fenv_t environment;
    fegetenv(&environment);
    l->environment = &environment, l->mode = mode(), l->calling = -1;
    while (track->at < track->count) {
        reach(l, &now, 1);
        int64_t time = l->now = now.time[0];
        l->arrived_count = 0;
        pass(l, &now);
        if (!l->alive) return (int)l->outcome[0];
        record(l, &now);
        track->at++;
        if (l->is_over) return OVER;
        if (time >= l->pause_at && time < track->stop) return PAUSED;
        if (l->row_count >= l->row_limit || l->event_count >= l->event_limit) return FULL;
    }
    return AT_END;
}
