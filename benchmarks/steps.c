/* Times a native FMU: steps LIBRARY GUID STEP_SIZE STEPS prints the CPU time of one fmi2DoStep [us], smallest of 9. */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

static void say(void *environment, const char *name, int status, const char *category, const char *message, ...)
{
    (void)environment;
    fprintf(stderr, "%s, status %d, category %s: %s\n", name, status, category, message);
}

static void find(void *library, const char *name, void *function)
{
    void *symbol = dlsym(library, name);
    if (!symbol)
        exit(1);
    memcpy(function, &symbol, sizeof symbol);
}

int main(int count, char **given)
{
    static const Callbacks callbacks = {say, calloc, free, NULL, NULL};
    void *(*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
    int (*setup)(void *, int, double, double, int, double), (*enter)(void *), (*leave)(void *);
    int (*do_step)(void *, double, double, int);
    if (count != 5)
        return 2;
    void *library = dlopen(given[1], RTLD_NOW);
    if (!library)
        return fprintf(stderr, "%s\n", dlerror()), 1;
    find(library, "fmi2Instantiate", &instantiate);
    find(library, "fmi2SetupExperiment", &setup);
    find(library, "fmi2EnterInitializationMode", &enter);
    find(library, "fmi2ExitInitializationMode", &leave);
    find(library, "fmi2DoStep", &do_step);
    const double h = strtod(given[3], NULL);
    const int steps = atoi(given[4]);
    double shortest = 1e9;
    for (int repetition = 0; repetition < 9; repetition++) {
        void *instance = instantiate("timed", 1, given[2], "", &callbacks, 0, 1);
        if (!instance || setup(instance, 0, 0.0, 0.0, 0, 0.0) || enter(instance) || leave(instance))
            return 3;
        const clock_t start = clock();
        for (int k = 0; k < steps; k++)
            if (do_step(instance, k * h, h, 1))
                return 3;
        const double taken = (double)(clock() - start) / CLOCKS_PER_SEC / steps * 1e6;
        shortest = taken < shortest ? taken : shortest;
    }
    printf("%.4f\n", shortest);
    return 0;
}
