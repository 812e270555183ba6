/* Real numbers that are one double each, or one double for each of several runs computed together (SIMD lanes).

   Code on q_real, q_bits and q_mask without branches is valid for both: QUADCOSIM_LANES is 1, or a power of two up to
   64. The arithmetic is IEEE 754 in double precision, with one rounding per operation, to the nearest; so the bits are
   the same for any number of lanes, compiler and machine. This file must be included before any that computes: it
   turns off the contraction of a * b + c to one rounding for the code after it. */

#ifndef QUADCOSIM_LANES_H
#define QUADCOSIM_LANES_H

#include <float.h>
#include <stdint.h>
#include <string.h>

#ifndef QUADCOSIM_LANES
#define QUADCOSIM_LANES 1
#endif

#if defined(__FAST_MATH__)
#error "quadcosim: compile without -ffast-math, which changes the results"
#endif
/* 0, 1, 16, 32 and 64 compute double as double; 2 and any other may not. */
#if defined(FLT_EVAL_METHOD) && (FLT_EVAL_METHOD < 0 || FLT_EVAL_METHOD == 2 || FLT_EVAL_METHOD > 64)
#error "quadcosim: compile for arithmetic in double precision, as with -msse2 -mfpmath=sse"
#endif

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
/* gcc ignores FP_CONTRACT. Without traps it can compute both sides of a selection, and vectorise loops. */
#pragma GCC optimize("fp-contract=off", "no-trapping-math")
#if QUADCOSIM_LANES > 1
/* Schedule operations on vectors before registers are allocated, for lower latency. */
#pragma GCC optimize("schedule-insns")
#endif
#pragma GCC diagnostic ignored "-Wpsabi" /* lanes are passed within one file only */
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#define Q_ONE static inline __attribute__((unused))
#define Q_SELDOM static __attribute__((unused, noinline, cold))
#define Q_FLAT __attribute__((flatten)) /* inlines all functions that it calls */
#if defined(_MSC_VER) && !defined(__clang__)
#undef Q_ONE
#undef Q_SELDOM
#undef Q_FLAT
#define Q_ONE static __inline
#define Q_SELDOM static
#define Q_FLAT
#endif

#define Q_WHOLE ((int64_t)1 << DBL_MANT_DIG) /* smaller whole numbers are exact */

/* -- the square root of one double, without libm --------------------------------------------------------------- */

/* Correctly rounded, as IEEE 754 requires: one instruction where the machine has it. gcc's own function calls libm for
   the errno of a negative number, unless -fno-math-errno is given, which also lets it vectorise loops. */
#if defined(__clang__)
#if defined(__has_builtin) && __has_builtin(__builtin_elementwise_sqrt)
#define Q_HARDWARE_SQRT(x) __builtin_elementwise_sqrt(x)
#else
double q_llvm_sqrt(double) __asm__("llvm.sqrt.f64") __attribute__((const));
#define Q_HARDWARE_SQRT(x) q_llvm_sqrt(x)
#endif
#elif defined(__GNUC__) && defined(__NO_MATH_ERRNO__) && defined(__OPTIMIZE__)
#define Q_HARDWARE_SQRT(x) __builtin_sqrt(x)
#endif

#if defined(__arm__) && !(__ARM_FP & 8)
#undef Q_HARDWARE_SQRT /* no doubles in hardware: the compiler would call libm */
#endif

/* Included only where needed, since they take most of the compilation time for one lane, and <immintrin.h> by far. */
#if QUADCOSIM_LANES > 1 || !defined(Q_HARDWARE_SQRT)
#if QUADCOSIM_LANES > 1 && defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif
#endif

/* The square root digit by digit, for a machine without the instruction. */
Q_ONE double q_sqrt_by_digits(double x) {
    uint64_t bits, root = 0, rest, bit;
    int exponent;
    double scaled = x;
    if (!(x > 0.0) || x > DBL_MAX) return x < 0.0 ? (x - x) / (x - x) : x; /* 0, -0, infinite, not a number */
    exponent = x < DBL_MIN ? -54 : 0;
    if (exponent) scaled = x * 18014398509481984.0; /* 2^54: subnormal */
    memcpy(&bits, &scaled, sizeof bits);
    exponent += (int)(bits >> 52) - 1023;
    rest = (bits & 0xfffffffffffffu) | 0x10000000000000u;
    if (exponent & 1) rest += rest, exponent -= 1;
    rest += rest; /* one bit more than the result has */
    for (bit = (uint64_t)1 << 53; bit; bit >>= 1) {
        uint64_t trial = root + root + bit;
        if (trial <= rest) rest -= trial, root += bit;
        rest += rest;
    }
    root = (root >> 1) + (root & 1); /* never a tie: the square of a root that ends in this bit has too many digits */
    bits = root + ((uint64_t)(exponent / 2 + 1022) << 52);
    memcpy(&scaled, &bits, sizeof scaled);
    return scaled;
}

