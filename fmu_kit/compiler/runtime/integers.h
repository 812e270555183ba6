/* Whole numbers of 128 bits within an expression, in every SIMD lane: exact where a double is not.

   A whole number that is stored, passed or compared is a q_real, smaller than Q_WHOLE, so that it is exact. Within an
   expression there may be larger ones, as in (n * 1103515245 + 12345) % 2147483648. Two's complement in two unsigned
   halves, for compilers without integers of 128 bits; no operation is undefined, whatever the content of inactive
   lanes. */

#ifndef QUADCOSIM_INTEGERS_H
#define QUADCOSIM_INTEGERS_H

#include "mathematics.h"

typedef struct {
    uint64_t low, high;
} q_int128;

typedef struct {
    q_int128 lane[QUADCOSIM_LANES];
} q_wide;

/* -- one number ---------------------------------------------------------------------------------------------------- */

Q_ONE int q_is_negative(q_int128 a) { return (a.high >> 63) != 0; }

Q_ONE q_int128 q_int128_add(q_int128 a, q_int128 b) {
    const uint64_t low = a.low + b.low;
    return (q_int128){low, a.high + b.high + (low < a.low)};
}

Q_ONE q_int128 q_int128_sub(q_int128 a, q_int128 b) {
    return (q_int128){a.low - b.low, a.high - b.high - (a.low < b.low)};
}

Q_ONE q_int128 q_int128_neg(q_int128 a) { return q_int128_sub((q_int128){0, 0}, a); }

Q_ONE q_int128 q_int128_abs(q_int128 a) { return q_is_negative(a) ? q_int128_neg(a) : a; }

Q_ONE q_int128 q_int128_mul(q_int128 a, q_int128 b) {
    const uint64_t half = 0xffffffffu, a0 = a.low & half, a1 = a.low >> 32, b0 = b.low & half, b1 = b.low >> 32;
    const uint64_t middle = a1 * b0 + (a0 * b0 >> 32), other = a0 * b1 + (middle & half);
    return (q_int128){a.low * b.low, a1 * b1 + (middle >> 32) + (other >> 32) + a.low * b.high + a.high * b.low};
}

Q_ONE int q_int128_less(q_int128 a, q_int128 b) {
    const uint64_t sign = (uint64_t)1 << 63;
    return a.high == b.high ? a.low < b.low : (a.high ^ sign) < (b.high ^ sign);
}

Q_ONE int q_int128_equal(q_int128 a, q_int128 b) { return a.high == b.high && a.low == b.low; }

/* Of unsigned numbers, the second not zero. */
Q_ONE q_int128 q_int128_quotient(q_int128 a, q_int128 b) {
    q_int128 rest = {0, 0}, quotient = {0, 0};
    if (!a.high && !b.high) return (q_int128){a.low / b.low, 0};
    for (int bit = 127; bit >= 0; bit--) {
        rest = (q_int128){rest.low << 1 | ((bit < 64 ? a.low : a.high) >> (bit & 63) & 1), rest.high << 1 | rest.low >> 63};
        quotient = (q_int128){quotient.low << 1, quotient.high << 1 | quotient.low >> 63};
        if (rest.high == b.high ? rest.low >= b.low : rest.high > b.high) {
            rest = q_int128_sub(rest, b);
            quotient.low |= 1;
        }
    }
    return quotient;
}

/* Python's a // b; 0 for division by zero, which is refused before. */
Q_ONE q_int128 q_int128_floordiv(q_int128 a, q_int128 b) {
    const q_int128 one = {1, 0};
    q_int128 quotient;
    if (!b.low && !b.high) return b;
    quotient = q_int128_quotient(q_int128_abs(a), q_int128_abs(b));
    if (q_is_negative(a) == q_is_negative(b)) return quotient;
    quotient = q_int128_neg(quotient);
    return q_int128_equal(q_int128_mul(quotient, b), a) ? quotient : q_int128_sub(quotient, one);
}

/* Python's a % b. */
Q_ONE q_int128 q_int128_mod(q_int128 a, q_int128 b) {
    return q_int128_sub(a, q_int128_mul(q_int128_floordiv(a, b), b));
}

Q_ONE q_int128 q_int128_bit_and(q_int128 a, q_int128 b) { return (q_int128){a.low & b.low, a.high & b.high}; }
Q_ONE q_int128 q_int128_bit_or(q_int128 a, q_int128 b) { return (q_int128){a.low | b.low, a.high | b.high}; }
Q_ONE q_int128 q_int128_bit_xor(q_int128 a, q_int128 b) { return (q_int128){a.low ^ b.low, a.high ^ b.high}; }

/* -- in every lane ------------------------------------------------------------------------------------------------- */

Q_ONE q_wide q_wide_known(uint64_t high, uint64_t low) {
    q_wide a;
    for (int k = 0; k < QUADCOSIM_LANES; k++) a.lane[k] = (q_int128){low, high};
    return a;
}

Q_ONE q_wide q_wide_of(q_real x) {
    q_wide a;
    for (int k = 0; k < QUADCOSIM_LANES; k++) {
        const int is_whole = q_lane(x, k) < Q_WHOLE && q_lane(x, k) > -Q_WHOLE;
        const int64_t number = is_whole ? (int64_t)q_lane(x, k) : 0;
        a.lane[k] = (q_int128){(uint64_t)number, number < 0 ? ~(uint64_t)0 : 0};
    }
    return a;
}

/* As a q_real, if it is not too large. */
Q_ONE q_real q_narrow(q_wide a) {
    q_real x = q_all(0);
    for (int k = 0; k < QUADCOSIM_LANES; k++) {
        const int64_t size = (int64_t)(q_int128_abs(a.lane[k]).low & ~((uint64_t)1 << 63));
        x = q_with_lane(x, k, q_is_negative(a.lane[k]) ? -size : size);
    }
    return x;
}

Q_ONE q_wide q_wide_1(q_int128 (*of)(q_int128), q_wide a) {
    for (int k = 0; k < QUADCOSIM_LANES; k++) a.lane[k] = of(a.lane[k]);
    return a;
}

Q_ONE q_wide q_wide_2(q_int128 (*of)(q_int128, q_int128), q_wide a, q_wide b) {
    for (int k = 0; k < QUADCOSIM_LANES; k++) a.lane[k] = of(a.lane[k], b.lane[k]);
    return a;
}

Q_ONE q_mask q_wide_compared(int (*how)(q_int128, q_int128), q_wide a, q_wide b) {
    q_real holds = q_all(0);
    for (int k = 0; k < QUADCOSIM_LANES; k++) holds = q_with_lane(holds, k, how(a.lane[k], b.lane[k]));
    return q_ne(holds, q_all(0));
}

/* Whether a number is too large to be a q_real. */
Q_ONE q_mask q_wide_beyond(q_wide a) {
    return q_not(q_wide_compared(q_int128_less, q_wide_1(q_int128_abs, a), q_wide_known(0, (uint64_t)Q_WHOLE)));
}

#endif
