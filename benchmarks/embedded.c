/* What a step of the controller takes on a Cortex-M, under QEMU with -icount shift=6: a flight of 10 s against the
   plant, of which the controller's steps alone are counted. */

#include <stdint.h>
#include <stdio.h>

#include "QuadrotorPlant.h"
#include "UnifiedController.h"

static UnifiedController c;
static QuadrotorPlant p;

static volatile uint32_t *const systick = (volatile uint32_t *)0xe000e010;
enum { CONTROL, RELOAD, NOW, STEPS = 1000 };

static void measure(void)
{
#define MEASURED(name) c.in.name = p.out.name;
    MEASURED(position_x) MEASURED(position_y) MEASURED(position_z)
    MEASURED(velocity_x) MEASURED(velocity_y) MEASURED(velocity_z)
    MEASURED(quaternion_x) MEASURED(quaternion_y) MEASURED(quaternion_z) MEASURED(quaternion_w)
    MEASURED(angular_velocity_x) MEASURED(angular_velocity_y) MEASURED(angular_velocity_z)
}

int main(void)
{
    uint32_t most = 0;
    double sum = 0.0;
    QuadrotorPlant_init(&p);
    UnifiedController_init(&c);
    c.par.sample_period = 0;
    if (QuadrotorPlant_start(&p, 0.0) || (measure(), UnifiedController_start(&c, 0)))
        return 1;
    systick[RELOAD] = 0xffffff;
    systick[CONTROL] = 5; /* of the processor's clock, without interrupts */
    for (int k = 0; k < STEPS; k++) {
        measure();
        systick[NOW] = 0;
        while (systick[NOW] == 0) {
        }
        const uint32_t before = systick[NOW];
        const int failed = UnifiedController_step(&c, k * 0.01, 0.01);
        const uint32_t ticks = before - systick[NOW];
        most = most > ticks ? most : ticks;
        sum += ticks;
        p.in.thrust = c.out.thrust;
        p.in.torque_x = c.out.torque_x;
        p.in.torque_y = c.out.torque_y;
        p.in.torque_z = c.out.torque_z;
        if (failed || QuadrotorPlant_step(&p, k * 0.01, 0.01))
            return 1;
    }
    /* A tick is 40 ns, an instruction 64 ns. */
    printf("%u %.0f %.0f\n", (unsigned)sizeof c, sum / STEPS * 40 / 64, most * 40.0 / 64);
    return 0;
}
