/* The elementary functions that slaves compute with, without libm, without tables and almost without branches: the
   same bits from every compiler, on every machine, in one lane and in many (lanes.h).

   No error is larger, in units of the last place of the result, than: sqrt 0.5; tanh 0.6; asin, acos 0.7; expm1 0.75;
   exp, pow, hypot 0.8; log, sin, cos 0.85; atan, atan2 0.9; tan 0.95, each for all its arguments, as far as
   samples tell (docs/native.md). All other functions are exact.
   Infinities, signed zeros, subnormal numbers and what is not a number are as annex F of the C standard has them,
   flags apart. The bits of what is not a number are the machine's.

   With QUADCOSIM_LIBM, the functions that CPython takes from libm come from libm, lane by lane: then a slave in C has
   the bits of the slave in CPython on the same machine. */

#ifndef QUADCOSIM_MATHEMATICS_H
#define QUADCOSIM_MATHEMATICS_H

#include "lanes.h"

/* -- exact functions ------------------------------------------------------------------------------------------- */

#define Q_SIGN 0x8000000000000000u
#define Q_FRACTION 0xfffffffffffffu /* the bits of a double after its exponent */
#define Q_INFINITE 0x7ff0000000000000u
#define Q_INFINITY q_from_bits(q_to_bits(q_all(0.0)) | Q_INFINITE)
#define Q_NAN q_from_bits(q_to_bits(q_all(0.0)) | Q_INFINITE | 0x8000000000000u)

Q_ONE q_real q_fabs(q_real x) { return q_from_bits(q_to_bits(x) & ~Q_SIGN); }

Q_ONE q_real q_copysign(q_real magnitude, q_real sign) {
    return q_from_bits((q_to_bits(magnitude) & ~Q_SIGN) | (q_to_bits(sign) & Q_SIGN));
}

/* As fmu_kit.scalar has it: -1, 0 or 1; a zero of either sign gives 0. */
Q_ONE q_real q_sign(q_real x) { return q_select(q_eq(x, 0.0), q_all(0.0), q_copysign(q_all(1.0), x)); }

/* Python's max(a, b) and min(a, b): the first where neither is larger, as where one is not a number. */
Q_ONE q_real q_max(q_real a, q_real b) { return q_select(q_gt(b, a), b, a); }
Q_ONE q_real q_min(q_real a, q_real b) { return q_select(q_lt(b, a), b, a); }

Q_ONE q_mask q_isfinite(q_real x) { return q_le(q_fabs(x), DBL_MAX); }
Q_ONE q_mask q_isinf(q_real x) { return q_gt(q_fabs(x), DBL_MAX); }
Q_ONE q_mask q_isnan(q_real x) { return q_ne(x, x); }

/* To the nearest integer, ties to the even one, as Python's round. */
Q_ONE q_real q_round(q_real x) {
    const q_real size = q_fabs(x), rounded = (size + 0x1p52) - 0x1p52; /* beyond 2^52 all are integers */
    return q_copysign(q_select(q_lt(size, 0x1p52), rounded, size), x);
}

Q_ONE q_real q_floor(q_real x) {
    const q_real nearest = q_round(x);
    return q_copysign(nearest - q_select(q_gt(nearest, x), q_all(1.0), q_all(0.0)), x);
}

Q_ONE q_real q_ceil(q_real x) { return -q_floor(-x); }

Q_ONE q_real q_trunc(q_real x) { return q_copysign(q_floor(q_fabs(x)), x); }

/* -- pairs: a sum of two doubles, the second much smaller than the first ------------------------------------------ */

typedef struct {
    q_real high, low;
} q_pair;

/* a + b, exactly, where a is not the smaller one, or zero. */
Q_ONE q_pair q_fast_sum(q_real a, q_real b) {
    const q_real high = a + b;
    return (q_pair){high, (a - high) + b};
}

/* a + b, exactly. */
Q_ONE q_pair q_exact_sum(q_real a, q_real b) {
    const q_real high = a + b, b_part = high - a;
    return (q_pair){high, (a - (high - b_part)) + (b - b_part)};
}

/* The first 26 bits of a number: the product of two such is exact. */
Q_ONE q_real q_head(q_real x) { return q_from_bits(q_to_bits(x) & 0xfffffffff8000000u); }

/* a * b, to a last place of `low`. */
Q_ONE q_pair q_exact_product(q_real a, q_real b) {
    const q_real high = a * b, a1 = q_head(a), a2 = a - a1, b1 = q_head(b), b2 = b - b1;
    return (q_pair){high, ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2};
}

/* Short pairs have a first number of 26 bits, so they hold a number to about 79 bits, and multiply in few operations.
   a + b as a short pair, where a is not the smaller one. */
Q_ONE q_pair q_short_sum(q_real a, q_real b, q_real b_low) {
    const q_real high = q_head(a + b);
    return (q_pair){high, ((a - high) + b) + b_low};
}

/* Of short pairs, exact but for the last bits of `low`, and not short. */
Q_ONE q_pair q_product(q_pair a, q_pair b) {
    return (q_pair){a.high * b.high, a.high * b.low + a.low * (b.high + b.low)};
}

