/* The library of a traced copy of an FMU: it records a line of JSON for the end of initialisation and for each step.
   Every call is forwarded to the FMU's own library in the same folder. The file NAME.record there has, a line each: the
   path of the log, the FMU's own library, its GUID (a copy has another, as some hosts keep one library for each), the
   numbers of connected inputs and outputs, and the type and reference of each. Inputs are remembered as they are set:
   FMI 2.0 allows no reading between a set and a step. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define ALL(CALL) \
    CALL(GetTypesPlatform) CALL(GetVersion) CALL(SetDebugLogging) CALL(FreeInstance) \
    CALL(SetupExperiment) CALL(EnterInitializationMode) CALL(Terminate) CALL(Reset) \
    CALL(GetReal) CALL(GetInteger) CALL(GetBoolean) CALL(GetString) CALL(SetString) \
    CALL(GetFMUstate) CALL(SetFMUstate) CALL(FreeFMUstate) CALL(SerializedFMUstateSize) CALL(SerializeFMUstate) \
    CALL(DeSerializeFMUstate) CALL(GetDirectionalDerivative) CALL(SetRealInputDerivatives) \
    CALL(GetRealOutputDerivatives) CALL(CancelStep) CALL(GetStatus) CALL(GetRealStatus) CALL(GetIntegerStatus) \
    CALL(GetBooleanStatus) CALL(GetStringStatus)
#define WATCHED(CALL) CALL(Instantiate) CALL(ExitInitializationMode) CALL(DoStep) CALL(SetReal) CALL(SetInteger) CALL(SetBoolean)

enum { ERROR = 3, LINE_SIZE = 4096 };
enum { REAL, INTEGER, BOOLEAN };
typedef const unsigned *References;
typedef struct {
    int kind;
    unsigned reference;
    double value;
} Port;

static void *own;
static FILE *record;
static char guid[LINE_SIZE];
static Port *inputs, *outputs;
static int input_count, output_count;

static int missing(void) { return ERROR; }

#define CALL(name) __attribute__((visibility("hidden"))) void *own_##name = (void *)missing;
ALL(CALL)
WATCHED(CALL)
#undef CALL

/* A jump leaves registers and stack as they are, so that the arguments need not be known. */
#define CALL(name) \
    EXPORT void fmi2##name(void); \
    __attribute__((naked)) void fmi2##name(void) { __asm__("jmp *own_" #name "(%rip)"); }
ALL(CALL)
#undef CALL

static Port *ports(FILE *file, int count)
{
    Port *found = calloc(count + 1, sizeof *found);
    for (int i = 0; i < count; i++)
        if (fscanf(file, "%d %u", &found[i].kind, &found[i].reference) != 2)
            abort();
    return found;
}

__attribute__((constructor)) static void open_own(void)
{
    Dl_info here;
    char path[3 * LINE_SIZE], line[LINE_SIZE];
    if (!dladdr((void *)missing, &here))
        abort();
    snprintf(path, sizeof path, "%.*s.record", (int)(strlen(here.dli_fname) - strlen(".so")), here.dli_fname);
    FILE *file = fopen(path, "re");
    if (!file || !fgets(line, sizeof line, file))
        abort();
    line[strcspn(line, "\n")] = '\0';
    record = fopen(line, "ae");
    if (!record || !fgets(line, sizeof line, file) || !fgets(guid, sizeof guid, file))
        abort();
    line[strcspn(line, "\n")] = guid[strcspn(guid, "\n")] = '\0';
    snprintf(path, sizeof path, "%.*s/%s", (int)(strrchr(here.dli_fname, '/') - here.dli_fname), here.dli_fname, line);
    own = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!own) {
        fprintf(stderr, "%s\n", dlerror());
        abort();
    }
    if (fscanf(file, "%d %d", &input_count, &output_count) != 2)
        abort();
    inputs = ports(file, input_count);
    outputs = ports(file, output_count);
    fclose(file);
#define CALL(name) { void *found = dlsym(own, "fmi2" #name); if (found) own_##name = found; }
    ALL(CALL)
    WATCHED(CALL)
#undef CALL
}

EXPORT void finalizePythonInterpreter(void); /* an FMU with Python inside calls it in its library as a process ends */
void finalizePythonInterpreter(void)
{
    void (*finalize)(void) = (void (*)(void))dlsym(own, "finalizePythonInterpreter");
    if (finalize)
        finalize();
}

__attribute__((destructor)) static void close_own(void)
{
    fclose(record);
    dlclose(own);
}

static void read_from(void *c, Port *port)
{
    int whole = 0;
    if (port->kind == REAL)
        ((int (*)(void *, References, size_t, double *))own_GetReal)(c, &port->reference, 1, &port->value);
    else {
        void *get = port->kind == INTEGER ? own_GetInteger : own_GetBoolean;
        ((int (*)(void *, References, size_t, int *))get)(c, &port->reference, 1, &whole);
        port->value = whole;
    }
}

static void put(const char *name, const Port *of, int count)
{
    fprintf(record, "\"%s\": [", name);
    for (int i = 0; i < count; i++) {
        const double value = of[i].value;
        if (isfinite(value)) /* an exponent, so that a reader takes -0 for a float */
            fprintf(record, "%s%.16e", i ? ", " : "", value);
        else
            fprintf(record, "%s%s", i ? ", " : "", isnan(value) ? "NaN" : value > 0 ? "Infinity" : "-Infinity");
    }
    fprintf(record, "]");
}

static void put_line(void *c)
{
    for (int i = 0; i < output_count; i++)
        read_from(c, &outputs[i]);
    put("outputs", outputs, output_count);
    fprintf(record, "}\n");
    fflush(record);
}

typedef void *Instantiate(const char *, int, const char *, const char *, const void *, int, int);
EXPORT Instantiate fmi2Instantiate;
void *fmi2Instantiate(const char *name, int kind, const char *given, const char *place, const void *callbacks,
                      int visible, int logs)
{
    (void)given;
    return ((Instantiate *)own_Instantiate)(name, kind, guid, place, callbacks, visible, logs);
}

EXPORT int fmi2ExitInitializationMode(void *c);
int fmi2ExitInitializationMode(void *c)
{
    const int status = ((int (*)(void *))own_ExitInitializationMode)(c);
    for (int i = 0; i < input_count; i++)
        read_from(c, &inputs[i]);
    fprintf(record, "{");
    put("inputs", inputs, input_count);
    fprintf(record, ", ");
    put_line(c);
    return status;
}

EXPORT int fmi2DoStep(void *c, double t, double h, int no_restore);
int fmi2DoStep(void *c, double t, double h, int no_restore)
{
    fprintf(record, "{\"t\": %.17g, \"h\": %.17g, ", t, h);
    put("inputs", inputs, input_count);
    fprintf(record, ", ");
    const int status = ((int (*)(void *, double, double, int))own_DoStep)(c, t, h, no_restore);
    put_line(c);
    return status;
}

#define SETTER(name, of, type) \
    EXPORT int fmi2Set##name(void *c, References references, size_t count, const type *values); \
    int fmi2Set##name(void *c, References references, size_t count, const type *values) \
    { \
        for (size_t k = 0; k < count; k++) \
            for (int i = 0; i < input_count; i++) \
                if (inputs[i].kind == of && inputs[i].reference == references[k]) \
                    inputs[i].value = values[k]; \
        return ((int (*)(void *, References, size_t, const type *))own_Set##name)(c, references, count, values); \
    }
SETTER(Real, REAL, double)
SETTER(Integer, INTEGER, int)
SETTER(Boolean, BOOLEAN, int)
