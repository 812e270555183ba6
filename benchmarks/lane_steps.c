/* Times a slave in lanes: lane_steps LIBRARY STEP_SIZE STEPS [PLACE=VALUE ...] prints the CPU time of one step a lane
   [ns], smallest of 9, all lanes active and alike. */

#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_LANES = 64 };

static void find(void *library, const char *name, void *function)
{
    void *symbol = dlsym(library, name);
    if (!symbol)
        exit(1);
    memcpy(function, &symbol, sizeof symbol);
}

int main(int count, char **given)
{
    static double t[MAX_LANES], h[MAX_LANES];
    static uint64_t active[MAX_LANES];
    static int32_t status[MAX_LANES];
    int (*lanes_of)(void), (*places_of)(void);
    void (*begin)(double *), (*initialise)(double *, const uint64_t *, const double *, int32_t *);
    void (*do_step)(double *, const uint64_t *, const double *, const double *, int32_t *, const uint8_t *);
    if (count < 4)
        return 2;
    void *library = dlopen(given[1], RTLD_NOW);
    if (!library)
        return fprintf(stderr, "%s\n", dlerror()), 1;
    find(library, "quadcosim_lanes", &lanes_of);
    find(library, "quadcosim_places", &places_of);
    find(library, "quadcosim_begin", &begin);
    find(library, "quadcosim_initialise", &initialise);
    find(library, "quadcosim_do_step", &do_step);
    const int lanes = lanes_of(), steps = atoi(given[3]);
    double *memory = aligned_alloc(64, ((size_t)lanes * places_of() * sizeof *memory + 63) / 64 * 64), shortest = 1e9;
    for (int repetition = 0; repetition < 9; repetition++) {
        begin(memory);
        for (int lane = 0; lane < lanes; lane++)
            t[lane] = 0.0, h[lane] = strtod(given[2], NULL), active[lane] = ~(uint64_t)0;
        for (int k = 4; k < count; k++) {
            char *value;
            const long place = strtol(given[k], &value, 10);
            for (int lane = 0; lane < lanes; lane++)
                memory[place * lanes + lane] = strtod(value + 1, NULL);
        }
        initialise(memory, active, t, status);
        const clock_t start = clock();
        for (int k = 0; k < steps; k++) {
            for (int lane = 0; lane < lanes; lane++)
                t[lane] = k * h[lane];
            do_step(memory, active, t, h, status, NULL);
        }
        const double taken = (double)(clock() - start) / CLOCKS_PER_SEC / steps / lanes * 1e9;
        shortest = taken < shortest ? taken : shortest;
        if (status[0])
            return 3;
    }
    printf("%.1f\n", shortest);
    return 0;
}
