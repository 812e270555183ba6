/* Definitions for the loop of runs where each thread of a GPU computes one run: CUDA in C++, in one text with all that
   it includes. Thread t computes lane t % L of batch t / L, in memory of the same layout as for SIMD lanes: the lanes
   of a batch are adjacent, so that neighbouring threads read neighbouring numbers.

   Multiplications and additions are not contracted (--fmad=false), division and root are rounded correctly, and the
   elementary functions are those of mathematics.h: the bits are those of lanes. */

#define QUADCOSIM_THREADS
#define QUADCOSIM_LANES 1
#define LANE ((int)(threadIdx.x % L)) /* blocks contain whole batches */
#define EXPORT static
#define Q_HARDWARE_SQRT(x) __dsqrt_rn(x)
#define Q_IF_EVER(condition) if (__builtin_expect(condition, 0))
#define Q_WANTED(place) ((void)wanted, 1)
#define __builtin_ctzll(bits) (__ffsll((long long)(bits)) - 1)

#include <stdint.h>

/* A place of a component's memory, v[PLACE] in its functions: the next place is L numbers further. */
struct q_place {
    double own, others[L - 1];
    operator double() const { return own; }
    q_place &operator=(double value) { return own = value, *this; }
};
