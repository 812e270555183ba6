/* The functions of mathematics.h in single precision, by those of libm: for a microcontroller with floats in hardware,
   but doubles only in software. Their bits are those of that libm. */

#ifndef QUADCOSIM_SINGLE_H
#define QUADCOSIM_SINGLE_H

#include <float.h>
#include <math.h>
#include <stdint.h>

#if defined(__FAST_MATH__)
#error "quadcosim: compile without -ffast-math, under which NaN cannot be detected"
#endif

#define Q_ONE static inline __attribute__((unused))
#if defined(_MSC_VER) && !defined(__clang__)
#undef Q_ONE
#define Q_ONE static __inline
#endif

#define QUADCOSIM_LANES 1
#define Q_WHOLE ((int64_t)1 << FLT_MANT_DIG) /* whole numbers below it are exact, also as results of rounding */

typedef float q_real;
typedef int q_mask;

typedef struct {
    q_real sin, cos;
} q_sines;

#define q_lt(a, b) ((q_mask)((a) < (b)))
#define q_le(a, b) ((q_mask)((a) <= (b)))
#define q_gt(a, b) ((q_mask)((a) > (b)))
#define q_ge(a, b) ((q_mask)((a) >= (b)))
#define q_eq(a, b) ((q_mask)((a) == (b)))
#define q_ne(a, b) ((q_mask)((a) != (b)))
#define Q_INFINITY INFINITY
#define Q_NAN NAN

Q_ONE q_real q_all(float x) { return x; }
Q_ONE float q_lane(q_real x, int lane) { return (void)lane, x; }
Q_ONE q_real q_with_lane(q_real x, int lane, float value) { return (void)x, (void)lane, value; }
Q_ONE q_mask q_known(int holds) { return holds; }
Q_ONE q_real q_select(q_mask condition, q_real yes, q_real no) { return condition ? yes : no; }
Q_ONE q_mask q_not(q_mask condition) { return !condition; }
Q_ONE q_real q_fabs(q_real x) { return fabsf(x); }
Q_ONE q_real q_copysign(q_real magnitude, q_real sign) { return copysignf(magnitude, sign); }
Q_ONE q_mask q_isfinite(q_real x) { return q_le(q_fabs(x), FLT_MAX); }
Q_ONE q_mask q_isinf(q_real x) { return q_gt(q_fabs(x), FLT_MAX); }
Q_ONE q_mask q_isnan(q_real x) { return q_ne(x, x); }
Q_ONE q_real q_floor(q_real x) { return floorf(x); }
Q_ONE q_real q_ceil(q_real x) { return ceilf(x); }
Q_ONE q_real q_sqrt(q_real x) { return sqrtf(x); }
Q_ONE q_real q_exp(q_real x) { return expf(x); }
Q_ONE q_real q_expm1(q_real x) { return expm1f(x); }
Q_ONE q_real q_log(q_real x) { return logf(x); }
Q_ONE q_real q_pow(q_real x, q_real y) { return powf(x, y); }
Q_ONE q_real q_tanh(q_real x) { return tanhf(x); }
Q_ONE q_real q_sin(q_real x) { return sinf(x); }
Q_ONE q_real q_cos(q_real x) { return cosf(x); }
Q_ONE q_sines q_sin_cos(q_real x) { return (q_sines){sinf(x), cosf(x)}; }
Q_ONE q_real q_tan(q_real x) { return tanf(x); }
Q_ONE q_real q_asin(q_real x) { return asinf(x); }
Q_ONE q_real q_acos(q_real x) { return acosf(x); }
Q_ONE q_real q_atan(q_real x) { return atanf(x); }
Q_ONE q_real q_atan2(q_real y, q_real x) { return atan2f(y, x); }

/* Python's x % y: the sign is that of y. */
Q_ONE q_real q_modulo(q_real x, q_real y) {
    const q_real rest = fmodf(x, y);
    if (rest == 0.0f) return copysignf(0.0f, y);
    return (rest < 0.0f) == (y < 0.0f) ? rest : rest + y;
}

/* Python's x // y. */
Q_ONE q_real q_floor_divide(q_real x, q_real y) {
    const q_real quotient = (x - q_modulo(x, y)) / y, below = floorf(quotient);
    return quotient - below > 0.5f ? below + 1.0f : below;
}

#endif
