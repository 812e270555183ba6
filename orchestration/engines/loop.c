/* The master's loop over instants, as orchestration/engines/instants.py has it, to the bit: it steps FMUs through the
   arrays of a schedule and records rows and events. All memory is Python's, which also begins and ends a run, and says
   what has failed in its own words. Structures are those of structures.h. */

#include <fenv.h>
#include <math.h>
#include <string.h>

#define QUADCOSIM_LANES 1
#include "structures.h"

#include "condition.h"

#define NANOSECONDS 1e9
#define WARNING 1 /* the worst status of a call that was done */

enum { SAMPLED, SENT, ARRIVED, LOST };

typedef int Access(void *, const uint32_t *, size_t, void *);
typedef int CountedAccess(void *, const uint32_t *, size_t, void *, size_t);
typedef int Step2(void *, double, double, int);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

EXPORT const Size sizes[] = {SIZES, SIZE_OF(Operation), {0}};

/* -- what FMUs have in common --------------------------------------------------------------------------------------- */

/* How this thread computes, as far as it can be seen in its results: to which side numbers are rounded, and whether
   the smallest ones are taken for zero. */
static int mode(void) {
    static const volatile double one = 1.0, little = 0x1p-60, smallest = 0x1p-1022, half = 0.5, tiny = 0x1p-1074;
    return (one + little != one) | (one - little != one) << 1 | (-one - little != -one) << 2 |
           (smallest * half == 0.0) << 3 | (tiny * one == 0.0) << 4;
}

/* After each call of a foreign FMU: the others compute as they did. */
static void called(Loop *loop, int64_t index) {
    Component *c = &loop->components[index];
    loop->calling = -1;
    if (!c->foreign || mode() == loop->mode) return;
    fesetenv(loop->environment);
    c->moved = 1;
}

/* -- values ------------------------------------------------------------------------------------------------------- */

