/* What Python says to timetable.h of a system, and what it is told of a window. They are declared only here:
   compiled_timetable.py reads this file. Times are in nanoseconds; a place is one among the components in continuous
   time, in the order in which they are stepped, and -1 for a sampled one. */

#include <stdint.h>

/* How numbers of a stream are made, as in lateness_and_loss.py. */
enum { CONSTANT, UNIFORM, NORMAL, CUT_NORMAL, VALUES, WEIGHTED, IN_ORDER, BELOW, BURSTS };

typedef struct { /* round(offset + k·period), k = 0, 1, …: whole nanoseconds, and the rest as a fraction of one */
    int64_t offset, offset_rest, period, period_rest, denominator;
} Grid;

typedef struct { /* a stream of times, or of losses as 0 and 1 */
    int64_t kind;
    const uint32_t *key; /* of its random numbers */
    int64_t key_size;
    int64_t least, most;
    double mean, deviation, low, width; /* BURSTS: the probabilities to be lost, at first, in a burst and outside */
    const int64_t *values;
    const double *sums; /* of probabilities */
    int64_t count, last;
} Varying;

typedef struct { /* a connection */
    int64_t sender, receiver; /* places of its ends */
    int64_t jacobi, read_ahead;
    Varying delay, late, loss;
} Route;

typedef struct { /* a sampled component, and its connections by their indices, in the order of exchange */
    int64_t component, ahead; /* the largest lateness of a measurement */
    Grid grid;
    Varying late;
    const int64_t *incoming, *outgoing;
    int64_t incoming_count, outgoing_count;
} Clock;

typedef struct { /* a connection with a message at each point of its sender */
    int64_t connection;
    Grid grid;
} Post;

typedef struct { /* all that the timetables of some runs have in common, in the order of one instant */
    const Route *routes;
    const Clock *clocks;
    const Post *posts;
    int64_t route_count, clock_count, post_count, continuous_count, stop;
} Outline;

typedef struct { /* the numbers of rows of the tables of a window */
    int64_t own, sampled, samples, exchanged, posted, measured, arrivals;
} Counts;

typedef struct { /* a window, and memory for its schedule */
    const int64_t *regular, *own;
    const uint8_t *regular_stepped, *own_stepped;
    int64_t regular_count, own_count;
    const int64_t *posted, *measured, *arrivals; /* messages */
    const int64_t *sampled;
    int64_t posted_count, measured_count, arrivals_count, samples_count;
    const int64_t *continuous; /* components in continuous time, by their places */
    int64_t continuous_count;
    int64_t *times, *stepped_at, *posted_at, *measured_at, *arrivals_at, *samples_at, *stepped;
} Window;

typedef struct {
    const char *name;
    int64_t size;
} Size;

#define SIZE_OF(structure) {#structure, sizeof(structure)}
