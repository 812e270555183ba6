/* The timetable of timetable.py in C, to the bit, for systems that compiled_timetable.py admits: a window's samples and
   messages are drawn, counted, and then laid out in order. Beyond math.h and string.h nothing of a library is used:
   whoever includes this gives memory by `resized`, which is NULL without any. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "timetable_structures.h"

static void *resized(void *memory, size_t size);

typedef struct {
    int64_t *items, count, capacity;
} Numbers;

/* Room for `count` numbers more, behind those that are there; NULL without memory. */
static int64_t *room(Numbers *of, int64_t count) {
    if (of->count + count >= of->capacity) {
        int64_t capacity = 2 * of->capacity > of->count + count ? 2 * of->capacity : of->count + count + 64;
        int64_t *items = resized(of->items, (size_t)capacity * sizeof *items);
        if (!items) return NULL;
        of->items = items, of->capacity = capacity;
    }
    return of->items + of->count;
}

static void drop(Numbers *of, int64_t count) {
    of->count -= count;
    if (of->count == 0) return; /* there may be no items */
    memmove(of->items, of->items + count, (size_t)of->count * sizeof *of->items);
}

/* -- random numbers: numpy's SeedSequence and PCG64 ---------------------------------------------------------------- */

typedef unsigned __int128 Wide;
enum { POOL = 4 };

typedef struct {
    Wide state, increment;
} Generator;

static uint32_t hashed(uint32_t x, uint32_t *constant) {
    x ^= *constant, *constant *= 0x931e8875u, x *= *constant;
    return x ^ x >> 16;
}

static uint32_t mixed(uint32_t x, uint32_t y) {
    uint32_t both = 0xca01f9ddu * x - 0x4973f715u * y;
    return both ^ both >> 16;
}

static void step(Generator *of) {
    const Wide multiplier = (Wide)0x2360ed051fc65da4u << 64 | 0x4385df649fccf645u;
    of->state = of->state * multiplier + of->increment;
}

/* The generator of PCG64(SeedSequence(seed, spawn_key=key)). */
static Generator seeded(const uint32_t *seed, int64_t seed_size, const uint32_t *key, int64_t key_size) {
    uint32_t pool[POOL], constant = 0x43b0d7e5u;
    uint64_t words[4];
    for (int i = 0; i < POOL; i++) pool[i] = hashed(i < seed_size ? seed[i] : 0, &constant);
    for (int from = 0; from < POOL; from++)
        for (int to = 0; to < POOL; to++)
            if (from != to) pool[to] = mixed(pool[to], hashed(pool[from], &constant));
    for (int64_t i = POOL; i < seed_size; i++)
        for (int to = 0; to < POOL; to++) pool[to] = mixed(pool[to], hashed(seed[i], &constant));
    for (int64_t i = 0; i < key_size; i++)
        for (int to = 0; to < POOL; to++) pool[to] = mixed(pool[to], hashed(key[i], &constant));
    constant = 0x8b51f9ddu;
    for (int i = 0; i < 2 * 4; i++) {
        uint32_t x = pool[i % POOL] ^ constant;
        constant *= 0x58f38dedu, x *= constant, x ^= x >> 16;
        words[i / 2] = i % 2 ? words[i / 2] | (uint64_t)x << 32 : x;
    }
    Generator of = {0, ((Wide)words[2] << 64 | words[3]) << 1 | 1};
    step(&of);
    of.state += (Wide)words[0] << 64 | words[1];
    step(&of);
    return of;
}

/* A number in [0, 1). */
static double uniform(Generator *of) {
    step(of);
    uint64_t x = (uint64_t)(of->state >> 64) ^ (uint64_t)of->state;
    unsigned turn = (unsigned)(of->state >> 122);
    x = x >> turn | x << (-turn & 63);
    return (double)(x >> 11) * 0x1p-53;
}

/* -- lateness and loss --------------------------------------------------------------------------------------------- */

typedef struct {
    const Varying *of;
    Generator generator;
    int64_t past;
    bool has_begun, in_burst;
} Stream;

