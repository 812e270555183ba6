typedef struct { double current_p, current_i, speed_p, speed_i; } cascade_gains;

extern cascade_gains gains;

void speed_step(double wanted, double speed);
double current_step(double current);