Q_ONE q_pair q_short(q_pair a) { return q_short_sum(a.high, a.low, q_all(0.0)); }

/* a / b as a short pair. */
Q_ONE q_pair q_quotient(q_pair a, q_pair b) {
    const q_real inverse = 1.0 / b.high, high = q_head(a.high * inverse), b_head = q_head(b.high);
    const q_real rest = ((a.high - high * b_head) - high * (b.high - b_head)) + (a.low - high * b.low);
    return (q_pair){high, rest * inverse};
}

/* -- series, odd and even terms apart: they need not wait for each other ------------------------------------------
   Interpolated where a Chebyshev polynomial is zero, by python -m docs.make_coefficients. */

/* series */

/* (exp(r) - 1 - r - r^2 / 2) / r^3. */
Q_ONE q_real q_exp_series(q_real r) {
    const q_real w = r * r;
    const q_real even = 0x1.5555555555556p-3 + w * (0x1.1111111110999p-7 + w * (0x1.a01a01a7d84f0p-13 + w *
        (0x1.71de0d6013f59p-19 + w * (0x1.af39639ed0cfcp-26))));
    const q_real odd = 0x1.5555555555555p-5 + w * (0x1.6c16c16c167d2p-10 + w * (0x1.a01a01a4868ecp-16 + w *
        (0x1.27e4e1c7c7f96p-22 + w * (0x1.1f6749b841540p-29))));
    return even + r * odd;
}

/* (2 atanh(s) / s - 2) / s^2, z = s^2. */
Q_ONE q_real q_log_series(q_real z) {
    const q_real w = z * z;
    const q_real even = 0x1.5555555555558p-1 + w * (0x1.2492492df26cep-2 + w * (0x1.7462b5152e8a6p-3 + w *
        (0x1.2b58f4c8d5f63p-3)));
    const q_real odd = 0x1.99999999952d8p-2 + w * (0x1.c71c62e40b94ep-3 + w * (0x1.39fe52a20dc69p-3));
    return even + z * odd;
}

/* 1/5 + z/7 + z^2/9 + .... */
Q_ONE q_real q_log5_series(q_real z) {
    const q_real w = z * z;
    const q_real even = 0x1.999999999999ap-3 + w * (0x1.c71c71c6eaa18p-4 + w * (0x1.3b1395d249ed7p-4 + w *
        (0x1.df7ccb122450bp-5)));
    const q_real odd = 0x1.2492492492521p-3 + w * (0x1.745d177a95904p-4 + w * (0x1.1118c7da4e209p-4 + w *
        (0x1.e02e59475f3c5p-5)));
    return even + z * odd;
}

/* (sin(r) / r - 1) / r^2, z = r^2. */
Q_ONE q_real q_sin_series(q_real z) {
    const q_real w = z * z;
    const q_real even = -0x1.5555555555555p-3 + w * (-0x1.a01a01a019930p-13 + w * (-0x1.ae6454111d144p-26 + w *
        (-0x1.ab170df960b0ap-41)));
    const q_real odd = 0x1.1111111111110p-7 + w * (0x1.71de3a545fa14p-19 + w * (0x1.61217dbb62b67p-33));
    return even + z * odd;
}

/* (cos(r) - 1 + z / 2) / z^2, z = r^2. */
Q_ONE q_real q_cos_series(q_real z) {
    const q_real w = z * z;
    const q_real even = 0x1.5555555555555p-5 + w * (0x1.a01a019f4df68p-16 + w * (0x1.1eeb67eec0a6fp-29));
    const q_real odd = -0x1.6c16c16c16964p-10 + w * (-0x1.27e4fa16e9918p-22 + w * (-0x1.907cef05f8ec4p-37));
    return even + z * odd;
}

/* (asin(s) / s - 1) / s^2, z = s^2. */
Q_ONE q_real q_asin_series(q_real z) {
    const q_real w = z * z;
    const q_real even = 0x1.5555555555556p-3 + w * (0x1.6db6db6e31f13p-5 + w * (0x1.6e8bb1c8209a2p-6 + w *
        (0x1.c9cf07674736ap-7 + w * (0x1.52420b04b37bep-7 + w * (0x1.1d189408314eep-6 + w *
        (0x1.d72b2bc8155f8p-6))))));
    const q_real odd = 0x1.3333333332ecap-4 + w * (0x1.f1c71c1db0623p-6 + w * (0x1.1c4d35cf95421p-6 + w *
        (0x1.782651caa6547p-7 + w * (0x1.65a9c4dfcf8b2p-8 + w * (-0x1.e6aaa8a0a04ccp-7)))));
    return even + z * odd;
}

/* (atan(t) / t - 1) / t^2, z = t^2. */
Q_ONE q_real q_atan_series(q_real z) {
    const q_real w = z * z;
    const q_real even = -0x1.5555555555555p-2 + w * (-0x1.2492492436180p-3 + w * (-0x1.745d0b27da190p-4 + w *
        (-0x1.10fa76aa9b02cp-4 + w * (-0x1.a0993ef875d4ap-5 + w * (-0x1.3a2f1cc1ba3c5p-6)))));
    const q_real odd = 0x1.999999999934bp-3 + w * (0x1.c71c7185386f1p-4 + w * (0x1.3b1262f3a2b5bp-4 + w *
        (0x1.dfe637a48099bp-5 + w * (0x1.4161b24be475bp-5))));
    return even + z * odd;
}

