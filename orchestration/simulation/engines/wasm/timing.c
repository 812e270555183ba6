/* The instants, messages and random numbers of runs in a page: timetable.h, filled from settings, with the regular
   instants of common_timetable.py and the normal numbers of numpy. */

#define sizes timetable_sizes
#include "timetable.c"
#undef sizes
#include "live.h"
#include "timing.h"

/* -- decimal times ------------------------------------------------------------------------------------------------- */

static Wide power_of_ten(int64_t exponent) {
    Wide power = 1;
    for (int64_t i = 0; i < exponent; i++) power *= 10;
    return power;
}

/* digits · 10^exponent / divisor as whole numbers and a rest in parts of the divisor; 0 if these do not fit. */
static int in_parts(int64_t digits, int64_t exponent, int64_t divisor, int64_t *whole, int64_t *rest) {
    if (exponent > 18) return digits == 0 ? (*whole = *rest = 0, 1) : 0;
    Wide number = (Wide)digits * power_of_ten(exponent);
    if (number / (uint64_t)divisor >= (Wide)1 << 62) return 0;
    *whole = (int64_t)(number / (uint64_t)divisor), *rest = (int64_t)(number % (uint64_t)divisor);
    return 1;
}

/* Rounded, half to even; the times that are allowed are not negative and fit. */
int64_t as_nanoseconds(const Setting *s) {
    int64_t exponent = s->exponent + 9, whole, rest, divisor;
    if (s->digits == 0 || exponent < -18) return 0;
    divisor = exponent < 0 ? (int64_t)power_of_ten(-exponent) : 1;
    if (!in_parts(s->digits, exponent < 0 ? 0 : exponent, divisor, &whole, &rest)) return INT64_MAX / 4;
    return whole + (2 * (Wide)rest > (Wide)divisor || (2 * (Wide)rest == (Wide)divisor && (whole & 1)));
}

/* The grid of (offset + k·period) / ratio; without a ratio it is 1. 0 if its parts of a nanosecond are too fine. */
int grid_of(const Setting *offset, const Setting *period, const Setting *ratio, int64_t parts[5]) {
    const Setting zero = {0.0, 0, 0}, one = {1.0, 1, 0};
    offset = offset ? offset : &zero, ratio = ratio ? ratio : &one;
    int64_t late = offset->digits ? offset->exponent + 9 - ratio->exponent : 0;
    int64_t far = period->exponent + 9 - ratio->exponent, least = late < far ? late : far, more = least < 0 ? -least : 0;
    if (more > 18 || power_of_ten(more) * (uint64_t)ratio->digits >= (Wide)1 << 62) return 0;
    parts[4] = (int64_t)(power_of_ten(more) * (uint64_t)ratio->digits);
    return in_parts(offset->digits, late + more, parts[4], parts, parts + 1) &&
           in_parts(period->digits, far + more, parts[4], parts + 2, parts + 3);
}

/* -- an outline of settings ---------------------------------------------------------------------------------------- */

typedef struct {
    Route routes[ROUTES + 1];
    Clock clocks[CLOCKS + 1];
    Post posts[POSTS + 1];
    Grid points[POINTS + 1];
    Outline outline;
    Timetable *table;
    uint32_t seed[2];
    Numbers regular, stepped, tables;
    Numbers noise[ROUTES + 1], drawn[DRAWN + 1];
} Lane;

static Lane lanes[L];

#if TIMING_IS_GIVEN

int begin_timing(int number, const Setting *s, int64_t *first_samples, Refusal *refusal) {
    Lane *lane = &lanes[number];
    (void)refusal;
    uint64_t seed = (uint64_t)s[SEED_SETTING].digits * (uint64_t)power_of_ten(s[SEED_SETTING].exponent);
    lane->seed[0] = (uint32_t)seed, lane->seed[1] = (uint32_t)(seed >> 32);
    memcpy(first_samples, given_first_samples, sizeof given_first_samples);
    return 1;
}

int draw_timing(int number, Drawn *into) {
    (void)number;
    *into = (Drawn){
        given_regular, given_own, (const bool *)given_regular_stepped, (const bool *)given_own_stepped, GIVEN_REGULAR,
        GIVEN_OWN, given_posted, given_measured, given_arrivals, given_exchanged, given_samples, given_sampled,
        GIVEN_POSTED, GIVEN_MEASURED, GIVEN_ARRIVALS, GIVEN_SAMPLES, GIVEN_EXCHANGED};
    return 1;
}

#else

static Varying constant(int64_t value) { return (Varying){.kind = CONSTANT, .least = value}; }

static Varying drawn_by(int64_t kind, const Key *key) {
    return (Varying){.kind = kind, .key = key->words, .key_size = key->size};
}

