/* What a page sets of a run, and the tables of a system, which tables_of_system.py writes. */

#include <stdbool.h>
#include <stdint.h>

#ifndef L
#define L QUADCOSIM_LANES
#endif

typedef struct { /* value is digits · 10^exponent, its decimal form */
    double value;
    int64_t digits, exponent;
} Setting;

typedef struct { /* which values a setting may have */
    double low, high;
    int32_t excludes_low, is_whole;
} Allowed;

/* Why a run is refused, with the setting that is wrong. */
enum { BELOW_LEAST = 1, ABOVE_MOST, NOT_WHOLE, NO_NUMBER, NOT_WITHIN_PERIOD, TOO_MANY_IN_BURSTS, TOO_SHORT, TOO_FINE,
       TOO_MANY_INSTANTS, WITHOUT_MEMORY };

typedef struct {
    int32_t reason, setting;
} Refusal;

/* -- timing: settings by their indices, -1 for none ----------------------------------------------------------------- */

typedef struct {
    uint32_t words[4];
    int64_t size;
} Key;

typedef struct {
    int64_t sender, receiver, jacobi, read_ahead;
    int32_t delay, late, loss, burst_length, is_normal;
    Key delay_key, late_key, loss_key, noise_key;
    int32_t size, is_noisy; /* of a message */
    int32_t table; /* of its messages: 0 exchanged, 1 posted, 2 measured */
} RouteTable;

typedef struct {
    int64_t component;
    int32_t period, offset, jitter, ratio, is_normal;
    Key key;
    const int64_t *incoming, *outgoing;
    int64_t incoming_count, outgoing_count;
} ClockTable;

typedef struct {
    int64_t connection;
    int32_t step;
} PostTable;

typedef struct { /* regular instants: those of a component in continuous time, or changes of a source */
    int32_t period, first;
    uint64_t stepped; /* a bit for each component in continuous time */
} PointsTable;

typedef struct { /* normal numbers that a source draws in the order of its grid */
    int32_t period, width;
    Key key;
} DrawnTable;

/* -- what a run exchanges with timing.c ------------------------------------------------------------------------------ */

typedef struct { /* all instants of a run, with the messages and samples of each, as tables of 64-bit integers */
    const int64_t *regular, *own;
    const bool *regular_stepped, *own_stepped;
    int64_t regular_count, own_count;
    const void *posted, *measured, *arrivals, *exchanged, *samples;
    const int64_t *sampled;
    int64_t posted_count, measured_count, arrivals_count, samples_count, exchanged_count;
} Drawn;

int begin_timing(int lane, const Setting *settings, int64_t *first_samples, Refusal *refusal);
int draw_timing(int lane, Drawn *into);
const double *draw_noise(int lane, int connection, int64_t count);
const double *draw_source(int lane, int drawn, int64_t rows);
int64_t as_nanoseconds(const Setting *setting);
int grid_of(const Setting *offset, const Setting *period, const Setting *ratio, int64_t parts[5]);
