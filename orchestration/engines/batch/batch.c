/* Runs of systems of one structure, in lockstep: lane l of every vector is run l. What happens, and in which order, is
   what orchestration/engines/instants.py has, to the bit; what it comes to is summed up row by row by expressions.h, which
   is written for the system. Runs of one timing are a track: they share a schedule and pass through it together. */

#include "lanes.h"
#include "mathematics.h"

#include <stdlib.h>

#include "sizes.h"
#include "structures.h"

#define EVERY (L == 64 ? ~(uint64_t)0 : (((uint64_t)1 << (L & 63)) - 1))
#define NANOSECONDS 1e9

typedef void Step(double *, const uint64_t *, const double *, const double *, int32_t *);

EXPORT const Size sizes[] = {SIZES, {0}};

/* What one instant is to some lanes, gathered from the tracks that pass through one now. */
typedef struct {
    Lanes lanes, marks[CHANNELS], halts[COMPONENTS], waiting[CHANNELS];
    q_real t;
    int64_t time[L];
} Instant;

/* -- lanes ---------------------------------------------------------------------------------------------------------- */

static const q_bits lane_bits = LANE_BITS;

/* As functions of components are told of lanes: all bits of each, or none. */
Q_ONE q_bits bits_of(Lanes lanes) { return (q_bits)((lane_bits & lanes) != 0); }

#if defined(__AVX512DQ__) && L == 8
Q_ONE q_mask mask_of(Lanes lanes) { return (q_mask)lanes; }
Q_ONE Lanes lanes_of(q_mask mask) { return mask; }
#else
Q_ONE q_mask mask_of(Lanes lanes) { return bits_of(lanes); }
Q_ONE Lanes lanes_of(q_mask mask) {
    Lanes lanes = 0;
    for (int lane = 0; lane < L; lane++) lanes |= (mask[lane] & 1) << lane;
    return lanes;
}
#endif

typedef q_real Place __attribute__((may_alias));
#define AT(memory, place) (*(Place *)((memory) + (place) * L))
#define READ(memory, place) (*(const Place *)((memory) + (place) * L))
#define EACH(lane, lanes) \
    for (Lanes left_ = (lanes); left_; left_ &= left_ - 1) \
        for (int lane = __builtin_ctzll(left_), once_ = 1; once_; once_ = 0)

static void end_some(Batch *b, Lanes lanes, int64_t fate, int64_t component, const int64_t *time) {
    EACH(lane, lanes & b->alive) b->fate[lane] = fate, b->fate_component[lane] = component, b->fate_time[lane] = time[lane];
    b->alive &= ~lanes;
}

static int keep(Kept *kept, q_real value) {
    if (kept->count == kept->capacity) {
        int64_t capacity = kept->capacity ? 2 * kept->capacity : 1024;
        double *values = aligned_alloc(64, (size_t)capacity * sizeof(q_real));
        if (!values) return 0;
        if (kept->values) memcpy(values, kept->values, (size_t)kept->count * sizeof(q_real));
        free(kept->values);
        kept->values = values, kept->capacity = capacity;
    }
    AT(kept->values, kept->count++) = value;
    return 1;
}

#define STATE(i) AT(state, i)
#define CONSTANT(i) READ(constants_, i)
#define NUMBER(i) READ(b->numbers, i)
#define SEEN(i) READ(b->seen, i)
#define SIGNAL(component, place) READ(memory##component, place)
#define TRUE(mask) q_select(mask, q_all(1.0), q_all(0.0))
Q_ONE q_real lowest(q_real a, q_real b) { return q_select(q_lt(a, b) | q_isnan(a), a, b); }
Q_ONE q_real highest(q_real a, q_real b) { return q_select(q_gt(a, b) | q_isnan(a), a, b); }

#include "expressions.h"

/* -- connections ---------------------------------------------------------------------------------------------------- */

