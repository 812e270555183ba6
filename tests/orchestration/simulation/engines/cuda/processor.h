/* The parts of CUDA beyond C++, for a CPU that executes the threads of a GPU one after another. */

#include <stdint.h>
#include <string.h>

#define __global__
#define __noinline__ __attribute__((noinline))

static struct {
    unsigned x;
} threadIdx, blockIdx, blockDim;

static inline double __dsqrt_rn(double x) { return __builtin_sqrt(x); }
static inline int __ffsll(long long bits) { return __builtin_ffsll(bits); }
static inline unsigned __activemask() { return 1; }
static inline int __any_sync(unsigned, int condition) { return condition; }
static inline void atomicAnd(unsigned long long *bits, unsigned long long other) { *bits &= other; }
static inline void atomicOr(unsigned long long *bits, unsigned long long other) { *bits |= other; }

/* Called by gpu.c. */
extern "C" void play(void (*kernel)(int64_t, int64_t), unsigned blocks, unsigned threads, void **given) {
    blockDim.x = threads;
    for (blockIdx.x = 0; blockIdx.x < blocks; blockIdx.x++)
        for (threadIdx.x = 0; threadIdx.x < threads; threadIdx.x++)
            kernel(*(int64_t *)given[0], *(int64_t *)given[1]);
}
