/* A hash of each function of mathematics.h over numbers that are the same everywhere: one line a function. */

#include "loops.c"

#include <stdio.h>

enum { COUNT = 40000 }; /* of each function */

static double xs[COUNT], ys[COUNT], results[COUNT];
static uint64_t state = 1;

/* SplitMix64 (Steele, Lea and Flood, 2014). */
static uint64_t next_bits(void) {
    uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* Half of them of about 1, a quarter from about 2^-20 to 2^20, a quarter of any bits. */
static double next_number(void) {
    const uint64_t bits = next_bits(), kind = next_bits() % 4;
    const uint64_t exponent = kind < 2 ? 1022 + (bits >> 53) % 3 : 1003 + (bits >> 53) % 41;
    const uint64_t chosen = kind == 3 ? bits : (bits & 0x800fffffffffffffu) | exponent << 52;
    double x;
    memcpy(&x, &chosen, sizeof x);
    return x;
}

static void line(const char *name) {
    uint64_t hash = 0;
    for (int k = 0; k < COUNT; k++) {
        uint64_t bits = 0x7ff8000000000000u; /* what is not a number has not the same bits everywhere */
        if (results[k] == results[k]) memcpy(&bits, &results[k], sizeof bits);
        hash = (hash ^ bits) * 0x100000001b3u;
        hash ^= hash >> 29;
    }
    printf("%s %08lx%08lx\n", name, (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
}

#define ONE(name) name##_loop(xs, results, COUNT), line(#name)
#define TWO(name) name##_loop(xs, ys, results, COUNT), line(#name)

int main(void) {
    for (int k = 0; k < COUNT; k++) xs[k] = next_number(), ys[k] = next_number();
    ONE(sqrt), ONE(exp), ONE(expm1), ONE(log), ONE(tanh), ONE(sin), ONE(cos), ONE(tan), ONE(asin), ONE(acos), ONE(atan);
    ONE(fabs), ONE(floor), ONE(ceil), ONE(trunc), ONE(round), ONE(sign);
    TWO(atan2), TWO(pow), TWO(hypot), TWO(copysign), TWO(max), TWO(min), TWO(fmod), TWO(modulo), TWO(floor_divide);
    return 0;
}
