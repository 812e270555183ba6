/* functions.h of an FMU whose code is a user's own C: wrapped.h for instances, with its errors as texts. */

#include "wrapped.h"

static int expect_finite(Instance *m, unsigned variable)
{
    if (variable == VARIABLES)
        return 0;
    text_begin(m);
    text_add(m, names[variable]);
    text_add(m, " = ");
    text_real(m, m->state.memory[variable]);
    text_add(m, ": expected a finite value");
    return fail(m, DIVERGENCE);
}

static int model_enter_stepping(Instance *m)
{
    double *const memory = m->state.memory;
    const unsigned bad = parameter_out_of_bounds(memory, 1);
    if (bad == VARIABLES)
        return expect_finite(m, begin_code(memory, 1, memory + KEPT_STATE));
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
        return expect_finite(m, step_code(memory, 1, memory + KEPT_STATE, ALL_DUE));
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
    return expect_finite(m, step_code(memory, 1, memory + KEPT_STATE, (int)task));
}
#endif

static int tangents_enter_stepping(Instance *m)
{
    text_begin(m);
    text_add(m, "directional derivatives: not offered by this FMU");
    return fail(m, OUT_OF_BOUNDS);
}