/* end of series */

/* -- exponentials ------------------------------------------------------------------------------------------------ */

/* 2^-n for a number of about 2^n: it takes the number near to 1, however large or small it is. */
Q_ONE q_real q_unit_for(q_real size) {
    const q_real bounded = q_select(q_gt(size, 0x1p1000), q_all(0x1p1000), size);
    return q_from_bits((2045u - (q_to_bits(bounded) >> 52)) << 52);
}

#define Q_LOG2_E 0x1.71547652b82fep+0
#define Q_LN2_HIGH 0x1.62e42feep-1 /* its products with exponents are exact */
#define Q_LN2_LOW 0x1.a39ef35793c76p-33
#define Q_INTEGER 0x1.8p52 /* added and taken away again, it rounds to an integer, which its last bits are */

/* 2^n for an integer n, -1022 to 1023. */
Q_ONE q_real q_power_of_two(q_real n) { return q_from_bits((q_to_bits(n + Q_INTEGER) + 1023u) << 52); }

/* x = n ln 2 + r, for |x| < 1100; |r| < 0.3472. */
typedef struct {
    q_real n;
    q_pair r;
} q_octaves;

Q_ONE q_octaves q_in_octaves(q_real x, q_real x_low) {
    const q_real n = (x * Q_LOG2_E + Q_INTEGER) - Q_INTEGER;
    return (q_octaves){n, q_fast_sum(x - n * Q_LN2_HIGH, x_low - n * Q_LN2_LOW)};
}

/* exp(r), for |r| < 0.3472. */
Q_ONE q_real q_exp_of_rest(q_pair rest) {
    const q_real r = rest.high;
    const q_pair sum = q_fast_sum(q_all(1.0), r);
    return sum.high + (sum.low + (rest.low * sum.high + r * r * (0.5 + r * q_exp_series(r))));
}

/* exp(x + x_low). */
Q_ONE q_real q_exp_of_sum(q_real x, q_real x_low) {
    const q_real bounded = q_select(q_gt(x, 710.0), q_all(710.0), q_select(q_lt(x, -746.0), q_all(-746.0), x));
    const q_octaves part = q_in_octaves(bounded, q_select(q_eq(bounded, x), x_low, q_all(0.0)));
    const q_real half = q_round(0.5 * part.n);
    /* In two steps, so that the result may be subnormal, or infinite. */
    return q_exp_of_rest(part.r) * q_power_of_two(half) * q_power_of_two(part.n - half);
}

/* The same, for |x| < 708: in one step. */
Q_ONE q_real q_exp_of_small_sum(q_real x, q_real x_low) {
    const q_octaves part = q_in_octaves(x, x_low);
    return q_exp_of_rest(part.r) * q_power_of_two(part.n);
}

/* 2^-halvings (exp(x) - 1), for |x| < 710. */
Q_ONE q_pair q_expm1_pair(q_real x, double halvings) {
    const q_octaves part = q_in_octaves(x, q_all(0.0));
    const q_real r = part.r.high, scale = q_power_of_two(part.n - halvings), unit = q_power_of_two(q_all(-halvings));
    const q_real head = q_head(r), square = 0.5 * (r - head) * (r + head) + part.r.low * (1.0 + r);
    const q_pair first = q_fast_sum(r, 0.5 * head * head); /* exactly so far: near 0.4 much of it cancels */
    const q_real less = scale - unit, lost = (scale - less) - unit;
    const q_pair sum = q_fast_sum(less, scale * first.high);
    const q_real rest = first.low + (square + r * r * r * q_exp_series(r));
    return q_fast_sum(sum.high, sum.low + (lost + scale * rest));
}

Q_ONE q_real q_own_exp(q_real x) { return q_exp_of_sum(x, q_all(0.0)); }

Q_ONE q_real q_own_expm1(q_real x) {
    const q_real above = q_select(q_lt(x, -60.0), q_all(-60.0), x);
    const q_pair half = q_expm1_pair(q_select(q_gt(x, 710.0), q_all(710.0), above), 1.0);
    return q_select(q_lt(q_fabs(x), 0x1p-54), x, 2.0 * (half.high + half.low));
}

Q_ONE q_real q_own_tanh(q_real x) {
    const q_real size = q_fabs(x);
    const q_pair t = q_expm1_pair(2.0 * q_select(q_gt(size, 22.0), q_all(22.0), size), 0.0); /* 1 from there on */
    const q_pair sum = q_exact_sum(t.high, q_all(2.0));
    const q_pair ratio = q_quotient(t, (q_pair){sum.high, sum.low + t.low});
    return q_copysign(ratio.high + ratio.low, x);
}

/* -- logarithms and powers ---------------------------------------------------------------------------------------- */

/* x = 2^n m, for a positive x; m from sqrt(1/2) to sqrt(2). */
typedef struct {
    q_real n, m;
} q_parts;

