/* The library that a host on Linux opens as MODEL.so. The library of pythonfmu, which lies beside it, leaves the
   symbols of Python undefined: a host that is not Python cannot even open it. So this one finds a Python, opens it
   with global symbols, opens that library, and forwards every call. Before, it checks what pythonfmu does not: the
   GUID, that texts are UTF-8, and that the resources are where the URI points. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))

enum { OLDEST_MINOR = 10, NEWEST_MINOR = 30, PATH_SIZE = 4096 }; /* Python 3.10; future versions; length of a path */
enum { ERROR = 3 };

#define VARIABLE "QUADCOSIM_LIBPYTHON"
#define BESIDE "libpythonfmu-export.so"

extern char **environ;

typedef const char *Text;
typedef const unsigned *References;
typedef struct {
    void (*logger)(void *environment, Text instance, int status, Text category, Text message, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

/* -- forwarded calls ------------------------------------------------------------------------------------------ */

#define VALUES(kind, type) \
    CALL(Get##kind, (void *c, References vr, size_t n, type *value), (c, vr, n, value)) \
    CALL(Set##kind, (void *c, References vr, size_t n, const type *value), (c, vr, n, value))

#define CALLS \
    CALL(SetDebugLogging, (void *c, int on, size_t n, const Text *categories), (c, on, n, categories)) \
    CALL(SetupExperiment, (void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop), \
         (c, has_tolerance, tolerance, start, has_stop, stop)) \
    CALL(EnterInitializationMode, (void *c), (c)) \
    CALL(ExitInitializationMode, (void *c), (c)) \
    CALL(Terminate, (void *c), (c)) \
    CALL(Reset, (void *c), (c)) \
    VALUES(Real, double) \
    VALUES(Integer, int) \
    VALUES(Boolean, int) \
    VALUES(String, Text) \
    CALL(GetFMUstate, (void *c, void **state), (c, state)) \
    CALL(SetFMUstate, (void *c, void *state), (c, state)) \
    CALL(FreeFMUstate, (void *c, void **state), (c, state)) \
    CALL(SerializedFMUstateSize, (void *c, void *state, size_t *size), (c, state, size)) \
    CALL(SerializeFMUstate, (void *c, void *state, char *bytes, size_t size), (c, state, bytes, size)) \
    CALL(DeSerializeFMUstate, (void *c, const char *bytes, size_t size, void **state), (c, bytes, size, state)) \
    CALL(GetDirectionalDerivative, \
         (void *c, References z, size_t nz, References v, size_t nv, const double *dv, double *dz), \
         (c, z, nz, v, nv, dv, dz)) \
    CALL(SetRealInputDerivatives, (void *c, References vr, size_t n, const int *order, const double *value), \
         (c, vr, n, order, value)) \
    CALL(GetRealOutputDerivatives, (void *c, References vr, size_t n, const int *order, double *value), \
         (c, vr, n, order, value)) \
    CALL(DoStep, (void *c, double t, double h, int no_restore), (c, t, h, no_restore)) \
    CALL(CancelStep, (void *c), (c)) \
    CALL(GetStatus, (void *c, int kind, int *value), (c, kind, value)) \
    CALL(GetRealStatus, (void *c, int kind, double *value), (c, kind, value)) \
    CALL(GetIntegerStatus, (void *c, int kind, int *value), (c, kind, value)) \
    CALL(GetBooleanStatus, (void *c, int kind, int *value), (c, kind, value)) \
    CALL(GetStringStatus, (void *c, int kind, Text *value), (c, kind, value))

static struct {
#define CALL(name, parameters, arguments) int(*name) parameters;
    CALLS
#undef CALL
    void *(*Instantiate)(Text, int, Text, Text, const Callbacks *, int, int);
    void (*FreeInstance)(void *);
    void (*finalize)(void);
} opened; /* the functions of pythonfmu's library */

#define CALL(name, parameters, arguments) \
    EXPORT int fmi2##name parameters; \
    int fmi2##name parameters { return c ? opened.name arguments : ERROR; }
CALLS
#undef CALL

EXPORT Text fmi2GetTypesPlatform(void);
Text fmi2GetTypesPlatform(void) { return "default"; }

EXPORT Text fmi2GetVersion(void);
Text fmi2GetVersion(void) { return "2.0"; }

EXPORT void fmi2FreeInstance(void *c);
void fmi2FreeInstance(void *c)
{
    if (c)
        opened.FreeInstance(c);
}

EXPORT void finalizePythonInterpreter(void); /* called by a host that is Python before it ends */
void finalizePythonInterpreter(void)
{
    if (opened.finalize)
        opened.finalize();
}

/* -- finding a Python ------------------------------------------------------------------------------------------- */

static char problem[PATH_SIZE + 512]; /* why none was found; written under the lock */

static void *failed(Text format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(problem, sizeof problem, format, arguments);
    va_end(arguments);
    return NULL;
}

static void find(void *library, Text name, void *function)
{
    void *symbol = dlsym(library, name);
    memcpy(function, &symbol, sizeof symbol); /* ISO C has no cast from object to function pointers */
}

/* The minor version of the Python in a library, or in the global scope; 0 if it cannot run an FMU. */
static int version_of(void *library, Text path)
{
    Text (*version)(void);
    find(library, "Py_GetVersion", &version);
    const Text text = version ? version() : "";
    int minor = 0;
    if (strncmp(text, "3.", 2) == 0)
        for (Text digit = text + 2; *digit >= '0' && *digit <= '9'; digit++)
            minor = 10 * minor + (*digit - '0');
    if (minor >= OLDEST_MINOR && !strstr(text, "free-threading"))
        return minor;
    failed("%s is Python %.*s%s: expected 3.%d or newer, not free-threaded", path, (int)strcspn(text, " "), text,
           strstr(text, "free-threading") ? " (free-threaded)" : "", OLDEST_MINOR);
    return 0;
}

/* Whether PYTHONHOME, if set, is for that version: Python ends the process if it finds no standard library. */
static int home_is_valid(int minor)
{
    static const Text places[] = {"lib/python3.%d/os.py", "lib64/python3.%d/os.py", "lib/python3%d.zip"};
    const Text home = getenv("PYTHONHOME");
    char name[32], path[PATH_SIZE + 32];
    if (!home || !*home)
        return 1;
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        snprintf(name, sizeof name, places[i], minor);
        snprintf(path, sizeof path, "%.*s/%s", (int)strcspn(home, ":"), home, name);
        if (access(path, R_OK) == 0)
            return 1;
    }
    failed("PYTHONHOME = %s: expected a folder with the standard library of Python 3.%d, or none", home, minor);
    return 0;
}

#define STARTED "QUADCOSIM_STARTED_PYTHON" /* the process, not a Python program, in which an FMU has started Python */

/* Whether the host is a Python program; decided at the first FMU, which starts Python where none runs. */
static int in_python_program(void)
{
    char process[32];
    const Text started = getenv(STARTED);
    int (*is_initialised)(void);
    snprintf(process, sizeof process, "%ld", (long)getpid());
    if (started && strcmp(started, process) == 0)
        return 0;
    find(RTLD_DEFAULT, "Py_IsInitialized", &is_initialised);
    if (is_initialised && is_initialised())
        return 1;
    setenv(STARTED, process, 1);
    return 0;
}

static void *open_globally(Text path)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        return failed("%s", dlerror());
    const int minor = version_of(library, path);
    if (!minor || !home_is_valid(minor)) {
        dlclose(library);
        return NULL;
    }
    return dlopen(path, RTLD_NOW | RTLD_GLOBAL | RTLD_NODELETE);
}

static int is_python(struct dl_phdr_info *info, size_t size, void *path)
{
    (void)size;
    const Text slash = strrchr(info->dlpi_name, '/'), name = slash ? slash + 1 : info->dlpi_name;
    if (strncmp(name, "libpython3.", 11) != 0 || strlen(info->dlpi_name) >= PATH_SIZE)
        return 0;
    strcpy(path, info->dlpi_name);
    return 1;
}

/* Where `python3` is installed and where its library may be, line by line, as it reports itself. */
static void query_python(char *answer, size_t size)
{
    static char program[] = "import os, sys, sysconfig\n"
                            "name = sysconfig.get_config_var('INSTSONAME') or ''\n"
                            "print(sys.base_prefix)\n"
                            "print(os.path.join(sysconfig.get_config_var('LIBDIR') or '', name))\n"
                            "print(os.path.join(sys.base_prefix, 'lib', name))\n";
    static char *arguments[] = {"python3", "-I", "-S", "-c", program, NULL};
    int ends[2];
    pid_t child;
    size_t length = 0;
    posix_spawn_file_actions_t actions;
    if (pipe2(ends, O_CLOEXEC) != 0)
        return;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
    const int started = posix_spawnp(&child, arguments[0], &actions, NULL, arguments, environ) == 0;
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    for (ssize_t n = 1; n > 0 && length + 1 < size; length += n > 0 ? (size_t)n : 0)
        n = read(ends[0], answer + length, size - 1 - length);
    answer[length] = '\0';
    close(ends[0]);
    if (started)
        waitpid(child, NULL, 0);
}

static void *python_on_path(void)
{
    static wchar_t home[PATH_SIZE];
    char answer[4 * PATH_SIZE], *rest, *library;
    void *python = NULL, (*set_home)(const wchar_t *);
    query_python(answer, sizeof answer);
    const Text prefix = strtok_r(answer, "\n", &rest);
    while (prefix && !python && (library = strtok_r(NULL, "\n", &rest)))
        python = open_globally(library);
    if (python && !getenv("PYTHONHOME") && mbstowcs(home, prefix, PATH_SIZE) < PATH_SIZE) {
        find(python, "Py_SetPythonHome", &set_home); /* a python3 on PATH that is a shim would mislead it */
        if (set_home)
            set_home(home);
    }
    return python;
}

static void *python_of_the_system(void)
{
    void *python = NULL;
    char name[64];
    for (int minor = NEWEST_MINOR; !python && minor >= OLDEST_MINOR; minor--) {
        snprintf(name, sizeof name, "libpython3.%d.so.1.0", minor);
        python = open_globally(name);
    }
    return python;
}

/* Ensure a Python: that of this process, or else one that is configured, on PATH or known to the system's loader. */
static int ensure_python(void)
{
    char path[PATH_SIZE];
    const Text configured = getenv(VARIABLE);
    if (dlsym(RTLD_DEFAULT, "Py_GetVersion"))
        return version_of(RTLD_DEFAULT, "this process") != 0;
    if (dl_iterate_phdr(is_python, path))
        return open_globally(path) != NULL;
    if (configured && *configured)
        return open_globally(configured) != NULL;
    if (python_on_path() || python_of_the_system())
        return 1;
    failed("no shared library of Python 3.%d or newer%s, neither of the python3 on PATH nor where libraries are "
           "installed: install one (Debian, Ubuntu: libpython3-dev; Fedora: python3-libs) or set %s to the path of a "
           "libpython3.X.so.1.0", OLDEST_MINOR, getenv("PYTHONHOME") ? " that fits PYTHONHOME" : "", VARIABLE);
    return 0;
}

/* -- pythonfmu's library ---------------------------------------------------------------------------------------- */

static char folder[PATH_SIZE]; /* of this library, with a slash at its end */

__attribute__((constructor)) static void store_folder(void)
{
    Dl_info own;
    char path[PATH_SIZE];
    if (dladdr(folder, &own) && realpath(own.dli_fname, path) && strrchr(path, '/')) {
        strrchr(path, '/')[1] = '\0'; /* now: the host may change its folder before it calls */
        strcpy(folder, path);
    }
}

static void *closing; /* pythonfmu's library, if it is closed with this one */

/* In a Python program, hosts unpack and load an FMU again for each instance, so it must be unloaded completely. In any
   other, pythonfmu's library owns the running Python, so it stays. */
__attribute__((destructor)) static void close_pythonfmu(void)
{
    if (!closing)
        return;
    finalizePythonInterpreter(); /* otherwise pythonfmu frees a pointer twice as it is unloaded */
    dlclose(closing);
}

static int open_pythonfmu(void)
{
    char path[PATH_SIZE + sizeof BESIDE];
    if (opened.Instantiate)
        return 1;
    const int in_python = in_python_program();
    if (!ensure_python())
        return 0;
    snprintf(path, sizeof path, "%s%s", folder, BESIDE);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL | (in_python ? 0 : RTLD_NODELETE));
    if (!library)
        return failed("%s", dlerror()) != NULL;
    closing = in_python ? library : NULL;
#define CALL(name, parameters, arguments) find(library, "fmi2" #name, &opened.name);
    CALLS
#undef CALL
    find(library, "fmi2FreeInstance", &opened.FreeInstance);
    find(library, "finalizePythonInterpreter", &opened.finalize);
    find(library, "fmi2Instantiate", &opened.Instantiate);
    return opened.Instantiate != NULL;
}

/* -- arguments of the host -------------------------------------------------------------------------------------- */

/* Whether a text is UTF-8, without surrogates and overlong forms: Python accepts no other. */
static int is_utf8(Text text)
{
    for (const unsigned char *at = (const unsigned char *)text; *at;) {
        static const unsigned least[] = {0, 0x80, 0x800, 0x10000};
        const int more = *at < 0x80 ? 0 : *at < 0xc0 ? -1 : *at < 0xe0 ? 1 : *at < 0xf0 ? 2 : *at < 0xf8 ? 3 : -1;
        if (more < 0)
            return 0;
        unsigned code = more ? *at & (0x3f >> more) : *at;
        at++;
        for (int i = 0; i < more; i++, at++) {
            if ((*at & 0xc0) != 0x80)
                return 0;
            code = code << 6 | (*at & 0x3f);
        }
        if (code < least[more] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000))
            return 0;
    }
    return 1;
}