static int grow(Channel *c) {
    int64_t capacity = c->capacity ? 2 * c->capacity : 4;
    size_t bytes = (size_t)(capacity * c->size) * sizeof(q_real);
    double *flight = aligned_alloc(64, bytes);
    if (!flight) return 0;
    for (int lane = 0; lane < L; lane++)
        for (int64_t k = c->first[lane]; k < c->last[lane]; k++)
            for (int64_t i = 0; i < c->size; i++)
                flight[((k & (capacity - 1)) * c->size + i) * L + lane] =
                    c->flight[((k & (c->capacity - 1)) * c->size + i) * L + lane];
    free(c->flight);
    c->flight = flight, c->capacity = capacity;
    return 1;
}

Q_ONE q_real converted(const Channel *c, q_real x) {
    return c->converts ? x * READ(c->scale, 0) + READ(c->offset, 0) : x;
}

static void skip(Channel *c, Lanes lanes) {
    if (c->noisy) EACH(lane, lanes) c->noise[lane] += c->size;
}

static void take(Channel *c, Lanes lanes) {
    for (int64_t i = 0; i < c->size; i++) {
        q_real x = READ(c->sender, c->places[i]);
        if (c->noisy) {
            q_real noise = q_all(0.0);
            EACH(lane, lanes) noise[lane] = c->noise[lane][i];
            noise = noise * READ(c->sigma, i);
            x = x + noise;
        }
        if (c->rounds) {
            q_real quantum = READ(c->quantum, i);
            x = q_select(q_ne(quantum, 0.0), q_round(x / quantum) * quantum, x);
        }
        AT(c->value, i) = converted(c, x);
    }
    skip(c, lanes);
}

/* Set the receiver's inputs; a value that it cannot be set to is for the FMU itself to refuse. */
static void set(Batch *b, Channel *c, Lanes lanes, const double *value, const int64_t *time) {
    if (lanes == EVERY && c->into.as_they_are) {
        for (int64_t i = 0; i < c->size; i++) AT(c->into.memory, c->into.places[i]) = READ(value, i);
        return;
    }
    q_mask mask = mask_of(lanes), wrong = q_known(0);
    for (int64_t i = 0; i < c->size; i++) {
        q_real x = READ(value, i);
        if (c->into.kinds[i] == TRUTH) x = TRUE(q_ne(x, 0.0));
        if (c->into.kinds[i] == WHOLE) {
            x = q_round(x);
            wrong |= q_not(q_ge(x, c->into.low[i]) & q_le(x, c->into.high[i]));
        } else if (!c->into.plain)
            wrong |= q_not(q_isfinite(x));
        AT(c->into.memory, c->into.places[i]) = q_select(mask, x, READ(c->into.memory, c->into.places[i]));
    }
    wrong &= mask;
    if (q_any(wrong)) end_some(b, lanes_of(wrong), REFUSED, 0, time);
}

static void pass_on(Batch *b, Channel *c, Lanes lanes, const int64_t *time) {
    for (int64_t i = 0; i < c->size; i++) AT(c->value, i) = converted(c, READ(c->sender, c->places[i]));
    set(b, c, lanes, c->value, time);
}

static void apply(Batch *b, Channel *c, Lanes lanes, const double *value, const int64_t *time) {
    if (c->extrapolates)
        EACH(lane, lanes) { /* of those before this time the last one stays */
            int64_t count = c->applied_count[lane], n = c->size;
            while (count > 0 && c->applied_time[(count - 1) * L + lane] >= time[lane]) count--;
            if (count > 1) {
                for (int64_t i = 0; i < n; i++) c->applied[i * L + lane] = c->applied[(n + i) * L + lane];
                c->applied_time[lane] = c->applied_time[L + lane];
                count = 1;
            }
            for (int64_t i = 0; i < n; i++) c->applied[(count * n + i) * L + lane] = value[i * L + lane];
            c->applied_time[count * L + lane] = time[lane];
            c->applied_count[lane] = count + 1;
        }
    set(b, c, lanes, value, time);
}

