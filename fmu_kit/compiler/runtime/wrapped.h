/* The computations of an FMU whose code is a user's own C, in place of functions that are generated from Python.

   user_code.c, which is generated, calls that code and reads and sets its variables. The state of an instance is all
   that its objects can write, static variables of functions, too: these sections are one, between two symbols that
   the linker defines. They are the last places of an instance's memory, copied in before a call and out after it, so
   that instances share nothing. */

#include <stddef.h>
#include <string.h>

void quadcosim_init(void);
void quadcosim_after_parameters(void);
void quadcosim_step(void);
void quadcosim_set(unsigned variable, double x);
double quadcosim_get(unsigned variable);

#if STATE_BYTES > 0
extern char __start_quadcosim_state[], __stop_quadcosim_state[];

static void put_state(const double *memory) { memcpy(__start_quadcosim_state, memory + KEPT_STATE, STATE_BYTES); }
static void take_state(double *memory) { memcpy(memory + KEPT_STATE, __start_quadcosim_state, STATE_BYTES); }

/* The state before the first call of a process: every instance begins with it. */
static void put_first_state(void)
{
    static char first[STATE_BYTES];
    static int known;
    memcpy(known ? __start_quadcosim_state : first, known ? first : __start_quadcosim_state, STATE_BYTES);
    known = 1;
}
#else
static void put_state(const double *memory) { (void)memory; }
static void take_state(double *memory) { (void)memory; }
static void put_first_state(void) {}
#endif

/* Read the outputs; the number of the first that is not finite, or VARIABLES. */
static unsigned read_outputs(double *memory)
{
    unsigned bad = VARIABLES;
    for (unsigned i = FIRST_OUTPUT; i < FIRST_PARAMETER; i++) {
        memory[i] = quadcosim_get(i);
        if (bad == VARIABLES && !(memory[i] - memory[i] == 0.0))
            bad = i;
    }
    take_state(memory);
    return bad;
}

/* The number of the first parameter out of its bounds, or VARIABLES. */
static unsigned parameter_out_of_bounds(const double *memory)
{
    unsigned i = FIRST_PARAMETER;
    while (i < VARIABLES && memory[i] >= lowest[i - FIRST_PARAMETER] && memory[i] <= highest[i - FIRST_PARAMETER])
        i++;
    return i;
}

/* The outputs are as the code's initialisation leaves them: no step is made. */
static unsigned begin_code(double *memory)
{
    put_first_state();
    quadcosim_init();
    for (unsigned i = FIRST_PARAMETER; i < VARIABLES; i++)
        quadcosim_set(i, memory[i]);
    quadcosim_after_parameters();
    memory[KEPT_STALE] = 0.0;
    return read_outputs(memory);
}

/* The code runs once a step, whatever its length: whoever steps it is its timer. */
static unsigned step_code(double *memory)
{
    put_state(memory);
    for (unsigned i = 0; i < FIRST_OUTPUT; i++)
        quadcosim_set(i, memory[i]);
    quadcosim_step();
    return read_outputs(memory);
}