Q_ONE double q_sqrt_of_one(double x) {
#if defined(QUADCOSIM_SQRT_BY_DIGITS)
    return q_sqrt_by_digits(x);
#elif defined(Q_HARDWARE_SQRT)
    return Q_HARDWARE_SQRT(x);
#elif defined(__SSE2__) || defined(_M_X64)
    return _mm_cvtsd_f64(_mm_sqrt_pd(_mm_set1_pd(x)));
#elif defined(__aarch64__)
    return vget_lane_f64(vsqrt_f64(vdup_n_f64(x)), 0);
#elif defined(__arm__) && (__ARM_FP & 8) && defined(__GNUC__)
    double root;
    __asm__("vsqrt.f64 %P0, %P1" : "=w"(root) : "w"(x));
    return root;
#elif defined(__riscv_flen) && __riscv_flen >= 64
    double root;
    __asm__("fsqrt.d %0, %1" : "=f"(root) : "f"(x));
    return root;
#else
    return q_sqrt_by_digits(x);
#endif
}

/* -- one lane -------------------------------------------------------------------------------------------------- */

#if QUADCOSIM_LANES == 1

typedef double q_real;
typedef uint64_t q_bits;
typedef int q_mask;

#define q_lt(a, b) ((q_mask)((a) < (b)))
#define q_le(a, b) ((q_mask)((a) <= (b)))
#define q_gt(a, b) ((q_mask)((a) > (b)))
#define q_ge(a, b) ((q_mask)((a) >= (b)))
#define q_eq(a, b) ((q_mask)((a) == (b)))
#define q_ne(a, b) ((q_mask)((a) != (b)))

Q_ONE q_real q_all(double x) { return x; }
Q_ONE q_mask q_known(int holds) { return holds; }
Q_ONE q_mask q_has(q_bits bits, uint64_t asked) { return (bits & asked) != 0; }
Q_ONE q_real q_select(q_mask condition, q_real yes, q_real no) { return condition ? yes : no; }
Q_ONE q_mask q_not(q_mask condition) { return !condition; }
Q_ONE int q_any(q_mask condition) { return condition; }
Q_ONE int q_every(q_mask condition) { return condition; }
Q_ONE double q_lane(q_real x, int lane) { return (void)lane, x; }
Q_ONE q_real q_with_lane(q_real x, int lane, double value) { return (void)x, (void)lane, value; }
Q_ONE q_real q_sqrt(q_real x) { return q_sqrt_of_one(x); }

/* -- several lanes ----------------------------------------------------------------------------------------------- */

#else

typedef double q_real __attribute__((vector_size(8 * QUADCOSIM_LANES)));
typedef uint64_t q_bits __attribute__((vector_size(8 * QUADCOSIM_LANES)));

Q_ONE q_real q_all(double x) { return x - (q_real){0.0}; } /* keeps the sign of a zero */
Q_ONE double q_lane(q_real x, int lane) { return x[lane]; }
Q_ONE q_real q_with_lane(q_real x, int lane, double value) {
    x[lane] = value;
    return x;
}

/* A number as a vector, also if it is one for all lanes. */
#define Q_LANES_OF(x) ((x) - (q_real){0.0})

/* A mask is one bit per lane where the machine has mask registers, else all bits of the lane or none. */
#if defined(__AVX512DQ__) && QUADCOSIM_LANES == 8

typedef __mmask8 q_mask;

#define Q_COMPARED(a, b, how) _mm512_cmp_pd_mask((__m512d)Q_LANES_OF(a), (__m512d)Q_LANES_OF(b), how)
#define q_lt(a, b) Q_COMPARED(a, b, _CMP_LT_OQ)
#define q_le(a, b) Q_COMPARED(a, b, _CMP_LE_OQ)
#define q_gt(a, b) Q_COMPARED(a, b, _CMP_GT_OQ)
#define q_ge(a, b) Q_COMPARED(a, b, _CMP_GE_OQ)
#define q_eq(a, b) Q_COMPARED(a, b, _CMP_EQ_OQ)
#define q_ne(a, b) Q_COMPARED(a, b, _CMP_NEQ_UQ)