static void extrapolate(Batch *b, Channel *c, Lanes lanes, const int64_t *time) {
    Lanes on_a_line = 0;
    EACH(lane, lanes) {
        int64_t t0 = c->applied_time[lane], t1 = c->applied_time[L + lane];
        if (c->applied_count[lane] < 2 || t0 == t1 || time[lane] == t1) continue;
        double share = (double)(time[lane] - t1) / (double)(t1 - t0);
        for (int64_t i = 0; i < c->size; i++) {
            double before = c->applied[i * L + lane], last = c->applied[(c->size + i) * L + lane];
            double more = share * (last - before);
            c->value[i * L + lane] = last + more;
        }
        on_a_line |= (Lanes)1 << lane;
    }
    if (on_a_line) set(b, c, on_a_line, c->value, time);
}

static int dispatch(Channel *c, Lanes lanes) {
    int64_t some = __builtin_ctzll(lanes), slot = c->last[some];
    int together = lanes == EVERY;
    take(c, lanes);
    EACH(lane, lanes) {
        if (c->last[lane] - c->first[lane] == c->capacity && !grow(c)) return 0;
        together &= c->last[lane]++ == slot;
    }
    for (int64_t i = 0; i < c->size; i++) {
        if (together)
            AT(c->flight, (slot & (c->capacity - 1)) * c->size + i) = READ(c->value, i);
        else
            EACH(lane, lanes)
                c->flight[(((c->last[lane] - 1) & (c->capacity - 1)) * c->size + i) * L + lane] = c->value[i * L + lane];
    }
    return 1;
}

static void deliver(Batch *b, Channel *c, Lanes lanes, const int64_t *time) {
    if (!lanes) return;
    int64_t slot = c->first[__builtin_ctzll(lanes)];
    int together = lanes == EVERY;
    EACH(lane, lanes) together &= c->first[lane]++ == slot;
    if (together) {
        apply(b, c, lanes, c->flight + (slot & (c->capacity - 1)) * c->size * L, time);
        return;
    }
    EACH(lane, lanes)
        for (int64_t i = 0; i < c->size; i++)
            c->value[i * L + lane] = c->flight[(((c->first[lane] - 1) & (c->capacity - 1)) * c->size + i) * L + lane];
    apply(b, c, lanes, c->value, time);
}

/* -- components ----------------------------------------------------------------------------------------------------- */

static void expect_finite(Batch *b, int64_t index, Lanes lanes, const int64_t *time) {
    const Component *c = &b->components[index];
    const double *memory = c->memory;
    const int64_t *outputs = c->places, count = c->connected;
    q_real none = q_all(0.0), other = q_all(0.0), third = q_all(0.0);
    int64_t i = 0;
    for (; i + 2 < count; i += 3) { /* three sums at once take a third of the time */
        q_real x = READ(memory, outputs[i]), y = READ(memory, outputs[i + 1]), z = READ(memory, outputs[i + 2]);
        none = none + (x - x), other = other + (y - y), third = third + (z - z);
    }
    for (; i < count; i++) {
        q_real x = READ(memory, outputs[i]);
        none = none + (x - x);
    }
    q_mask wrong = q_isnan(none + (other + third)) & mask_of(lanes);
    if (q_any(wrong)) end_some(b, lanes_of(wrong), NOT_FINITE, index, time);
}

static void advance(Batch *b, int64_t index, Lanes lanes, q_real start, q_real length, const int64_t *time) {
    const Component *c = &b->components[index];
    q_bits active = bits_of(lanes);
    int32_t any = 0;
    ((Step *)c->step)(c->memory, (const uint64_t *)&active, (const double *)&start, (const double *)&length, b->status);
    for (int lane = 0; lane < L; lane++) any |= b->status[lane];
    if (any) {
        Lanes failed = 0;
        EACH(lane, lanes) failed |= (Lanes)(b->status[lane] != 0) << lane;
        end_some(b, failed, FAILED, index, time);
        memset(b->status, 0, L * sizeof *b->status);
    }
    expect_finite(b, index, lanes & b->alive, time);
}

