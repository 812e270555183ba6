/* A system that runs in a page: its components, batch.c and its timing in one module. The page sets the settings of each
   lane, calls `fly`, and reads results and rows. What a run does before its first instant is that of initialisation.py
   and initial.py. */

#include "batch.c"

#include "live.h"

typedef void DoStep(double *, const uint64_t *, const double *, const double *, int32_t *, const uint8_t *);
#define DECLARE(c) \
    DoStep c##_do_step; \
    void c##_begin(double *); \
    int c##_places(void); \
    void c##_initialise(double *, const uint64_t *, const double *, int32_t *); \
    __attribute__((weak)) Steps c##_do_steps;
#define COMPONENT(c) c##_do_step, c##_do_steps, c##_begin, c##_initialise, c##_places

typedef struct {
    DoStep *step;
    Steps *steps; /* NULL: it has no function for several */
    void (*begin)(double *);
    void (*initialise)(double *, const uint64_t *, const double *, int32_t *);
    int (*places)(void);
    const int64_t *outputs;
    int64_t connected, variables;
    List held, ahead, behind;
    int64_t rank, by_itself;
    const Fed *fed, *all_fed; /* inputs from sources: those that change, and all */
    int64_t fed_count, all_fed_count;
    const uint8_t *read;
    int32_t ratio, clock, waits; /* its setting, its place among the sampled ones; -1 for none */
} ComponentTable;

typedef struct {
    int64_t sender, receiver;
    const int64_t *start, *end, *kinds;
    const double *low, *high;
    int64_t size;
    int32_t plain, as_they_are, noisy, rounds, converts, extrapolates, read_ahead;
    int32_t sigma, quantum, scale, offset; /* settings, the first two of the first variable */
    int32_t table;
} ConnectionTable;

typedef struct {
    const int64_t *connections;
    int64_t count;
} GroupTable;

typedef struct { /* a setting that is a variable of a component */
    int32_t component, place, setting;
} ParameterTable;

/* Sources: the functions that system.h calls. */
static int64_t row_at(const double *times, int64_t count, double t) { /* the last row not after t; -1: none */
    int64_t low = 0, high = count;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (times[middle] <= t) low = middle + 1;
        else high = middle;
    }
    return low - 1;
}

static __attribute__((unused)) void
on_line(const double *times, const double *rows, int64_t count, int64_t width, double t, double *into) {
    int64_t i = row_at(times, count, t);
    i = i < 0 ? 0 : i > count - 2 ? count - 2 : i;
    double share = (t - times[i]) / (times[i + 1] - times[i]);
    share = share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share;
    for (int64_t k = 0; k < width; k++) {
        double before = rows[i * width + k], more = share * (rows[(i + 1) * width + k] - before);
        into[k] = before + more;
    }
}

static __attribute__((unused)) void
on_step(const double *times, const double *rows, int64_t count, int64_t width, double t, double *into) {
    int64_t i = row_at(times, count, t);
    memcpy(into, rows + (i < 0 ? 0 : i) * width, (size_t)width * sizeof *into);
}

#define ONE(function, x) q_lane(function(q_all(x)), 0)

/* The row of white noise that holds: values that are drawn, each for a period. */
typedef struct {
    int64_t parts[5], k, whole, rest;
    const double *rows;
} Held;

static void rewind_held(Held *of) { of->k = -1, of->whole = of->parts[0], of->rest = of->parts[1]; }

static __attribute__((unused)) const double *held_row(Held *of, int64_t width, int64_t time) {
    for (;;) {
        int64_t twice = 2 * of->rest, next = of->whole + (twice > of->parts[4] || (twice == of->parts[4] && (of->whole & 1)));
        if (next > time) return of->rows + (of->k < 0 ? 0 : of->k) * width;
        of->k++, of->whole += of->parts[2], of->rest += of->parts[3];
        if (of->rest >= of->parts[4]) of->rest -= of->parts[4], of->whole++;
    }
}

