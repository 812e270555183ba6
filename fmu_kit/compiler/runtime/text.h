/* Texts as Python formats them: numbers by repr, format and str, appended to an array.

   No allocation, no libm, no locale: the digits come from integers of 1280 bits, in which every double and its
   neighbours are exact (Steele and White, 1990; Burger and Dybvig, 1996). A text that does not fit is cut at a whole
   character. */

#ifndef QUADCOSIM_TEXT_H
#define QUADCOSIM_TEXT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#define Q_TEXT_FUNCTION static __attribute__((unused))
#else
#define Q_TEXT_FUNCTION static
#endif

/* -- texts ------------------------------------------------------------------------------------------------------- */

typedef struct {
    char *start;
    size_t size, length; /* of the array, of the text in it; size - length >= 1 */
} q_text;

/* An empty text in an array of `size` characters, at least one. */
Q_TEXT_FUNCTION q_text q_text_in(char *array, size_t size) {
    array[0] = '\0';
    return (q_text){array, size, 0};
}

Q_TEXT_FUNCTION void q_text_add(q_text *text, const char *characters, size_t count) {
    const size_t room = text->size - 1 - text->length;
    const int full = count > room;
    if (full) {
        count = room;
        while (count > 0 && ((unsigned char)characters[count] & 0xc0) == 0x80) count--; /* not within a character */
    }
    memcpy(text->start + text->length, characters, count);
    text->length += count;
    text->start[text->length] = '\0';
    if (full) text->size = text->length + 1; /* nothing is appended after a cut */
}

Q_TEXT_FUNCTION void q_text_string(q_text *text, const char *string) { q_text_add(text, string, strlen(string)); }

Q_TEXT_FUNCTION void q_text_boolean(q_text *text, int value) { q_text_string(text, value ? "True" : "False"); }

