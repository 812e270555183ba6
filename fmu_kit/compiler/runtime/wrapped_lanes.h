/* lane_functions.h of an FMU whose code is a user's own C: one call of the code for each active lane, no straight line.
   What the code of a lane keeps is in one piece. */

#include "wrapped.h"

static q_mask in_lanes(q_place *v, q_mask live, q_real *failed, int (*call)(double *values, double *state))
{
    double *const memory = (double *)v, errors[LANES];
    const q_real is_live = q_select(live, q_all(1.0), q_all(0.0));
    for (int lane = 0; lane < LANES; lane++) {
        double *const state = memory + KEPT_STATE * LANES + lane * (PLACES - KEPT_STATE);
        errors[lane] = q_lane(is_live, lane) != 0.0 ? call(memory + lane, state) : 0;
    }
    *failed = values_of(errors);
    return q_eq(*failed, q_all(0.0));
}

static int begin_lane(double *values, double *state)
{
    if (parameter_out_of_bounds(values, LANES) != VARIABLES)
        return OUT_OF_BOUNDS;
    return begin_code(values, LANES, state) == VARIABLES ? 0 : DIVERGENCE;
}

static int step_lane(double *values, double *state)
{
    return step_code(values, LANES, state, ALL_DUE) == VARIABLES ? 0 : DIVERGENCE;
}

static q_mask model_enter_stepping(q_place *v, q_mask live, q_real *failed)
{
    return in_lanes(v, live, failed, begin_lane);
}

static q_mask model_do_step(q_place *v, q_mask live, q_real *failed, q_real t, q_real h)
{
    (void)t, (void)h;
    return in_lanes(v, live, failed, step_lane);
}