#include "system.h"

enum { MOST_COLUMNS = 256 };

static Component components[COMPONENTS];
static Channel channels[CONNECTIONS + 1];
static double *received[CONNECTIONS + 1];
static bool wanted[COMPONENTS][MOST_VARIABLES];
static Track tracks[L];
static double state_[(STATES + 1) * L] __attribute__((aligned(64)));
static double numbers_[NUMBERS * L] __attribute__((aligned(64)));
static double constants_of[(CONSTANTS_COUNT + 1) * L] __attribute__((aligned(64)));
static double seen_[(SEEN_COUNT + 1) * L] __attribute__((aligned(64)));
static double given_[(GIVEN_COUNT + 1) * L] __attribute__((aligned(64)));
static double ratios[COMPONENTS][L] __attribute__((aligned(64)));
static double begins[COMPONENTS][L] __attribute__((aligned(64)));
static double reduced[(REDUCTIONS + 1) * L] __attribute__((aligned(64)));
static double objectives_[(OBJECTIVES + 1) * L] __attribute__((aligned(64)));
static int64_t moving[L][CONTINUOUS_COUNT + 1], now_of[L][COMPONENTS], first_samples[L][SAMPLED_COUNT + 1];
static int32_t status_[L] __attribute__((aligned(64)));
static Kept kept_[KEPT + 1];
static Loop loop;
static Setting settings[L][SETTINGS];
static Drawn drawn[L];
static struct { double *values; int64_t capacity; } source_tables[L][4], row_tables[L];
static const double *recorded_[MOST_COLUMNS];
static Refusal refusal;

/* -- what the page reads and sets ------------------------------------------------------------------------------------ */

EXPORT int lane_count(void) { return L; }
EXPORT Setting *settings_of(int lane) { return settings[lane]; }
EXPORT int refused_reason(void) { return refusal.reason; }
EXPORT int refused_setting(void) { return refusal.setting; }
EXPORT int64_t *outcomes(void) { return loop.outcome; }
EXPORT int64_t *outcome_components(void) { return loop.outcome_component; }
EXPORT int64_t *outcome_times(void) { return loop.outcome_time; }
EXPORT int64_t *step_counts(void) { return loop.steps; }
EXPORT int64_t *row_counts(void) { return loop.record_counts; }
EXPORT int doubtful_lanes(void) { return (int)loop.doubtful; }
EXPORT double *rows_of(int lane) { return loop.records[lane]; }
EXPORT double *values_of_objectives(void) { return objectives_; }
EXPORT double *values_of_sources(int lane, int own) { return source_tables[lane][own ? 1 : 0].values; }
EXPORT const int64_t *times_of(int lane, int own) { return own ? drawn[lane].own : drawn[lane].regular; }
EXPORT int time_count(int lane, int own) { return (int)(own ? drawn[lane].own_count : drawn[lane].regular_count); }
EXPORT const void *messages_of(int lane, int table) {
    const Drawn *of = &drawn[lane];
    return table == 0 ? of->exchanged : table == 1 ? of->posted : of->measured;
}
EXPORT int message_count(int lane, int table) {
    const Drawn *of = &drawn[lane];
    return (int)(table == 0 ? of->exchanged_count : table == 1 ? of->posted_count : of->measured_count);
}
EXPORT const int64_t *sample_times(int lane) { return drawn[lane].sampled; }
EXPORT const void *samples_of(int lane) { return drawn[lane].samples; }
EXPORT int sample_count(int lane) { return (int)drawn[lane].samples_count; }

static double *aligned_numbers(int64_t count) {
    return aligned_alloc(64, ((size_t)count * L * sizeof(double) + 63) & ~(size_t)63);
}