/* `NormalDist().inv_cdf`, by Wichura's AS 241. The logarithm is libm's, as in CPython. */
static double standard_normal(double share) {
    double q = share - 0.5, r, numerator, denominator;
#define POLYNOMIAL(a, b, c, d, e, f, g, h) \
    (((((((a * r + b) * r + c) * r + d) * r + e) * r + f) * r + g) * r + h)
    if (fabs(q) <= 0.425) {
        r = 0.180625 - q * q;
        numerator = q * POLYNOMIAL(
            2.5090809287301226727e+3, 3.3430575583588128105e+4, 6.7265770927008700853e+4, 4.5921953931549871457e+4,
            1.3731693765509461125e+4, 1.9715909503065514427e+3, 1.3314166789178437745e+2, 3.3871328727963666080e+0);
        denominator = POLYNOMIAL(
            5.2264952788528545610e+3, 2.8729085735721942674e+4, 3.9307895800092710610e+4, 2.1213794301586595867e+4,
            5.3941960214247511077e+3, 6.8718700749205790830e+2, 4.2313330701600911252e+1, 1.0);
        return numerator / denominator;
    }
    r = sqrt(-log(q <= 0.0 ? share : 1.0 - share));
    if (r <= 5.0) {
        r = r - 1.6;
        numerator = POLYNOMIAL(
            7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1, 1.27045825245236838258e+0,
            3.64784832476320460504e+0, 5.76949722146069140550e+0, 4.63033784615654529590e+0, 1.42343711074968357734e+0);
        denominator = POLYNOMIAL(
            1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2, 1.48103976427480074590e-1,
            6.89767334985100004550e-1, 1.67638483018380384940e+0, 2.05319162663775882187e+0, 1.0);
    } else {
        r = r - 5.0;
        numerator = POLYNOMIAL(
            2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3, 2.65321895265761230930e-2,
            2.96560571828504891230e-1, 1.78482653991729133580e+0, 5.46378491116411436990e+0, 6.65790464350110377720e+0);
        denominator = POLYNOMIAL(
            2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5,
            7.86869131145613259100e-4, 1.48753612908506148525e-2, 1.36929880922735805310e-1,
            5.99832206555887937690e-1, 1.0);
    }
    return q < 0.0 ? -numerator / denominator : numerator / denominator;
}

/* `cut_normal` of streams.py; `low` and `width` of NORMAL are the shares that it cuts. */
static double cut_normal(const Varying *of, double u) {
    double value = of->mean + standard_normal(of->low + u * of->width) * of->deviation;
    return value < 0.0 ? 0.0 : value > 1.0 ? 1.0 : value;
}

static int64_t cut(const Varying *of, double u) {
    double share = of->low + u * of->width;
    share = share < 0x1p-1074 ? 0x1p-1074 : share > 1.0 - 0x1p-53 ? 1.0 - 0x1p-53 : share;
    double value = floor((of->mean + of->deviation * standard_normal(share)) * 1e9);
    if (!(value > -0x1p62)) return of->least;
    if (!(value < 0x1p62)) return of->most;
    int64_t time = (int64_t)value;
    return time < of->least ? of->least : time > of->most ? of->most : time;
}

static int64_t weighted(const Varying *of, double u) {
    int64_t i = 0;
    while (i < of->last && of->sums[i] <= u) i++;
    return of->values[i];
}

static bool lost_in_burst(Stream *s, double u) {
    const Varying *of = s->of;
    s->in_burst = !s->has_begun ? u < of->mean : s->in_burst ? u >= of->low : u < of->width;
    s->has_begun = true;
    return s->in_burst;
}

static inline int64_t next_of(Stream *s) {
    const Varying *of = s->of;
    if (of->kind == CONSTANT) return of->least;
    if (of->kind == IN_ORDER) return of->values[s->past++ % of->count];
    double u = uniform(&s->generator);
    switch (of->kind) {
    case UNIFORM: return of->least + (int64_t)(u * (double)(of->most - of->least));
    case NORMAL: return (int64_t)(cut_normal(of, u) * (double)of->most);
    case CUT_NORMAL: return cut(of, u);
    case VALUES: return of->values[(int64_t)(u * (double)of->count)];
    case WEIGHTED: return weighted(of, u);
    case BELOW: return u < of->mean;
    default: return lost_in_burst(s, u);
    }
}