Q_ONE q_parts q_in_parts(q_real x) {
    const q_mask subnormal = q_lt(x, DBL_MIN);
    const q_bits bits = q_to_bits(q_select(subnormal, x * 0x1p54, x));
    const q_bits exponent = (bits + (0x3ff0000000000000u - 0x3fe6a09e667f3bcdu)) >> 52; /* 1023 more than n */
    const q_real n = q_from_bits(exponent | 0x4330000000000000u) - (0x1p52 + 1023.0);
    return (q_parts){n - q_select(subnormal, q_all(54.0), q_all(0.0)),
                     q_from_bits(bits - ((exponent - 1023u) << 52))};
}

Q_ONE q_real q_own_log(q_real x) {
    const q_parts part = q_in_parts(x);
    const q_real f = part.m - 1.0, s = f / (2.0 + f), z = s * s, half = 0.5 * f * f;
    const q_pair sum = q_fast_sum(part.n * Q_LN2_HIGH, f);
    const q_real rest = s * (half + z * q_log_series(z)) + (part.n * Q_LN2_LOW + sum.low);
    const q_real log = sum.high - (half - rest);
    const q_real limit = q_select(q_eq(x, 0.0), -Q_INFINITY, q_select(q_gt(x, 0.0), x, Q_NAN));
    return q_select(q_gt(x, 0.0) & q_le(x, DBL_MAX), log, limit);
}

/* The logarithm of a positive finite number as a short pair, to 2^-64 of it:
   log m = 2 s (1 + z (1/3 + z (1/5 + z/7 + ...))), s = (m - 1) / (m + 1), z = s^2. */
Q_ONE q_pair q_log_pair(q_real x) {
    const q_parts part = q_in_parts(x);
    const q_real sum = part.m + 1.0, zero = q_all(0.0), third = q_all(0x1.5555555555555p-2);
    const q_real rough = (part.m - 1.0) * (1.0 / sum), square = rough * rough;
    const q_pair s = q_quotient((q_pair){part.m - 1.0, zero}, (q_pair){sum, part.m - (sum - 1.0)});
    const q_pair from_third = q_short_sum(third, square * q_log5_series(square), q_all(0x1.5555555555555p-56));
    const q_pair more = q_product(s, q_short(q_product(q_short(q_product(s, s)), from_third)));
    const q_pair log = q_fast_sum(2.0 * s.high, 2.0 * more.high);
    const q_real low = log.low + 2.0 * (s.low + more.low);
    return q_short_sum(part.n * Q_LN2_HIGH, log.high, low + part.n * Q_LN2_LOW);
}

/* x^y, by the logarithm of |x|, whatever they are. */
Q_SELDOM q_real q_any_power(q_real x, q_real y, q_pair log) {
    const q_real one = q_all(1.0), size = q_fabs(x), y_size = q_fabs(y);
    const q_real exponent = q_copysign(q_min(y_size, q_all(0x1p66)), y); /* enough for any number but 1 */
    const q_real head = q_head(exponent);
    const q_real regular = q_exp_of_sum(head * log.high, (exponent - head) * log.high + exponent * log.low);
    const q_real limit = q_select(q_gt(y, 0.0), size, 1.0 / size); /* of zero and infinity */
    const q_mask whole = q_eq(q_round(y), y), odd = whole & q_ne(q_round(0.5 * y), 0.5 * y);
    const q_mask inner = q_gt(size, 0.0) & q_le(size, DBL_MAX);
    const q_real signed_power = q_select(inner, regular, limit);
    const q_real power_of_x = q_select(odd, q_copysign(signed_power, x), signed_power);
    const q_real known = q_select(inner & q_lt(x, 0.0) & q_not(whole), Q_NAN, power_of_x);
    const q_real number = q_select(q_isnan(x) | q_isnan(y), x + y, known);
    return q_select(q_eq(y, 0.0) | q_eq(x, 1.0), one, number);
}

/* The same for a positive x, where nothing overflows; `rare` gains the lanes in which that is not so, and which have no
   result. */
Q_ONE q_real q_usual_power(q_real x, q_real y, q_mask *rare) {
    const q_real head = q_head(y);
    const q_pair log = q_log_pair(q_fabs(x));
    const q_real product = head * log.high;
    const q_mask usual = q_gt(x, 0.0) & q_le(x, DBL_MAX) & q_lt(q_fabs(y), 0x1p66) & q_lt(q_fabs(product), 708.0);
    *rare |= q_not(usual);
    return q_exp_of_small_sum(product, (y - head) * log.high + y * log.low);
}

Q_ONE q_real q_own_pow(q_real x, q_real y) {
    q_mask rare = q_known(0);
    const q_real power = q_usual_power(x, y, &rare);
    return q_any(rare) ? q_any_power(x, y, q_log_pair(q_fabs(x))) : power;
}

/* -- angles --------------------------------------------------------------------------------------------------------- */

/* x = (quadrant) pi/2 + r, |r| < 0.7855: of the quadrant the last two bits count. */
typedef struct {
    q_bits quadrant;
    q_pair r;
} q_turn;

#define Q_NEAR 0x1.921fb54442d18p20 /* 2^20 pi/2: to here the products below are exact, or as good as */

