/* The functions of the GPU driver that are used, emulated by the CPU: an image is the path of a library that was
   compiled with processor.h. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { DONE, NOT_FOUND = 500 };

typedef void Play(void *, unsigned, unsigned, void **);
static void *context = &context, *library;

int cuInit(unsigned flags) { return flags; }
int cuDeviceGet(int *device, int number) { return *device = number, DONE; }
int cuDevicePrimaryCtxRetain(void **found, int device) { return *found = context, device; }
int cuCtxSetCurrent(void *given) { return given == context ? DONE : NOT_FOUND; }
int cuCtxSynchronize(void) { return DONE; }
int cuDeviceGetAttribute(int *value, int attribute, int device) { return *value = attribute == 75 ? 9 : 0, device; }
int cuDeviceGetName(char *name, int size, int device) { return strncpy(name, "a processor", size), device; }
int cuGetErrorString(int error, const char **text) { return *text = error == NOT_FOUND ? "not found" : NULL, DONE; }
int cuMemAllocManaged(uint64_t *found, size_t size, unsigned flags)
{
    *found = (uint64_t)aligned_alloc(256, (size + 255) / 256 * 256);
    return flags == 1 && *found ? DONE : NOT_FOUND;
}
int cuMemFree_v2(uint64_t address) { return free((void *)address), DONE; }
int cuModuleLoadData(void **module, const char *path)
{
    library = *module = dlopen(path, RTLD_NOW);
    return *module ? DONE : NOT_FOUND;
}
int cuModuleGetFunction(void **function, void *module, const char *name)
{
    *function = dlsym(module, name);
    return *function ? DONE : NOT_FOUND;
}
int cuLaunchKernel(void *kernel, unsigned blocks, unsigned y, unsigned z, unsigned threads, unsigned ty, unsigned tz,
                   unsigned shared, void *stream, void **given, void **extra)
{
    if (y * z * ty * tz != 1 || shared || stream || extra) return NOT_FOUND;
    ((Play *)dlsym(library, "play"))(kernel, blocks, threads, given);
    return DONE;
}
