/* The life of instances of the plant as FMI 3.0, with refusals and states, for sanitizers: prints the log. */

#include <stdio.h>
#include <stdlib.h>

#include "fmi3.c"

static void print_message(void *environment, Status status, Text category, Text message)
{
    (void)environment;
    printf("%d %s: %s\n", status, category, message);
}

static void expect_that(int is_so, const char *what)
{
    if (!is_so) {
        printf("not so: %s\n", what);
        exit(1);
    }
}

#define EXPECT(condition) expect_that(condition, #condition)

static void *instantiate(Text token)
{
    return fmi3InstantiateCoSimulation("plant", token, "", false, true, false, false, NULL, 0, NULL, print_message,
                                       NULL);
}

static void refusals(void *c, const uint8_t *bytes, void **state)
{
    const unsigned references[2] = {0, 1};
    bool event, ends, early;
    double last, values[3];
    EXPECT(fmi3GetFloat64(c, references, 2, values, 3) == ERROR);
    EXPECT(fmi3DoStep(c, 2.01, 0.01, true, &event, &ends, &early, &last) == ERROR && last == 2.01);
    EXPECT(fmi3DeserializeFMUState(c, bytes, 7, state) == ERROR);
    EXPECT(fmi3EnterEventMode(c) == ERROR);
    EXPECT(fmi3GetClock(c, references, 1, &event) == ERROR);
    EXPECT(fmi3GetClock(c, references, 0, &event) == OK);
}

static void live(void)
{
    const unsigned known = AT_INITIAL_POSITION_X, unknown = AT_POSITION_X, with_time[3] = {0, TIME, 1};
    const double x = 1.5;
    void *c = instantiate(GUID), *state = NULL, *copy = NULL;
    uint8_t bytes[sizeof(Serialised)];
    bool event, ends, early;
    double last, values[3], before;
    size_t size;

    EXPECT(fmi3EnterInitializationMode(c, false, 0.0, 2.0, false, 0.0) == OK);
    EXPECT(fmi3SetFloat64(c, &known, 1, &x, 1) == OK);
    EXPECT(fmi3GetDirectionalDerivative(c, &unknown, 1, &known, 1, &x, 1, values, 1) == OK && values[0] != 0.0);
    EXPECT(fmi3ExitInitializationMode(c) == OK);
    EXPECT(fmi3DoStep(c, 2.0, 0.01, true, &event, &ends, &early, &last) == OK && last == 2.01);
    EXPECT(fmi3GetFloat64(c, with_time, 3, values, 3) == OK && values[1] == 2.01);
    EXPECT(fmi3GetFMUState(c, &state) == OK);
    EXPECT(fmi3SerializedFMUStateSize(c, state, &size) == OK && size == sizeof bytes);
    EXPECT(fmi3SerializeFMUState(c, state, bytes, size) == OK);
    EXPECT(fmi3DeserializeFMUState(c, bytes, size, &copy) == OK);
    EXPECT(fmi3DoStep(c, 2.01, 0.01, true, &event, &ends, &early, &last) == OK);
    EXPECT(fmi3GetFloat64(c, &unknown, 1, &before, 1) == OK);
    EXPECT(fmi3SetFMUState(c, state) == OK);
    refusals(c, bytes, &copy);
    EXPECT(fmi3SetFMUState(c, copy) == OK);
    EXPECT(fmi3DoStep(c, 2.01, 0.01, true, &event, &ends, &early, &last) == OK);
    EXPECT(fmi3GetFloat64(c, &unknown, 1, values, 1) == OK && values[0] == before);
    EXPECT(fmi3FreeFMUState(c, &state) == OK && fmi3FreeFMUState(c, &copy) == OK && !copy);
    EXPECT(fmi3Terminate(c) == OK && fmi3Reset(c) == OK);
    fmi3FreeInstance(c);
}

static void exchange(void)
{
    const unsigned rates[2] = {FIRST_RATE + 5, AT_ACCELERATION_Z}, input = AT_THRUST;
    const double thrust = 7.0;
    void *c = fmi3InstantiateModelExchange("plant", GUID, "", false, true, NULL, print_message), *state = NULL;
    double x[STATES], dx[STATES], next, values[2];
    bool again, ends, nominals, continuous, has_next;
    size_t n;

    EXPECT(fmi3EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0) == OK);
    EXPECT(fmi3GetContinuousStateDerivatives(c, dx, STATES) == OK);
    EXPECT(fmi3ExitInitializationMode(c) == OK && fmi3GetNumberOfContinuousStates(c, &n) == OK && n == STATES);
    EXPECT(fmi3UpdateDiscreteStates(c, &again, &ends, &nominals, &continuous, &has_next, &next) == OK && !has_next);
    EXPECT(fmi3EnterContinuousTimeMode(c) == OK && fmi3GetContinuousStates(c, x, STATES) == OK);
    EXPECT(fmi3GetFMUState(c, &state) == OK && fmi3SetFloat64(c, &input, 1, &thrust, 1) == OK);
    x[12] = 1.0;
    EXPECT(fmi3SetTime(c, 0.5) == OK && fmi3SetContinuousStates(c, x, STATES) == OK);
    EXPECT(fmi3GetFloat64(c, rates, 2, values, 2) == OK && values[0] == values[1]);
    x[3] = Q_INFINITY;
    EXPECT(fmi3SetContinuousStates(c, x, STATES) == DISCARD);
    EXPECT(fmi3SetFMUState(c, state) == OK && fmi3GetContinuousStateDerivatives(c, x, STATES) == OK);
    for (size_t i = 0; i < STATES; i++)
        EXPECT(x[i] == dx[i]);
    EXPECT(fmi3FreeFMUState(c, &state) == OK && fmi3DoStep(c, 0.5, 0.1, true, &again, &ends, &nominals, x) == ERROR);
    fmi3FreeInstance(c);
}

int main(void)
{
    EXPECT(!instantiate("of another FMU"));
    EXPECT(!fmi3InstantiateScheduledExecution("plant", GUID, "", false, true, NULL, print_message, NULL, NULL, NULL));
    live();
    exchange();
    live();
    exchange();
    fmi3FreeInstance(NULL);
    return 0;
}
