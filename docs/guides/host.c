/* A host that is not Python: flies the controller FMU as a tool written in C would.

   host LIBPYTHON FMU_LIBRARY RESOURCES_URI GUID STEPS STEP_SIZE OUTPUT,OUTPUT,... [INPUT=VALUE ...]

   LIBPYTHON is - for an FMU that needs no Python, or finds one itself.
   Variables are given by value reference. Prints each output after the last step, one a line, to the last
   digit. The log goes to stderr. Ends with 3 if the FMU refuses a call. */

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    void (*logger)(void *environment, const char *instance, int status, const char *category, const char *message, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

typedef void *(*Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
typedef int (*SetupExperiment)(void *, int, double, double, int, double);
typedef int (*Plain)(void *);
typedef void (*Free)(void *);
typedef int (*SetReal)(void *, const unsigned *, size_t, const double *);
typedef int (*GetReal)(void *, const unsigned *, size_t, double *);
typedef int (*DoStep)(void *, double, double, int);

enum { WARNING = 1, CO_SIMULATION = 1, MAX_OUTPUTS = 16 };

static void print_message(void *environment, const char *instance, int status, const char *category,
                          const char *message, ...)
{
    (void)environment;
    fprintf(stderr, "%s, status %d, category %s: ", instance, status, category ? category : "none");
    va_list arguments;
    va_start(arguments, message);
    vfprintf(stderr, message, arguments); /* the message is a format: FMI 2.0, section 2.1.5 */
    va_end(arguments);
    fputc('\n', stderr);
}

static void *open_library(const char *path, int mode)
{
    void *library = dlopen(path, RTLD_NOW | mode);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    return library;
}

static void find(void *library, const char *name, void *function)
{
    void *symbol = dlsym(library, name);
    if (!symbol) {
        fprintf(stderr, "no %s\n", name);
        exit(1);
    }
    memcpy(function, &symbol, sizeof symbol); /* ISO C has no cast from object to function pointers */
}

static void check(int status, const char *call)
{
    if (status > WARNING) {
        fprintf(stderr, "%s: status %d\n", call, status);
        exit(3);
    }
}

int main(int count, char **arguments)
{
    if (count < 8)
        return 2;
    const char *resources = arguments[3], *guid = arguments[4];
    const int steps = atoi(arguments[5]);
    const double h = strtod(arguments[6], NULL);

    if (strcmp(arguments[1], "-") != 0)
        open_library(arguments[1], RTLD_GLOBAL); /* the FMU finds Python's symbols in the global scope */
    void *fmu = open_library(arguments[2], RTLD_LOCAL);
    Instantiate instantiate;
    SetupExperiment setup_experiment;
    Plain enter, leave, terminate;
    Free free_instance;
    SetReal set_real;
    GetReal get_real;
    DoStep do_step;
    find(fmu, "fmi2Instantiate", &instantiate);
    find(fmu, "fmi2SetupExperiment", &setup_experiment);
    find(fmu, "fmi2EnterInitializationMode", &enter);
    find(fmu, "fmi2ExitInitializationMode", &leave);
    find(fmu, "fmi2Terminate", &terminate);
    find(fmu, "fmi2FreeInstance", &free_instance);
    find(fmu, "fmi2SetReal", &set_real);
    find(fmu, "fmi2GetReal", &get_real);
    find(fmu, "fmi2DoStep", &do_step);

    const Callbacks callbacks = {print_message, calloc, free, NULL, NULL};
    void *controller = instantiate("controller", CO_SIMULATION, guid, resources, &callbacks, 0, 1);
    if (!controller)
        return 3;
    check(setup_experiment(controller, 0, 0.0, 0.0, 1, steps * h), "fmi2SetupExperiment");
    check(enter(controller), "fmi2EnterInitializationMode");
    for (int i = 8; i < count; i++) {
        char *end;
        const unsigned reference = (unsigned)strtoul(arguments[i], &end, 10);
        const double value = strtod(end + 1, NULL);
        check(set_real(controller, &reference, 1, &value), "fmi2SetReal");
    }
    check(leave(controller), "fmi2ExitInitializationMode");
    for (int k = 0; k < steps; k++)
        check(do_step(controller, k * h, h, 1), "fmi2DoStep");

    unsigned outputs[MAX_OUTPUTS];
    double values[MAX_OUTPUTS];
    size_t n = 0;
    for (char *text = strtok(arguments[7], ","); text && n < MAX_OUTPUTS; text = strtok(NULL, ","))
        outputs[n++] = (unsigned)strtoul(text, NULL, 10);
    check(get_real(controller, outputs, n, values), "fmi2GetReal");
    for (size_t i = 0; i < n; i++)
        printf("%.17g\n", values[i]);

    check(terminate(controller), "fmi2Terminate");
    free_instance(controller);
    return 0;
}