/* -- grids --------------------------------------------------------------------------------------------------------- */

typedef struct {
    const Grid *of;
    int64_t k, whole, rest; /* of the next point */
} Points;

static Points points_of(const Grid *of) { return (Points){of, 0, of->offset, of->offset_rest}; }

static int64_t point(const Points *at) { /* half to even */
    int64_t denominator = at->of->denominator, twice = 2 * at->rest;
    return at->whole + (twice > denominator || (twice == denominator && (at->whole & 1)));
}

static int64_t next_point(Points *at) {
    int64_t time = point(at);
    at->k++, at->whole += at->of->period, at->rest += at->of->period_rest;
    if (at->rest >= at->of->denominator) at->rest -= at->of->denominator, at->whole++;
    return time;
}

/* -- the state of a run -------------------------------------------------------------------------------------------- */

typedef struct {
    const Route *of;
    int64_t index;
    Stream delay, late, loss;
    int64_t last; /* arrival or measurement */
    Numbers sent, arrivals; /* of drawn samples, or of the points of a window; `sent` is `measured` into a sample */
    int64_t past, now;      /* messages measured before this window, and in it */
    Numbers flight;         /* on their way, in the order of arrival, FLIGHT numbers each */
    int64_t landing;        /* how many arrive in this window */
} Link;

enum { FLIGHT = 4 }; /* k, sent, arrival, and the instant at which that was decided */

typedef struct {
    const Clock *of;
    Points points;
    Stream late;
    Numbers times;              /* of the drawn samples, and of the next one */
    int64_t first, now, to_end; /* index of the first of these; those in this window before the end, and up to it */
} Task;

typedef struct {
    const Post *of;
    Points points;
    int64_t first; /* index of the first message in this window */
} Poster;

typedef struct { /* those of a window, as in common_timetable.py */
    int64_t *own, *sampled, *samples, *exchanged, *posted, *measured, *arrivals;
    uint8_t *stepped;
} Tables;

/* Rows in the order of their times, one column of a table. */
typedef struct {
    const int64_t *times, *then; /* `then`: NULL, or the column that orders rows of the same time */
    int64_t stride, at, end, first; /* the next row, the end, and the index of the message in row 0 */
    const Link *link;
    const Task *task;
} Run;

typedef struct {
    _Alignas(Wide) const Outline *of; /* so that links may follow it in memory */
    Link *links;
    Task *tasks;
    Poster *posters;
    Run *runs;
    int64_t end, run_count; /* the end of the window */
    Numbers times, masks;          /* of own instants, run by run, and of the components that are stepped to them */
} Timetable;

static Stream stream_of(const Varying *of, const uint32_t *seed, int64_t seed_size) {
    Stream s = {.of = of};
    if (of->kind != CONSTANT && of->kind != IN_ORDER) s.generator = seeded(seed, seed_size, of->key, of->key_size);
    return s;
}

/* Draw the first sample of each task; 0 without memory. */
static int begin_timetable(Timetable *t, const uint32_t *seed, int64_t seed_size) {
    const Outline *of = t->of;
    for (int64_t i = 0; i < of->route_count; i++) {
        const Route *route = &of->routes[i];
        t->links[i].of = route, t->links[i].index = i;
        t->links[i].delay = stream_of(&route->delay, seed, seed_size);
        t->links[i].late = stream_of(&route->late, seed, seed_size);
        t->links[i].loss = stream_of(&route->loss, seed, seed_size);
    }
    for (int64_t i = 0; i < of->post_count; i++)
        t->posters[i].of = &of->posts[i], t->posters[i].points = points_of(&of->posts[i].grid);
    for (int64_t i = 0; i < of->clock_count; i++) {
        Task *task = &t->tasks[i];
        task->of = &of->clocks[i], task->points = points_of(&task->of->grid);
        task->late = stream_of(&task->of->late, seed, seed_size);
        int64_t *times = room(&task->times, 1);
        if (!times) return 0;
        times[0] = next_point(&task->points) + next_of(&task->late), task->times.count = 1;
    }
    return 1;
}

