/* The whole life of instances of a native FMU, for tools that watch memory: compiled together with its sources.

   Takes no arguments. Two threads go through it at once, each with instances of its own. Names the line on which
   something is not as expected, and ends with 1; memory that a step asks for is such a thing. */

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

static _Thread_local int asked;
static void *counted_malloc(size_t size)
{
    asked++;
    return malloc(size);
}
static void *counted_calloc(size_t count, size_t size)
{
    asked++;
    return calloc(count, size);
}
#define malloc counted_malloc
#define calloc counted_calloc
#include "fmi2.c"

enum { STEPS = 50 };
static _Thread_local int messages;
static void count_message(void *environment, Text instance, Status status, Text category, Text message, ...)
{
    (void)environment, (void)instance, (void)status, (void)category, (void)message;
    messages++;
}

#define EXPECT(condition) \
    if (!(condition)) { \
        fprintf(stderr, "line %d\n", __LINE__); \
        exit(1); \
    }

static void host_initialise(void *c)
{
    EXPECT(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == OK)
    EXPECT(fmi2EnterInitializationMode(c) == OK)
    EXPECT(fmi2ExitInitializationMode(c) == OK)
}

static void host_fly(void *c, int first, int last, double out[VARIABLES])
{
    static const double h = 0.01;
    unsigned vr[VARIABLES], n = 0;
    for (unsigned i = 0; i < VARIABLES; i++)
        if (types[i] == REAL)
            vr[n++] = i;
    for (int k = first; k < last; k++) {
        const int before = asked;
        EXPECT(fmi2DoStep(c, k * h, h, 1) == OK)
        EXPECT(asked == before)
    }
    EXPECT(fmi2GetReal(c, vr, n, out) == OK)
}

static void host_goes_back(void *c, const Host *host)
{
    double there[VARIABLES] = {0}, again[VARIABLES] = {0};
    void *state = NULL, *read = NULL, *other;
    size_t size;
    char *bytes;
    EXPECT(fmi2GetFMUstate(c, &state) == OK)
    EXPECT(fmi2GetFMUstate(c, &state) == OK) /* into what is there */
    EXPECT(fmi2SerializedFMUstateSize(c, state, &size) == OK)
    EXPECT((bytes = malloc(size)) != NULL)
    EXPECT(fmi2SerializeFMUstate(c, state, bytes, size) == OK)
    host_fly(c, STEPS, 2 * STEPS, there);
    EXPECT(fmi2SetFMUstate(c, state) == OK)
    host_fly(c, STEPS, 2 * STEPS, again);
    EXPECT(memcmp(there, again, sizeof there) == 0)
    EXPECT((other = fmi2Instantiate("other", CO_SIMULATION, GUID, "", host, 0, 1)) != NULL)
    EXPECT(fmi2DeSerializeFMUstate(other, bytes, size, &read) == OK)
    EXPECT(fmi2SetFMUstate(other, read) == OK)
    host_fly(other, STEPS, 2 * STEPS, again);
    EXPECT(memcmp(there, again, sizeof there) == 0)
    for (size_t cut = 0; cut < size; cut += 1 + size / 9) {
        void *nothing = NULL;
        EXPECT(fmi2DeSerializeFMUstate(other, bytes, cut, &nothing) == ERROR && nothing == NULL)
    }
    for (size_t k = 0; k < sizeof(Owner); k++) {
        bytes[k] = (char)~bytes[k];
        EXPECT(fmi2DeSerializeFMUstate(other, bytes, size, &read) == ERROR)
        bytes[k] = (char)~bytes[k];
    }
    EXPECT(fmi2SerializeFMUstate(other, read, bytes, size - 1) == ERROR)
    EXPECT(fmi2SetFMUstate(other, NULL) == ERROR)
    EXPECT(fmi2GetFMUstate(other, NULL) == ERROR && fmi2SerializedFMUstateSize(other, read, NULL) == ERROR)
    EXPECT(fmi2SerializeFMUstate(other, NULL, bytes, size) == ERROR)
    EXPECT(fmi2SerializeFMUstate(other, read, NULL, size) == ERROR)
    EXPECT(fmi2DeSerializeFMUstate(other, NULL, size, &read) == ERROR)
    EXPECT(fmi2DeSerializeFMUstate(other, bytes, size, NULL) == ERROR)
    EXPECT(fmi2FreeFMUstate(other, &read) == OK && read == NULL)
    EXPECT(fmi2FreeFMUstate(c, &state) == OK && fmi2FreeFMUstate(c, &state) == OK && fmi2FreeFMUstate(c, NULL) == OK)
    fmi2FreeInstance(other);
    free(bytes);
}

static void host_comes_back(void *c)
{
    static const unsigned none[] = {0, VARIABLES, 4000000000u};
    static const Text asked_for[] = {"divergence", NULL, "something"};
    const double nan = 0.0 / (1.0 - 1.0), huge[] = {1e308};
    double values[3];
    int whole[3];
    Text words[1];
    EXPECT(fmi2GetReal(c, none, 3, values) == ERROR)
    EXPECT(fmi2GetInteger(c, none, 3, whole) == ERROR && fmi2GetBoolean(c, none, 3, whole) == ERROR)
    EXPECT(fmi2GetString(c, none, 1, words) == ERROR && fmi2GetString(c, NULL, 0, NULL) == OK)
    EXPECT(fmi2DoStep(c, 0.0, 0.01, 1) == ERROR && fmi2DoStep(c, nan, nan, 1) == ERROR)
    EXPECT(fmi2CancelStep(c) == ERROR && messages > 8)
    EXPECT(fmi2Reset(c) == OK && fmi2SetDebugLogging(c, 1, 3, asked_for) == OK)
    for (unsigned i = 0; i < VARIABLES; i++) {
        fmi2Reset(c);
        EXPECT(fmi2SetReal(c, &i, 1, &nan) == ERROR)
        fmi2Reset(c);
        if (fmi2SetReal(c, &i, 1, huge) == OK && fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == OK) {
            fmi2EnterInitializationMode(c);
            for (unsigned k = 0; k < VARIABLES; k++)
                if (types[k] == REAL && fmi2GetReal(c, &k, 1, values) == OK)
                    fmi2GetDirectionalDerivative(c, &k, 1, &i, 1, huge, values);
            fmi2ExitInitializationMode(c);
            fmi2DoStep(c, 0.0, 0.01, 1);
        }
    }
    EXPECT(fmi2Reset(c) == OK)
    host_initialise(c);
    EXPECT(fmi2Terminate(c) == OK)
}

static void *host_live(void *argument)
{
    const Host host = {count_message, calloc, free, NULL, NULL};
    double out[VARIABLES] = {0};
    void *c;
    (void)argument;
    EXPECT(fmi2Instantiate("it", CO_SIMULATION, "another", "", &host, 0, 1) == NULL)
    for (int round = 0; round < 2; round++) {
        EXPECT((c = fmi2Instantiate("it", CO_SIMULATION, GUID, NULL, &host, 0, 1)) != NULL)
        host_initialise(c);
        host_fly(c, 0, STEPS, out);
        host_goes_back(c, &host);
        host_comes_back(c);
        fmi2FreeInstance(c);
    }
    fmi2FreeInstance(NULL);
    return NULL;
}

int main(void)
{
    pthread_t threads[2];
    for (int k = 0; k < 2; k++)
        EXPECT(pthread_create(&threads[k], NULL, host_live, NULL) == 0)
    for (int k = 0; k < 2; k++)
        pthread_join(threads[k], NULL);
    return 0;
}