Q_TEXT_FUNCTION void q_text_integer(q_text *text, int64_t value) {
    char digits[20];
    size_t at = sizeof digits;
    uint64_t rest = value < 0 ? (uint64_t)0 - (uint64_t)value : (uint64_t)value;
    do {
        digits[--at] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    if (value < 0) digits[--at] = '-';
    q_text_add(text, digits + at, sizeof digits - at);
}

/* -- integers of many bits ------------------------------------------------------------------------------------------ */

enum { Q_LIMBS = 40 };

typedef struct {
    int count; /* of limbs in use, the lowest first; the highest of them is not zero */
    uint32_t limb[Q_LIMBS];
} q_integer;

Q_TEXT_FUNCTION q_integer q_integer_of(uint64_t value) {
    q_integer result;
    result.limb[0] = (uint32_t)value;
    result.limb[1] = (uint32_t)(value >> 32);
    result.count = value >> 32 ? 2 : value ? 1 : 0;
    return result;
}

Q_TEXT_FUNCTION void q_integer_multiply(q_integer *a, uint32_t factor) {
    uint64_t carry = 0;
    for (int k = 0; k < a->count; k++) {
        carry += (uint64_t)a->limb[k] * factor;
        a->limb[k] = (uint32_t)carry;
        carry >>= 32;
    }
    if (carry) a->limb[a->count++] = (uint32_t)carry;
}

Q_TEXT_FUNCTION void q_integer_shift(q_integer *a, int bits) {
    const int limbs = bits / 32;
    if (a->count == 0) return;
    memmove(a->limb + limbs, a->limb, (size_t)a->count * sizeof a->limb[0]);
    memset(a->limb, 0, (size_t)limbs * sizeof a->limb[0]);
    a->count += limbs;
    q_integer_multiply(a, (uint32_t)1 << bits % 32);
}

Q_TEXT_FUNCTION void q_integer_times_power_of_ten(q_integer *a, int power) {
    for (; power >= 9; power -= 9) q_integer_multiply(a, 1000000000u);
    for (; power > 0; power--) q_integer_multiply(a, 10u);
}

/* The sign of a + b - c. */
Q_TEXT_FUNCTION int q_integer_compare_sum(const q_integer *a, const q_integer *b, const q_integer *c) {
    int64_t difference = 0; /* of the limbs so far: it decides once lower limbs cannot compensate it */
    for (int k = (a->count > c->count ? a->count : c->count); k >= 0; k--) {
        difference = difference * ((int64_t)1 << 32) + (k < a->count ? a->limb[k] : 0);
        difference += (int64_t)(k < b->count ? b->limb[k] : 0) - (int64_t)(k < c->count ? c->limb[k] : 0);
        if (difference > 0) return 1;
        if (difference < -1) return -1;
    }
    return difference < 0 ? -1 : 0;
}

/* a / b, below 10; a becomes the remainder. The highest limb of b is from 2^27 to 2^28, and a has no more limbs. */
Q_TEXT_FUNCTION int q_integer_divide(q_integer *a, const q_integer *b) {
    const q_integer zero = {0, {0}};
    int digit = 0;
    uint32_t guess = a->count < b->count ? 0 : a->limb[b->count - 1] / (b->limb[b->count - 1] + 1);
    for (;; guess = 1) { /* the first may be too small by one */
        int64_t rest = 0;
        for (int k = 0; guess && k < b->count; k++) {
            rest += (int64_t)a->limb[k] - (int64_t)((uint64_t)guess * b->limb[k]);
            a->limb[k] = (uint32_t)rest;
            rest = (rest - (int64_t)a->limb[k]) / ((int64_t)1 << 32);
        }
        while (a->count > 0 && a->limb[a->count - 1] == 0) a->count--;
        digit += (int)guess;
        if (q_integer_compare_sum(a, &zero, b) < 0) return digit;
    }
}

/* -- digits of a double ----------------------------------------------------------------------------------------------- */

enum { Q_DIGITS = 400 };

typedef struct {
    int count, point; /* 0.DIGITS times 10 to the power of `point` */
    char digit[Q_DIGITS];
} q_digits;

/* A positive number as rest / unit times 10^point, from 0.1 to 1; the halves of its distances to the neighbours. */
typedef struct {
    q_integer rest, unit, above, below;
    int even, point;
} q_decimal;

Q_TEXT_FUNCTION int q_bit_length(uint64_t value) {
    int length = 0;
    for (; value; value >>= 1) length++;
    return length;
}

Q_TEXT_FUNCTION void q_decimal_times_power_of_ten(q_decimal *number, int power) {
    q_integer_times_power_of_ten(&number->rest, power);
    q_integer_times_power_of_ten(&number->above, power);
    q_integer_times_power_of_ten(&number->below, power);
}

Q_TEXT_FUNCTION void q_decimal_shift(q_decimal *number, int bits) {
    q_integer_shift(&number->rest, bits);
    q_integer_shift(&number->above, bits);
    q_integer_shift(&number->below, bits);
}

/* Without `shortest` the neighbours are left out; with it, a number that rounds up to a power of ten has its point. */
Q_TEXT_FUNCTION void q_decimal_of(q_decimal *number, double value, int shortest) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const int biased = (int)(bits >> 52 & 0x7ff), exponent = (biased ? biased : 1) - 1075;
    const uint64_t fraction = bits & 0xfffffffffffffu, mantissa = biased ? fraction + 0x10000000000000u : fraction;
    const int log2 = q_bit_length(mantissa) + exponent - 1, lower = log2 * 1233;

    number->even = mantissa % 2 == 0;
    number->rest = q_integer_of(4 * mantissa);
    number->unit = q_integer_of(4);
    number->above = q_integer_of(shortest ? 2 : 0);
    number->below = q_integer_of(!shortest ? 0 : fraction == 0 && biased > 1 ? 1 : 2);
    q_decimal_shift(number, exponent > 0 ? exponent : 0);
    q_integer_shift(&number->unit, exponent < 0 ? -exponent : 0);

    number->point = lower / 4096 - (lower % 4096 < 0); /* 1233/4096 is log10 2 or a little less: never too large */
    q_decimal_times_power_of_ten(number, -number->point);
    q_integer_times_power_of_ten(&number->unit, number->point);
    while (q_integer_compare_sum(&number->rest, &number->above, &number->unit) >= (shortest && !number->even)) {
        q_integer_times_power_of_ten(&number->unit, 1);
        number->point++;
    }
    const int shift = (60 - q_bit_length(number->unit.limb[number->unit.count - 1])) % 32; /* for the division */
    q_decimal_shift(number, shift);
    q_integer_shift(&number->unit, shift);
}

/* The shortest digits that are read as this positive number, and of these the nearest. */
Q_TEXT_FUNCTION void q_shortest_digits(q_digits *digits, double value) {
    const q_integer zero = {0, {0}};
    q_decimal number;
    int low, high;
    q_decimal_of(&number, value, 1);
    digits->count = 0;
    digits->point = number.point;
    do {
        q_decimal_times_power_of_ten(&number, 1);
        const int digit = q_integer_divide(&number.rest, &number.unit);
        low = q_integer_compare_sum(&number.rest, &zero, &number.below) < number.even;
        high = q_integer_compare_sum(&number.rest, &number.above, &number.unit) > -number.even;
        const int half = q_integer_compare_sum(&number.rest, &number.rest, &number.unit);
        const int up = high && (!low || half > 0 || (half == 0 && digit % 2));
        digits->digit[digits->count++] = (char)('0' + digit + up);
    } while (!low && !high);
}