/* -- messages ------------------------------------------------------------------------------------------------------ */

/* Add `sign` times the next numbers of a stream. */
static void spread(Stream *s, int64_t *times, int64_t count, int64_t sign) {
    const Varying *of = s->of;
    if (of->kind == CONSTANT) {
        for (int64_t i = 0; of->least && i < count; i++) times[i] += sign * of->least;
    } else if (of->kind == UNIFORM) { /* the usual one, with its generator in registers */
        Generator generator = s->generator;
        double width = (double)(of->most - of->least);
        for (int64_t i = 0; i < count; i++) times[i] += sign * (of->least + (int64_t)(uniform(&generator) * width));
        s->generator = generator;
    } else
        for (int64_t i = 0; i < count; i++) times[i] += sign * next_of(s);
}

static void lose(Stream *s, int64_t *arrivals, int64_t count) {
    for (int64_t i = 0; s->of->kind != CONSTANT && i < count; i++)
        if (next_of(s)) arrivals[i] = -1;
}

/* No message overtakes another, and a lost one hinders none. */
static void put_in_order(Link *link, int64_t *times, int64_t count) {
    int64_t last = link->last;
    for (int64_t i = 0; i < count; i++) {
        last = times[i] > last ? times[i] : last;
        times[i] = times[i] < 0 ? -1 : last;
    }
    link->last = last;
}

static void draw_arrivals(Link *link, const int64_t *sent, int64_t *arrivals, int64_t count) {
    memcpy(arrivals, sent, (size_t)count * sizeof *sent);
    spread(&link->delay, arrivals, count, 1);
    spread(&link->late, arrivals, count, 1);
    lose(&link->loss, arrivals, count);
    put_in_order(link, arrivals, count);
}

/* When messages are measured for samples at these times. */
static void draw_measurements(Link *link, const int64_t *times, int64_t *measured, int64_t *arrivals, int64_t count) {
    memcpy(measured, times, (size_t)count * sizeof *times);
    memcpy(arrivals, times, (size_t)count * sizeof *times);
    spread(&link->delay, measured, count, -1);
    spread(&link->late, measured, count, -1);
    for (int64_t i = 0; i < count; i++) measured[i] = measured[i] < 0 ? 0 : measured[i];
    put_in_order(link, measured, count);
    lose(&link->loss, arrivals, count);
}

static int draw_messages(Link *link, const int64_t *times, int64_t count, bool are_measured) {
    int64_t *sent = room(&link->sent, count), *arrivals = room(&link->arrivals, count);
    if (!sent || !arrivals) return 0;
    link->sent.count += count, link->arrivals.count += count;
    if (are_measured)
        draw_measurements(link, times, sent, arrivals, count);
    else {
        memcpy(sent, times + (link->of->jacobi != 0), (size_t)count * sizeof *sent);
        draw_arrivals(link, sent, arrivals, count);
    }
    return 1;
}

/* Add the points before `end`, and `least` of them at the least. */
static int add_points(Points *points, Numbers *times, int64_t end, int64_t least) {
    for (int64_t count = 0; count < least || point(points) < end; count++) {
        if (!room(times, 1)) return 0;
        times->items[times->count++] = next_point(points);
    }
    return 1;
}

/* Draw samples until no later one affects anything before the end of the window. */
static int draw_samples(Timetable *t, Task *task) {
    const Clock *of = task->of;
    int64_t drawn = task->times.count - 1;
    while (task->times.items[task->times.count - 1] - of->ahead < t->end) {
        int64_t first = task->times.count;
        if (!add_points(&task->points, &task->times, t->end + of->ahead, 1)) return 0;
        spread(&task->late, task->times.items + first, task->times.count - first, 1);
    }
    const int64_t *times = task->times.items + drawn;
    int64_t count = task->times.count - 1 - drawn;
    for (int64_t i = 0; i < of->incoming_count; i++)
        if (!draw_messages(&t->links[of->incoming[i]], times, count, true)) return 0;
    for (int64_t i = 0; i < of->outgoing_count; i++)
        if (!draw_messages(&t->links[of->outgoing[i]], times, count, false)) return 0;
    return 1;
}

