/* functions.h of an FMU whose code is a user's own C: wrapped.h for instances, with its errors as texts. */

#include "wrapped.h"

/* Fail for the variable, if it is one, that its type in C does not hold, or that is an output and not finite. */
static int expect_held(Instance *m, unsigned variable)
{
    if (variable == VARIABLES)
        return 0;
    const int is_output = variable >= FIRST_OUTPUT && variable < FIRST_PARAMETER;
    text_begin(m);
    text_add(m, names[variable]);
    text_add(m, " = ");
    text_real(m, m->state.memory[variable]);
    text_add(m, is_output ? ": expected a finite value"
                          : ": expected a value that its integer type in C holds; what clips it belongs in the code");
    return fail(m, DIVERGENCE);
}

static int model_enter_stepping(Instance *m)
{
    double *const memory = m->state.memory;
    const unsigned bad = parameter_out_of_bounds(memory, 1);
    if (bad == VARIABLES)
        return expect_held(m, begin_code(memory, 1, memory + KEPT_STATE));
    text_begin(m);
    text_add(m, names[bad]);
    text_add(m, " = ");
    text_real(m, memory[bad]);
    text_add(m, ": expected ");
    text_add(m, bounds[bad - FIRST_PARAMETER]);
    return fail(m, OUT_OF_BOUNDS);
}

static int model_do_step(Instance *m, double t, double h)
{
    double *const memory = m->state.memory;
    if (h > 0.0 && q_isfinite(t + h))
        return expect_held(m, step_code(memory, 1, memory + KEPT_STATE, ALL_DUE));
    text_begin(m);
    text_add(m, q_isfinite(t) ? "communicationStepSize = " : "currentCommunicationPoint = ");
    text_real(m, q_isfinite(t) ? h : t);
    text_add(m, q_isfinite(t) ? ": expected a positive number of seconds" : ": expected a finite time");
    return fail(m, OUT_OF_BOUNDS);
}

#if defined(PARTITIONS)
static int model_run_task(Instance *m, unsigned task)
{
    double *const memory = m->state.memory;
    return expect_held(m, step_code(memory, 1, memory + KEPT_STATE, (int)task));
}
#endif

static int tangents_enter_stepping(Instance *m)
{
    text_begin(m);
    text_add(m, "directional derivatives: not offered by this FMU");
    return fail(m, OUT_OF_BOUNDS);
}