static void feed(Batch *b, const Component *c, Lanes lanes) {
    if (!c->fed_count) return;
    q_mask mask = mask_of(lanes);
    for (int64_t i = 0; i < c->fed_count; i++)
        AT(c->memory, c->fed[i].place) = q_select(mask, READ(b->given, c->fed[i].source), READ(c->memory, c->fed[i].place));
}

static void extrapolate_each(Batch *b, const List *held, Lanes lanes, const int64_t *time) {
    for (int64_t i = 0; i < held->count; i++) extrapolate(b, &b->channels[held->items[i]], lanes & b->alive, time);
}

static void pass_on_each(Batch *b, const List *wires, Lanes lanes, const int64_t *time) {
    for (int64_t i = 0; i < wires->count; i++) pass_on(b, &b->channels[wires->items[i]], lanes & b->alive, time);
}

/* -- an instant ------------------------------------------------------------------------------------------------------ */

#define TRACKS(track, moving) \
    for (Lanes tracks_ = (moving); tracks_; tracks_ &= tracks_ - 1) \
        for (Track *track = &b->tracks[__builtin_ctzll(tracks_)], *end_ = track + 1; track < end_; track++)

static int64_t time_of(const Track *track) { return track->schedule.times[track->at]; }

/* Times, sources and who halts, of all tracks that move. */
static void gather(Batch *b, Instant *now, Lanes moving) {
    now->lanes = 0;
    memset(now->marks, 0, sizeof now->marks);
    memset(now->halts, 0, sizeof now->halts);
    memset(now->waiting, 0, sizeof now->waiting);
    TRACKS(track, moving) {
        const Schedule *s = &track->schedule;
        int64_t time = time_of(track), at = track->at;
        Lanes lanes = track->lanes & b->alive;
        now->lanes |= lanes;
        now->t = q_select(mask_of(lanes), q_all((double)time / NANOSECONDS), now->t);
        if (lanes == EVERY)
            for (int lane = 0; lane < L; lane++) now->time[lane] = time;
        else
            EACH(lane, lanes) now->time[lane] = time;
        for (int64_t i = s->halts_at[at]; i < s->halts_at[at + 1]; i++) now->halts[s->halts[i]] |= lanes;
        if (track->one_for_all) {
            int lane = __builtin_ctzll(track->lanes);
            q_mask mask = mask_of(lanes);
            const double *seen = track->seen[lane] + at * b->seen_count;
            const double *given = track->given[lane] + at * b->given_count;
            for (int64_t i = 0; i < b->seen_count; i++)
                AT(b->seen, i) = q_select(mask, q_all(seen[i]), READ(b->seen, i));
            for (int64_t i = 0; i < b->given_count; i++)
                AT(b->given, i) = q_select(mask, q_all(given[i]), READ(b->given, i));
        } else
            EACH(lane, lanes) {
                for (int64_t i = 0; i < b->seen_count; i++)
                    b->seen[i * L + lane] = track->seen[lane][at * b->seen_count + i];
                for (int64_t i = 0; i < b->given_count; i++)
                    b->given[i * L + lane] = track->given[lane][at * b->given_count + i];
            }
    }
}