static int draw_points(Timetable *t, Poster *poster) {
    Link *link = &t->links[poster->of->connection];
    poster->first = poster->points.k, link->sent.count = 0;
    if (!add_points(&poster->points, &link->sent, t->end, 0)) return 0;
    link->arrivals.count = 0;
    if (!room(&link->arrivals, link->sent.count)) return 0;
    link->arrivals.count = link->sent.count;
    draw_arrivals(link, link->sent.items, link->arrivals.items, link->sent.count);
    return 1;
}

/* Messages that are decided at these instants and arrive later are on their way. */
static int set_out(Link *link, const int64_t *times, int64_t first, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        int64_t arrival = link->arrivals.items[i], *message;
        if (arrival <= times[i]) continue;
        if (!(message = room(&link->flight, FLIGHT))) return 0;
        message[0] = first + i, message[1] = link->sent.items[i], message[2] = arrival, message[3] = times[i];
        link->flight.count += FLIGHT;
    }
    return 1;
}

/* The number of times before `end`, which are most of them. */
static int64_t count_before(const int64_t *times, int64_t count, int64_t end) {
    while (count && times[count - 1] >= end) count--;
    return count;
}

/* Draw the next window, which ends at `end`, and count its rows, of own instants at most; 0 without memory. */
static int draw_window(Timetable *t, int64_t end, Counts *counts) {
    const Outline *of = t->of;
    *counts = (Counts){0};
    t->end = end;
    for (int64_t i = 0; i < of->clock_count; i++)
        if (!draw_samples(t, &t->tasks[i])) return 0;
    for (int64_t i = 0; i < of->post_count; i++) {
        Poster *poster = &t->posters[i];
        Link *link = &t->links[poster->of->connection];
        if (!draw_points(t, poster) || !set_out(link, link->sent.items, poster->first, link->sent.count)) return 0;
        counts->posted += link->sent.count;
    }
    for (int64_t i = 0; i < of->clock_count; i++) {
        Task *task = &t->tasks[i];
        const Clock *clock = task->of;
        const int64_t *times = task->times.items;
        task->to_end = count_before(times, task->times.count - 1, end);
        task->now = count_before(times, task->to_end, of->stop);
        for (int64_t j = 0; j < clock->incoming_count; j++) {
            Link *link = &t->links[clock->incoming[j]];
            if (!link->of->read_ahead) continue;
            link->now = count_before(link->sent.items, link->sent.count, end) - link->past;
            counts->measured += link->now;
        }
        for (int64_t j = 0; j < clock->outgoing_count; j++)
            if (!set_out(&t->links[clock->outgoing[j]], times, task->first, task->now)) return 0;
        counts->sampled += task->now, counts->samples += task->now, counts->own += task->to_end;
        counts->exchanged += task->now * (clock->incoming_count + clock->outgoing_count);
    }
    for (int64_t i = 0; i < of->route_count; i++) {
        Link *link = &t->links[i];
        const int64_t *flight = link->flight.items;
        for (link->landing = 0; link->landing < link->flight.count / FLIGHT; link->landing++)
            if (flight[FLIGHT * link->landing + 2] >= end) break;
        counts->arrivals += link->landing;
    }
    counts->own += counts->posted + counts->measured + counts->arrivals;
    return 1;
}

/* -- tables in order ----------------------------------------------------------------------------------------------- */

static void add_run(Timetable *t, Run run) {
    if (run.at < run.end) t->runs[t->run_count++] = run;
}

