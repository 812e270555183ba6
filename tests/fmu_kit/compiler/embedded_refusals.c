/* What a controller answers to what cannot be: a line each. */

#include <stdio.h>

#include "UnifiedController.h"

static UnifiedController c;
static volatile double zero;

static void said(int status) { printf("%d %s\n", status != 0, UnifiedController_error(status)); }

static int begun(double mass)
{
    UnifiedController_init(&c);
    c.par.mass = mass;
    return UnifiedController_start(&c, 0.0);
}

int main(void)
{
    double thrust;
    UnifiedController_init(&c);
    said(UnifiedController_step(&c, 0.0, 0.01));
    said(begun(-1.0));
    said(UnifiedController_start(&c, 0.0)); /* the same as before */
    said(begun(2.0));
    said(UnifiedController_start(&c, 0.0));
    said(begun(2.0));
    said(UnifiedController_step(&c, 0.0, -0.01));
    said(begun(2.0));
    c.in.position_x = zero / zero;
    thrust = c.out.thrust;
    said(UnifiedController_step(&c, 0.0, 0.01));
    said(c.status);
    printf("%d\n", thrust == c.out.thrust);
    said(begun(2.0));
    c.in.velocity_x = 1e200;
    said(UnifiedController_step(&c, 0.0, 0.01));
    said(begun(2.0));
    c.par.mass = -3.0; /* not looked at before it is said */
    said(UnifiedController_step(&c, 0.0, 0.01));
    UnifiedController_changed(&c);
    said(UnifiedController_step(&c, 0.01, 0.01));
    said(begun(2.0));
    printf("%u\n", c.warnings);
    c.in.quaternion_w = 0.0;
    said(UnifiedController_step(&c, 0.0, 0.02));
    printf("%d\n", c.warnings == (UNIFIEDCONTROLLER_NO_MEASUREMENT | UNIFIEDCONTROLLER_LONG_STEP));
    said(-1);
    said(1000);
    return 0;
}