static void step_bodies(Batch *b, const Instant *now, Lanes moving) {
    Lanes moved = 0;
    for (int64_t j = 0; j < b->bodies.count; j++) {
        int64_t index = b->bodies.items[j];
        const Component *body = &b->components[index];
        q_real start = q_all(0.0), length = q_all(0.0);
        Lanes lanes = 0;
        TRACKS(track, moving) {
            Lanes some = now->halts[index] & track->lanes & b->alive;
            int64_t time = time_of(track), before = track->now[index];
            if (!some || time == before) continue;
            q_mask mask = mask_of(some);
            start = q_select(mask, q_all((double)before / NANOSECONDS), start);
            length = q_select(mask, q_all((double)(time - before) / NANOSECONDS), length);
            track->now[index] = time;
            lanes |= some;
        }
        if (!lanes) continue;
        pass_on_each(b, &body->ahead, lanes, now->time);
        lanes &= b->alive;
        advance(b, index, lanes, start, length, now->time);
        q_bits steps;
        memcpy(&steps, b->steps, sizeof steps);
        steps -= bits_of(lanes); /* all bits are -1 */
        memcpy(b->steps, &steps, sizeof steps);
        moved |= lanes;
    }
    moved &= b->alive;
    if (!HAS_CONDITION || !moved) return;
    q_mask over = holds(b, now->t) & mask_of(moved);
    if (q_any(over)) end_some(b, lanes_of(over), DIVERGED, 0, now->time);
}

/* Of a connection some lanes have a message, which may be lost; one that has had one before in this round goes first. */
static int post(Batch *b, Instant *now, const Message *m, Lanes lanes) {
    Lanes before = now->waiting[m->connection];
    if (before & lanes) {
        if (!dispatch(&b->channels[m->connection], before)) return 0;
        before = 0;
    }
    if (m->arrival < 0) skip(&b->channels[m->connection], lanes);
    now->waiting[m->connection] = m->arrival < 0 ? before : before | lanes;
    return 1;
}

static int post_rest(Batch *b, Instant *now) {
    for (int64_t i = 0; i < b->channel_count; i++) {
        if (now->waiting[i] && !dispatch(&b->channels[i], now->waiting[i])) return 0;
        now->waiting[i] = 0;
    }
    return 1;
}

static void arrive(Batch *b, Instant *now, int64_t connection, Lanes lanes) {
    Lanes before = now->waiting[connection];
    now->marks[connection] |= lanes;
    if (before & lanes) {
        deliver(b, &b->channels[connection], before, now->time);
        before = 0;
    }
    now->waiting[connection] = before | lanes;
}

static void arrive_rest(Batch *b, Instant *now) {
    for (int64_t i = 0; i < b->channel_count; i++) {
        if (now->waiting[i]) deliver(b, &b->channels[i], now->waiting[i] & b->alive, now->time);
        now->waiting[i] = 0;
    }
}

/* Messages between components in continuous time, what is measured for samples to come, and what arrives. */
static int exchange(Batch *b, Instant *now, Lanes moving) {
    int some = 0;
    TRACKS(track, moving) {
        const Schedule *s = &track->schedule;
        int64_t at = track->at;
        Lanes lanes = track->lanes & b->alive;
        some |= s->arrivals_at[at] < s->arrivals_at[at + 1] || s->posted_at[at] < s->posted_at[at + 1] ||
            s->measured_at[at] < s->measured_at[at + 1];
        for (int64_t i = s->posted_at[at]; i < s->posted_at[at + 1]; i++)
            if (!post(b, now, &s->posted[i], lanes)) return 0;
        for (int64_t i = s->measured_at[at]; i < s->measured_at[at + 1]; i++) {
            const Message *m = &s->measured[i];
            if (!post(b, now, m, lanes)) return 0;
            if (m->arrival >= 0 && m->arrival < track->stop) now->marks[m->connection] |= lanes;
        }
    }
    if (!some) return 1;
    if (!post_rest(b, now)) return 0;
    TRACKS(track, moving) {
        const Schedule *s = &track->schedule;
        int64_t at = track->at, time = time_of(track);
        Lanes lanes = track->lanes & b->alive;
        for (int64_t i = s->arrivals_at[at]; i < s->arrivals_at[at + 1]; i++)
            arrive(b, now, s->arrivals[i].connection, lanes);
        for (int64_t i = s->posted_at[at]; i < s->posted_at[at + 1]; i++)
            if (s->posted[i].arrival == time) arrive(b, now, s->posted[i].connection, lanes);
    }
    arrive_rest(b, now);
    return 1;
}

