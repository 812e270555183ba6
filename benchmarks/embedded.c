/* What a step of a controller takes on a Cortex-M, under QEMU with -icount shift=6: a flight of 10 s against the plant,
   of which the controller's steps alone are counted. It prints the bytes of the instance, then the instructions of each
   step, a line each. CONTROLLER is its name, PREPARED what is set of its parameters, as c.par.gain = 1; */

#include <stdint.h>
#include <stdio.h>

#include "QuadrotorPlant.h"

#ifndef CONTROLLER
#define CONTROLLER UnifiedController
#endif
#ifndef PREPARED
#define PREPARED
#endif
#define TEXT(name) #name
#define HEADER_OF(name) TEXT(name.h)
#define JOINED(name, what) name##_##what
#define OF(name, what) JOINED(name, what)

#include HEADER_OF(CONTROLLER)

static CONTROLLER c;
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
    QuadrotorPlant_init(&p);
    OF(CONTROLLER, init)(&c);
    c.par.sample_period = 0;
    PREPARED
    if (QuadrotorPlant_start(&p, 0.0) || (measure(), OF(CONTROLLER, start)(&c, 0)))
        return 1;
    printf("%u\n", (unsigned)sizeof c);
    systick[RELOAD] = 0xffffff;
    systick[CONTROL] = 5; /* of the processor's clock, without interrupts */
    for (int k = 0; k < STEPS; k++) {
        measure();
        systick[NOW] = 0;
        while (systick[NOW] == 0) {
        }
        const uint32_t before = systick[NOW];
        const int failed = OF(CONTROLLER, step)(&c, k * 0.01, 0.01);
        const uint32_t ticks = before - systick[NOW];
        printf("%.0f\n", ticks * 40.0 / 64); /* a tick is 40 ns, an instruction 64 ns */
        p.in.thrust = c.out.thrust;
        p.in.torque_x = c.out.torque_x;
        p.in.torque_y = c.out.torque_y;
        p.in.torque_z = c.out.torque_z;
        if (failed || QuadrotorPlant_step(&p, k * 0.01, 0.01))
            return 1;
    }
    return 0;
}