/* The run with the earliest row, of several the first; NULL if no row is left. */
static inline Run *earliest(Timetable *t) {
    Run *found = NULL;
    int64_t time = 0, then = 0;
    if (t->run_count == 1) return t->runs->at < t->runs->end ? t->runs : NULL;
    for (Run *run = t->runs; run < t->runs + t->run_count; run++) {
        if (run->at == run->end) continue;
        int64_t own = run->times[run->stride * run->at], own_then = run->then ? run->then[run->stride * run->at] : 0;
        if (!found || own < time || (own == time && own_then < then)) found = run, time = own, then = own_then;
    }
    return found;
}

static int64_t *put_message(int64_t *into, const Link *link, int64_t k, int64_t sent, int64_t arrival) {
    into[0] = link->index, into[1] = k, into[2] = sent, into[3] = arrival;
    return into + 4;
}

/* Lay out the messages of runs over the columns of links. */
static void put_messages(Timetable *t, int64_t *into) {
    for (Run *run; (run = earliest(t)); run->at++)
        into = put_message(
            into, run->link, run->first + run->at, run->link->sent.items[run->at], run->link->arrivals.items[run->at]);
}

static void put_posted(Timetable *t, int64_t *into) {
    t->run_count = 0;
    for (const Poster *poster = t->posters; poster < t->posters + t->of->post_count; poster++) {
        const Link *link = &t->links[poster->of->connection];
        add_run(t, (Run){link->sent.items, .stride = 1, .end = link->sent.count, .first = poster->first, .link = link});
    }
    put_messages(t, into);
}

static void put_measured(Timetable *t, int64_t *into) {
    t->run_count = 0;
    for (const Task *task = t->tasks; task < t->tasks + t->of->clock_count; task++)
        for (int64_t i = 0; i < task->of->incoming_count; i++) {
            const Link *link = &t->links[task->of->incoming[i]];
            if (!link->of->read_ahead) continue;
            add_run(t, (Run){link->sent.items, .stride = 1, .at = link->past, .end = link->past + link->now,
                             .first = task->first, .link = link});
        }
    put_messages(t, into);
}

/* Lay out the messages of one task from row `at` to before `end` of its samples, in the order of exchange. */
static void put_exchanged(const Timetable *t, const Task *task, int64_t at, int64_t end, int64_t *into) {
    int64_t incoming = task->of->incoming_count, count = incoming + task->of->outgoing_count;
    for (int64_t i = 0; i < count; i++) {
        const Link *link = &t->links[i < incoming ? task->of->incoming[i] : task->of->outgoing[i - incoming]];
        const int64_t *sent = link->sent.items, *arrivals = link->arrivals.items;
        int64_t *row = into + 4 * i;
        for (int64_t j = at; j < end; j++, row += 4 * count)
            put_message(row, link, task->first + j, sent[j], arrivals[j]);
    }
}

static void put_samples(Timetable *t, const Tables *into) {
    int64_t *sampled = into->sampled, *samples = into->samples, exchanged = 0;
    t->run_count = 0;
    for (const Task *task = t->tasks; task < t->tasks + t->of->clock_count; task++)
        add_run(t, (Run){task->times.items, .stride = 1, .end = task->now, .task = task});
    bool is_alone = t->run_count == 1;
    if (is_alone) put_exchanged(t, t->runs->task, 0, t->runs->end, into->exchanged);
    for (Run *run; (run = earliest(t)); run->at++, sampled++, samples += 5) {
        const Clock *of = run->task->of;
        int64_t at = run->at, received = exchanged, sent = received + of->incoming_count;
        if (!is_alone) put_exchanged(t, run->task, at, at + 1, into->exchanged + 4 * exchanged);
        exchanged = sent + of->outgoing_count;
        *sampled = run->times[at];
        samples[0] = of->component, samples[1] = run->times[at + 1];
        samples[2] = received, samples[3] = sent, samples[4] = exchanged;
    }
}

static void add_landing(Timetable *t, int64_t connection) {
    const Link *link = &t->links[connection];
    add_run(t, (Run){link->flight.items + 2, link->flight.items + 3, FLIGHT, .end = link->landing, .link = link});
}

