/* The structures of a run that C and Python share. They are declared only here: structures.py reads this file. L, the
   number of lanes, is 1 where FMUs are called; fields for the other kind of components are 0. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifndef L
#define L QUADCOSIM_LANES
#endif

typedef uint64_t Lanes; /* SIMD lanes of a vector register, or tracks: a bit for each */

/* How a run has ended, or why C returns from one that has not. */
enum { RUNNING, FAILED, REFUSED, STOPPED, OVER, NOT_FINITE, DIVERGED, AT_END, FULL, PAUSED, NEXT_WINDOW, NO_MEMORY, AWAITS };

/* The types of an FMU's buffer, and the kinds of a kernel's inputs. */
enum { FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOL, BOOLEAN32 };
enum { REAL, TRUTH, WHOLE };

/* The events of a message, as in recording.py; MEASURED is not recorded. */
enum { SAMPLED, SENT, ARRIVED, LOST, MEASURED };

/* -- schedules, as in orchestration/systems/schedule/instant_arrays.py ----------------------------------------------------------- */

typedef struct {
    int64_t connection, k, sent, arrival; /* arrival -1: lost */
} Message;

typedef struct {
    int64_t component, next_time, received, sent, end; /* indices of its messages */
} SampleInstant;

typedef struct {
    const int64_t *times; /* of the instants, and one more */
    const int64_t *stepped_at, *stepped, *posted_at, *measured_at, *arrivals_at, *samples_at;
    const Message *posted, *measured, *arrivals, *exchanged;
    const SampleInstant *samples;
} Schedule;

typedef struct { /* in increasing order, without duplicates */
    const int64_t *times;
    const bool *stepped; /* of each, whether each component in continuous time is stepped to it */
    int64_t count, at;   /* their number, and the next one */
} Instants;

typedef struct { /* the schedule of an interval, as in orchestration/systems/schedule/spans.py */
    Instants regular, own;
    const Message *posted, *measured, *arrivals, *exchanged;
    const SampleInstant *samples;
    const int64_t *sampled; /* [ns], the times of the samples */
    int64_t posted_count, measured_count, arrivals_count, samples_count;
    int64_t posted_at, measured_at, arrivals_at, samples_at; /* the next ones */
    int64_t end;                                             /* [ns] the instant after these */
} Span;

/* The kind of an instant, as a sum; 0: only the one component in continuous time is stepped. */
enum { MORE = 1, SAMPLES = 2, START = 4 };

/* -- values of FMUs ------------------------------------------------------------------------------------------------ */

typedef struct { /* one call that moves values of one type between an FMU and a buffer */
    void *function, *fmu;
    const uint32_t *references;
    size_t count;
    void *buffer;
    size_t values;
    const int64_t *asked, *places; /* NULL: the buffer is the array itself */
    int64_t size;
    int32_t type, counts_values;
    double low, high; /* of the numbers that its type holds */
    int64_t component;
} Part;

typedef struct { /* the calls that move the values of one array */
    const Part *parts;
    int64_t count;
    double *array;
} Transfer;

typedef struct { /* a source that sets inputs of one component */
    Transfer write;
    const double *values; /* at each instant of the schedule */
    int64_t size;
} Feed;

/* -- values of kernels --------------------------------------------------------------------------------------------- */

typedef struct { /* inputs of a component in its memory, with their kinds and bounds */
    double *memory;
    const int64_t *places, *kinds;
    const double *low, *high;
    int32_t plain, as_they_are; /* whether they need no check, and whether they are also all Reals */
} Inputs;

typedef struct { /* a value of a source, and the place of the input that gets it */
    int64_t source, place;
} Fed;

typedef struct { /* values that are kept row by row */
    double *values;
    int64_t count, capacity;
} Kept;

/* -- a running system ---------------------------------------------------------------------------------------------- */

typedef struct {
    const int64_t *items;
    int64_t count;
} List;

typedef struct {
    int64_t rank; /* its place in the order of an instant, among components of its kind */
    List held, ahead, behind; /* connections into it */
    const double *ratio;      /* by lane, of a sampled component */
    int64_t by_itself;
    /* of FMUs */
    void *fmu, *step;
    double start_time; /* [s] its own at 0 */
    int32_t version, unused;
    int32_t foreign, moved;     /* whether it may change the rounding mode, and whether it has */
    bool *event, *ends, *early; /* what an FMU of FMI 3 returns from a step */
    double *reached;
    const int64_t *messages_waiting; /* their number */
    Transfer read;
    const double *outputs; /* the connected ones, in the row */
    int64_t connected;
    List feeds;
    /* of kernels */
    void *steps; /* does several at once; NULL: there is no such function */
    double *memory;
    const int64_t *places; /* of the connected outputs in it */
    const bool *wanted;    /* of each variable, whether it is read */
    const Fed *fed;
    int64_t fed_count;
} Component;