/* Far from zero: 192 bits of 2/pi from where they begin to count, times the 53 bits of x, lane by lane. */
Q_SELDOM q_turn q_far_turn(q_real x, q_turn turn) {
    static const uint32_t two_over_pi[] = {
        0x00000000u, 0x00000000u, 0xa2f9836eu, 0x4e441529u, 0xfc2757d1u, 0xf534ddc0u, 0xdb629599u, 0x3c439041u,
        0xfe5163abu, 0xdebbc561u, 0xb7246e3au, 0x424dd2e0u, 0x06492eeau, 0x09d1921cu, 0xfe1deb1cu, 0xb129a73eu,
        0xe88235f5u, 0x2ebb4484u, 0xe99c7026u, 0xb45f7e41u, 0x3991d639u, 0x835339f4u, 0x9c845f8bu, 0xbdf9283bu,
        0x1ff897ffu, 0xde05980fu, 0xef2f118bu, 0x5a0a6d1fu, 0x6d367ecfu, 0x27cb09b7u, 0x4f463f66u, 0x9e5fea2du,
        0x7527bac7u, 0xebe5f17bu, 0x3d0739f7u, 0x8a5292eau, 0x6bfb5fb1u, 0x1f8d5d08u, 0x56033046u, 0xfc7b6babu,
        0xf0cfbc20u, 0x9af4361du,
    };
    for (int lane = 0; lane < QUADCOSIM_LANES; lane++) {
        const double one = q_lane(x, lane);
        uint64_t bits, carry = 0;
        uint32_t window[6], product[6] = {0};
        memcpy(&bits, &one, sizeof bits);
        const int exponent = (int)(bits >> 52 & 0x7ff) - 1075; /* |x| = mantissa 2^exponent */
        if (!(one >= Q_NEAR || one <= -Q_NEAR) || exponent > 971) continue;
        const uint64_t mantissa = (bits & Q_FRACTION) | (Q_FRACTION + 1);
        const int start = exponent - 2 + 64; /* the table begins with 64 zeros */
        for (int k = 0; k < 6; k++) {
            const uint64_t both = (uint64_t)two_over_pi[start / 32 + k] << 32 | two_over_pi[start / 32 + k + 1];
            window[k] = (uint32_t)(both >> (32 - start % 32));
        }
        for (int k = 5; k >= 0; k--) { /* the last 192 bits of the product: turns of 2 pi are left away */
            carry += (mantissa & 0xffffffffu) * window[k];
            product[k] = (uint32_t)carry;
            carry >>= 32;
        }
        carry = 0;
        for (int k = 4; k >= 0; k--) {
            carry += (mantissa >> 32) * window[k + 1] + product[k];
            product[k] = (uint32_t)carry;
            carry >>= 32;
        }
        /* Two bits of the quadrant, 190 of a fraction, which is rounded to the nearest quadrant. */
        const uint32_t up = product[0] >> 29 & 1, quadrant = (product[0] >> 30) + up;
        const double sign = (bits & Q_SIGN) != 0 ? -1.0 : 1.0;
        double high = (double)(product[0] & 0x3fffffffu) - (up ? 0x1p30 : 0.0), low = 0.0, scale = 0x1p-32;
        for (int k = 1; k < 6; k++, scale *= 0x1p-32) {
            const double term = product[k] * scale, sum = high + term, part = sum - high;
            low += (high - (sum - part)) + (term - part);
            high = sum;
        }
        const q_pair fraction = q_fast_sum(q_all(sign * 0x1p-30 * high), q_all(sign * 0x1p-30 * low));
        const q_pair quarter = {q_all(0x1.921fb50000000p+0), q_all(0x1.110b4611a6263p-26)};
        const q_pair angle = q_product(q_short(fraction), quarter), r = q_fast_sum(angle.high, angle.low);
        turn.r.high = q_with_lane(turn.r.high, lane, q_lane(r.high, 0));
        turn.r.low = q_with_lane(turn.r.low, lane, q_lane(r.low, 0));
        const double count = sign * (quadrant & 3) + Q_INTEGER;
        const q_real counted = q_with_lane(q_from_bits(turn.quadrant), lane, count);
        turn.quadrant = q_to_bits(counted);
    }
    return turn;
}

/* pi/2 is taken away in parts of 33 bits (Cody and Waite), the rest of each difference kept. */
Q_ONE q_turn q_near_turn(q_real x) {
    const q_real n = (x * 0x1.45f306dc9c883p-1 + Q_INTEGER) - Q_INTEGER;
    const q_pair first = q_exact_sum(x - n * 0x1.921fb544p+0, -(n * 0x1.0b4611a6p-34));
    const q_pair second = q_exact_sum(first.high, -(n * 0x1.3198a2ep-69));
    const q_pair r = q_fast_sum(second.high, second.low + (first.low - n * 0x1.b839a252049c1p-104));
    return (q_turn){q_to_bits(n + Q_INTEGER), r};
}

Q_ONE q_mask q_is_far(q_real x) { return q_gt(q_fabs(x), Q_NEAR); }

Q_ONE q_turn q_in_quadrants(q_real x) {
    const q_turn turn = q_near_turn(x);
    return q_any(q_is_far(x)) ? q_far_turn(x, turn) : turn;
}