/* Those at the same time in the order in which they were decided, and of links: posts, then tasks. */
static void put_arrivals(Timetable *t, int64_t *into) {
    t->run_count = 0;
    for (int64_t i = 0; i < t->of->post_count; i++) add_landing(t, t->of->posts[i].connection);
    for (int64_t i = 0; i < t->of->clock_count; i++)
        for (int64_t j = 0; j < t->of->clocks[i].outgoing_count; j++) add_landing(t, t->of->clocks[i].outgoing[j]);
    for (Run *run; (run = earliest(t)); run->at++) {
        const int64_t *message = run->link->flight.items + FLIGHT * run->at;
        into = put_message(into, run->link, message[0], message[1], message[2]);
    }
}

static uint64_t bit(int64_t place) { return place < 0 ? 0 : (uint64_t)1 << place; }

/* Add the instants behind those that are noted: one more run. */
static void end_run(Timetable *t, const int64_t *end) {
    int64_t first = t->times.count;
    t->times.count = end - t->times.items;
    add_run(t, (Run){t->times.items, .stride = 1, .at = first, .end = t->times.count});
}

/* Note the instants of a task's samples, and of messages that are measured for later ones. */
static void note_task(Timetable *t, const Task *task) {
    const Clock *of = task->of;
    int64_t *time = t->times.items + t->times.count, *stepped = t->masks.items + t->times.count;
    uint64_t read = 0;
    for (int64_t i = 0; i < of->incoming_count; i++) {
        const Route *route = &t->of->routes[of->incoming[i]];
        if (!route->read_ahead) read |= bit(route->sender);
    }
    for (int64_t i = 0; i < task->to_end; i++) {
        time[i] = task->times.items[i];
        stepped[i] = i < task->now ? (int64_t)read : 0;
    }
    for (int64_t j = 0; j < of->outgoing_count; j++) {
        const Link *link = &t->links[of->outgoing[j]];
        int64_t receiver = (int64_t)bit(link->of->receiver);
        for (int64_t i = 0; i < task->now; i++) stepped[i] |= link->arrivals.items[i] == time[i] ? receiver : 0;
    }
    end_run(t, time + task->to_end);
    for (int64_t i = 0; i < of->incoming_count; i++) {
        const Link *link = &t->links[of->incoming[i]];
        if (!link->of->read_ahead) continue;
        time = t->times.items + t->times.count, stepped = t->masks.items + t->times.count;
        for (int64_t j = link->past; j < link->past + link->now; j++)
            *time++ = link->sent.items[j], *stepped++ = (int64_t)bit(link->of->sender);
        end_run(t, time);
    }
}

/* Note the instants at which messages arrive: those of a post at once, then all others. */
static void note_arrivals(Timetable *t, const int64_t *arrivals, int64_t count) {
    for (const Poster *poster = t->posters; poster < t->posters + t->of->post_count; poster++) {
        const Link *link = &t->links[poster->of->connection];
        int64_t *time = t->times.items + t->times.count, *stepped = t->masks.items + t->times.count;
        for (int64_t i = 0; i < link->sent.count; i++)
            if (link->arrivals.items[i] == link->sent.items[i])
                *time++ = link->sent.items[i], *stepped++ = (int64_t)bit(link->of->receiver);
        end_run(t, time);
    }
    int64_t *time = t->times.items + t->times.count, *stepped = t->masks.items + t->times.count;
    for (int64_t i = 0; i < count; i++)
        *time++ = arrivals[4 * i + 3], *stepped++ = (int64_t)bit(t->of->routes[arrivals[4 * i]].receiver);
    end_run(t, time);
}

/* Own instants, each once; the result is their number. */
static int64_t put_own_instants(Timetable *t, const Tables *into, const Counts *counts) {
    int64_t count = t->of->continuous_count, rows = 0, last = -1;
    const int64_t *masks = t->masks.items;
    uint8_t *row = into->stepped;
    t->run_count = t->times.count = 0;
    for (const Task *task = t->tasks; task < t->tasks + t->of->clock_count; task++) note_task(t, task);
    note_arrivals(t, into->arrivals, counts->arrivals);
    for (Run *run; (run = earliest(t)); run->at++) {
        uint64_t stepped = (uint64_t)masks[run->at];
        int64_t time = run->times[run->at];
        if (time != last) {
            row = into->stepped + rows * count, into->own[rows++] = last = time;
            for (int64_t i = 0; i < count; i++) row[i] = stepped >> i & 1;
        } else
            for (int64_t i = 0; i < count; i++) row[i] |= stepped >> i & 1;
    }
    return rows;
}