Q_ONE q_mask q_known(int holds) { return (q_mask)-holds; }
Q_ONE q_mask q_has(q_bits bits, uint64_t asked) {
    return _mm512_test_epi64_mask((__m512i)bits, _mm512_set1_epi64((long long)asked));
}
Q_ONE q_mask q_not(q_mask condition) { return (q_mask)~condition; }
Q_ONE int q_any(q_mask condition) { return condition != 0; }
Q_ONE int q_every(q_mask condition) { return condition == 0xff; }
Q_ONE q_real q_select(q_mask condition, q_real yes, q_real no) {
    return (q_real)_mm512_mask_blend_pd(condition, (__m512d)no, (__m512d)yes);
}
Q_ONE q_real q_sqrt(q_real x) { return (q_real)_mm512_sqrt_pd((__m512d)x); }

#else

typedef q_bits q_mask;

#define q_lt(a, b) ((q_mask)(Q_LANES_OF(a) < Q_LANES_OF(b)))
#define q_le(a, b) ((q_mask)(Q_LANES_OF(a) <= Q_LANES_OF(b)))
#define q_gt(a, b) ((q_mask)(Q_LANES_OF(a) > Q_LANES_OF(b)))
#define q_ge(a, b) ((q_mask)(Q_LANES_OF(a) >= Q_LANES_OF(b)))
#define q_eq(a, b) ((q_mask)(Q_LANES_OF(a) == Q_LANES_OF(b)))
#define q_ne(a, b) ((q_mask)(Q_LANES_OF(a) != Q_LANES_OF(b)))

Q_ONE q_mask q_known(int holds) { return (q_mask){0} - (uint64_t)holds; }
Q_ONE q_mask q_has(q_bits bits, uint64_t asked) { return (q_mask)((bits & asked) != 0u); }
Q_ONE q_mask q_not(q_mask condition) { return ~condition; }

#if defined(__AVX__) && QUADCOSIM_LANES == 4

Q_ONE int q_any(q_mask condition) { return _mm256_movemask_pd((__m256d)condition) != 0; }
Q_ONE int q_every(q_mask condition) { return _mm256_movemask_pd((__m256d)condition) == 15; }
Q_ONE q_real q_select(q_mask condition, q_real yes, q_real no) {
    return (q_real)_mm256_blendv_pd((__m256d)no, (__m256d)yes, (__m256d)condition);
}
Q_ONE q_real q_sqrt(q_real x) { return (q_real)_mm256_sqrt_pd((__m256d)x); }

#else

Q_ONE int q_any(q_mask condition) {
    uint64_t any = 0;
    for (int lane = 0; lane < QUADCOSIM_LANES; lane++) any |= condition[lane];
    return any != 0;
}
Q_ONE q_real q_select(q_mask condition, q_real yes, q_real no) {
    return (q_real)((condition & (q_bits)yes) | (~condition & (q_bits)no));
}

Q_ONE int q_every(q_mask condition) { return !q_any(~condition); }

/* As many lanes at once as a register of the machine has: gcc does not vectorise a loop over a root. */
#if defined(__AVX512F__) && QUADCOSIM_LANES >= 8
#define Q_ROOTS 8
#define Q_ROOT(from, to) _mm512_storeu_pd(to, _mm512_sqrt_pd(_mm512_loadu_pd(from)))
#elif defined(__AVX__) && QUADCOSIM_LANES >= 4
#define Q_ROOTS 4
#define Q_ROOT(from, to) _mm256_storeu_pd(to, _mm256_sqrt_pd(_mm256_loadu_pd(from)))
#elif defined(__SSE2__)
#define Q_ROOTS 2
#define Q_ROOT(from, to) _mm_storeu_pd(to, _mm_sqrt_pd(_mm_loadu_pd(from)))
#elif defined(__aarch64__)
#define Q_ROOTS 2
#define Q_ROOT(from, to) vst1q_f64(to, vsqrtq_f64(vld1q_f64(from)))
#else
#define Q_ROOTS 1
#define Q_ROOT(from, to) (*(to) = q_sqrt_of_one(*(from)))
#endif

Q_ONE q_real q_sqrt(q_real x) {
    double from[QUADCOSIM_LANES], to[QUADCOSIM_LANES];
    memcpy(from, &x, sizeof from);
    for (int lane = 0; lane < QUADCOSIM_LANES; lane += Q_ROOTS) Q_ROOT(from + lane, to + lane);
    memcpy(&x, to, sizeof x);
    return x;
}

#endif
#endif
#endif

/* -- bits ---------------------------------------------------------------------------------------------------------- */

Q_ONE q_bits q_to_bits(q_real x) {
    q_bits bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

Q_ONE q_real q_from_bits(q_bits bits) {
    q_real x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

#endif