/* sin r and cos r, for |r| < 0.7855. */
Q_ONE q_pair q_sin_pair(q_pair r) {
    const q_real z = r.high * r.high;
    return q_fast_sum(r.high, r.high * z * q_sin_series(z) + r.low * (1.0 - 0.5 * z));
}

Q_ONE q_pair q_cos_pair(q_pair r) {
    const q_real z = r.high * r.high, half = 0.5 * z;
    const q_pair most = q_fast_sum(q_all(1.0), -half);
    return q_fast_sum(most.high, most.low + (z * z * q_cos_series(z) - r.high * r.low));
}

/* The quadrant's bits as a mask and a sign. */
Q_ONE q_mask q_is_odd(q_bits quadrant) { return q_has(quadrant, 1u); }
Q_ONE q_real q_signed_by(q_real x, q_bits bit_one) { return q_from_bits(q_to_bits(x) ^ ((bit_one & 2u) << 62)); }

typedef struct {
    q_real sin, cos;
} q_sines;

Q_ONE q_sines q_sines_of(q_real x, q_turn turn) {
    const q_pair sin_pair = q_sin_pair(turn.r), cos_pair = q_cos_pair(turn.r);
    const q_real near_zero = sin_pair.high + sin_pair.low, near_one = cos_pair.high + cos_pair.low;
    const q_mask odd = q_is_odd(turn.quadrant);
    const q_real sine = q_signed_by(q_select(odd, near_one, near_zero), turn.quadrant);
    const q_real cosine = q_signed_by(q_select(odd, near_zero, near_one), turn.quadrant + 1u);
    return (q_sines){q_select(q_eq(x, 0.0), x, sine), cosine};
}

Q_ONE q_sines q_own_sin_cos(q_real x) { return q_sines_of(x, q_in_quadrants(x)); }
Q_ONE q_real q_own_sin(q_real x) { return q_own_sin_cos(x).sin; }
Q_ONE q_real q_own_cos(q_real x) { return q_own_sin_cos(x).cos; }

Q_ONE q_real q_own_tan(q_real x) {
    const q_turn turn = q_in_quadrants(x);
    const q_pair sine = q_sin_pair(turn.r), cosine = q_cos_pair(turn.r);
    const q_mask odd = q_is_odd(turn.quadrant);
    const q_pair above = {q_select(odd, -cosine.high, sine.high), q_select(odd, -cosine.low, sine.low)};
    const q_pair below = {q_select(odd, sine.high, cosine.high), q_select(odd, sine.low, cosine.low)};
    const q_pair ratio = q_quotient(above, below);
    return q_select(q_lt(q_fabs(x), 0x1p-27), x, ratio.high + ratio.low);
}

/* asin s = s + s^3 series(s^2) below 1/2; from there on asin x = pi/2 - 2 asin sqrt((1 - x) / 2). */
#define Q_HALF_PI 0x1.921fb54442d18p+0
#define Q_HALF_PI_LOW 0x1.1a62633145c07p-54
#define Q_EIGHTH_HIGH 0x1.921fb54442d18p-1 /* its first 50 bits: small multiples are exact */
#define Q_EIGHTH_LOW 0x1.1a62633145c07p-55

typedef struct {
    q_mask large;
    q_real s, rest; /* s + rest: the arc of s, twice of it where |x| is large */
} q_arc;

Q_ONE q_arc q_arc_of(q_real size) {
    const q_mask large = q_ge(size, 0.5);
    const q_real z = q_select(large, 0.5 * (1.0 - size), size * size), s = q_select(large, q_sqrt(z), size);
    const q_pair square = q_exact_product(s, s);
    const q_real missing = ((z - square.high) - square.low) / (s + s);
    const q_real low = q_select(large & q_gt(s, 0.0), missing, q_all(0.0)), factor = q_select(large, q_all(2.0), q_all(1.0));
    return (q_arc){large, factor * s, factor * (low + s * z * q_asin_series(z))};
}

Q_ONE q_real q_own_asin(q_real x) {
    const q_arc arc = q_arc_of(q_fabs(x));
    const q_pair most = q_fast_sum(q_all(Q_HALF_PI), -arc.s);
    const q_real down = most.high + (most.low + (Q_HALF_PI_LOW - arc.rest));
    return q_copysign(q_select(arc.large, down, arc.s + arc.rest), x);
}

Q_ONE q_real q_own_acos(q_real x) {
    const q_arc arc = q_arc_of(q_fabs(x));
    const q_real zero = q_all(0.0), one = q_all(1.0);
    const q_real turns = q_select(arc.large, q_select(q_lt(x, 0.0), q_all(2.0), zero), one); /* in pi/2 */
    const q_real sign = q_copysign(one, x) * q_select(arc.large, one, -one);
    const q_pair most = q_fast_sum(turns * Q_HALF_PI, sign * arc.s);
    return most.high + (most.low + (turns * Q_HALF_PI_LOW + sign * arc.rest));
}

/* With the smaller of |y| and |x| as a, the larger as b: atan(a / b), or atan((a - b) / (a + b)) + pi/4 for ratios
   above tan(pi/8), then its place among the eight octants. */
