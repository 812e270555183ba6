/* A host that is not Python and has threads: flies several FMUs, each step of each in a thread made for it.

   threads LIBPYTHON STEPS STEP_SIZE (FMU_LIBRARY RESOURCES_URI GUID OUTPUT,OUTPUT,...)...

   After half of the steps the first FMU is freed and its library closed; the others fly on. Variables are given
   by value reference. Prints the outputs of each FMU after its last step, one FMU a line, to the last digit.
   Ends with 3 if an FMU refuses a call. */

#include <pthread.h>

#define main main_of_the_guide /* its types, log and loading are what this host needs too */
#include "host.c"
#undef main

typedef struct {
    void *library, *component;
    DoStep do_step;
    char *outputs;
    double t, h;
    int status;
} Fmu;

enum { MAX_FMUS = 8 };

static void start(Fmu *fmu, const char *resources, const char *guid)
{
    static const Callbacks callbacks = {print_message, calloc, free, NULL, NULL};
    Instantiate instantiate;
    SetupExperiment setup_experiment;
    Plain enter, leave;
    find(fmu->library, "fmi2Instantiate", &instantiate);
    find(fmu->library, "fmi2SetupExperiment", &setup_experiment);
    find(fmu->library, "fmi2EnterInitializationMode", &enter);
    find(fmu->library, "fmi2ExitInitializationMode", &leave);
    find(fmu->library, "fmi2DoStep", &fmu->do_step);
    fmu->component = instantiate("instance", CO_SIMULATION, guid, resources, &callbacks, 0, 1);
    if (!fmu->component)
        exit(3);
    check(setup_experiment(fmu->component, 0, 0.0, 0.0, 0, 0.0), "fmi2SetupExperiment");
    check(enter(fmu->component), "fmi2EnterInitializationMode");
    check(leave(fmu->component), "fmi2ExitInitializationMode");
}

static void *step(void *argument)
{
    Fmu *fmu = argument;
    fmu->status = fmu->do_step(fmu->component, fmu->t, fmu->h, 1);
    return NULL;
}

static void fly(Fmu *fmus, int count, int first, int last, double h)
{
    pthread_t threads[MAX_FMUS];
    for (int k = first; k < last; k++) {
        for (int i = 0; i < count; i++) {
            fmus[i].t = k * h;
            fmus[i].h = h;
            if (pthread_create(&threads[i], NULL, step, &fmus[i]))
                exit(1);
        }
        for (int i = 0; i < count; i++)
            pthread_join(threads[i], NULL);
        for (int i = 0; i < count; i++)
            check(fmus[i].status, "fmi2DoStep");
    }
}

static void print_and_free(Fmu *fmu)
{
    int (*get_real)(void *, const unsigned *, size_t, double *);
    void (*free_instance)(void *);
    find(fmu->library, "fmi2GetReal", &get_real);
    find(fmu->library, "fmi2FreeInstance", &free_instance);
    unsigned outputs[MAX_OUTPUTS];
    double values[MAX_OUTPUTS];
    size_t n = 0;
    for (char *text = strtok(fmu->outputs, ","); text && n < MAX_OUTPUTS; text = strtok(NULL, ","))
        outputs[n++] = (unsigned)strtoul(text, NULL, 10);
    check(get_real(fmu->component, outputs, n, values), "fmi2GetReal");
    for (size_t i = 0; i < n; i++)
        printf("%.17g%c", values[i], i + 1 < n ? ' ' : '\n');
    free_instance(fmu->component);
    dlclose(fmu->library);
}

int main(int count, char **arguments)
{
    const int fmu_count = (count - 4) / 4;
    if (fmu_count < 1 || fmu_count > MAX_FMUS)
        return 2;
    const int steps = atoi(arguments[2]);
    const double h = strtod(arguments[3], NULL);
    open_library(arguments[1], RTLD_GLOBAL); /* the FMUs find Python's symbols in the global scope */

    Fmu fmus[MAX_FMUS];
    for (int i = 0; i < fmu_count; i++) {
        char **of_this = arguments + 4 + 4 * i;
        fmus[i].library = open_library(of_this[0], RTLD_LOCAL);
        fmus[i].outputs = of_this[3];
        start(&fmus[i], of_this[1], of_this[2]);
    }
    fly(fmus, fmu_count, 0, steps / 2, h);
    print_and_free(&fmus[0]);
    fly(fmus + 1, fmu_count - 1, steps / 2, steps, h);
    for (int i = 1; i < fmu_count; i++)
        print_and_free(&fmus[i]);
    return 0;
}