/* Prepare the module; once. */
EXPORT void set_up(void) {
    int64_t settles = 0, ahead = 0;
    for (int i = 0; i < COMPONENTS; i++) {
        const ComponentTable *of = &component_table[i];
        components[i] = (Component){
            .rank = of->rank, .held = of->held, .ahead = of->ahead, .behind = of->behind, .ratio = ratios[i],
            .by_itself = of->by_itself, .step = (void *)of->step, .steps = (void *)of->steps, .connected = of->connected, .places = of->outputs,
            .memory = aligned_numbers(of->places()), .wanted = wanted[i], .fed = of->fed, .fed_count = of->fed_count};
        memcpy(wanted[i], of->read, (size_t)of->variables);
        settles |= of->held.count || of->behind.count || of->fed_count, ahead |= of->ahead.count;
    }
    for (int i = 0; i < CONNECTIONS; i++) {
        const ConnectionTable *of = &connection_table[i];
        double *numbers = aligned_numbers(6 * of->size + 2);
        memset(numbers, 0, (size_t)(6 * of->size + 2) * L * sizeof *numbers);
        int64_t row = of->size * L;
        received[i] = numbers + 5 * row;
        channels[i] = (Channel){
            .sender = components[of->sender].memory, .places = of->start, .size = of->size, .noisy = of->noisy,
            .rounds = of->rounds, .converts = of->converts, .extrapolates = of->extrapolates,
            .read_ahead = of->read_ahead, .sigma = numbers, .quantum = numbers + row, .value = numbers + 2 * row,
            .applied = numbers + 3 * row, .scale = numbers + 6 * row, .offset = numbers + 6 * row + L,
            .into = {components[of->receiver].memory, of->end, of->kinds, of->low, of->high, of->plain,
                     of->as_they_are}};
    }
    for (int lane = 0; lane < L; lane++) tracks[lane].moving = moving[lane];
    loop = (Loop){
        .components = components, .channels = channels, .channel_count = CONNECTIONS,
        .continuous = {continuous_, CONTINUOUS_COUNT}, .sampled = {sampled_, SAMPLED_COUNT}, .tracks = tracks,
        .some_by_themselves = SOME_BY_THEMSELVES, .settles = settles, .stays = !(settles || ahead),
        .seen_count = SEEN_COUNT, .given_count = GIVEN_COUNT, .seen = seen_, .given = given_, .state = state_,
        .constants = constants_of, .numbers = numbers_, .kept = kept_, .status = status_, .recorded = recorded_};
}

EXPORT void record_at(int column, int component, int place) {
    recorded_[column] = components[component].memory + place * L;
    wanted[component][place] = 1;
}

/* Record so many columns, which record_at then sets. */
EXPORT void record_columns(int count) {
    loop.recorded_count = count;
    for (int i = 0; i < COMPONENTS; i++) memcpy(wanted[i], component_table[i].read, component_table[i].variables);
}

/* -- before the first instant ------------------------------------------------------------------------------------------ */

static int refuse(int reason, int setting) {
    refusal = (Refusal){reason, setting};
    return 0;
}

/* Whether all settings of a lane are allowed. */
static int check(const Setting *of) {
    for (int i = 0; i < SETTINGS; i++) {
        const Allowed *allowed = &allowed_settings[i];
        double x = of[i].value;
        if (!(x - x == 0.0)) return refuse(NO_NUMBER, i);
        if (x < allowed->low || (allowed->excludes_low && x == allowed->low)) return refuse(BELOW_LEAST, i);
        if (x > allowed->high) return refuse(ABOVE_MOST, i);
        if (allowed->is_whole && x != __builtin_rint(x)) return refuse(NOT_WHOLE, i);
    }
    for (int i = 0; i < BURSTS_COUNT; i++) {
        double loss = of[bursts[i][0]].value, length = of[bursts[i][1]].value;
        if (loss > length / (length + 1.0) && loss != 1.0) return refuse(TOO_MANY_IN_BURSTS, bursts[i][0]);
    }
    return 1;
}