Q_ONE q_real q_own_atan2(q_real y, q_real x) {
    const q_real zero = q_all(0.0), one = q_all(1.0), x_size = q_fabs(x), y_size = q_fabs(y);
    const q_mask steep = q_gt(y_size, x_size), back = q_lt(q_copysign(one, x), 0.0);
    const q_real larger = q_select(steep, y_size, x_size), smaller = q_select(steep, x_size, y_size);
    const q_mask none = q_gt(larger, DBL_MAX) | q_eq(larger, 0.0);
    /* Scaled so that nothing overflows, and that no product is subnormal but that of a tiny angle. */
    const q_real shrunk = q_select(q_gt(larger, 0x1p1000), q_all(0x1p-100), one);
    const q_real unit = q_select(q_lt(larger, 1.0), q_unit_for(larger), shrunk);
    const q_real corner = q_select(q_eq(smaller, Q_INFINITY), one, zero); /* as if both were 1 */
    const q_real b = q_select(none, one, larger * unit), a = q_select(none, corner, smaller * unit);
    const q_mask diagonal = q_gt(a, 0x1.a827999fcef32p-2 * b);
    const q_pair difference = q_fast_sum(-b, a), sum = q_fast_sum(b, a);
    const q_pair above = {q_select(diagonal, difference.high, a), q_select(diagonal, difference.low, zero)};
    const q_pair below = {q_select(diagonal, sum.high, b), q_select(diagonal, sum.low, zero)};
    const q_real t = above.high / below.high, z = t * t;
    const q_pair again = q_exact_product(t, below.high);
    const q_real missing = ((above.high - again.high) - again.low) + (above.low - t * below.low);
    const q_real t_low = q_select(q_gt(q_fabs(t), 0x1p-900), missing / below.high, zero);
    const q_real rest = t_low + t * z * q_atan_series(z);
    /* angle = sign (t + rest) + eighths pi/4 */
    const q_real eighth = q_select(diagonal, one, zero), up = q_select(steep, 2.0 - eighth, eighth);
    const q_real eighths = q_select(back, 4.0 - up, up), sign = q_select(steep ^ back, -one, one);
    const q_pair most = q_fast_sum(eighths * Q_EIGHTH_HIGH, sign * t);
    const q_real angle = most.high + (most.low + (sign * rest + eighths * Q_EIGHTH_LOW));
    return q_copysign(q_select(q_isnan(x) | q_isnan(y), x + y, angle), y);
}

Q_ONE q_real q_own_atan(q_real x) { return q_own_atan2(x, q_all(1.0)); }

/* -- lengths and remainders ------------------------------------------------------------------------------------------ */

/* As CPython's, which is its own and not libm's, so in both modes. (Of a subnormal length, as from CPython 3.12.) */
Q_ONE q_real q_hypot(q_real x, q_real y) {
    const q_real x_size = q_fabs(x), y_size = q_fabs(y), larger = q_select(q_gt(y_size, x_size), y_size, x_size);
    const q_real smaller = q_select(q_gt(y_size, x_size), x_size, y_size);
    const q_real unit = q_unit_for(larger), a = larger * unit, b = smaller * unit;
    const q_pair a_square = q_exact_product(a, a), b_square = q_exact_product(b, b);
    const q_pair square = q_fast_sum(a_square.high, b_square.high);
    const q_real root = q_sqrt(square.high);
    const q_pair again = q_exact_product(root, root);
    const q_real missing = ((square.high - again.high) - again.low) + (square.low + (a_square.low + b_square.low));
    const q_real length = (root + missing / (root + root)) / unit;
    const q_real regular = q_select(q_gt(larger, 0.0) & q_le(larger, DBL_MAX), length, larger);
    const q_real number = q_select(q_isnan(x) | q_isnan(y), x + y, regular);
    return q_select(q_eq(x_size, Q_INFINITY) | q_eq(y_size, Q_INFINITY), Q_INFINITY, number);
}

/* A positive number as 53 bits, the first of them set, times 2^(exponent - 1075). */
typedef struct {
    uint64_t mantissa;
    int exponent;
} q_scaled;

Q_ONE q_scaled q_scaled_of(uint64_t bits) {
    const int exponent = (int)(bits >> 52);
    q_scaled scaled = {bits & Q_FRACTION, exponent ? exponent : 1};
    if (exponent) scaled.mantissa += Q_FRACTION + 1;
    for (; scaled.mantissa <= Q_FRACTION; scaled.mantissa <<= 1) scaled.exponent--;
    return scaled;
}

