/* What a controller answers to what cannot be: a line each. */

#include <stdio.h>

#include "UnifiedController.h"

static UnifiedController c;
static volatile double zero;

static void print_status(int status) { printf("%d %s\n", status != 0, UnifiedController_error(status)); }

static int started(double mass)
{
    UnifiedController_init(&c);
    c.par.mass = mass;
    return UnifiedController_start(&c, 0.0);
}

int main(void)
{
    double thrust;
    UnifiedController_init(&c);
    print_status(UnifiedController_step(&c, 0.0, 0.01));
    print_status(started(-1.0));
    print_status(UnifiedController_start(&c, 0.0)); /* the same as before */
    print_status(started(2.0));
    print_status(UnifiedController_start(&c, 0.0));
    print_status(started(2.0));
    print_status(UnifiedController_step(&c, 0.0, -0.01));
    print_status(started(2.0));
    c.in.position_x = zero / zero;
    thrust = c.out.thrust;
    print_status(UnifiedController_step(&c, 0.0, 0.01));
    print_status(c.status);
    printf("%d\n", thrust == c.out.thrust);
    print_status(started(2.0));
    c.in.velocity_x = 1e200;
    print_status(UnifiedController_step(&c, 0.0, 0.01));
    print_status(started(2.0));
    c.par.mass = -3.0; /* not checked before `changed` */
    print_status(UnifiedController_step(&c, 0.0, 0.01));
    UnifiedController_changed(&c);
    print_status(UnifiedController_step(&c, 0.01, 0.01));
    print_status(started(2.0));
    printf("%u\n", c.warnings);
    c.in.quaternion_w = 0.0;
    print_status(UnifiedController_step(&c, 0.0, 0.02));
    printf("%d\n", c.warnings == (UNIFIEDCONTROLLER_NO_MEASUREMENT | UNIFIEDCONTROLLER_LONG_STEP));
    print_status(-1);
    print_status(1000);
    return 0;
}