static void put_settings(int lane, const double *inner) {
    const Setting *of = settings[lane];
    for (int i = 0; i < PARAMETERS; i++) {
        const ParameterTable *at = &parameter_table[i];
        components[at->component].memory[at->place * L + lane] = of[at->setting].value;
    }
    for (int i = 0; i < OWN_CLOCKS; i++) components[own_clocks[i][0]].memory[own_clocks[i][1] * L + lane] = 0.0;
    for (int i = 0; i < COMPONENTS; i++) {
        const ComponentTable *component = &component_table[i];
        ratios[i][lane] = component->ratio < 0 ? 1.0 : of[component->ratio].value;
        begins[i][lane] = 0.0;
        if (component->waits || component->clock < 0) continue;
        int64_t first = first_samples[lane][component->clock];
        begins[i][lane] = ratios[i][lane] * (first < (int64_t)tracks[lane].stop ? (double)first / NANOSECONDS : 0.0);
    }
    for (int i = 0; i < CONNECTIONS; i++) {
        const ConnectionTable *x = &connection_table[i];
        for (int k = 0; k < x->size; k++) {
            ((double *)channels[i].sigma)[k * L + lane] = of[x->sigma + k].value;
            ((double *)channels[i].quantum)[k * L + lane] = of[x->quantum + k].value;
        }
        ((double *)channels[i].scale)[lane] = of[x->scale].value;
        ((double *)channels[i].offset)[lane] = of[x->offset].value;
    }
    for (int i = 0; i < NAMED; i++) numbers_[i * L + lane] = number_at(i, of);
    numbers_[NAMED * L + lane] = (double)as_nanoseconds(of + STOP_TIME_SETTING) / NANOSECONDS;
    for (int i = 0; i < INNER; i++)
        numbers_[(NAMED + 1 + i) * L + lane] = inner ? inner[inner_reductions[i] * L + lane] : 0.0;
}

/* Set the inputs that sources feed to their values at the start. */
static void feed_first(int lane) {
#if TIMING_IS_GIVEN
    const double *const values = given_at_first;
#else
    double values[GIVEN_ALL + 1];
    rewind_sources(lane);
    given_at(lane, settings[lane], 0, values);
#endif
    for (int i = 0; i < COMPONENTS; i++)
        for (const Fed *fed = component_table[i].all_fed; fed < component_table[i].all_fed + component_table[i].all_fed_count; fed++)
            components[i].memory[fed->place * L + lane] = values[fed->source];
}

static Lanes compute(int component, Lanes lanes) {
    q_bits active = bits_of(lanes);
    Lanes failed = 0;
    component_table[component].initialise(
        components[component].memory, (const uint64_t *)&active, begins[component], status_);
    EACH(lane, lanes) failed |= (Lanes)(status_[lane] != 0) << lane;
    memset(status_, 0, sizeof status_);
    return failed;
}

/* Carry out a connection in the lanes that are open; the result are those whose values stay. */
static Lanes pass_first(int64_t i, Lanes lanes, Lanes open, Lanes *failed) {
    const ConnectionTable *x = &connection_table[i];
    Lanes settled = lanes;
    *failed |= compute((int)x->sender, lanes);
    EACH(lane, open)
        for (int64_t k = 0; k < x->size; k++) {
            double before = received[i][k * L + lane], after = components[x->sender].memory[x->start[k] * L + lane];
            if (x->converts) {
                double scaled = after * channels[i].scale[lane];
                after = scaled + channels[i].offset[lane];
            }
            received[i][k * L + lane] = after;
            double most = __builtin_fabs(after) > 1.0 ? __builtin_fabs(after) : 1.0;
            if (!(__builtin_fabs(after - before) <= 1e-12 * most)) settled &= ~((Lanes)1 << lane);
            if (x->kinds[k] == TRUTH) after = after != 0.0;
            if (x->kinds[k] == WHOLE) after = __builtin_rint(after);
            components[x->receiver].memory[x->end[k] * L + lane] = after;
        }
    return settled;
}