/* C's fmod of one lane: exact, a bit of the quotient at a time. */
Q_ONE double q_fmod_of_one(double x, double y) {
    uint64_t x_bits, y_bits, sign;
    memcpy(&x_bits, &x, sizeof x_bits);
    memcpy(&y_bits, &y, sizeof y_bits);
    sign = x_bits & Q_SIGN;
    x_bits &= ~Q_SIGN;
    y_bits &= ~Q_SIGN;
    if (y_bits == 0 || x_bits >= Q_INFINITE || y_bits > Q_INFINITE) return (x * y) / (x * y);
    if (x_bits < y_bits) return x;
    const q_scaled b = q_scaled_of(y_bits);
    q_scaled a = q_scaled_of(x_bits);
    for (; a.exponent > b.exponent; a.exponent--)
        a.mantissa = (a.mantissa >= b.mantissa ? a.mantissa - b.mantissa : a.mantissa) << 1;
    if (a.mantissa >= b.mantissa) a.mantissa -= b.mantissa;
    if (a.mantissa == 0) return sign ? -0.0 : 0.0;
    for (; a.mantissa <= Q_FRACTION; a.mantissa <<= 1) a.exponent--;
    x_bits = a.exponent > 0 ? (a.mantissa & Q_FRACTION) | (uint64_t)a.exponent << 52 : a.mantissa >> (1 - a.exponent);
    x_bits |= sign;
    memcpy(&x, &x_bits, sizeof x);
    return x;
}

Q_ONE q_real q_fmod(q_real x, q_real y) {
    for (int lane = 0; lane < QUADCOSIM_LANES; lane++)
        x = q_with_lane(x, lane, q_fmod_of_one(q_lane(x, lane), q_lane(y, lane)));
    return x;
}

/* Python's x % y, for a y that is not zero (there Python raises): the sign is that of y. */
Q_ONE q_real q_modulo(q_real x, q_real y) {
    const q_real rest = q_fmod(x, y);
    const q_real moved = q_select(q_lt(y, 0.0) ^ q_lt(rest, 0.0), rest + y, rest);
    return q_select(q_eq(rest, 0.0), q_copysign(q_all(0.0), y), moved);
}

/* Python's x // y, likewise. */
Q_ONE q_real q_floor_divide(q_real x, q_real y) {
    const q_real zero = q_all(0.0), one = q_all(1.0), rest = q_fmod(x, y);
    const q_mask moved = q_not(q_eq(rest, 0.0)) & (q_lt(y, 0.0) ^ q_lt(rest, 0.0));
    const q_real quotient = (x - rest) / y - q_select(moved, one, zero), below = q_floor(quotient);
    const q_real whole = below + q_select(q_gt(quotient - below, 0.5), one, zero);
    return q_select(q_eq(quotient, 0.0), q_copysign(zero, x / y), whole);
}

/* -- whose functions ---------------------------------------------------------------------------------------------------- */

/* Declared under names of our own: a compiler that knows a function's name computes pow(x, 2) in its own way. */
#ifdef QUADCOSIM_LIBM
#define Q_TEXT_OF(x) #x
#define Q_TEXT(x) Q_TEXT_OF(x)
#define Q_LIBM(name) __asm__(Q_TEXT(__USER_LABEL_PREFIX__) #name)
#define Q_FUNCTION(name) \
    extern double q_libm_##name(double) Q_LIBM(name); \
    Q_ONE q_real q_##name(q_real x) { \
        for (int lane = 0; lane < QUADCOSIM_LANES; lane++) \
            x = q_with_lane(x, lane, q_libm_##name(q_lane(x, lane))); \
        return x; \
    }
#define Q_FUNCTION2(name) \
    extern double q_libm_##name(double, double) Q_LIBM(name); \
    Q_ONE q_real q_##name(q_real x, q_real y) { \
        for (int lane = 0; lane < QUADCOSIM_LANES; lane++) \
            x = q_with_lane(x, lane, q_libm_##name(q_lane(x, lane), q_lane(y, lane))); \
        return x; \
    }
#else
#define Q_FUNCTION(name) Q_ONE q_real q_##name(q_real x) { return q_own_##name(x); }
#define Q_FUNCTION2(name) Q_ONE q_real q_##name(q_real x, q_real y) { return q_own_##name(x, y); }
#endif

Q_FUNCTION(exp)
Q_FUNCTION(expm1)
Q_FUNCTION(log)
Q_FUNCTION(tanh)
Q_FUNCTION(sin)
Q_FUNCTION(cos)
Q_FUNCTION(tan)
Q_FUNCTION(asin)
Q_FUNCTION(acos)
Q_FUNCTION(atan)
Q_FUNCTION2(atan2)
Q_FUNCTION2(pow)

/* Sine and cosine for little more than one of them; and what is usual of functions with branches, without those: `rare`
   gains the lanes in which another branch would be taken, and which have no result. */
#ifdef QUADCOSIM_LIBM
Q_ONE q_sines q_sin_cos(q_real x) { return (q_sines){q_sin(x), q_cos(x)}; }
Q_ONE q_sines q_usual_sin_cos(q_real x, q_mask *rare) { return (void)rare, q_sin_cos(x); }
Q_ONE q_real q_usual_pow(q_real x, q_real y, q_mask *rare) { return (void)rare, q_pow(x, y); }
#else
Q_ONE q_sines q_sin_cos(q_real x) { return q_own_sin_cos(x); }
Q_ONE q_sines q_usual_sin_cos(q_real x, q_mask *rare) { return *rare |= q_is_far(x), q_sines_of(x, q_near_turn(x)); }
Q_ONE q_real q_usual_pow(q_real x, q_real y, q_mask *rare) { return q_usual_power(x, y, rare); }
#endif

#endif
