/* Processes an instant exactly as instants.py does, in L SIMD lanes: lane l of every vector is run l. Runs of one
   timing are a track: they share a schedule and process it together.

   It is compiled for FMUs that are called (loop.c, one lane) and for kernels (batch.c). These define how values are
   set, stepped and read, what is noted, and the divergence monitor: the functions that are only declared here. A lane
   whose run has ended is not alive, and takes part in nothing. */

#define NANOSECONDS 1e9
#define EVERY (L == 64 ? ~(uint64_t)0 : (((uint64_t)1 << (L & 63)) - 1))

typedef struct { /* of the tracks that have any, rows of a table, which begin with an index */
    Lanes tracks;
    const int64_t *next[L], *end[L];
} Rows;

typedef struct { /* messages over one connection, one of each track whose next message it is */
    const Message *message; /* one of them */
    Lanes lost, at_once, later, beyond;
} Messages;

typedef struct {
    Lanes lanes, tracks; /* that are at this instant */
    q_real t;
    int64_t time[L];
    Rows stepped, samples; /* of components, in the order of ranks */
    Rows arrivals, posted, measured;
    /* of kernels */
    Lanes *marks; /* by connection, lanes in which a message has values of this instant */
    int still;    /* whether all held values are unchanged */
} Instant;

static void set(Loop *l, Channel *c, Lanes lanes, const double *value, const Instant *now);
static int make_room(Channel *c, int lane);
static void step(Loop *l, int64_t index, Lanes lanes, q_real begin, q_real length, int64_t until, const Instant *now);
static void read_outputs(Loop *l, int64_t index, Lanes lanes, const Instant *now);
static void feed(Loop *l, const Component *c, Lanes lanes, const Instant *now);
static void look(Loop *l, Lanes lanes, const Instant *now);
static void note(Loop *l, int kind, const Messages *m, const Instant *now);

/* Without inlining, the functions that an instant calls in many places cost a tenth of a step of FMUs. */
#define INLINED static inline __attribute__((always_inline))

/* -- lanes --------------------------------------------------------------------------------------------------------- */

#if L == 1
Q_ONE q_bits bits_of(Lanes lanes) { return -lanes; }
Q_ONE q_mask mask_of(Lanes lanes) { return (q_mask)lanes; }
Q_ONE Lanes lanes_of(q_mask mask) { return (Lanes)(mask != 0); }
#define EACH(lane, lanes) for (int lane = 0, once_ = (lanes) != 0; once_; once_ = 0)
#else
static const q_bits lane_bits = LANE_BITS;

/* Lanes as the functions of components receive them: all bits of each, or none. */
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

#define EACH(lane, lanes) \
    for (Lanes left_ = (lanes); left_; left_ &= left_ - 1) \
        for (int lane = __builtin_ctzll(left_), once_ = 1; once_; once_ = 0)
#endif

#if L == 1
#define TRACKS(track, some) for (Track *track = (some) ? l->tracks : NULL; track; track = NULL)
#else
#define TRACKS(track, some) \
    for (Lanes tracks_ = (some); tracks_; tracks_ &= tracks_ - 1) \
        for (Track *track = &l->tracks[__builtin_ctzll(tracks_)], *end_ = track + 1; track < end_; track++)
#endif

/* The numbers of the lanes at a place of a memory. */
typedef q_real Place __attribute__((may_alias));
#define AT(memory, place) (*(Place *)((memory) + (place) * L))
#define READ(memory, place) (*(const Place *)((memory) + (place) * L))

static void end_some(Loop *l, Lanes lanes, int64_t outcome, int64_t component, const Instant *now) {
    EACH(lane, lanes & l->alive)
        l->outcome[lane] = outcome, l->outcome_component[lane] = component, l->outcome_time[lane] = now->time[lane];
    l->alive &= ~lanes;
}

INLINED int64_t time_of(const Track *track) { return track->schedule.times[track->at]; }

#define WIDTH(type) ((int64_t)(sizeof(type) / sizeof(int64_t)))

INLINED void add(Rows *rows, int64_t track, const void *table, int64_t width, int64_t begin, int64_t end) {
    if (begin == end) return;
    rows->tracks |= (Lanes)1 << track;
    rows->next[track] = (const int64_t *)table + width * begin, rows->end[track] = (const int64_t *)table + width * end;
}

