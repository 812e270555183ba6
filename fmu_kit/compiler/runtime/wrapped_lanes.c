/* lanes.c of an FMU whose code is a user's own C: the same functions, one call of the code for each active lane. */

#ifdef QUADCOSIM_LANES

#include <stdint.h>

#include "places.h"
#include "wrapped.h"

#define EXPORT __attribute__((visibility("default")))

enum { LANES = QUADCOSIM_LANES };

EXPORT int quadcosim_lanes(void);
int quadcosim_lanes(void) { return LANES; }

EXPORT int quadcosim_places(void);
int quadcosim_places(void) { return PLACES; }

EXPORT int quadcosim_variables(void);
int quadcosim_variables(void) { return VARIABLES; }

EXPORT int quadcosim_divergence(void);
int quadcosim_divergence(void) { return DIVERGENCE; }

EXPORT void quadcosim_begin(double *memory);
void quadcosim_begin(double *memory)
{
    for (int place = 0; place < PLACES; place++)
        for (int lane = 0; lane < LANES; lane++)
            memory[place * LANES + lane] = starts[place];
}

static void gather(double *one, const double *memory, int lane, int from, int to)
{
    for (int place = from; place < to; place++)
        one[place] = memory[place * LANES + lane];
}

static void scatter(const double *one, double *memory, int lane, int from, int to)
{
    for (int place = from; place < to; place++)
        memory[place * LANES + lane] = one[place];
}

EXPORT void quadcosim_initialise(double *memory, const uint64_t *active, const double *start_time, int32_t *status);
void quadcosim_initialise(double *memory, const uint64_t *active, const double *start_time, int32_t *status)
{
    for (int lane = 0; lane < LANES; lane++) {
        double one[PLACES];
        if (!active[lane])
            continue;
        gather(one, memory, lane, 0, PLACES);
        one[KEPT_START_TIME] = start_time[lane];
        if (parameter_out_of_bounds(one) != VARIABLES)
            status[lane] = OUT_OF_BOUNDS;
        else
            status[lane] = begin_code(one) == VARIABLES ? 0 : DIVERGENCE;
        scatter(one, memory, lane, 0, PLACES);
    }
}

/* There is no straight line. */
EXPORT void quadcosim_line(int64_t *tried, int64_t *left);
void quadcosim_line(int64_t *tried, int64_t *left) { *tried = *left = 0; }

EXPORT void quadcosim_do_step(double *memory, const uint64_t *active, const double *t, const double *h, int32_t *status,
                              const uint8_t *wanted);
void quadcosim_do_step(double *memory, const uint64_t *active, const double *t, const double *h, int32_t *status,
                       const uint8_t *wanted)
{
    (void)t, (void)h, (void)wanted;
    for (int lane = 0; lane < LANES; lane++) {
        double one[PLACES];
        if (!active[lane])
            continue;
        gather(one, memory, lane, 0, FIRST_OUTPUT);
        gather(one, memory, lane, KEPT_STATE, PLACES);
        status[lane] = step_code(one) == VARIABLES ? 0 : DIVERGENCE;
        scatter(one, memory, lane, FIRST_OUTPUT, FIRST_PARAMETER);
        scatter(one, memory, lane, KEPT_STATE, PLACES);
    }
}

#else
typedef int quadcosim_no_lanes; /* C does not allow an empty file */
#endif
