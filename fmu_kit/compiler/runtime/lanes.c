/* The slave for several runs at once, one in each lane of vector registers (SIMD).

   It is not part of the FMU's library, and empty unless QUADCOSIM_LANES is the number of lanes:

       cc -O2 -march=native -ffp-contract=off -DQUADCOSIM_LANES=8 -shared -fPIC lanes.c -o lanes.so

   A lane has the bits of an instance of the FMU, whatever the others do. The memory of all lanes is
   double[places][lanes], aligned to 64 bytes; the first places are the variables by their value references, Integers
   and Booleans as doubles, those behind them are the slave's own. `active` has all bits set in an active lane, and none
   in others, which stay unchanged. `status` becomes 0 in an active lane, or the number of the error with which an
   instance would have failed; such a lane must not be used any more. `wanted` states for each variable whether it is
   read: the others may keep the value of an earlier step. NULL: all are read. QUADCOSIM_SEVERAL adds a function that
   does several steps at once, if the slave's usual step is a straight line.

   Values that an instance would refuse are not checked here. The caller must ensure that Reals, the start time too, are
   finite, Integers whole numbers of 32 bits, Booleans 0 or 1, and write only inputs and, before the first step,
   parameters. */

#ifdef QUADCOSIM_LANES

#include "integers.h"
#include "mathematics.h"
#include "places.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#if defined(__GNUC__)
#define Q_IF_EVER(condition) if (__builtin_expect(condition, 0))
typedef q_real q_place __attribute__((aligned(QUADCOSIM_LANES < 8 ? 8 * QUADCOSIM_LANES : 64)));
#else
#define Q_IF_EVER(condition) if (condition)
typedef q_real q_place;
#endif

enum { LANES = QUADCOSIM_LANES };

static q_real values_of(const double *of_lanes)
{
    q_real value;
    memcpy(&value, of_lanes, sizeof value);
    return value;
}

#ifdef QUADCOSIM_SEVERAL

enum { MOST_STEPS = 32 }; /* of a straight line */

typedef struct { /* steps of one length that follow one another */
    int64_t count;
    q_real h;            /* [s] */
    const double *times; /* [s] where each begins, for all lanes */
    int lane;            /* one that is active */
    int (*between)(void *);
    void *given;
} Steps;

/* Whether a value has the same bits in all active lanes. */
Q_ONE int is_one(q_real x, q_mask live, int lane)
{
    return !q_any(live & q_has(q_to_bits(x) ^ q_to_bits(q_all(q_lane(x, lane))), ~(uint64_t)0));
}

/* Keep the values of a step, or, if its lanes are steps, of all of these. */
Q_ONE void fill(q_place *to, q_real x, int of_steps)
{
    if (!of_steps)
        *to = x;
    else
        for (int lane = 0; lane < LANES; lane++)
            to[lane] = q_all(q_lane(x, lane));
}

#endif

#include "lane_functions.h"

static q_mask lanes_of(const uint64_t *active)
{
    q_bits bits;
    memcpy(&bits, active, sizeof bits);
    return q_has(bits, 1u);
}

static void tell_status(const uint64_t *active, q_mask through, q_real failed, int32_t *status)
{
    const q_real number = q_select(through, q_all(0.0), failed);
    for (int lane = 0; lane < LANES; lane++)
        if (active[lane])
            status[lane] = (int32_t)q_lane(number, lane);
}

EXPORT int quadcosim_lanes(void);
int quadcosim_lanes(void) { return LANES; }

EXPORT int quadcosim_places(void);
int quadcosim_places(void) { return PLACES; }

EXPORT int quadcosim_variables(void);
int quadcosim_variables(void) { return VARIABLES; }

/* The status of a divergence. */
EXPORT int quadcosim_divergence(void);
int quadcosim_divergence(void) { return DIVERGENCE; }

/* Counts how often the straight line was tried, and left, in which case the step is done twice. If it is left too
   often, it is not tried for a while: other states may come. This changes no bit of the results. */
static struct { int64_t tried, left, waited; } line;

/* The start values, in all lanes. */
EXPORT void quadcosim_begin(double *memory);
void quadcosim_begin(double *memory)
{
    const double *const volatile known = starts; /* gcc 12 stores constants wrongly by AVX-512 */
    const double *const start = known;
    for (int place = 0; place < PLACES; place++)
        for (int lane = 0; lane < LANES; lane++)
            memory[place * LANES + lane] = start[place];
    memset(&line, 0, sizeof line);
}

