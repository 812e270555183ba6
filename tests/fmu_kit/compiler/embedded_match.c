/* Commands of the redesign `match` over several hold periods: a line each. */

#include <stdio.h>

#include "UnifiedController.h"

static UnifiedController c;

int main(void)
{
    const double periods[] = {0.002, 0.01, 0.05};
    for (int i = 0; i < 3; i++) {
        UnifiedController_init(&c);
        c.par.discretisation = 5;
        c.par.hold_period = (q_number)periods[i];
        c.in.position_x = (q_number)0.3;
        c.in.velocity_y = (q_number)0.2;
        c.in.angular_velocity_z = (q_number)0.3;
        UnifiedController_start(&c, 0);
        for (int k = 0; k < 4; k++)
            UnifiedController_step(&c, (q_number)(k * periods[i]), (q_number)periods[i]);
        printf("%d %.9g %.9g %.9g %.9g\n", c.status, (double)c.out.thrust, (double)c.out.torque_x,
               (double)c.out.torque_y, (double)c.out.torque_z);
    }
    return 0;
}
