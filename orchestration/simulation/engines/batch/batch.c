/* The loop of runs of kernels in SIMD lanes: the reductions of a run are updated row by row by expressions.h, which is
   generated for the system. The processing of an instant is in instants.h. */

#include "lanes.h"
#include "mathematics.h"

#include <stdlib.h>

#include "sizes.h"
#include "structures.h"

#include "instants.h"

/* With the C library of GNU, a run has a stack of its own, on which it waits for outputs that the caller computes. */
#ifdef __GLIBC__
#include <ucontext.h>
#endif

EXPORT const Size sizes[] = {SIZES, {0}};

static int make_room_to_keep(Kept *kept) {
    int64_t capacity = kept->capacity ? 2 * kept->capacity : 1024;
    double *values = aligned_alloc(64, (size_t)capacity * sizeof(q_real));
    if (!values) return 0;
    if (kept->values) memcpy(values, kept->values, (size_t)kept->count * sizeof(q_real));
    free(kept->values);
    kept->values = values, kept->capacity = capacity;
    return 1;
}

static int keep(Kept *kept, q_real value) {
    if (kept->count == kept->capacity && !make_room_to_keep(kept)) return 0;
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

/* -- the functions that an instant calls --------------------------------------------------------------------------- */

/* Set the receiver's inputs; a run with an invalid value ends here, and is repeated with the FMU itself. */
static void set(Loop *l, Channel *c, Lanes lanes, const double *value, const Instant *now) {
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
    if (q_any(wrong)) end_some(l, lanes_of(wrong), REFUSED, 0, now);
}

typedef void Step(double *, const uint64_t *, const double *, const double *, int32_t *, const bool *);

static Lanes failed_in_step(Loop *l, const Component *c, Lanes lanes, q_real begin, q_real length) {
    q_bits active = bits_of(lanes);
    int32_t any = 0;
    ((Step *)c->step)(
        c->memory, (const uint64_t *)&active, (const double *)&begin, (const double *)&length, l->status, c->wanted);
    for (int lane = 0; lane < L; lane++) any |= l->status[lane];
    if (!any) return 0;
    Lanes failed = 0;
    EACH(lane, lanes) failed |= (Lanes)(l->status[lane] != 0) << lane;
    memset(l->status, 0, L * sizeof *l->status);
    return failed;
}

static void step_from_put_off(Loop *l, Track *track, int64_t index, Lanes lanes, const Instant *now);
static void await_outputs(Loop *l, Lanes lanes);

static void step(Loop *l, int64_t index, Lanes lanes, q_real begin, q_real length, int64_t until, const Instant *now) {
    if (l->tracks->put_off && index == l->continuous.items[0]) {
        step_from_put_off(l, l->tracks, index, lanes, now);
        return;
    }
    if (!l->components[index].step) {
        await_outputs(l, lanes);
        return;
    }
    Lanes failed = failed_in_step(l, &l->components[index], lanes, begin, length);
    if (failed) end_some(l, failed, FAILED, index, now);
}

/* End the lanes in which a connected output is not finite. */
static void read_outputs(Loop *l, int64_t index, Lanes lanes, const Instant *now) {
    const Component *c = &l->components[index];
    const double *memory = c->memory;
    const int64_t *outputs = c->places, count = c->connected;
    q_real none = q_all(0.0), other = q_all(0.0), third = q_all(0.0);
    int64_t i = 0;
    for (; i + 2 < count; i += 3) { /* three independent sums take a third of the time */
        q_real x = READ(memory, outputs[i]), y = READ(memory, outputs[i + 1]), z = READ(memory, outputs[i + 2]);
        none = none + (x - x), other = other + (y - y), third = third + (z - z);
    }
    for (; i < count; i++) {
        q_real x = READ(memory, outputs[i]);
        none = none + (x - x);
    }
    q_mask wrong = q_isnan(none + (other + third)) & mask_of(lanes);
    if (q_any(wrong)) end_some(l, lanes_of(wrong), NOT_FINITE, index, now);
}

static void feed(Loop *l, const Component *c, Lanes lanes, const Instant *now) {
    q_mask mask = mask_of(lanes);
    for (const Fed *fed = c->fed; fed < c->fed + c->fed_count; fed++)
        AT(c->memory, fed->place) = q_select(mask, READ(l->given, fed->source), READ(c->memory, fed->place));
}

static void look(Loop *l, Lanes lanes, const Instant *now) {
    if (!HAS_CONDITION) return;
    q_mask over = holds(l, now->t) & mask_of(lanes);
    if (q_any(over)) end_some(l, lanes_of(over), DIVERGED, 0, now);
}

static int make_room(Channel *c, int lane) {
    int64_t capacity = c->capacity ? 2 * c->capacity : 4;
    size_t bytes = (size_t)(capacity * c->size) * sizeof(q_real);
    double *flight = aligned_alloc(64, bytes);
    if (!flight) return 0;
    for (int each = 0; each < L; each++)
        for (int64_t k = c->first[each]; k < c->last[each]; k++)
            for (int64_t i = 0; i < c->size; i++)
                flight[((k & (capacity - 1)) * c->size + i) * L + each] =
                    c->flight[((k & (c->capacity - 1)) * c->size + i) * L + each];
    free(c->flight);
    c->flight = flight, c->capacity = capacity;
    return 1;
}

/* Mark the lanes whose row has values of a message: the row at which they were sampled, or at which they arrive. */
static void note(Loop *l, int kind, const Messages *m, const Instant *now) {
    int64_t connection = m->message->connection;
    Lanes not_lost = m->at_once | m->later;
    if (kind == ARRIVED) now->marks[connection] |= m->at_once;
    if (kind == SAMPLED && !l->channels[connection].read_ahead) now->marks[connection] |= not_lost;
    if (kind == MEASURED) now->marks[connection] |= not_lost & ~m->beyond;
}

/* -- schedules ----------------------------------------------------------------------------------------------------- */

static int64_t time_in(const Instants *some) { return some->at < some->count ? some->times[some->at] : INT64_MAX; }

static int64_t next_time(const Span *span) {
    int64_t regular = time_in(&span->regular), own = time_in(&span->own);
    return regular < own ? regular : own;
}

/* The time of the next event that is not a regular instant. */
static int64_t next_more(const Span *span) {
    int64_t time = time_in(&span->own);
#define EARLIEST(table, time_of_row) \
    if (span->table##_at < span->table##_count && span->time_of_row < time) time = span->time_of_row
    EARLIEST(posted, posted[span->posted_at].sent);
    EARLIEST(measured, measured[span->measured_at].sent);
    EARLIEST(arrivals, arrivals[span->arrivals_at].arrival);
    EARLIEST(samples, sampled[span->samples_at]);
    return time;
}

enum { MOST_PUT_OFF = 127 }; /* steps in one call, less one */

/* Whether at a regular instant nothing but a step of the one component in continuous time happens. */
static int only_steps(const Track *track, int64_t at) {
    const Instants *regular = &track->span.regular;
    return at < regular->count && regular->times[at] < track->more && regular->stepped[at];
}

/* Whether the next instant of a track is this time, and the one component is stepped to it. */
static int is_stepped_to(const Track *track, int64_t time) {
    const Instants *regular = &track->span.regular, *own = &track->span.own;
    return next_time(&track->span) == time &&
           ((time_in(regular) == time && regular->stepped[regular->at]) || (time_in(own) == time && own->stepped[own->at]));
}

static int puts_off(const Loop *l) {
    return l->track_count == 1 && l->stays && l->components[l->continuous.items[0]].steps;
}

/* Put off instants at which nothing but steps of one length happen, until the step to the instant that follows them: the
   component then does all of these in one call. */
static void put_off(const Loop *l, Track *track) {
    Instants *regular = &track->span.regular;
    int64_t from = regular->at, before = track->now[l->continuous.items[0]], length = regular->times[from] - before;
    for (; only_steps(track, regular->at) && regular->at - from < MOST_PUT_OFF; regular->at++) {
        if (regular->times[regular->at] - before != length) break;
        before = regular->times[regular->at];
    }
    regular->at -= !is_stepped_to(track, before + length); /* that follows them: it is the last of them */
    track->put_off = regular->at - from, track->put_off_from = from, track->put_off_length = length;
}

/* Put the next instant of a track's span into its schedule, if there is one. */
static void advance(Loop *l, Track *track) {
    Span *s = &track->span;
    Instants *regular = &s->regular, *own = &s->own;
    int64_t count = l->continuous.count, one_moves = count == 1 && !l->some_by_themselves, moving = 0;
    if (one_moves && puts_off(l) && only_steps(track, regular->at)) put_off(l, track);
    if (one_moves && only_steps(track, regular->at)) { /* the usual case */
        track->times[0] = time_in(regular), track->source_row = regular->at++, track->kind = 0, track->count = 1;
        return;
    }
    int64_t time = next_time(s);
    if (time == INT64_MAX) return;
    int more = next_more(s) == time, is_regular = time_in(regular) == time, is_own = time_in(own) == time;
    for (int64_t i = 0; i < count; i++)
        if ((is_regular && regular->stepped[regular->at * count + i]) || (is_own && own->stepped[own->at * count + i]))
            track->moving[moving++] = l->continuous.items[i];
        else if (time && is_observed(l->continuous.items[i]))
            l->doubtful |= track->lanes; /* on a line to its next point, which is not known yet */
    track->source_row = is_regular ? regular->at : ~own->at;
    regular->at += is_regular, own->at += is_own;
#define THOSE_OF(table, time_of_row) \
    track->table##_at[0] = s->table##_at; \
    while (s->table##_at < s->table##_count && s->time_of_row == time) s->table##_at++; \
    track->table##_at[1] = s->table##_at
    THOSE_OF(posted, posted[s->posted_at].sent);
    THOSE_OF(measured, measured[s->measured_at].sent);
    THOSE_OF(arrivals, arrivals[s->arrivals_at].arrival);
    THOSE_OF(samples, sampled[s->samples_at]);
    int64_t next = next_time(s), sampling = track->samples_at[0] < track->samples_at[1];
    track->times[0] = time, track->times[1] = next < INT64_MAX ? next : s->end, track->stepped_at[1] = moving;
    track->kind = MORE * (!time || more || !one_moves || !moving) + SAMPLES * sampling + START * !time;
    track->more = next_more(s), track->at = 0, track->count = 1;
    track->schedule = (Schedule){
        .times = track->times, .stepped_at = track->stepped_at, .stepped = track->moving,
        .posted_at = track->posted_at, .measured_at = track->measured_at, .arrivals_at = track->arrivals_at,
        .samples_at = track->samples_at, .posted = s->posted, .measured = s->measured, .arrivals = s->arrivals,
        .exchanged = s->exchanged, .samples = s->samples,
    };
}

/* -- a run --------------------------------------------------------------------------------------------------------- */

static const double *
source_values(const double *const *regular, const double *const *own, int lane, int64_t row, int64_t n) {
    return row < 0 ? own[lane] + ~row * n : regular[lane] + row * n;
}

/* Take over the values of sources at the instants that tracks have reached. */
static void take_sources(Loop *l, const Instant *now) {
    TRACKS(track, now->tracks) {
        Lanes lanes = track->lanes & l->alive;
        int64_t row = track->source_row;
        if (track->one_for_all) {
            int lane = __builtin_ctzll(track->lanes);
            q_mask mask = mask_of(lanes);
            const double *seen = source_values(track->seen, track->seen_own, lane, row, l->seen_count);
            const double *given = source_values(track->given, track->given_own, lane, row, l->given_count);
            for (int64_t i = 0; i < l->seen_count; i++)
                AT(l->seen, i) = q_select(mask, q_all(seen[i]), READ(l->seen, i));
            for (int64_t i = 0; i < l->given_count; i++)
                AT(l->given, i) = q_select(mask, q_all(given[i]), READ(l->given, i));
        } else
            EACH(lane, lanes) {
                const double *seen = source_values(track->seen, track->seen_own, lane, row, l->seen_count);
                const double *given = source_values(track->given, track->given_own, lane, row, l->given_count);
                for (int64_t i = 0; i < l->seen_count; i++) l->seen[i * L + lane] = seen[i];
                for (int64_t i = 0; i < l->given_count; i++) l->given[i * L + lane] = given[i];
            }
    }
}

static void record(Loop *l, const Instant *now, Lanes lanes) {
    EACH(lane, lanes) {
        if (l->record_counts[lane] == l->record_limit) continue;
        double *into = l->records[lane] + l->record_counts[lane]++ * (l->recorded_count + 1);
        *into++ = q_lane(now->t, lane);
        for (int64_t i = 0; i < l->recorded_count; i++) into[i] = l->recorded[i][lane];
    }
}

/* Process an instant at which, in some tracks, only the one component in continuous time is stepped: as `reach` and
   `pass` do, without looking for anything else. */
static void only_step(Loop *l, Instant *now, Lanes tracks) {
    int64_t index = l->continuous.items[0], until = 0;
    q_real begin = q_all(0.0), length = q_all(0.0);
    now->tracks = tracks, now->lanes = 0, now->still = l->stays;
    TRACKS(track, tracks) {
        Lanes lanes = track->lanes & l->alive;
        int64_t before = track->now[index];
        track->now[index] = until = time_of(track);
        reach_time(now, lanes, until);
        begin = q_select(mask_of(lanes), q_all((double)before / NANOSECONDS), begin);
        length = q_select(mask_of(lanes), q_all((double)(until - before) / NANOSECONDS), length);
    }
    take_sources(l, now);
    Lanes moved = move(l, index, now->lanes, begin, length, until, now);
    if (moved & l->alive) look(l, moved & l->alive, now);
    if (l->settles) hold(l, index, now->lanes & l->alive, now);
}

typedef struct { /* instants that were put off, of which `now` is the next */
    Loop *l;
    Track *track;
    int64_t index, last; /* of the component, and of the last regular instant of these */
    Lanes lanes;
    Instant now;
} PutOff;

static void reach_put_off(PutOff *off, int64_t row) {
    off->track->source_row = row;
    off->now.lanes = 0;
    reach_time(&off->now, off->lanes, off->track->span.regular.times[row]);
}

/* Process such an instant after the step to it, and reach the next: whether all its runs go on. */
static int pass_put_off(void *put_off) {
    PutOff *off = put_off;
    Loop *l = off->l;
    const Lanes lanes = off->lanes;
    take_sources(l, &off->now);
    count_steps(l, lanes);
    read_outputs(l, off->index, lanes, &off->now);
    if (lanes & l->alive) look(l, lanes & l->alive, &off->now);
    off->lanes = lanes & l->alive;
    if (off->lanes && !next_row(l, &off->now, mask_of(off->lanes))) l->no_memory = 1;
    if (l->record_limit) record(l, &off->now, off->lanes);
    if (off->track->source_row < off->last) reach_put_off(off, off->track->source_row + 1);
    return off->lanes == lanes && !l->no_memory;
}

typedef int64_t
Steps(double *, const uint64_t *, const double *, double, int64_t, const bool *, int (*)(void *), void *);

/* Step to the instants that were put off, and to the present one. */
static void step_from_put_off(Loop *l, Track *track, int64_t index, Lanes lanes, const Instant *present) {
    const Component *c = &l->components[index];
    const int64_t from = track->put_off_from, count = track->put_off + 1, source_row = track->source_row;
    const int64_t length = track->put_off_length, before = track->span.regular.times[from] - length;
    double times[MOST_PUT_OFF + 1 + L];
    for (int64_t i = 0; i < count; i++) times[i] = (double)(before + i * length) / NANOSECONDS;
    for (int64_t i = count; i < count + L; i++) times[i] = times[count - 1];
    PutOff off;
    off.l = l, off.track = track, off.index = index, off.last = from + count - 2, off.lanes = lanes;
    off.now.tracks = present->tracks, off.now.marks = present->marks, off.now.still = 1;
    reach_put_off(&off, from);
    for (int64_t i = 0; i < count && off.lanes && !l->no_memory;) {
        const q_bits active = bits_of(off.lanes);
        const double of_each = (double)length / NANOSECONDS;
        const int64_t done = ((Steps *)c->steps)(
            c->memory, (const uint64_t *)&active, times + i, of_each, count - i, c->wanted, pass_put_off, &off);
        i += done;
        if (done) continue;
        Lanes failed = failed_in_step(l, c, off.lanes, q_all(times[i]), q_all(of_each));
        const int is_present = ++i == count;
        if (failed) end_some(l, failed, FAILED, index, is_present ? present : &off.now);
        if ((off.lanes &= l->alive) && !is_present) pass_put_off(&off);
    }
    track->put_off = 0, track->source_row = source_row;
    take_sources(l, present);
}

/* Write such a step as a schedule, for tracks that are processed together with others in which more happens. */
static void lay_out_step(Loop *l, Lanes tracks) {
    TRACKS(track, tracks) {
        int64_t *const tables[] = {track->posted_at, track->measured_at, track->arrivals_at, track->samples_at};
        for (int i = 0; i < 4; i++) tables[i][1] = tables[i][0];
        track->stepped_at[1] = 1, track->moving[0] = l->continuous.items[0];
    }
}

static void reach_and_pass(Loop *l, Instant *now, Lanes tracks, int first) {
    reach(l, now, tracks);
    now->still = 0;
    take_sources(l, now);
    if (first) look(l, now->lanes, now);
    pass(l, now);
}

/* Process the windows of the tracks. Tracks at their first instant process it together; those that sample next wait for
   one another, since the cost of a sample does not grow with the number of its lanes. */
EXPORT int run(Loop *l) {
    Lanes marks[CHANNELS], due = ((Lanes)1 << (l->track_count - 1) << 1) - 1; /* tracks that need their next instant */
    Lanes ready = 0, with_more = 0, sampling = 0, setting_out = 0;
    Instant now = {.marks = marks};
    constants(l);
    for (;;) {
        ready &= ~due, with_more &= ~due, sampling &= ~due, setting_out &= ~due;
        TRACKS(track, due) {
            int64_t number = track - l->tracks;
            if (!(track->lanes & l->alive)) continue;
            if (!track->count) advance(l, track);
            if (!track->count) {
                if (track->last_window) continue;
                l->track = number;
                return NEXT_WINDOW;
            }
            ready |= (Lanes)1 << number;
            if (!track->kind) continue;
            with_more |= (Lanes)1 << number;
            sampling |= (Lanes)((track->kind & SAMPLES) != 0) << number;
            setting_out |= (Lanes)((track->kind & START) != 0) << number;
        }
        if (!ready) return AT_END;
        due = setting_out ? setting_out : ready & ~sampling ? ready & ~sampling : ready;
        memset(marks, 0, sizeof marks);
        if (due & with_more) {
            lay_out_step(l, due & ~with_more);
            reach_and_pass(l, &now, due, setting_out != 0);
        } else
            only_step(l, &now, due);
        Lanes lanes = now.lanes & l->alive;
        if (lanes) {
            if (!(setting_out ? begin_row(l, &now, mask_of(lanes)) : next_row(l, &now, mask_of(lanes))))
                return NO_MEMORY;
            if (l->record_limit) record(l, &now, lanes);
        }
        if (l->no_memory) return NO_MEMORY;
        TRACKS(track, due) track->count = 0;
    }
}

/* -- runs of which the caller computes the outputs of a component --------------------------------------------------- */

#ifdef __GLIBC__

enum { STACK = 1 << 20 }; /* bytes, of which the system provides those that are used */

typedef struct {
    ucontext_t caller, own;
    Loop *loop;
    int code;
    char stack[STACK] __attribute__((aligned(64)));
} Suspended;

static void await_outputs(Loop *l, Lanes lanes) {
    Suspended *s = l->suspended;
    l->awaiting = lanes, s->code = AWAITS;
    swapcontext(&s->own, &s->caller);
    s->code = RUNNING;
}

static void run_suspended(unsigned high, unsigned low) { /* makecontext passes numbers of 32 bits */
    Suspended *s = (Suspended *)((uintptr_t)high << 32 | low);
    s->code = run(s->loop);
}

/* As `run`, and it also returns AWAITS, where a component without a `step` is to be stepped: then its outputs are to be
   in its memory when it is called again. */
EXPORT int proceed(Loop *l) {
    Suspended *s = l->suspended;
    if (!s) {
        s = l->suspended = aligned_alloc(64, (sizeof *s + 63) / 64 * 64);
        if (!s) return NO_MEMORY;
        s->loop = l, s->code = RUNNING;
    }
    if (s->code != AWAITS) {
        getcontext(&s->own);
        s->own.uc_stack.ss_sp = s->stack, s->own.uc_stack.ss_size = STACK, s->own.uc_link = &s->caller;
        makecontext(
            &s->own, (void (*)(void))run_suspended, 2, (unsigned)((uintptr_t)s >> 32), (unsigned)(uintptr_t)s);
    }
    swapcontext(&s->caller, &s->own);
    return s->code;
}

static void abandon(Loop *l) {
    if (l->suspended) ((Suspended *)l->suspended)->code = RUNNING; /* it holds nothing but its stack */
}

#else
static void await_outputs(Loop *l, Lanes lanes) {}
static void abandon(Loop *l) {}
#endif

/* The values of the reductions at the end of the runs. */
EXPORT void values_of_reductions(const Loop *l, double *values) { reductions(l, values); }

/* The number of steps in which a kept value grows, and ends above a floor. */
EXPORT void grown(const Loop *l, int64_t number, const double *floor, double *grown_steps) {
    const Kept *kept = &l->kept[number];
    q_real count = q_all(0.0);
    for (int64_t i = 1; i < kept->count; i++) {
        q_real before = READ(kept->values, i - 1), x = READ(kept->values, i);
        count = count + TRUE(q_gt(x - before, 0.0) & q_gt(x, READ(floor, 0)));
    }
    AT(grown_steps, 0) = count;
}

/* Discard messages on their way, kept values and a run that waits; their memory stays allocated. */
EXPORT void clear(Loop *l) {
    abandon(l);
    for (int64_t i = 0; i < KEPT; i++) l->kept[i].count = 0;
    for (int64_t i = 0; i < l->channel_count; i++)
        for (int lane = 0; lane < L; lane++) l->channels[i].first[lane] = l->channels[i].last[lane] = 0;
}

/* Free the memory of messages, of kept values and of a run that waits. */
EXPORT void free_all(Loop *l) {
    free(l->suspended);
    for (int64_t i = 0; i < KEPT; i++) free(l->kept[i].values);
    for (int64_t i = 0; i < l->channel_count; i++) free(l->channels[i].flight);
}