/* Message number `place` of the samples of these tracks, of what they receive (or send). */
typedef struct {
    Lanes taken, sent, delivered;
} Exchange;

static int sample(Batch *b, Instant *now, int64_t index, Lanes moving) {
    const Component *task = &b->components[index];
    q_real t = now->t, length = q_all(0.0);
    Lanes sampling = 0, running = 0, tracks = 0;
    int64_t received = 0, sent = 0;
    const Due *dues[L];
    TRACKS(track, moving) {
        const Schedule *s = &track->schedule;
        int64_t time = time_of(track), at = track->at, end = 0, number = track - b->tracks;
        Lanes lanes = track->lanes & b->alive;
        const Due *due = s->dues + s->dues_at[at], *last = s->dues + s->dues_at[at + 1];
        while (due < last && due->component != index) due++;
        if (due < last) {
            end = task->by_itself ? s->times[at + 1] : due->next_time;
            dues[number] = due, tracks |= (Lanes)1 << number;
            received = due->sent - due->received, sent = due->end - due->sent;
            sampling |= lanes;
        } else if (task->by_itself && time < track->stop) {
            end = s->times[at + 1];
            running |= lanes;
        } else
            continue;
        if (end > track->stop) end = track->stop;
        length = q_select(mask_of(lanes), q_all((double)(end - time) / NANOSECONDS), length);
    }
    if (!sampling && !running) return 1;
    for (int64_t i = 0; i < received; i++) {
        Lanes come = 0;
        int64_t connection = -1;
        TRACKS(track, tracks) {
            const Message *m = &track->schedule.exchanged[dues[track - b->tracks]->received + i];
            connection = m->connection;
            if (m->arrival >= 0) come |= track->lanes;
            else if (!b->channels[connection].read_ahead) skip(&b->channels[connection], track->lanes & b->alive);
        }
        come &= b->alive;
        if (!come) continue;
        Channel *c = &b->channels[connection];
        if (c->read_ahead) deliver(b, c, come, now->time);
        else {
            now->marks[connection] |= come;
            take(c, come);
            apply(b, c, come, c->value, now->time);
        }
    }
    extrapolate_each(b, &task->held, sampling | running, now->time);
    feed(b, task, sampling & b->alive);
    Lanes stepping = (sampling | running) & b->alive;
    if (stepping) {
        q_real ratio = READ(task->ratio, 0);
        advance(b, index, stepping, ratio * t, ratio * length, now->time);
    }
    for (int64_t i = 0; i < sent; i++) {
        Lanes at_once = 0, later = 0;
        int64_t connection = -1;
        TRACKS(track, tracks) {
            const Message *m = &track->schedule.exchanged[dues[track - b->tracks]->sent + i];
            connection = m->connection;
            if (m->arrival < 0) skip(&b->channels[connection], track->lanes & b->alive);
            else if (m->arrival == time_of(track)) at_once |= track->lanes;
            else later |= track->lanes;
        }
        Channel *c = &b->channels[connection];
        at_once &= b->alive, later &= b->alive;
        if (at_once) {
            now->marks[connection] |= at_once;
            take(c, at_once);
            apply(b, c, at_once, c->value, now->time);
        }
        if (later && !dispatch(c, later)) return 0;
    }
    return 1;
}

static void settle(Batch *b, const Instant *now) {
    for (int64_t j = 0; j < b->bodies.count; j++) {
        int64_t index = b->bodies.items[j];
        const Component *body = &b->components[index];
        Lanes lanes = now->halts[index] & b->alive;
        if (!body->settles || !lanes) continue;
        extrapolate_each(b, &body->held, lanes, now->time);
        pass_on_each(b, &body->behind, lanes, now->time);
        feed(b, body, lanes & b->alive);
    }
}

