/* Both sides of the loop as quadcosim export-c writes them, run for STEPS steps of H seconds: every hundredth row of all
   variables, as the bits of doubles, and last the CRC-32 of all rows. */

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "QuadrotorPlant.h"
#include "UnifiedController.h"

static UnifiedController c;
static QuadrotorPlant p;
static uint32_t crc = 0xffffffffu;

#include "variables.h" /* written by the test: EACH(X) is X of every variable */

static void note(double x, int shown)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    for (int k = 0; k < 64; k++)
        crc = (crc >> 1) ^ (((crc ^ (uint32_t)(bits >> k)) & 1u) ? 0xedb88320u : 0u);
    if (shown)
        printf("%08" PRIx32 "%08" PRIx32 " ", (uint32_t)(bits >> 32), (uint32_t)bits);
}

static void measure(void)
{
#define MEASURED(name) c.in.name = p.out.name;
    MEASURED(position_x) MEASURED(position_y) MEASURED(position_z)
    MEASURED(velocity_x) MEASURED(velocity_y) MEASURED(velocity_z)
    MEASURED(quaternion_x) MEASURED(quaternion_y) MEASURED(quaternion_z) MEASURED(quaternion_w)
    MEASURED(angular_velocity_x) MEASURED(angular_velocity_y) MEASURED(angular_velocity_z)
}

static void command(void)
{
#define COMMANDED(name) p.in.name = c.out.name;
    COMMANDED(thrust) COMMANDED(torque_x) COMMANDED(torque_y) COMMANDED(torque_z)
}

int main(void)
{
    const double h = H;
    int failed;
    UnifiedController_init(&c);
    QuadrotorPlant_init(&p);
    c.par.sample_period = SAMPLE_PERIOD;
    p.par.mass = 1.1;
    p.par.wind_amplitude_x = 0.5;
    p.par.initial_position_x = 0.3;
    failed = QuadrotorPlant_start(&p, 0.0);
    measure();
    failed |= UnifiedController_start(&c, 0);
    for (int k = 0; k < STEPS && !failed; k++) {
        measure();
        failed |= UnifiedController_step(&c, k * h, h);
        command();
        failed |= QuadrotorPlant_step(&p, k * h, h);
#define NOTED(x) note(x, (k + 1) % 100 == 0);
        EACH(NOTED)
        if ((k + 1) % 100 == 0)
            printf("\n");
    }
    if (failed)
        printf("%s %s\n", UnifiedController_error(c.status), QuadrotorPlant_error(p.status));
    printf("%08" PRIx32 "\n", crc ^ 0xffffffffu);
    return failed;
}