static int hexadecimal(char c)
{
    const Text digits = "0123456789abcdef", found = c ? strchr(digits, c | 0x20) : NULL;
    return found ? (int)(found - digits) : -1;
}

static void unescape(char *text)
{
    char *to = text;
    for (const char *from = text; *from; to++) {
        const int high = *from == '%' ? hexadecimal(from[1]) : -1, low = high < 0 ? -1 : hexadecimal(from[2]);
        *to = low < 0 ? *from : (char)(16 * high + low);
        from += low < 0 ? 1 : 3;
    }
    *to = '\0';
}

/* Open a file in the folder of the resources. */
static FILE *resource(Text resources, Text name)
{
    char path[PATH_SIZE + 32];
    snprintf(path, sizeof path, "%s/%s", resources, name);
    return fopen(path, "re");
}

static int has_fmu_resources(Text resources)
{
    FILE *file = resource(resources, "slavemodule.txt");
    return file ? fclose(file) == 0 : 0;
}

/* The path of the resources: of file:///a%20b, file:/a%20b, file://localhost/a%20b, or the plain path itself. */
static int find_resources(Text location, char *path)
{
    Text start = location;
    if (strncmp(location, "file:", 5) == 0) {
        start += strncmp(location, "file://localhost/", 17) == 0 ? 16 : strncmp(location, "file://", 7) == 0 ? 7 : 5;
        snprintf(path, PATH_SIZE, "%s", start);
        unescape(path);
    } else {
        snprintf(path, PATH_SIZE, "%s", start);
        if (!has_fmu_resources(path)) /* some hosts remove file:// but not the escapes */
            unescape(path);
    }
    for (char *end = path + strlen(path); end > path + 1 && end[-1] == '/';)
        *--end = '\0';
    return has_fmu_resources(path);
}