/* Remove and return the next row of a track. */
INLINED const int64_t *row_of(Rows *rows, int64_t track, int64_t width) {
    const int64_t *row = rows->next[track];
    if ((rows->next[track] += width) == rows->end[track]) rows->tracks &= ~((Lanes)1 << track);
    return row;
}

/* Lanes have reached a time [ns]. */
INLINED void reach_time(Instant *now, Lanes lanes, int64_t time) {
    now->lanes |= lanes;
    now->t = q_select(mask_of(lanes), q_all((double)time / NANOSECONDS), now->t);
    if (lanes == EVERY)
        for (int lane = 0; lane < L; lane++) now->time[lane] = time;
    else
        EACH(lane, lanes) now->time[lane] = time;
}

/* Tracks have reached their next instant. */
INLINED void reach(Loop *l, Instant *now, Lanes tracks) {
    now->tracks = tracks, now->lanes = 0;
    now->stepped.tracks = now->samples.tracks = now->arrivals.tracks = now->posted.tracks = now->measured.tracks = 0;
    TRACKS(track, tracks) {
        const Schedule *s = &track->schedule;
        int64_t at = track->at, number = track - l->tracks;
        reach_time(now, track->lanes & l->alive, time_of(track));
        add(&now->stepped, number, s->stepped, 1, s->stepped_at[at], s->stepped_at[at + 1]);
        add(&now->arrivals, number, s->arrivals, WIDTH(Message), s->arrivals_at[at], s->arrivals_at[at + 1]);
        add(&now->posted, number, s->posted, WIDTH(Message), s->posted_at[at], s->posted_at[at + 1]);
        add(&now->measured, number, s->measured, WIDTH(Message), s->measured_at[at], s->measured_at[at + 1]);
        add(&now->samples, number, s->samples, WIDTH(SampleInstant), s->samples_at[at], s->samples_at[at + 1]);
    }
}

/* -- connections --------------------------------------------------------------------------------------------------- */

Q_ONE q_real converted(const Channel *c, q_real x) {
    return c->converts ? x * READ(c->scale, 0) + READ(c->offset, 0) : x;
}

static void skip(Channel *c, Lanes lanes) {
    if (c->noisy) EACH(lane, lanes) c->noise[lane] += c->size;
}