/* A positive number rounded to so many digits, or so many after its point; ties to even. */
Q_TEXT_FUNCTION void q_rounded_digits(q_digits *digits, double value, int wanted, int after_point) {
    q_decimal number;
    q_decimal_of(&number, value, 0);
    digits->count = 0;
    digits->point = number.point;
    if (after_point) wanted += number.point;
    if (wanted > Q_DIGITS) wanted = Q_DIGITS;
    while (digits->count < wanted) {
        q_decimal_times_power_of_ten(&number, 1);
        digits->digit[digits->count++] = (char)('0' + q_integer_divide(&number.rest, &number.unit));
    }
    if (wanted < 0) return; /* below half of the last place */
    const int half = q_integer_compare_sum(&number.rest, &number.rest, &number.unit);
    int last = wanted - 1;
    if (half < 0 || (half == 0 && (last < 0 || digits->digit[last] % 2 == 0))) return;
    while (last >= 0 && digits->digit[last] == '9') digits->digit[last--] = '0';
    if (last >= 0) {
        digits->digit[last]++;
    } else {
        digits->digit[0] = '1'; /* followed by zeros, which are implied */
        digits->count += digits->count == 0;
        digits->point++;
    }
}

/* -- numbers ------------------------------------------------------------------------------------------------------------ */

Q_TEXT_FUNCTION void q_text_digits(q_text *text, const q_digits *digits, int from, int to) {
    for (; from < to; from++)
        q_text_add(text, from >= 0 && from < digits->count ? &digits->digit[from] : "0", 1);
}

Q_TEXT_FUNCTION void q_text_decimal(q_text *text, const q_digits *digits, int decimals) {
    q_text_digits(text, digits, digits->point > 0 ? 0 : -1, digits->point > 0 ? digits->point : 0);
    if (decimals > 0) q_text_add(text, ".", 1);
    q_text_digits(text, digits, digits->point, digits->point + decimals);
}

Q_TEXT_FUNCTION void q_text_scientific(q_text *text, const q_digits *digits, int decimals) {
    const int exponent = digits->point - 1;
    q_text_digits(text, digits, 0, 1);
    if (decimals > 0) q_text_add(text, ".", 1);
    q_text_digits(text, digits, 1, 1 + decimals);
    q_text_string(text, exponent < 0 ? "e-" : "e+");
    if (exponent > -10 && exponent < 10) q_text_add(text, "0", 1);
    q_text_integer(text, exponent < 0 ? -exponent : exponent);
}

/* Append the sign, and `nan` or `inf`; returns 0 if the digits of `size` have to follow. */
Q_TEXT_FUNCTION int q_text_sign_or_name(q_text *text, double value, double *size) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint64_t magnitude = bits & 0x7fffffffffffffffu;
    memcpy(size, &magnitude, sizeof magnitude);
    if (magnitude <= 0x7ff0000000000000u && bits != magnitude) q_text_add(text, "-", 1);
    if (magnitude >= 0x7ff0000000000000u) q_text_add(text, magnitude > 0x7ff0000000000000u ? "nan" : "inf", 3);
    return magnitude >= 0x7ff0000000000000u;
}

static const q_digits q_zero_digits = {1, 1, {'0'}};

/* repr(value), which is str(value) and f"{value}" too. */
Q_TEXT_FUNCTION void q_text_repr(q_text *text, double value) {
    q_digits digits = q_zero_digits;
    double size;
    if (q_text_sign_or_name(text, value, &size)) return;
    if (size > 0.0) q_shortest_digits(&digits, size);
    const int decimals = digits.count - digits.point;
    if (digits.point > -4 && digits.point <= 16) {
        q_text_decimal(text, &digits, decimals > 1 ? decimals : 1);
    } else {
        q_text_scientific(text, &digits, digits.count - 1);
    }
}

/* f"{value:.{precision}g}"; 6 is Python's precision where none is given. */
Q_TEXT_FUNCTION void q_text_general(q_text *text, double value, int precision) {
    q_digits digits = q_zero_digits;
    double size;
    if (precision < 1) precision = 1;
    if (q_text_sign_or_name(text, value, &size)) return;
    if (size > 0.0) q_rounded_digits(&digits, size, precision, 0);
    while (digits.count > 1 && digits.digit[digits.count - 1] == '0') digits.count--;
    if (digits.point > -4 && digits.point <= precision) {
        q_text_decimal(text, &digits, digits.count - digits.point);
    } else {
        q_text_scientific(text, &digits, digits.count - 1);
    }
}

/* f"{value:.{precision}e}", for a precision below 400. */
Q_TEXT_FUNCTION void q_text_exponential(q_text *text, double value, int precision) {
    q_digits digits = q_zero_digits;
    double size;
    if (q_text_sign_or_name(text, value, &size)) return;
    if (size > 0.0) q_rounded_digits(&digits, size, precision + 1, 0);
    q_text_scientific(text, &digits, precision);
}

/* f"{value:.{precision}f}", of which the first 400 digits count. */
Q_TEXT_FUNCTION void q_text_fixed(q_text *text, double value, int precision) {
    q_digits digits = q_zero_digits;
    double size;
    if (q_text_sign_or_name(text, value, &size)) return;
    if (size > 0.0) q_rounded_digits(&digits, size, precision, 1);
    if (digits.count == 0) digits = q_zero_digits;
    q_text_decimal(text, &digits, precision);
}

#endif
