/* Each function of mathematics.h over arrays, QUADCOSIM_LANES numbers at a time, their count a multiple of that. */

#include "mathematics.h"

#include <stddef.h>

#define LOOP(name) \
    void name##_loop(const double *restrict x, double *restrict out, size_t count) { \
        for (size_t k = 0; k < count; k += QUADCOSIM_LANES) { \
            q_real a; \
            memcpy(&a, x + k, sizeof a); \
            a = q_##name(a); \
            memcpy(out + k, &a, sizeof a); \
        } \
    }

#define LOOP2(name) \
    void name##_loop(const double *restrict x, const double *restrict y, double *restrict out, size_t count) { \
        for (size_t k = 0; k < count; k += QUADCOSIM_LANES) { \
            q_real a, b; \
            memcpy(&a, x + k, sizeof a); \
            memcpy(&b, y + k, sizeof b); \
            a = q_##name(a, b); \
            memcpy(out + k, &a, sizeof a); \
        } \
    }

LOOP(sqrt)
LOOP(exp)
LOOP(expm1)
LOOP(log)
LOOP(tanh)
LOOP(sin)
LOOP(cos)
LOOP(tan)
LOOP(asin)
LOOP(acos)
LOOP(atan)
LOOP(fabs)
LOOP(floor)
LOOP(ceil)
LOOP(trunc)
LOOP(round)
LOOP(sign)
LOOP2(atan2)
LOOP2(pow)
LOOP2(hypot)
LOOP2(copysign)
LOOP2(max)
LOOP2(min)
LOOP2(fmod)
LOOP2(modulo)
LOOP2(floor_divide)
