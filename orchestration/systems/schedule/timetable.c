/* The timetables of runs for Python, whose memory is that of this process. */

#include <stdlib.h>

#include "timetable.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT const Size sizes[] = {
    SIZE_OF(Grid), SIZE_OF(Varying), SIZE_OF(Route), SIZE_OF(Clock), SIZE_OF(Post), SIZE_OF(Outline), SIZE_OF(Counts),
    SIZE_OF(Window), SIZE_OF(Size), {0}};

static void *resized(void *memory, size_t size) { return realloc(memory, size); }

static void free_numbers(Numbers *of) { free(of->items); }

EXPORT void timetable_free(Timetable *t) {
    for (int64_t i = 0; i < t->of->route_count; i++)
        free_numbers(&t->links[i].sent), free_numbers(&t->links[i].arrivals), free_numbers(&t->links[i].flight);
    for (int64_t i = 0; i < t->of->clock_count; i++) free_numbers(&t->tasks[i].times);
    free_numbers(&t->times), free_numbers(&t->masks);
    free(t);
}

/* A timetable of which nothing is drawn but the first samples, in the order of its clocks; NULL without memory. */
EXPORT Timetable *timetable_new(const Outline *of, const uint32_t *seed, int64_t seed_size, int64_t *first_samples) {
    size_t links = (size_t)of->route_count * sizeof(Link), tasks = (size_t)of->clock_count * sizeof(Task);
    size_t posters = (size_t)of->post_count * sizeof(Poster);
    size_t runs = (size_t)(2 * of->route_count + of->clock_count + 1) * sizeof(Run);
    char *memory = calloc(1, sizeof(Timetable) + links + tasks + posters + runs);
    if (!memory) return NULL;
    Timetable *t = (Timetable *)memory;
    t->of = of, memory += sizeof *t;
    t->links = (Link *)memory, memory += links;
    t->tasks = (Task *)memory, memory += tasks;
    t->posters = (Poster *)memory, memory += posters;
    t->runs = (Run *)memory;
    if (!begin_timetable(t, seed, seed_size)) {
        timetable_free(t);
        return NULL;
    }
    for (int64_t i = 0; i < of->clock_count; i++) first_samples[i] = t->tasks[i].times.items[0];
    return t;
}

EXPORT int timetable_draw(Timetable *t, int64_t end, Counts *counts) { return draw_window(t, end, counts); }

EXPORT int64_t timetable_lay_out(Timetable *t, int64_t *memory, const Counts *counts) {
    return lay_out(t, memory, counts);
}

EXPORT int64_t timetable_schedule(const Window *window) { return lay_out_schedule(window); }
