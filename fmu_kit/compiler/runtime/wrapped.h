/* The computations of an FMU whose code is a user's own C, in place of functions that are generated from Python.

   user_code.c, which is generated, calls that code and reads and sets its variables. The state of an instance is all
   that its objects can write, static variables of functions, too: these sections are one, between two symbols that
   the linker defines. They are the last places of an instance's memory, copied in before a call and out after it, so
   that instances share nothing. */

#include <stddef.h>
#include <string.h>

/* Variables are `apart` places apart, of which the first is given. Those that set some return the number, among these,
   of the first whose value its type in C does not hold, or how many they are. */
void quadcosim_init(void);
void quadcosim_after_parameters(void);
void quadcosim_step(void);
void quadcosim_run(unsigned task);
unsigned quadcosim_set_inputs(const double *values, unsigned apart);
unsigned quadcosim_set_parameters(const double *values, unsigned apart);
void quadcosim_get_outputs(double *values, unsigned apart);

#if STATE_BYTES > 0
extern char __start_quadcosim_state[], __stop_quadcosim_state[];

static void put_state(const double *state) { memcpy(__start_quadcosim_state, state, STATE_BYTES); }
static void take_state(double *state) { memcpy(state, __start_quadcosim_state, STATE_BYTES); }

/* The state before the first call of a process: every instance begins with it. */
static void put_first_state(void)
{
    static char first[STATE_BYTES];
    static int known;
    memcpy(known ? __start_quadcosim_state : first, known ? first : __start_quadcosim_state, STATE_BYTES);
    known = 1;
}
#else
static void put_state(const double *state) { (void)state; }
static void take_state(double *state) { (void)state; }
static void put_first_state(void) {}
#endif

/* Read the outputs; the number of the first that is not finite, or VARIABLES. */
static unsigned read_outputs(double *values, unsigned apart, double *state)
{
    quadcosim_get_outputs(values + FIRST_OUTPUT * apart, apart);
    take_state(state);
    for (unsigned i = FIRST_OUTPUT; i < FIRST_PARAMETER; i++)
        if (!(values[i * apart] - values[i * apart] == 0.0))
            return i;
    return VARIABLES;
}

/* The number of the first parameter out of its bounds, or VARIABLES. */
static unsigned parameter_out_of_bounds(const double *values, unsigned apart)
{
    for (unsigned i = FIRST_PARAMETER; i < VARIABLES; i++)
        if (!(values[i * apart] >= lowest[i - FIRST_PARAMETER] && values[i * apart] <= highest[i - FIRST_PARAMETER]))
            return i;
    return VARIABLES;
}

/* The outputs are as the code's initialisation leaves them: no step is made. */
static unsigned begin_code(double *values, unsigned apart, double *state)
{
    put_first_state();
    quadcosim_init();
    const unsigned parameter = FIRST_PARAMETER + quadcosim_set_parameters(values + FIRST_PARAMETER * apart, apart);
    if (parameter != VARIABLES)
        return parameter;
    quadcosim_after_parameters();
    values[KEPT_STALE * apart] = 0.0;
    return read_outputs(values, apart, state);
}

enum { ALL_DUE = -1 };

/* The code runs once a step, whatever its length: whoever steps it is its timer. So does one of its tasks, or all that
   are due. */
static unsigned step_code(double *values, unsigned apart, double *state, int task)
{
    put_state(state);
    const unsigned input = quadcosim_set_inputs(values, apart);
    if (input != FIRST_OUTPUT)
        return input;
    if (task == ALL_DUE)
        quadcosim_step();
    else
        quadcosim_run((unsigned)task);
    return read_outputs(values, apart, state);
}