static int is_guid(Text resources, Text guid, char *expected, int size)
{
    FILE *file = resource(resources, "guid.txt");
    if (!file)
        return 1;
    const int known = fgets(expected, size, file) != NULL;
    fclose(file);
    return !known || strcmp(guid, expected) == 0;
}

static void *refuse(const Callbacks *callbacks, Text name, Text format, ...)
{
    char text[sizeof problem + 256], message[2 * sizeof text], *to = message;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (Text from = text; *from; from++) { /* a message is a format without arguments, like pythonfmu's */
        *to++ = *from;
        if (*from == '%')
            *to++ = '%';
    }
    *to = '\0';
    if (callbacks && callbacks->logger)
        callbacks->logger(callbacks->environment, name, ERROR, NULL, message);
    return NULL;
}

EXPORT void *fmi2Instantiate(Text, int, Text, Text, const Callbacks *, int, int);
void *fmi2Instantiate(Text name, int kind, Text guid, Text location, const Callbacks *callbacks, int visible, int logs)
{
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    char path[PATH_SIZE], expected[64], why[sizeof problem];
    if (!name || !guid || !location || !callbacks)
        return refuse(callbacks, name, "fmi2Instantiate: expected instanceName, GUID, resource location and callbacks");
    if (!is_utf8(name))
        return refuse(callbacks, "", "instanceName: expected UTF-8");
    if (!find_resources(location, path))
        return refuse(callbacks, name, "fmuResourceLocation = %s: expected the URI of the resources of this FMU", location);
    if (!is_utf8(path) || strstr(path, "%20") || strstr(path, "file://"))
        return refuse(callbacks, name, "%s: expected a path in UTF-8, without %%20 and file:// in it", path);
    if (!is_guid(path, guid, expected, sizeof expected))
        return refuse(callbacks, name, "GUID = %s: expected %s, that of this FMU", guid, expected);
    pthread_mutex_lock(&lock);
    const int complete = open_pythonfmu();
    memcpy(why, problem, sizeof why);
    pthread_mutex_unlock(&lock);
    if (!complete)
        return refuse(callbacks, name, "%s", why);
    return opened.Instantiate(name, kind, guid, path, callbacks, visible, logs);
}
