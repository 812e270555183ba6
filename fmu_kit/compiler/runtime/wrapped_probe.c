#include <stdio.h>
void quadcosim_init(void);
void quadcosim_get_all(double *values, unsigned apart);
int main(void) {
    double values[VARIABLES];
    quadcosim_init();
    quadcosim_get_all(values, 1);
    for (unsigned i = 0; i < VARIABLES; i++)
        printf("%a\n", values[i]);
    return 0;
}
