/* The arithmetic of integers.h on one number, as a library. */

#include "integers.h"

#define OF_TWO(name) \
    void name(const q_int128 *a, const q_int128 *b, q_int128 *c) { *c = q_int128_##name(*a, *b); }
#define COMPARED(name) \
    int name(const q_int128 *a, const q_int128 *b) { return q_int128_##name(*a, *b); }

OF_TWO(add)
OF_TWO(sub)
OF_TWO(mul)
OF_TWO(floordiv)
OF_TWO(mod)
OF_TWO(bit_and)
OF_TWO(bit_or)
OF_TWO(bit_xor)
COMPARED(less)
COMPARED(equal)