/* Take over the set values, and compute outputs at the start time [s]: once at the end of initialisation, and before
   that wherever an output is read after a value was set. */
EXPORT void quadcosim_initialise(double *memory, const uint64_t *active, const double *start_time, int32_t *status);
void quadcosim_initialise(double *memory, const uint64_t *active, const double *start_time, int32_t *status)
{
    q_place *v = (q_place *)memory;
    const q_mask live = lanes_of(active);
    q_real failed = q_all(0.0);
    v[KEPT_START_TIME] = q_select(live, values_of(start_time), v[KEPT_START_TIME]);
    const q_mask through = model_enter_stepping(v, live, &failed);
    tell_status(active, through, failed, status);
}

EXPORT void quadcosim_line(int64_t *tried, int64_t *left);
void quadcosim_line(int64_t *tried, int64_t *left) { *tried = line.tried, *left = line.left; }

#ifdef STRAIGHT_STEP

/* After the trials, one step of so many may leave the line; the steps until it is tried again. */
enum { TRIALS = 256, OF_WHICH_ONE = 20, PAUSE = 64 * TRIALS };

static int is_tried(void)
{
    if (line.tried < TRIALS || line.left * OF_WHICH_ONE <= line.tried)
        return 1;
    if (++line.waited < PAUSE)
        return 0;
    memset(&line, 0, sizeof line);
    return 1;
}

static int step_straight(q_place *v, q_mask live, const uint8_t *wanted, q_real t, q_real h)
{
    if (!is_tried())
        return 0;
    line.tried++;
    if (q_any(STRAIGHT_STEP(v, live, wanted, t, h)))
        return 1;
    line.left++;
    return 0;
}

#else
#define step_straight(v, live, wanted, t, h) ((void)(wanted), 0)
#endif

/* Advance from t by h [s], which may differ from lane to lane. */
EXPORT void quadcosim_do_step(double *memory, const uint64_t *active, const double *t, const double *h, int32_t *status,
                              const uint8_t *wanted);
void quadcosim_do_step(double *memory, const uint64_t *active, const double *t, const double *h, int32_t *status,
                       const uint8_t *wanted)
{
    q_place *const v = (q_place *)memory;
    const q_mask live = lanes_of(active);
    q_real failed = q_all(0.0);
    if (step_straight(v, live, wanted, values_of(t), values_of(h))) {
        for (int lane = 0; lane < LANES; lane++)
            status[lane] = active[lane] ? 0 : status[lane];
        return;
    }
    const q_mask through = model_do_step(v, live, &failed, values_of(t), values_of(h));
    tell_status(active, through, failed, status);
}

#ifdef STRAIGHT_STEPS

/* Advance by up to `count` steps of one length h [s] that follow one another: `times` are where they begin [s], the same
   in all lanes, and behind them a finite number for each lane. After each step but the last of the `count`,
   `between(given)` may read variables, and returns whether to go on. The number of steps that were done: it ends where
   a step is not the usual one, or would fail, which quadcosim_do_step can then do. */
EXPORT int64_t quadcosim_do_steps(double *memory, const uint64_t *active, const double *times, double h, int64_t count,
                                  const uint8_t *wanted, int (*between)(void *), void *given);
int64_t quadcosim_do_steps(double *memory, const uint64_t *active, const double *times, double h, int64_t count,
                           const uint8_t *wanted, int (*between)(void *), void *given)
{
    Steps steps = {.h = q_all(h), .between = between, .given = given};
    int64_t done = 0;
    while (steps.lane < LANES - 1 && !active[steps.lane])
        steps.lane++;
    for (int goes_on = is_tried(); goes_on; goes_on = done < count && between(given)) {
        steps.count = count - done < MOST_STEPS ? count - done : MOST_STEPS, steps.times = times + done;
        const int64_t some = STRAIGHT_STEPS((q_place *)memory, lanes_of(active), wanted, &steps);
        line.tried += some, done += some;
        if (some < steps.count)
            break;
    }
    return done;
}

#endif

#else
typedef int quadcosim_no_lanes; /* C does not allow an empty file */
#endif
