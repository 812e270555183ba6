/* PI on the current, every 0.2 ms, within PI on the speed, every 1 ms. */
#include "cascade.h"

#define CURRENT_PERIOD 0.0002
#define SPEED_PERIOD 0.001

cascade_gains gains = {1.0, 1000.0, 0.4, 20.0};

static double wanted_current, integral_of_current, integral_of_speed;

void speed_step(double wanted, double speed) {
    double error = wanted - speed;
    integral_of_speed += gains.speed_i * SPEED_PERIOD * error;
    wanted_current = gains.speed_p * error + integral_of_speed;
}

double current_step(double current) {
    double error = wanted_current - current;
    integral_of_current += gains.current_i * CURRENT_PERIOD * error;
    return gains.current_p * error + integral_of_current;
}