static Varying lateness(const Setting *longest, int is_normal, const Key *key) {
    int64_t most = as_nanoseconds(longest);
    if (most == 0) return constant(0);
    Varying of = drawn_by(is_normal ? NORMAL : UNIFORM, key);
    of.most = most;
    if (is_normal) of.mean = 0.5, of.deviation = 1.0 / 6.0, of.low = LOWEST, of.width = HIGHEST - LOWEST;
    return of;
}

static Varying losses(double loss, double burst_length, const Key *key) {
    if (loss == 0.0) return constant(0);
    Varying of = drawn_by(burst_length == 0.0 || loss == 1.0 ? BELOW : BURSTS, key);
    of.mean = loss;
    if (of.kind == BURSTS) of.low = 1.0 / burst_length, of.width = loss / (burst_length * (1.0 - loss));
    return of;
}

static const Setting *setting_of(const Setting *settings, int32_t index) { return index < 0 ? NULL : settings + index; }

static int set_grid(Grid *of, const Setting *offset, const Setting *period, const Setting *ratio) {
    int64_t parts[5];
    if (!grid_of(offset, period, ratio, parts)) return 0;
    *of = (Grid){parts[0], parts[1], parts[2], parts[3], parts[4]};
    return 1;
}

static int refuse(Refusal *refusal, int reason, int setting) {
    *refusal = (Refusal){reason, setting};
    return 0;
}

/* How many points a grid has up to the end, about. */
static double count_of(const Grid *of, int64_t stop) {
    return (double)stop / ((double)of->period + (double)of->period_rest / (double)of->denominator) + 1.0;
}

/* Draw the first samples; 0 with the refusal if the settings are. */
int begin_timing(int number, const Setting *s, int64_t *first_samples, Refusal *refusal) {
    Lane *lane = &lanes[number];
    int64_t stop = as_nanoseconds(s + STOP_TIME_SETTING);
    uint64_t seed = (uint64_t)s[SEED_SETTING].digits * (uint64_t)power_of_ten(s[SEED_SETTING].exponent);
    double instants = 1.0;
    if (lane->table) timetable_free(lane->table);
    lane->table = NULL;
    for (int i = 0; i < ROUTES; i++) {
        const RouteTable *of = &route_table[i];
        double burst = of->burst_length < 0 ? 0.0 : s[of->burst_length].value;
        lane->routes[i] = (Route){
            of->sender, of->receiver, of->jacobi, of->read_ahead, constant(as_nanoseconds(s + of->delay)),
            lateness(s + of->late, of->is_normal, &of->late_key), losses(s[of->loss].value, burst, &of->loss_key)};
    }
    for (int i = 0; i < CLOCKS; i++) {
        const ClockTable *of = &clock_table[i];
        Clock *clock = &lane->clocks[i];
        *clock = (Clock){.component = of->component, .incoming = of->incoming, .outgoing = of->outgoing,
                         .incoming_count = of->incoming_count, .outgoing_count = of->outgoing_count,
                         .late = lateness(s + of->jitter, of->is_normal, &of->key)};
        if (!set_grid(&clock->grid, s + of->offset, s + of->period, s + of->ratio))
            return refuse(refusal, TOO_FINE, of->period);
        if (clock->grid.period < 1) return refuse(refusal, TOO_SHORT, of->period);
        if (!(s[of->jitter].value < s[of->period].value / s[of->ratio].value))
            return refuse(refusal, NOT_WITHIN_PERIOD, of->jitter);
        for (int64_t j = 0; j < of->incoming_count; j++) {
            const RouteTable *route = &route_table[of->incoming[j]];
            int64_t longest = as_nanoseconds(s + route->delay) + as_nanoseconds(s + route->late);
            clock->ahead = longest > clock->ahead ? longest : clock->ahead;
            if ((double)longest / 1e9 > 1e6 * s[of->period].value) return refuse(refusal, ABOVE_MOST, route->delay);
        }
        instants += (1.0 + (double)(of->incoming_count + of->outgoing_count)) * count_of(&clock->grid, stop);
        if (instants > MOST_INSTANTS) return refuse(refusal, TOO_MANY_INSTANTS, of->period);
    }
    for (int i = 0; i < POINTS; i++) {
        const PointsTable *of = &points_table[i];
        if (!set_grid(&lane->points[i], NULL, s + of->period, NULL)) return refuse(refusal, TOO_FINE, of->period);
        if (lane->points[i].period < 1) return refuse(refusal, TOO_SHORT, of->period);
        instants += count_of(&lane->points[i], stop);
        if (instants > MOST_INSTANTS) return refuse(refusal, TOO_MANY_INSTANTS, of->period);
    }
    for (int i = 0; i < POSTS; i++) {
        lane->posts[i] = (Post){.connection = post_table[i].connection};
        if (!set_grid(&lane->posts[i].grid, NULL, s + post_table[i].step, NULL))
            return refuse(refusal, TOO_FINE, post_table[i].step);
    }
    lane->outline = (Outline){lane->routes, lane->clocks, lane->posts, ROUTES, CLOCKS, POSTS, CONTINUOUS, stop};
    lane->seed[0] = (uint32_t)seed, lane->seed[1] = (uint32_t)(seed >> 32);
    lane->table = timetable_new(&lane->outline, lane->seed, 2, first_samples);
    return lane->table ? 1 : refuse(refusal, WITHOUT_MEMORY, -1);
}