static void record(Batch *b, const Instant *now, Lanes lanes) {
    EACH(lane, lanes) {
        if (b->record_counts[lane] == b->record_limit) continue;
        double *into = b->records[lane] + b->record_counts[lane]++ * (b->recorded_count + 1);
        *into++ = now->t[lane];
        for (int64_t i = 0; i < b->recorded_count; i++) into[i] = b->recorded[i][lane];
    }
}

static int pass(Batch *b, Instant *now, Lanes moving) {
    gather(b, now, moving);
    if (HAS_CONDITION && now->lanes && now->time[__builtin_ctzll(now->lanes)] == 0) {
        q_mask over = holds(b, now->t) & mask_of(now->lanes);
        if (q_any(over)) end_some(b, lanes_of(over), DIVERGED, 0, now->time);
    }
    step_bodies(b, now, moving);
    if (!exchange(b, now, moving)) return 0;
    for (int64_t i = 0; i < b->tasks.count; i++)
        if (!sample(b, now, b->tasks.items[i], moving)) return 0;
    settle(b, now);
    Lanes lanes = now->lanes & b->alive;
    if (!lanes) return 1;
    int first = now->time[__builtin_ctzll(lanes)] == 0; /* tracks set out together */
    if (!(first ? begin_row(b, now, mask_of(lanes)) : next_row(b, now, mask_of(lanes)))) return 0;
    if (b->recorded_count) record(b, now, lanes);
    return 1;
}

/* -- a run ----------------------------------------------------------------------------------------------------------- */

static int samples_next(const Track *track) {
    const int64_t *at = track->schedule.dues_at + track->at;
    return at[1] > at[0];
}

/* Pass through the windows that the tracks have. Tracks that sample next wait for one another, since what a sample
   costs does not grow with the lanes that take part. */
EXPORT int fly(Batch *b) {
    Instant now;
    memset(&now, 0, sizeof now);
    constants(b);
    for (;;) {
        Lanes flying = 0, sampling = 0, setting_out = 0;
        for (int64_t i = 0; i < b->track_count; i++) {
            Track *track = &b->tracks[i];
            if (!(track->lanes & b->alive)) continue;
            if (track->at == track->count) {
                if (track->last_window) continue;
                b->track = i;
                return NEXT_WINDOW;
            }
            flying |= (Lanes)1 << i;
            setting_out |= (Lanes)(time_of(track) == 0) << i;
            sampling |= (Lanes)samples_next(track) << i;
        }
        if (!flying) return AT_END;
        Lanes moving = setting_out ? setting_out : flying & ~sampling ? flying & ~sampling : flying;
        if (!pass(b, &now, moving)) return NO_MEMORY;
        TRACKS(track, moving) track->at++;
    }
}

/* How often a value that was kept grows, and ends above a floor. */
EXPORT void grown(const Batch *b, int64_t number, const double *floor, double *found) {
    const Kept *kept = &b->kept[number];
    q_real count = q_all(0.0);
    for (int64_t i = 1; i < kept->count; i++) {
        q_real before = READ(kept->values, i - 1), x = READ(kept->values, i);
        count = count + TRUE(q_gt(x - before, 0.0) & q_gt(x, READ(floor, 0)));
    }
    AT(found, 0) = count;
}

/* Begin again: nothing is on its way, and nothing is kept. Memory that was made for it stays. */
EXPORT void clear(Batch *b) {
    for (int64_t i = 0; i < KEPT; i++) b->kept[i].count = 0;
    for (int64_t i = 0; i < b->channel_count; i++)
        for (int lane = 0; lane < L; lane++) b->channels[i].first[lane] = b->channels[i].last[lane] = 0;
}

/* Free what was made. */
EXPORT void land(Batch *b) {
    for (int64_t i = 0; i < KEPT; i++) free(b->kept[i].values);
    for (int64_t i = 0; i < b->channel_count; i++) free(b->channels[i].flight);
}