static void drop_past(Timetable *t) {
    for (Task *task = t->tasks; task < t->tasks + t->of->clock_count; task++) {
        int64_t past = task->to_end, incoming = task->of->incoming_count;
        for (int64_t i = 0; i < incoming + task->of->outgoing_count; i++) {
            Link *link = &t->links[i < incoming ? task->of->incoming[i] : task->of->outgoing[i - incoming]];
            drop(&link->sent, past), drop(&link->arrivals, past);
            if (link->of->read_ahead) link->past += link->now - past;
        }
        drop(&task->times, past);
        task->first += past;
    }
    for (int64_t i = 0; i < t->of->route_count; i++) drop(&t->links[i].flight, FLIGHT * t->links[i].landing);
}

/* The tables one after another in the order of their counts, then a byte for each own instant and component. */
static Tables tables_in(int64_t *memory, const Counts *counts) {
    Tables in;
    in.own = memory;
    in.sampled = in.own + counts->own;
    in.samples = in.sampled + counts->sampled;
    in.exchanged = in.samples + 5 * counts->samples;
    in.posted = in.exchanged + 4 * counts->exchanged;
    in.measured = in.posted + 4 * counts->posted;
    in.arrivals = in.measured + 4 * counts->measured;
    in.stepped = (uint8_t *)(in.arrivals + 4 * counts->arrivals);
    return in;
}

/* Lay out the tables of the window that was drawn; the result is the number of own instants, -1 without memory. */
static int64_t lay_out(Timetable *t, int64_t *memory, const Counts *counts) {
    Tables tables = tables_in(memory, counts), *into = &tables;
    t->times.count = 0;
    if (!room(&t->times, counts->own) || !room(&t->masks, counts->own)) return -1;
    put_posted(t, into->posted);
    put_measured(t, into->measured);
    put_samples(t, into);
    put_arrivals(t, into->arrivals);
    int64_t rows = put_own_instants(t, into, counts);
    drop_past(t);
    return rows;
}

/* -- schedules, as in instant_arrays.py ---------------------------------------------------------------------------- */

/* Lay out the instants of a window and the rows that each has in its tables; the result is their number. */
static int64_t lay_out_schedule(const Window *w) {
    int64_t count = w->continuous_count, n = 0, i = 0, j = 0;
    int64_t moved = 0, posted = 0, measured = 0, arrived = 0, sampled = 0; /* rows so far */
    for (;; n++) {
        w->stepped_at[n] = moved, w->posted_at[n] = posted, w->measured_at[n] = measured;
        w->arrivals_at[n] = arrived, w->samples_at[n] = sampled;
        if (i == w->regular_count && j == w->own_count) return n;
        int64_t regular = i < w->regular_count ? w->regular[i] : INT64_MAX;
        int64_t own = j < w->own_count ? w->own[j] : INT64_MAX, time = regular < own ? regular : own;
        const uint8_t *one = w->regular_stepped + i * count, *other = w->own_stepped + j * count;
        w->times[n] = time;
        for (int64_t k = 0; k < count; k++)
            if ((regular == time && one[k]) || (own == time && other[k])) w->stepped[moved++] = w->continuous[k];
        i += regular == time, j += own == time;
        while (posted < w->posted_count && w->posted[4 * posted + 2] == time) posted++;
        while (measured < w->measured_count && w->measured[4 * measured + 2] == time) measured++;
        while (arrived < w->arrivals_count && w->arrivals[4 * arrived + 3] == time) arrived++;
        while (sampled < w->samples_count && w->sampled[sampled] == time) sampled++;
    }
}