static double from(const Part *part, int64_t i) {
    const void *b = part->buffer;
    switch (part->type) {
    case FLOAT32: return ((const float *)b)[i];
    case INT8: return ((const int8_t *)b)[i];
    case UINT8: return ((const uint8_t *)b)[i];
    case INT16: return ((const int16_t *)b)[i];
    case UINT16: return ((const uint16_t *)b)[i];
    case INT32:
    case BOOLEAN32: return ((const int32_t *)b)[i];
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

static int call(Loop *loop, const Part *part) {
    loop->calling = part->component;
    int status = part->counts_values
        ? ((CountedAccess *)part->function)(part->fmu, part->references, part->count, part->buffer, part->values)
        : ((Access *)part->function)(part->fmu, part->references, part->count, part->buffer);
    called(loop, part->component);
    if (status <= WARNING) return 0;
    loop->failed = part, loop->component = part->component;
    return FAILED;
}

static int read_all(Loop *loop, const Transfer *transfer) {
    for (int64_t i = 0; i < transfer->count; i++) {
        const Part *part = &transfer->parts[i];
        int code = call(loop, part);
        if (code) return code;
        if (part->asked)
            for (int64_t j = 0; j < part->size; j++) transfer->array[part->asked[j]] = from(part, part->places[j]);
    }
    return 0;
}

static int write_all(Loop *loop, const Transfer *transfer) {
    for (int64_t i = 0; i < transfer->count; i++) {
        const Part *part = &transfer->parts[i];
        if (part->asked) {
            for (int64_t j = 0; j < part->size; j++) {
                double x = transfer->array[part->asked[j]];
                if (whole(part) && !(rint(x) >= part->low && rint(x) <= part->high)) {
                    loop->failed = part, loop->component = part->component;
                    return REFUSED;
                }
            }
            for (int64_t j = 0; j < part->size; j++) {
                double x = transfer->array[part->asked[j]];
                into(part, part->places[j], whole(part) ? rint(x) : x);
            }
        }
        int code = call(loop, part);
        if (code) return code;
    }
    return 0;
}

/* -- connections -------------------------------------------------------------------------------------------------- */

static void convert(const Channel *channel, double *value) {
    if (!channel->converts) return;
    for (int64_t i = 0; i < channel->size; i++) {
        value[i] *= *channel->scale;
        value[i] += *channel->offset;
    }
}

static void skip(Channel *channel) {
    if (channel->noisy) channel->noise[0] += channel->size;
}

static void take(Channel *channel, double *value) {
    for (int64_t i = 0; i < channel->size; i++) value[i] = channel->sender[channel->places[i]];
    if (channel->noisy)
        for (int64_t i = 0; i < channel->size; i++) {
            double noise = channel->noise[0][i] * channel->sigma[i];
            value[i] += noise;
        }
    skip(channel);
    if (channel->rounds)
        for (int64_t i = 0; i < channel->size; i++)
            if (channel->quantum[i] != 0.0) value[i] = rint(value[i] / channel->quantum[i]) * channel->quantum[i];
    convert(channel, value);
}

static int pass_on(Loop *loop, Channel *channel) {
    double *received = channel->write.array;
    for (int64_t i = 0; i < channel->size; i++) received[i] = channel->sender[channel->places[i]];
    convert(channel, received);
    return write_all(loop, &channel->write);
}

static int apply(Loop *loop, Channel *channel, const double *value, int64_t time) {
    int64_t n = channel->size;
    size_t bytes = (size_t)n * sizeof(double);
    if (channel->extrapolates) { /* of those before this time the last one stays */
        int64_t count = channel->applied_count[0];
        while (count > 0 && channel->applied_time[count - 1] >= time) count--;
        if (count > 1) {
            memmove(channel->applied, channel->applied + n, bytes);
            channel->applied_time[0] = channel->applied_time[1];
            count = 1;
        }
        memcpy(channel->applied + count * n, value, bytes);
        channel->applied_time[count] = time;
        channel->applied_count[0] = count + 1;
    }
    memcpy(channel->write.array, value, bytes);
    return write_all(loop, &channel->write);
}

static int extrapolate(Loop *loop, Channel *channel, int64_t time) {
    if (channel->applied_count[0] < 2) return 0;
    int64_t t0 = channel->applied_time[0], t1 = channel->applied_time[1], n = channel->size;
    if (t0 == t1 || time == t1) return 0;
    double share = (double)(time - t1) / (double)(t1 - t0);
    const double *before = channel->applied, *last = channel->applied + n;
    for (int64_t i = 0; i < n; i++) {
        double more = share * (last[i] - before[i]);
        channel->write.array[i] = last[i] + more;
    }
    return write_all(loop, &channel->write);
}

static int hand_over(Loop *loop, Channel *channel, int64_t time, int lost) {
    if (lost) {
        skip(channel);
        return 0;
    }
    take(channel, channel->value);
    return apply(loop, channel, channel->value, time);
}

static void dispatch(Channel *channel, int lost) {
    if (lost)
        skip(channel);
    else
        take(channel, channel->flight + channel->size * channel->last[0]++);
}

static int deliver(Loop *loop, Channel *channel, int64_t time) {
    return apply(loop, channel, channel->flight + channel->size * channel->first[0]++, time);
}

static int extrapolate_each(Loop *loop, const List *held, int64_t time) {
    int code = 0;
    for (int64_t i = 0; i < held->count && !code; i++) code = extrapolate(loop, &loop->channels[held->items[i]], time);
    return code;
}

static int pass_on_each(Loop *loop, const List *wires) {
    int code = 0;
    for (int64_t i = 0; i < wires->count && !code; i++) code = pass_on(loop, &loop->channels[wires->items[i]]);
    return code;
}

static int feed_each(Loop *loop, const List *feeds) {
    int code = 0;
    for (int64_t i = 0; i < feeds->count && !code; i++) {
        const Feed *feed = &loop->feeds[feeds->items[i]];
        memcpy(feed->write.array, feed->values + loop->at * feed->size, (size_t)feed->size * sizeof(double));
        code = write_all(loop, &feed->write);
    }
    return code;
}

/* -- events ------------------------------------------------------------------------------------------------------- */

static int64_t *noted(int64_t *event, int64_t time, int64_t kind, const Message *message) {
    event[0] = time, event[1] = kind, event[2] = message->connection, event[3] = message->k;
    return event;
}

static void note(Loop *loop, int64_t time, int64_t kind, const Message *message) {
    noted(loop->events + 4 * loop->event_count++, time, kind, message);
}

static void note_arrival(Loop *loop, int64_t time, const Message *message) {
    noted(loop->arrived + 4 * loop->arrived_count++, time, ARRIVED, message);
}

static void note_sending(Loop *loop, const Message *message) {
    if (message->sent > loop->stop) return;
    note(loop, message->sent, SENT, message);
    if (message->arrival < 0) note(loop, message->sent, LOST, message);
}

/* -- components --------------------------------------------------------------------------------------------------- */

static int step(Loop *loop, int64_t index, double t, double h, int64_t until) {
    Component *c = &loop->components[index];
    int status, is_done;
    loop->component = index, loop->end = t + h;
    loop->calling = index;
    if (c->version == 3) {
        status = ((Step3 *)c->step)(c->fmu, t, h, true, c->event, c->ends, c->early, c->reached);
        is_done = status <= WARNING && !*c->event && !*c->ends && !*c->early;
    } else {
        status = ((Step2 *)c->step)(c->fmu, t, h, 1);
        is_done = status <= WARNING;
    }
    called(loop, index);
    if (!is_done) {
        if (loop->stopped(status, until)) return STOPPED;
        loop->is_over = 1;
    }
    if (*c->heard) loop->collect(index);
    return 0;
}

static int read_outputs(Loop *loop, int64_t index) {
    Component *c = &loop->components[index];
    int code = read_all(loop, &c->read);
    if (code) return code;
    for (int64_t i = 0; i < c->connected; i++)
        if (!isfinite(c->outputs[i])) {
            loop->component = index;
            return NOT_FINITE;
        }
    return 0;
}

static int step_bodies(Loop *loop, int64_t time) {
    const Schedule *s = &loop->schedule;
    int moved = 0, code;
    for (int64_t i = s->halts_at[loop->at]; i < s->halts_at[loop->at + 1]; i++) {
        int64_t index = s->halts[i];
        Component *body = &loop->components[index];
        int64_t start = body->now;
        if (time == start) continue;
        if ((code = pass_on_each(loop, &body->ahead))) return code;
        body->now = time;
        double begin = (double)start / NANOSECONDS, length = (double)(time - start) / NANOSECONDS;
        if ((code = step(loop, index, begin, length, time))) return code;
        loop->steps++;
        if ((code = read_outputs(loop, index))) return code;
        moved = 1;
    }
    if (!moved) return 0;
    double t = (double)time / NANOSECONDS;
    const double *sources = loop->watched + loop->at * loop->watched_size;
    if (loop->condition && !may_hold(loop->condition, loop->condition_length, t, loop->row, sources)) return 0;
    return loop->look(t) ? DIVERGED : 0;
}

static int step_task(Loop *loop, int64_t index, int64_t time, int64_t end) {
    Component *task = &loop->components[index];
    int64_t until = end < loop->stop ? end : loop->stop;
    double start = (double)time / NANOSECONDS, length = (double)(until - time) / NANOSECONDS;
    int code = step(loop, index, *task->ratio * start, *task->ratio * length, until);
    return code ? code : read_outputs(loop, index);
}

static int sense(Loop *loop, const Due *due, int64_t time) {
    for (int64_t i = due->received; i < due->sent; i++) {
        const Message *m = &loop->schedule.exchanged[i];
        Channel *channel = &loop->channels[m->connection];
        int lost = m->arrival < 0, code = 0;
        note(loop, m->sent, SAMPLED, m);
        if (lost) note(loop, m->sent, LOST, m);
        if (!channel->read_ahead)
            code = hand_over(loop, channel, time, lost);
        else if (!lost)
            code = deliver(loop, channel, time);
        if (code) return code;
    }
    return 0;
}

static int send(Loop *loop, const Due *due, int64_t time) {
    for (int64_t i = due->sent; i < due->end; i++) {
        const Message *m = &loop->schedule.exchanged[i];
        Channel *channel = &loop->channels[m->connection];
        note_sending(loop, m);
        if (m->arrival == time) {
            note_arrival(loop, time, m);
            int code = hand_over(loop, channel, time, 0);
            if (code) return code;
        } else
            dispatch(channel, m->arrival < 0);
    }
    return 0;
}

static int sample(Loop *loop, const Due *due, int64_t time) {
    const Component *task = &loop->components[due->component];
    int64_t end = task->by_itself ? loop->schedule.times[loop->at + 1] : due->next_time;
    int code = sense(loop, due, time);
    if (!code) code = extrapolate_each(loop, &task->held, time);
    if (!code) code = feed_each(loop, &task->feeds);
    if (!code) code = step_task(loop, due->component, time, end);
    return code ? code : send(loop, due, time);
}

static int sample_each(Loop *loop, int64_t time) {
    const Schedule *s = &loop->schedule;
    const Due *due = s->dues + s->dues_at[loop->at], *end = s->dues + s->dues_at[loop->at + 1];
    int code = 0;
    if (!loop->some_by_themselves) {
        for (; due < end && !code; due++) code = sample(loop, due, time);
        return code;
    }
    for (int64_t i = 0; i < loop->tasks.count && !code; i++) {
        int64_t index = loop->tasks.items[i];
        if (due < end && due->component == index)
            code = sample(loop, due++, time);
        else if (loop->components[index].by_itself && time < loop->stop) {
            code = extrapolate_each(loop, &loop->components[index].held, time);
            if (!code) code = step_task(loop, index, time, s->times[loop->at + 1]);
        }
    }
    return code;
}

static int settle(Loop *loop, int64_t time) {
    const Schedule *s = &loop->schedule;
    int code = 0;
    for (int64_t i = s->halts_at[loop->at]; i < s->halts_at[loop->at + 1] && !code; i++) {
        const Component *body = &loop->components[s->halts[i]];
        code = extrapolate_each(loop, &body->held, time);
        if (!code) code = pass_on_each(loop, &body->behind);
        if (!code) code = feed_each(loop, &body->feeds);
    }
    return code;
}

/* -- an instant --------------------------------------------------------------------------------------------------- */

static int pass(Loop *loop, int64_t time) {
    const Schedule *s = &loop->schedule;
    int64_t at = loop->at;
    int code;
    if ((code = step_bodies(loop, time))) return code;
    for (int64_t i = s->arrivals_at[at]; i < s->arrivals_at[at + 1]; i++) {
        note_arrival(loop, time, &s->arrivals[i]);
        if ((code = deliver(loop, &loop->channels[s->arrivals[i].connection], time))) return code;
    }
    for (int64_t i = s->posted_at[at]; i < s->posted_at[at + 1]; i++) {
        const Message *m = &s->posted[i];
        Channel *channel = &loop->channels[m->connection];
        note_sending(loop, m);
        dispatch(channel, m->arrival < 0);
        if (m->arrival != time) continue;
        note_arrival(loop, time, m);
        if ((code = deliver(loop, channel, time))) return code;
    }
    for (int64_t i = s->measured_at[at]; i < s->measured_at[at + 1]; i++)
        dispatch(&loop->channels[s->measured[i].connection], s->measured[i].arrival < 0);
    if ((code = sample_each(loop, time))) return code;
    return loop->settles ? settle(loop, time) : 0;
}

static void record(Loop *loop, int64_t time) {
    memcpy(loop->events + 4 * loop->event_count, loop->arrived, (size_t)loop->arrived_count * 4 * sizeof(int64_t));
    loop->event_count += loop->arrived_count;
    loop->arrived_count = 0;
    loop->row[0] = (double)time / NANOSECONDS;
    memcpy(loop->rows + loop->row_count++ * loop->stride, loop->row, (size_t)loop->width * sizeof(double));
}

/* Pass through instants of the schedule up to `until`; the code says why it ended. */
EXPORT int fly(Loop *loop, int64_t until) {
    fenv_t environment;
    fegetenv(&environment);
    loop->environment = &environment, loop->mode = mode(), loop->calling = -1;
    while (loop->at < until) {
        int64_t time = loop->now = loop->schedule.times[loop->at];
        loop->arrived_count = 0;
        int code = pass(loop, time);
        if (code) return code;
        record(loop, time);
        loop->at++;
        if (loop->is_over) return OVER;
        if (time >= loop->pause_at && time < loop->stop) return PAUSED;
        if (loop->row_count >= loop->row_limit || loop->event_count >= loop->event_limit) return FULL;
    }
    return AT_END;
}
