/* Calls of the operating system that fail, by LD_PRELOAD, on files of a given folder, and calls for memory by libraries
 * of two: the n-th of one kind, or all from it on; or the process is killed before it. Calls are counted in a file that
 * child processes share. Calls that libc makes inside of itself, as those of fwrite, are not seen. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { WRITE, OPEN, RENAME, FSYNC, MMAP, FTRUNCATE, MALLOC, OPERATIONS };
enum { KILL = -1, SHORT = -2 };

/* tests/faults/shim.py packs the same. */
struct plan {
    long calls[OPERATIONS]; /* how many there were, also of those that failed */
    long struck;            /* how many failed */
    long operation, first, last;
    long how; /* the errno, or KILL, or SHORT: half of what was to be written is */
    char folder[PATH_MAX], libraries[PATH_MAX];
};

static struct plan *plan;

#define REAL(name) \
    static __typeof__(&name) real; \
    if (real == NULL) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

/* Without calls that are replaced here. */
void faults_load(const char *path) {
    int file = (int)syscall(SYS_openat, AT_FDCWD, path, O_RDWR | O_CLOEXEC);
    if (file < 0) return;
    void *memory = (void *)syscall(SYS_mmap, NULL, sizeof *plan, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    plan = memory == MAP_FAILED ? NULL : memory;
    syscall(SYS_close, file);
}

__attribute__((constructor)) static void load(void) {
    const char *path = getenv("QUADCOSIM_TESTS_FAULTS");
    if (path != NULL) faults_load(path);
}

static int starts_with(const char *path, const char *folder) {
    return *folder && strncmp(path, folder, strlen(folder)) == 0;
}

static int is_within(const char *path) {
    return starts_with(path, plan->folder);
}

static int of_descriptor(int descriptor, char path[PATH_MAX]) {
    char link[40];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, PATH_MAX - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return 1;
}

static int is_descriptor_within(int descriptor) {
    char path[PATH_MAX];
    int before = errno, within = of_descriptor(descriptor, path) && is_within(path);
    errno = before;
    return within;
}

static int is_path_within(int folder, const char *path) {
    char whole[2 * PATH_MAX], start[PATH_MAX] = "";
    int before = errno, within;
    if (path[0] == '/') return is_within(path);
    if (folder != AT_FDCWD ? !of_descriptor(folder, start) : getcwd(start, sizeof start) == NULL) return 0;
    snprintf(whole, sizeof whole, "%s/%s", start, path);
    within = is_within(whole);
    errno = before;
    return within;
}

/* Whether this call fails, with errno set, or is to be short; a killed process does not return. */
static int strikes(int operation) {
    long n = __atomic_add_fetch(&plan->calls[operation], 1, __ATOMIC_SEQ_CST);
    if (operation != plan->operation || n < plan->first || n > plan->last) return 0;
    __atomic_add_fetch(&plan->struck, 1, __ATOMIC_SEQ_CST);
    if (plan->how == KILL) {
        kill(getpid(), SIGKILL);
        pause();
    }
    if (plan->how != SHORT) errno = (int)plan->how;
    return 1;
}

#define FAILS_ON_DESCRIPTOR(operation, descriptor) (plan && is_descriptor_within(descriptor) && strikes(operation))
#define FAILS_ON_PATH(operation, folder, path) (plan && is_path_within(folder, path) && strikes(operation))

#define WRITE_LIKE(name, parameters, arguments, shorter) \
    ssize_t name parameters { \
        REAL(name); \
        if (!FAILS_ON_DESCRIPTOR(WRITE, out)) return real arguments; \
        return plan->how == SHORT ? real shorter : -1; \
    }

WRITE_LIKE(write, (int out, const void *data, size_t n), (out, data, n), (out, data, (n + 1) / 2))
WRITE_LIKE(pwrite, (int out, const void *data, size_t n, off_t at), (out, data, n, at), (out, data, (n + 1) / 2, at))
WRITE_LIKE(pwrite64, (int out, const void *data, size_t n, off64_t at), (out, data, n, at), (out, data, (n + 1) / 2, at))
WRITE_LIKE(writev, (int out, const struct iovec *parts, int n), (out, parts, n), (out, parts, (n + 1) / 2))
WRITE_LIKE(pwritev, (int out, const struct iovec *parts, int n, off_t at), (out, parts, n, at), (out, parts, (n + 1) / 2, at))
WRITE_LIKE(sendfile, (int out, int in, off_t *at, size_t n), (out, in, at, n), (out, in, at, (n + 1) / 2))
WRITE_LIKE(sendfile64, (int out, int in, off64_t *at, size_t n), (out, in, at, n), (out, in, at, (n + 1) / 2))
WRITE_LIKE(copy_file_range, (int in, off64_t *from, int out, off64_t *at, size_t n, unsigned flags), \
           (in, from, out, at, n, flags), (in, from, out, at, (n + 1) / 2, flags))

static mode_t mode_of(int flags, va_list rest) {
    return (flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(rest, mode_t) : 0;
}

#define OPEN_LIKE(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); \
        va_list rest; \
        va_start(rest, flags); \
        mode_t mode = mode_of(flags, rest); \
        va_end(rest); \
        return FAILS_ON_PATH(OPEN, AT_FDCWD, path) ? -1 : real(path, flags, mode); \
    }

#define OPENAT_LIKE(name) \
    int name(int folder, const char *path, int flags, ...) { \
        REAL(name); \
        va_list rest; \
        va_start(rest, flags); \
        mode_t mode = mode_of(flags, rest); \
        va_end(rest); \
        return FAILS_ON_PATH(OPEN, folder, path) ? -1 : real(folder, path, flags, mode); \
    }

OPEN_LIKE(open)
OPEN_LIKE(open64)
OPENAT_LIKE(openat)
OPENAT_LIKE(openat64)

int creat(const char *path, mode_t mode) {
    return open(path, O_CREAT | O_WRONLY | O_TRUNC, mode);
}

int rename(const char *from, const char *to) {
    REAL(rename);
    return FAILS_ON_PATH(RENAME, AT_FDCWD, to) ? -1 : real(from, to);
}

int renameat(int from_folder, const char *from, int to_folder, const char *to) {
    REAL(renameat);
    return FAILS_ON_PATH(RENAME, to_folder, to) ? -1 : real(from_folder, from, to_folder, to);
}

#define FSYNC_LIKE(name) \
    int name(int file) { \
        REAL(name); \
        return FAILS_ON_DESCRIPTOR(FSYNC, file) ? -1 : real(file); \
    }

FSYNC_LIKE(fsync)
FSYNC_LIKE(fdatasync)

#define MMAP_LIKE(name, offset) \
    void *name(void *at, size_t n, int protection, int flags, int file, offset from) { \
        REAL(name); \
        return file >= 0 && FAILS_ON_DESCRIPTOR(MMAP, file) ? MAP_FAILED : real(at, n, protection, flags, file, from); \
    }

MMAP_LIKE(mmap, off_t)
MMAP_LIKE(mmap64, off64_t)

#define FTRUNCATE_LIKE(name, size) \
    int name(int file, size length) { \
        REAL(name); \
        return FAILS_ON_DESCRIPTOR(FTRUNCATE, file) ? -1 : real(file, length); \
    }

FTRUNCATE_LIKE(ftruncate, off_t)
FTRUNCATE_LIKE(ftruncate64, off64_t)

/* Whether the code at an address is of a library in one of the folders. Most calls come from the same pages, of which
 * the answers are kept. */
static int is_of_library(void *address) {
    static uintptr_t known[1024];
    uintptr_t page = (uintptr_t)address >> 12, *kept = &known[page % 1024], seen = __atomic_load_n(kept, __ATOMIC_RELAXED);
    if (seen >> 1 == page) return seen & 1;
    Dl_info info;
    int within = dladdr(address, &info) && info.dli_fname
                 && (is_within(info.dli_fname) || starts_with(info.dli_fname, plan->libraries));
    __atomic_store_n(kept, page << 1 | (uintptr_t)within, __ATOMIC_RELAXED);
    return within;
}

#define MALLOC_LIKE(name, of_libc, parameters, arguments) \
    extern void *of_libc parameters; \
    void *name parameters { \
        if (plan && is_of_library(__builtin_return_address(0)) && strikes(MALLOC)) return NULL; \
        return of_libc arguments; \
    }

MALLOC_LIKE(malloc, __libc_malloc, (size_t n), (n))
MALLOC_LIKE(calloc, __libc_calloc, (size_t count, size_t n), (count, n))
MALLOC_LIKE(realloc, __libc_realloc, (void *memory, size_t n), (memory, n))
MALLOC_LIKE(aligned_alloc, __libc_memalign, (size_t alignment, size_t n), (alignment, n))
