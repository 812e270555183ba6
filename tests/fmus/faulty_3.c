/* A library of FMI 3.0 before a sound one: what it is asked it passes on, but for the one fault that the file `fault`
   beside it names. So every fault has the description of one FMU, and one library, that is compiled once.

   The sound one is a dependency, `sound.so`: what is not defined here is found there. Macros give the value references
   of variables, and the token of the sound one, which no damage to a description changes. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef int Status;
typedef const char *Text;
typedef const unsigned *References;
typedef void (*Log)(void *, Status, Text, Text);
enum { OK, ERROR = 3 };

static char fault[64];
static bool is(Text name) { return strcmp(fault, name) == 0; }

__attribute__((constructor)) static void read_fault(void)
{
    Dl_info here;
    char path[4096];
    FILE *file;
    dladdr((void *)read_fault, &here);
    snprintf(path, sizeof path, "%s", here.dli_fname);
    strcpy(strrchr(path, '/') + 1, "fault");
    if ((file = fopen(path, "r"))) {
        if (!fgets(fault, sizeof fault, file))
            fault[0] = '\0';
        fclose(file);
    }
}

/* The function of that name in the sound library. */
#define SOUND(name) ((__typeof__(name) *)dlsym(dlopen("sound.so", RTLD_NOW), #name))

static Log tell;
static void *teller;
static int instances, resets, steps;
static bool initialised, rounded, set, ended;
static double reached, thrust, torque;

Status fmi3SetFloat64(void *c, References vr, size_t n, const double *value, size_t values);

static Status refuse(Text why)
{
    tell(teller, ERROR, "logStatusError", why);
    return ERROR;
}

void *fmi3InstantiateCoSimulation(Text name, Text token, Text resources, bool visible, bool logs, bool events,
                                  bool early, References needed, size_t n, void *environment, Log log, void *update)
{
    tell = log;
    teller = environment;
    instances++;
    initialised = rounded = set = ended = false;
    steps = 0;
    torque = 0.0;
    if (is("no instance")) {
        refuse("no");
        return NULL;
    }
    return SOUND(fmi3InstantiateCoSimulation)(name, TOKEN, resources, visible, logs, events, early, needed, n,
                                              environment, log, update);
}

void *fmi3InstantiateModelExchange(Text name, Text token, Text resources, bool visible, bool logs, void *environment,
                                   Log log)
{
    tell = log;
    teller = environment;
    return SOUND(fmi3InstantiateModelExchange)(name, TOKEN, resources, visible, logs, environment, log);
}

void fmi3FreeInstance(void *c)
{
    instances--;
    SOUND(fmi3FreeInstance)(c);
}

Status fmi3EnterInitializationMode(void *c, bool defined, double tolerance, double t, bool ends, double stop)
{
    if (is("stop not heeded") || (is("stop before start") && stop < t))
        ends = false;
    reached = t;
    return SOUND(fmi3EnterInitializationMode)(c, defined, tolerance, t, ends, stop);
}

Status fmi3ExitInitializationMode(void *c)
{
    if (is("odd"))
        refuse("something is odd");
    initialised = true;
    return SOUND(fmi3ExitInitializationMode)(c);
}

Status fmi3DoStep(void *c, double t, double h, bool no_set, bool *event, bool *ends, bool *early, double *last)
{
    Status status;
    char text[99];
    if (is("fails"))
        return refuse("fmi3DoStep: division by zero");
    if (is("exits"))
        exit(3);
    if (is("one step only") && fabs(h - 0.01) > 1e-9) {
        snprintf(text, sizeof text, "communicationStepSize = %g: expected 0.01", h);
        return refuse(text);
    }
    if (is("no torque") && torque != 0.0)
        return refuse("torque.x = 1: expected 0");
    if (is("any time") || (is("not looked back") && t > reached))
        t = reached;
    status = SOUND(fmi3DoStep)(c, t, h, no_set, event, ends, early, last);
    reached = t + h;
    steps++;
    set = false;
    if (is("event"))
        *event = true;
    if (is("early"))
        *early = true;
    if (is("no time"))
        *last = NAN;
    return status;
}

Status fmi3Terminate(void *c)
{
    bool again = ended;
    ended = true;
    return again && is("terminates twice") ? OK : SOUND(fmi3Terminate)(c);
}

Status fmi3Reset(void *c)
{
    resets++;
    initialised = ended = false;
    return SOUND(fmi3Reset)(c);
}

Status fmi3GetFloat64(void *c, References vr, size_t n, double *value, size_t values)
{
    Status status = SOUND(fmi3GetFloat64)(c, vr, n, value, values);
    for (size_t i = 0; i < n && status == OK; i++) {
        if (vr[i] == POSITION_Y && is("follows"))
            value[i] += initialised ? thrust : 0.0;
        if (vr[i] != POSITION_X)
            continue;
        if (is("not finite") && steps > 3)
            value[i] = NAN;
        if (is("by chance"))
            value[i] += 1e-3 * rand() / RAND_MAX;
        if (is("keeps"))
            value[i] += resets;
        if (is("shares"))
            value[i] += instances > 1;
        if (rounded)
            value[i] += 1e-9;
    }
    return status;
}

static Status set_one(void *c, unsigned vr, double value)
{
    if (vr == MASS && ((is("unbounded") && value <= 0.0) || (is("never fixed") && initialised)))
        return OK;
    if (is("not a number") && !isfinite(value))
        return OK;
    if (vr == TORQUE_X)
        torque = value;
    if (vr == THRUST) {
        thrust = value;
        if (is("adds") && set)
            value += 1.0;
        set = initialised;
    }
    return SOUND(fmi3SetFloat64)(c, &vr, 1, &value, 1);
}

Status fmi3SetFloat64(void *c, References vr, size_t n, const double *value, size_t values)
{
    Status status = OK;
    for (size_t i = 0; i < n && status == OK; i++)
        status = set_one(c, vr[i], value[i]);
    return status;
}

Status fmi3SetFMUState(void *c, void *state)
{
    rounded = rounded || is("forgets");
    return SOUND(fmi3SetFMUState)(c, state);
}

Status fmi3DeserializeFMUState(void *c, const unsigned char *bytes, size_t size, void **state)
{
    rounded = is("rounds");
    return SOUND(fmi3DeserializeFMUState)(c, bytes, size, state);
}