INLINED void take(Channel *c, Lanes lanes) {
    for (int64_t i = 0; i < c->size; i++) {
        q_real x = READ(c->sender, c->places[i]);
        if (c->noisy) {
            q_real noise = q_all(0.0);
            EACH(lane, lanes) noise = q_with_lane(noise, lane, c->noise[lane][i]);
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

static void pass_on(Loop *l, Channel *c, Lanes lanes, const Instant *now) {
    for (int64_t i = 0; i < c->size; i++) AT(c->value, i) = converted(c, READ(c->sender, c->places[i]));
    set(l, c, lanes, c->value, now);
}

INLINED void apply(Loop *l, Channel *c, Lanes lanes, const double *value, const Instant *now) {
    if (c->extrapolates)
        EACH(lane, lanes) { /* keep only the last of the values before this time */
            int64_t count = c->applied_count[lane], n = c->size;
            while (count > 0 && c->applied_time[(count - 1) * L + lane] >= now->time[lane]) count--;
            if (count > 1) {
                for (int64_t i = 0; i < n; i++) c->applied[i * L + lane] = c->applied[(n + i) * L + lane];
                c->applied_time[lane] = c->applied_time[L + lane];
                count = 1;
            }
            for (int64_t i = 0; i < n; i++) c->applied[(count * n + i) * L + lane] = value[i * L + lane];
            c->applied_time[count * L + lane] = now->time[lane];
            c->applied_count[lane] = count + 1;
        }
    set(l, c, lanes, value, now);
}

static void hand_over(Loop *l, Channel *c, Lanes lanes, const Instant *now) {
    take(c, lanes);
    apply(l, c, lanes, c->value, now);
}

static void extrapolate(Loop *l, Channel *c, Lanes lanes, const Instant *now) {
    Lanes on_a_line = 0;
    EACH(lane, lanes) {
        int64_t t0 = c->applied_time[lane], t1 = c->applied_time[L + lane], time = now->time[lane];
        if (c->applied_count[lane] < 2 || t0 == t1 || time == t1) continue;
        double share = (double)(time - t1) / (double)(t1 - t0);
        for (int64_t i = 0; i < c->size; i++) {
            double before = c->applied[i * L + lane], last = c->applied[(c->size + i) * L + lane];
            double more = share * (last - before);
            c->value[i * L + lane] = last + more;
        }
        on_a_line |= (Lanes)1 << lane;
    }
    if (on_a_line) set(l, c, on_a_line, c->value, now);
}

/* The place of message number k of a lane in the ring. */
Q_ONE double *slot_of(const Channel *c, int64_t k) { return c->flight + (k & (c->capacity - 1)) * c->size * L; }

static void dispatch(Loop *l, Channel *c, Lanes lanes) {
    int64_t k = c->last[__builtin_ctzll(lanes)];
    int together = lanes == EVERY;
    take(c, lanes);
    EACH(lane, lanes) {
        if (c->last[lane] - c->first[lane] == c->capacity && !make_room(c, lane)) {
            l->no_memory = 1;
            return;
        }
        together &= c->last[lane]++ == k;
    }
    for (int64_t i = 0; i < c->size; i++) {
        if (together)
            AT(slot_of(c, k), i) = READ(c->value, i);
        else
            EACH(lane, lanes) slot_of(c, c->last[lane] - 1)[i * L + lane] = c->value[i * L + lane];
    }
}

static void deliver(Loop *l, Channel *c, Lanes lanes, const Instant *now) {
    int64_t k = c->first[__builtin_ctzll(lanes)];
    int together = lanes == EVERY;
    EACH(lane, lanes) together &= c->first[lane]++ == k;
    if (together) {
        apply(l, c, lanes, slot_of(c, k), now);
        return;
    }
    EACH(lane, lanes)
        for (int64_t i = 0; i < c->size; i++)
            c->value[i * L + lane] = slot_of(c, c->first[lane] - 1)[i * L + lane];
    apply(l, c, lanes, c->value, now);
}

static void extrapolate_each(Loop *l, const List *held, Lanes lanes, const Instant *now) {
    for (int64_t i = 0; i < held->count; i++)
        if (lanes & l->alive) extrapolate(l, &l->channels[held->items[i]], lanes & l->alive, now);
}

static void pass_on_each(Loop *l, const List *wires, Lanes lanes, const Instant *now) {
    for (int64_t i = 0; i < wires->count; i++)
        if (lanes & l->alive) pass_on(l, &l->channels[wires->items[i]], lanes & l->alive, now);
}

/* -- messages of several tracks ------------------------------------------------------------------------------------ */

/* The next messages, in the order of each track; those over one connection are processed together. */
INLINED int next(Loop *l, Rows *rows, Messages *m) {
    while (rows->tracks) {
        int64_t connection = *rows->next[__builtin_ctzll(rows->tracks)];
        m->lost = m->at_once = m->later = m->beyond = 0;
        TRACKS(track, rows->tracks) {
            int64_t number = track - l->tracks;
            if (*rows->next[number] != connection) continue;
            const Message *message = m->message = (const Message *)row_of(rows, number, WIDTH(Message));
            Lanes lanes = track->lanes & l->alive;
            if (message->arrival < 0) m->lost |= lanes;
            else if (message->arrival == time_of(track)) m->at_once |= lanes;
            else m->later |= lanes;
            if (message->arrival >= track->stop) m->beyond |= lanes;
        }
        if (m->lost | m->at_once | m->later) return 1;
    }
    return 0;
}

static Channel *channel_of(Loop *l, const Messages *m) { return &l->channels[m->message->connection]; }

static void arrive(Loop *l, Rows *rows, const Instant *now) {
    for (Messages m; next(l, rows, &m);) {
        note(l, ARRIVED, &m, now);
        deliver(l, channel_of(l, &m), m.at_once, now);
    }
}

static void note_sending(Loop *l, const Messages *m, const Instant *now) {
    note(l, SENT, m, now);
    if (m->lost) note(l, LOST, m, now);
}

/* Messages between components in continuous time that can be late or lost. */
static void post(Loop *l, Rows *rows, const Instant *now) {
    for (Messages m; next(l, rows, &m);) {
        Channel *c = channel_of(l, &m);
        note_sending(l, &m, now);
        skip(c, m.lost);
        if (m.at_once | m.later) dispatch(l, c, m.at_once | m.later);
        if (!m.at_once) continue;
        note(l, ARRIVED, &m, now);
        deliver(l, c, m.at_once, now);
    }
}

/* Measure values for later samples. */
static void measure(Loop *l, Rows *rows, const Instant *now) {
    for (Messages m; next(l, rows, &m);) {
        note(l, MEASURED, &m, now);
        skip(channel_of(l, &m), m.lost);
        if (m.at_once | m.later) dispatch(l, channel_of(l, &m), m.at_once | m.later);
    }
}

/* A sample reads the values that it measures. */
static void sense(Loop *l, Rows *rows, const Instant *now) {
    for (Messages m; next(l, rows, &m);) {
        Channel *c = channel_of(l, &m);
        Lanes not_lost = m.at_once | m.later;
        note(l, SAMPLED, &m, now);
        if (m.lost) note(l, LOST, &m, now);
        if (!c->read_ahead) skip(c, m.lost);
        if (!not_lost) continue;
        if (c->read_ahead) deliver(l, c, not_lost, now);
        else hand_over(l, c, not_lost, now);
    }
}

/* A sample sends its outputs, which no arrival changes. */
static void send(Loop *l, Rows *rows, const Instant *now) {
    for (Messages m; next(l, rows, &m);) {
        Channel *c = channel_of(l, &m);
        note_sending(l, &m, now);
        skip(c, m.lost);
        if (m.at_once) {
            note(l, ARRIVED, &m, now);
            hand_over(l, c, m.at_once, now);
        }
        if (m.later) dispatch(l, c, m.later);
    }
}

/* -- components ---------------------------------------------------------------------------------------------------- */

/* The rank of the next component among those that are due in some track. */
INLINED int64_t next_rank(Loop *l, const Rows *rows) {
    int64_t rank = INT64_MAX;
    TRACKS(track, rows->tracks) {
        int64_t own = l->components[*rows->next[track - l->tracks]].rank;
        if (own < rank) rank = own;
    }
    return rank;
}

/* The row of a track for a component, if it is next. */
INLINED const int64_t *turn_of(Rows *rows, int64_t track, int64_t index, int64_t width) {
    if (!(rows->tracks >> track & 1) || *rows->next[track] != index) return NULL;
    return row_of(rows, track, width);
}

INLINED void count_steps(Loop *l, Lanes lanes) {
    q_bits steps;
    memcpy(&steps, l->steps, sizeof steps);
    steps -= bits_of(lanes); /* all bits are -1 */
    memcpy(l->steps, &steps, sizeof steps);
}

/* Step a component in continuous time to the instant; the lanes in which it has reached it. */
INLINED Lanes
move(Loop *l, int64_t index, Lanes lanes, q_real begin, q_real length, int64_t until, const Instant *now) {
    pass_on_each(l, &l->components[index].ahead, lanes, now);
    if (!(lanes &= l->alive)) return 0;
    step(l, index, lanes, begin, length, until, now);
    if (!(lanes &= l->alive)) return 0;
    count_steps(l, lanes);
    read_outputs(l, index, lanes, now);
    return lanes;
}

/* Step components in continuous time to the instant; divergence is detected before any value is passed on. */
static void step_continuous(Loop *l, Rows *stepped, const Instant *now) {
    Lanes moved = 0;
    while (stepped->tracks) {
        int64_t index = l->continuous.items[next_rank(l, stepped)], until = 0;
        q_real begin = q_all(0.0), length = q_all(0.0);
        Lanes lanes = 0;
        TRACKS(track, stepped->tracks) {
            Lanes some = track->lanes & l->alive;
            int64_t time = time_of(track), before = track->now[index];
            if (!turn_of(stepped, track - l->tracks, index, 1) || !some || time == before) continue;
            begin = q_select(mask_of(some), q_all((double)before / NANOSECONDS), begin);
            length = q_select(mask_of(some), q_all((double)(time - before) / NANOSECONDS), length);
            track->now[index] = until = time;
            lanes |= some;
        }
        if (lanes) moved |= move(l, index, lanes, begin, length, until, now);
    }
    if (moved & l->alive) look(l, moved & l->alive, now);
}

/* A component reads, steps and sends in the tracks in which it is due; with its own clock it steps in all. */
static void sample(Loop *l, int64_t index, Rows *samples, const Instant *now) {
    const Component *c = &l->components[index];
    Rows received, sent;
    q_real length = q_all(0.0);
    Lanes sampling = 0, stepping = 0;
    int64_t until = 0;
    received.tracks = sent.tracks = 0;
    TRACKS(track, c->by_itself ? now->tracks : samples->tracks) {
        const Schedule *s = &track->schedule;
        int64_t time = time_of(track), end = s->times[track->at + 1], number = track - l->tracks;
        Lanes lanes = track->lanes & l->alive;
        const SampleInstant *due = (const SampleInstant *)turn_of(samples, number, index, WIDTH(SampleInstant));
        if (due) {
            if (!c->by_itself) end = due->next_time;
            add(&received, number, s->exchanged, WIDTH(Message), due->received, due->sent);
            add(&sent, number, s->exchanged, WIDTH(Message), due->sent, due->end);
            sampling |= lanes;
        } else if (!c->by_itself || time == track->stop)
            continue;
        until = end < track->stop ? end : track->stop;
        length = q_select(mask_of(lanes), q_all((double)(until - time) / NANOSECONDS), length);
        stepping |= lanes;
    }
    if (!stepping) return;
    sense(l, &received, now);
    extrapolate_each(l, &c->held, stepping, now);
    if (sampling & l->alive) feed(l, c, sampling & l->alive, now);
    if (!(stepping &= l->alive)) return;
    step(l, index, stepping, READ(c->ratio, 0) * now->t, READ(c->ratio, 0) * length, until, now);
    if (stepping & l->alive) read_outputs(l, index, stepping & l->alive, now);
    send(l, &sent, now);
}

static void sample_each(Loop *l, Rows *samples, const Instant *now) {
    if (l->some_by_themselves)
        for (int64_t i = 0; i < l->sampled.count; i++) sample(l, l->sampled.items[i], samples, now);
    else
        while (samples->tracks) sample(l, l->sampled.items[next_rank(l, samples)], samples, now);
}

/* Set the inputs that a component in continuous time holds over the step that begins now. */
static void hold(Loop *l, int64_t index, Lanes lanes, const Instant *now) {
    const Component *c = &l->components[index];
    extrapolate_each(l, &c->held, lanes, now);
    pass_on_each(l, &c->behind, lanes, now);
    if (lanes & l->alive) feed(l, c, lanes & l->alive, now);
}

static void settle(Loop *l, Rows *stepped, const Instant *now) {
    while (stepped->tracks) {
        int64_t index = l->continuous.items[next_rank(l, stepped)];
        Lanes lanes = 0;
        TRACKS(track, stepped->tracks)
            if (turn_of(stepped, track - l->tracks, index, 1)) lanes |= track->lanes & l->alive;
        hold(l, index, lanes, now);
    }
}

/* Read outputs that follow at once what has been set, and pass them on. */
static void close_instant(Loop *l, const Instant *now) {
    for (int64_t i = 0; i < l->closing.count && l->alive; i++) {
        int64_t index = l->closing.items[i];
        if (index < 0) pass_on(l, &l->channels[~index], l->alive, now);
        else read_outputs(l, index, l->alive, now);
    }
}

/* -- an instant: (1) to (5) of instants.py; (6) and (7) are those of each loop -------------------------------------- */

static void pass(Loop *l, Instant *now) {
    Rows stepped = now->stepped;
    Lanes closes = l->closing.count ? stepped.tracks : 0;
    step_continuous(l, &stepped, now); /* (1) */
    arrive(l, &now->arrivals, now);    /* (2), before messages sent now, which are delivered last if without delay */
    post(l, &now->posted, now);
    measure(l, &now->measured, now);               /* (3) */
    sample_each(l, &now->samples, now);            /* (4) */
    if (l->settles) settle(l, &now->stepped, now); /* (5) */
    if (closes) close_instant(l, now);
}