typedef struct {
    const double *sender;
    const int64_t *places; /* of the sent variables */
    int64_t size;
    int32_t noisy, rounds, converts, extrapolates, read_ahead, unused;
    const double *sigma, *quantum, *scale, *offset; /* by lane, the first two also by variable */
    const double *noise[L];                         /* random numbers, message by message */
    double *value;                                  /* of the current message */
    double *flight; /* a ring of messages on their way, in the order of sending, which is that of arrival */
    int64_t capacity, first[L], last[L];
    double *applied; /* the last two values, for a first-order hold */
    int64_t applied_count[L], applied_time[2 * L];
    Transfer write; /* of FMUs: its array has the values that the receiver was set to */
    Inputs into;    /* of kernels */
} Channel;

typedef struct { /* runs that share a schedule */
    Schedule schedule;
    int64_t count, at, last_window; /* its number of instants, the next one, whether it is the last window */
    Lanes lanes;
    int64_t stop; /* [ns] */
    int64_t *now; /* [ns] of each component in continuous time */
    /* of kernels */
    Span span; /* whose next instant is in the schedule */
    int64_t times[2], stepped_at[2], posted_at[2], measured_at[2], arrivals_at[2], samples_at[2]; /* its tables */
    int64_t *moving;
    int64_t source_row; /* the index of the regular instant, or ~ that of the own one */
    int64_t put_off, put_off_from, put_off_length; /* regular instants not yet processed, the first, the steps [ns] */
    int64_t kind, more; /* [ns] of the next instant with more than a step */
    const double *seen[L], *given[L]; /* values of sources for expressions and for inputs, at regular instants */
    const double *seen_own[L], *given_own[L]; /* at own ones */
    int64_t one_for_all, unused; /* whether these are the same in all lanes */
} Track;

typedef struct {
    Component *components;
    Channel *channels;
    List continuous, sampled; /* components in the order of an instant */
    List closing; /* what ends it: i reads component i, ~i carries out wire i; of FMUs */
    int64_t some_by_themselves, settles;
    Track *tracks;
    int64_t track_count, channel_count;
    Lanes alive; /* whose runs have not ended */
    int64_t outcome[L], outcome_component[L], outcome_time[L], steps[L];
    int64_t no_memory; /* for messages on their way, or for kept values */
    /* of FMUs */
    const Feed *feeds;
    int64_t pause_at, now; /* [ns] */
    double *row, *rows;
    int64_t width, stride, row_count, row_limit; /* in numbers; behind the width are sources, which Python adds */
    int64_t *events, *arrived; /* `arrived`: those of this instant, noted after the messages sent at it */
    int64_t event_count, event_limit, arrived_count;
    const Part *failed;
    int64_t failed_status;
    int64_t component; /* whose FMU was called last */
    double end;        /* of its step [s] */
    int64_t is_over;   /* whether an FMU ends the run at this instant */
    int (*look)(double);
    int (*stopped)(int, int64_t); /* called after an unsuccessful step: whether the instant is not completed */
    void (*collect)(int64_t);
    const void *condition; /* operations of condition.h; NULL: call `look` each time */
    int64_t condition_length;
    const double *watched; /* sources of the condition at each instant */
    int64_t watched_size, in_rows; /* their number, and the number of them at the end of rows: all or none */
    int64_t calling; /* the component whose FMU is called; -1: none */
    int64_t mode;    /* the rounding mode of this run */
    const void *environment;
    /* of kernels */
    int64_t track; /* that needs its next window */
    int64_t stays; /* whether all held values stay unchanged at an instant with nothing but a step */
    int64_t seen_count, given_count;
    double *seen, *given, *state, *constants, *numbers;
    Lanes doubtful; /* in which a value was not a number, or one of a component between its points */
    Kept *kept;
    int32_t *status;
    int64_t recorded_count, record_limit; /* number of recorded columns, and largest number of rows: 0 for none */
    const double **recorded;
    double *records[L];
    int64_t record_counts[L];
    void *suspended; /* a run that waits for outputs which its caller computes; NULL: there was none yet */
    Lanes awaiting;  /* in which it does */
} Loop;

/* -- sizes, which Python compares ---------------------------------------------------------------------------------- */

typedef struct {
    const char *name;
    int64_t size;
} Size;

#define SIZE_OF(structure) {#structure, sizeof(structure)}
#define SIZES \
    SIZE_OF(Message), SIZE_OF(SampleInstant), SIZE_OF(Schedule), SIZE_OF(Instants), SIZE_OF(Span), SIZE_OF(Part), SIZE_OF(Transfer), SIZE_OF(Feed), \
    SIZE_OF(Inputs), SIZE_OF(Fed), SIZE_OF(Kept), SIZE_OF(List), SIZE_OF(Component), SIZE_OF(Channel), SIZE_OF(Track), SIZE_OF(Loop), \
    SIZE_OF(Size)
#define EXPORT __attribute__((visibility("default")))