enum { ITERATIONS = 100 };

/* The first exchange; the result are the lanes in which it fails. */
static Lanes exchange(Lanes lanes) {
    Lanes failed = 0;
    for (int g = 0; g < GROUPS; g++) {
        const GroupTable *group = &group_table[g];
        Lanes open = lanes;
        for (int turn = 0; open; turn++) {
            Lanes settled = lanes;
            if (turn == ITERATIONS) {
                failed |= open;
                break;
            }
            for (int64_t i = 0; i < group->count; i++)
                settled &= pass_first(group->connections[i], lanes, open, &failed);
            open &= ~settled;
            if (group->count == 1) break;
        }
    }
    for (int i = 0; i < COMPONENTS; i++) {
        failed |= compute(i, lanes);
        for (int64_t k = 0; k < component_table[i].connected; k++)
            EACH(lane, lanes) {
                double x = components[i].memory[component_table[i].outputs[k] * L + lane];
                if (!(x - x == 0.0)) failed |= (Lanes)1 << lane;
            }
    }
    for (int i = 0; i < CONNECTIONS; i++) {
        Channel *c = &channels[i];
        if (!c->extrapolates) continue;
        memcpy(c->applied, received[i], (size_t)c->size * L * sizeof *c->applied);
        for (int lane = 0; lane < L; lane++)
            c->applied_count[lane] = 1, c->applied_time[lane] = c->applied_time[L + lane] = 0;
    }
    return failed;
}

/* -- a run --------------------------------------------------------------------------------------------------------------- */

static double *numbers_for(double **values, int64_t *capacity, int64_t count) {
    if (*capacity < count) {
        free(*values);
        *values = malloc((size_t)count * sizeof **values), *capacity = *values ? count : 0;
    }
    return *values;
}

/* The values of sources at the instants of a lane; 0 without memory. */
static int tabulate_sources(int lane) {
#if TIMING_IS_GIVEN
    const double *const tables[] = {seen_regular, seen_own, given_regular, given_own};
    for (int i = 0; i < 4; i++) source_tables[lane][i].values = (double *)tables[i];
#else
    if (!set_out_sources(lane, settings[lane])) return 0;
    for (int own = 0; own < 2; own++) {
        int64_t count = own ? drawn[lane].own_count : drawn[lane].regular_count;
        const int64_t *times = own ? drawn[lane].own : drawn[lane].regular;
        for (int fed = 0; fed < 2; fed++) {
            int64_t width = fed ? GIVEN_COUNT : SEEN_COUNT;
            double *into = numbers_for(&source_tables[lane][2 * fed + own].values,
                                       &source_tables[lane][2 * fed + own].capacity, count * width + 1);
            if (!into) return 0;
            rewind_sources(lane);
            for (int64_t i = 0; width && i < count; i++)
                (fed ? given_at : seen_at)(lane, settings[lane], times[i], into + i * width);
        }
    }
#endif
    tracks[lane].seen[lane] = source_tables[lane][0].values, tracks[lane].seen_own[lane] = source_tables[lane][1].values;
    tracks[lane].given[lane] = source_tables[lane][2].values;
    tracks[lane].given_own[lane] = source_tables[lane][3].values;
    return 1;
}

