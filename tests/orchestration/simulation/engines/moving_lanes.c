/* The FMU of moving.c in lanes, as fmu_kit/compiler/runtime/lanes.c has them: one after the other, in the same words. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define API __attribute__((visibility("default")))
enum { INPUTS = 32, Y = 32, Z = 33, PLACE = 34, FAILS_AT = 35, NAN_AT = 36, WARNS_AT = 37, COUNT = 40 };
enum { LANES = QUADCOSIM_LANES, FAILED = 1, DIVERGED = 2 };
typedef double Memory[COUNT][LANES];

API int quadcosim_lanes(void) { return LANES; }
API int quadcosim_places(void) { return COUNT; }
API int quadcosim_variables(void) { return COUNT; }
API int quadcosim_divergence(void) { return DIVERGED; }
API void quadcosim_begin(double *memory) {
    double(*v)[LANES] = (double(*)[LANES])memory;
    memset(memory, 0, sizeof(Memory));
    for (int lane = 0; lane < LANES; lane++) v[FAILS_AT][lane] = v[NAN_AT][lane] = v[WARNS_AT][lane] = 1e9;
}
API void quadcosim_initialise(double *memory, const uint64_t *active, const double *start, int32_t *status) {
    double(*v)[LANES] = (double(*)[LANES])memory;
    for (int lane = 0; lane < LANES; lane++) {
        if (!active[lane]) continue;
        v[Y][lane] = 0.25 * v[PLACE][lane], v[Z][lane] = v[Y][lane] + 0.125;
        status[lane] = 0;
    }
}
API void quadcosim_do_step(double *memory, const uint64_t *active, const double *t, const double *h, int32_t *status) {
    double(*v)[LANES] = (double(*)[LANES])memory;
    for (int lane = 0; lane < LANES; lane++) {
        double told = 0.0;
        if (!active[lane]) continue;
        for (int i = 0; i < INPUTS; i++) told += (i + 1) * v[i][lane];
        v[Y][lane] = t[lane] < v[NAN_AT][lane] ? sin(t[lane] + 2 * h[lane] + told) : NAN;
        v[Z][lane] = sin(2 * (t[lane] + 2 * h[lane]) + told + 0.125);
        status[lane] = t[lane] < v[FAILS_AT][lane] ? 0 : FAILED;
    }
}