/* -- all of a run -------------------------------------------------------------------------------------------------- */

/* The regular instants: points, changes of sources, the start and the end; 0 without memory. */
static int draw_regular(Lane *lane) {
    Points points[POINTS + 1];
    int64_t stop = lane->outline.stop;
    lane->regular.count = lane->stepped.count = 0;
    for (int i = 0; i < POINTS; i++) {
        points[i] = points_of(&lane->points[i]);
        for (int k = 0; k < points_table[i].first; k++) next_point(&points[i]);
    }
    for (int64_t time = 0, first = 1; first || time <= stop; first = 0) {
        uint64_t stepped = time == stop ? ~(uint64_t)0 : 0;
        int64_t next = time < stop ? stop : INT64_MAX;
        for (int i = 0; i < POINTS; i++) {
            int64_t own = point(&points[i]);
            if (own == time) stepped |= points_table[i].stepped, next_point(&points[i]), own = point(&points[i]);
            if (own < next) next = own;
        }
        if (!room(&lane->regular, 1) || !room(&lane->stepped, CONTINUOUS + 8)) return 0;
        bool *row = (bool *)lane->stepped.items + lane->regular.count * CONTINUOUS;
        for (int i = 0; i < CONTINUOUS; i++) row[i] = stepped >> i & 1;
        lane->stepped.count = (lane->regular.count + 1) * CONTINUOUS / 8 + 1;
        lane->regular.items[lane->regular.count++] = time;
        if (time == stop) break;
        time = next;
    }
    return 1;
}

/* All instants and messages of a run; 0 without memory. */
int draw_timing(int number, Drawn *into) {
    Lane *lane = &lanes[number];
    Counts counts;
    if (!draw_regular(lane) || !draw_window(lane->table, lane->outline.stop + 1, &counts)) return 0;
    int64_t size = counts.own + counts.sampled + 5 * counts.samples + counts.own * CONTINUOUS / 8 + 8;
    size += 4 * (counts.exchanged + counts.posted + counts.measured + counts.arrivals);
    lane->tables.count = 0;
    if (!room(&lane->tables, size)) return 0;
    int64_t rows = lay_out(lane->table, lane->tables.items, &counts);
    Tables in = tables_in(lane->tables.items, &counts);
    *into = (Drawn){
        lane->regular.items, in.own, (const bool *)lane->stepped.items, (const bool *)in.stepped, lane->regular.count,
        rows, in.posted, in.measured, in.arrivals, in.exchanged, in.samples, in.sampled, counts.posted,
        counts.measured, counts.arrivals, counts.samples, counts.exchanged};
    return rows >= 0;
}

#endif

/* -- normal numbers, as numpy: the ziggurat of Marsaglia and Tsang ---------------------------------------------------- */

#if NORMALS
static uint64_t bits_of(Generator *of) {
    step(of);
    uint64_t x = (uint64_t)(of->state >> 64) ^ (uint64_t)of->state;
    unsigned turn = (unsigned)(of->state >> 122);
    return x >> turn | x << (-turn & 63);
}

static double normal(Generator *of) {
    for (;;) {
        uint64_t bits = bits_of(of), layer = bits & 0xff, place = bits >> 9 & 0xfffffffffffff;
        double x = (double)place * normal_widths[layer];
        if (bits >> 8 & 1) x = -x;
        if (place < normal_inner[layer]) return x;
        if (layer) {
            double low = normal_heights[layer], between = normal_heights[layer - 1] - low;
            if (between * uniform(of) + low < exp(-0.5 * x * x)) return x;
        } else
            for (;;) { /* the tail; log1p is that of the library */
                double far = -NORMAL_TAIL_INVERSE * log1p(-uniform(of)), y = -log1p(-uniform(of));
                if (y + y > far * far) return place >> 8 & 1 ? -(NORMAL_TAIL + far) : NORMAL_TAIL + far;
            }
    }
}

static const double *normals(Lane *lane, const Key *key, Numbers *into, int64_t count) {
    Generator generator = seeded(lane->seed, 2, key->words, key->size);
    into->count = 0;
    if (!room(into, count)) return NULL;
    double *values = (double *)into->items;
    for (int64_t i = 0; i < count; i++) values[i] = normal(&generator);
    return values;
}

const double *draw_noise(int number, int connection, int64_t count) {
    Lane *lane = &lanes[number];
    return normals(lane, &route_table[connection].noise_key, &lane->noise[connection], count);
}

const double *draw_source(int number, int drawn, int64_t rows) {
    Lane *lane = &lanes[number];
    return normals(lane, &drawn_table[drawn].key, &lane->drawn[drawn], rows * drawn_table[drawn].width);
}
#endif