static int set_out(int lane, int64_t row_limit) {
    Track *track = &tracks[lane];
    if (!check(settings[lane]) || !begin_timing(lane, settings[lane], first_samples[lane], &refusal)) return 0;
    if (!draw_timing(lane, &drawn[lane])) return refuse(WITHOUT_MEMORY, -1);
    Drawn *d = &drawn[lane];
    memset(now_of[lane], 0, sizeof now_of[lane]);
    *track = (Track){
        .lanes = (Lanes)1 << lane, .stop = as_nanoseconds(settings[lane] + STOP_TIME_SETTING), .now = now_of[lane],
        .last_window = 1, .moving = moving[lane], .one_for_all = 1,
        .span = {.regular = {d->regular, d->regular_stepped, d->regular_count, 0},
                 .own = {d->own, d->own_stepped, d->own_count, 0}, .posted = d->posted, .measured = d->measured,
                 .arrivals = d->arrivals, .exchanged = d->exchanged, .samples = d->samples, .sampled = d->sampled,
                 .posted_count = d->posted_count, .measured_count = d->measured_count,
                 .arrivals_count = d->arrivals_count, .samples_count = d->samples_count}};
    track->span.end = track->stop + 1;
    if (!tabulate_sources(lane)) return refuse(WITHOUT_MEMORY, -1);
    if (row_limit) {
        int64_t size = (loop.recorded_count + 1) * (d->regular_count + d->own_count);
        loop.records[lane] = numbers_for(&row_tables[lane].values, &row_tables[lane].capacity, size);
        if (!loop.records[lane]) return refuse(WITHOUT_MEMORY, -1);
    }
    return 1;
}

static int draw_noises(int lane) {
    (void)lane;
#if NORMALS
    for (int i = 0; i < CONNECTIONS; i++) {
        const ConnectionTable *x = &connection_table[i];
        if (!x->noisy) continue;
        int64_t count = 0;
        const Message *messages = messages_of(lane, x->table);
        for (int64_t k = 0; k < message_count(lane, x->table); k++) count += messages[k].connection == i;
        channels[i].noise[lane] = draw_noise(lane, i, count * x->size);
        if (!channels[i].noise[lane]) return refuse(WITHOUT_MEMORY, -1);
    }
#endif
    return 1;
}

static int fly_once(int count, const double *inner) {
    Lanes lanes = ((Lanes)1 << (count - 1) << 1) - 1;
    clear(&loop);
    for (int i = 0; i < COMPONENTS; i++) component_table[i].begin(components[i].memory);
    for (int i = 0; i < CONNECTIONS; i++)
        memset(received[i], 0, (size_t)connection_table[i].size * L * sizeof *received[i]);
    for (int i = 0; i < STATES; i++)
        for (int lane = 0; lane < L; lane++) state_[i * L + lane] = first_states[i];
    loop.alive = lanes, loop.doubtful = 0, loop.no_memory = 0, loop.track_count = count;
    for (int lane = 0; lane < count; lane++) {
        Track *track = &tracks[lane];
        put_settings(lane, inner);
        loop.outcome[lane] = loop.outcome_component[lane] = loop.outcome_time[lane] = 0;
        loop.steps[lane] = loop.record_counts[lane] = 0;
        memset(now_of[lane], 0, sizeof now_of[lane]);
        track->count = track->at = track->more = 0;
        track->span.regular.at = track->span.own.at = 0;
        track->span.posted_at = track->span.measured_at = track->span.arrivals_at = track->span.samples_at = 0;
        if (!draw_noises(lane)) return 0;
        feed_first(lane);
    }
    Lanes failed = exchange(lanes);
    EACH(lane, failed) loop.outcome[lane] = REFUSED;
    loop.alive &= ~failed;
    return run(&loop) == AT_END ? 1 : refuse(WITHOUT_MEMORY, -1);
}

/* Fly the first `count` lanes, each with its settings, and record rows if asked; 0 if that is refused. */
EXPORT int fly(int count, int records) {
    refusal = (Refusal){0, -1};
    loop.record_limit = 0;
    for (int lane = 0; lane < count; lane++)
        if (!set_out(lane, records)) return 0;
    for (int turn = 0; turn < PASSES; turn++) {
        loop.record_limit = records && turn == PASSES - 1 ? INT64_MAX : 0;
        if (!fly_once(count, turn ? reduced : NULL)) return 0;
        reductions(&loop, reduced);
        finish(&loop, reduced, objectives_);
    }
    return 1;
}
