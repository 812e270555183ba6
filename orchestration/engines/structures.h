/* What a run has that C and Python share. Structures are declared here alone: structures.py reads them. Of fields whose
   number is that of the lanes, L is 1 where FMUs are called; those of the other kind of components are 0 then. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifndef L
#define L QUADCOSIM_LANES
#endif

typedef uint64_t Lanes; /* a bit for each */

/* What has become of a run, or why C comes back from one that goes on. */
enum { RUNNING, FAILED, REFUSED, STOPPED, OVER, NOT_FINITE, DIVERGED, AT_END, FULL, PAUSED, NEXT_WINDOW, NO_MEMORY };

/* What a buffer of an FMU holds, and what an input of a kernel takes. */
enum { FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOL, BOOLEAN32 };
enum { REAL, TRUTH, WHOLE };

/* What happens to a message, as recording.py has it; MEASURED is not recorded. */
enum { SAMPLED, SENT, ARRIVED, LOST, MEASURED };

/* -- what happens when, as orchestration/schedule/schedule.py has it ----------------------------------------------- */

typedef struct {
    int64_t connection, k, sent, arrival; /* arrival -1: lost */
} Message;

typedef struct {
    int64_t component, next_time, received, sent, end; /* where its messages begin */
} SampleInstant;

typedef struct {
    const int64_t *times; /* one more than there are instants */
    const int64_t *stepped_at, *stepped, *posted_at, *measured_at, *arrivals_at, *samples_at;
    const Message *posted, *measured, *arrivals, *exchanged;
    const SampleInstant *samples;
} Schedule;

typedef struct { /* in order, each once */
    const int64_t *times;
    const bool *stepped; /* of each, whether the components in continuous time are stepped to it */
    int64_t count, at;   /* how many, and which is next */
} Instants;

typedef struct { /* what happens from one time to another, as orchestration/schedule/spans.py has it */
    Instants regular, own;
    const Message *posted, *measured, *arrivals, *exchanged;
    const SampleInstant *samples;
    const int64_t *sampled; /* [ns], the times of the samples */
    int64_t posted_count, measured_count, arrivals_count, samples_count;
    int64_t posted_at, measured_at, arrivals_at, samples_at; /* which are next */
    int64_t end;                                             /* [ns] of the instant after these */
} Span;

/* What happens at an instant, as a sum: nothing but a step of the only component in continuous time is 0. */
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
    double low, high; /* of a whole number */
    int64_t component;
} Part;

typedef struct { /* the calls that move the values of one array */
    const Part *parts;
    int64_t count;
    double *array;
} Transfer;

typedef struct { /* a source at work on inputs of one component */
    Transfer write;
    const double *values; /* at each instant of the schedule */
    int64_t size;
} Feed;

/* -- values of kernels --------------------------------------------------------------------------------------------- */

typedef struct { /* inputs of a component in its memory, and what they take */
    double *memory;
    const int64_t *places, *kinds;
    const double *low, *high;
    int32_t plain, as_they_are; /* whether nothing has to be checked, and whether they are Reals beside */
} Inputs;

typedef struct { /* a value of a source, and the place of the input that gets it */
    int64_t source, place;
} Fed;

typedef struct { /* values that are kept row by row */
    double *values;
    int64_t count, capacity;
} Kept;

/* -- a system at work ---------------------------------------------------------------------------------------------- */

typedef struct {
    const int64_t *items;
    int64_t count;
} List;

typedef struct {
    int64_t rank; /* its place among those of its kind in the order of an instant */
    List held, ahead, behind; /* connections into it */
    const double *ratio;      /* of the lanes; of a sampled one */
    int64_t by_itself;
    /* of FMUs */
    void *fmu, *step;
    int32_t version, unused;
    int32_t foreign, moved;     /* whether it may change how numbers are rounded, and whether it has */
    bool *event, *ends, *early; /* what an FMU of FMI 3 says of a step */
    double *reached;
    const int64_t *heard; /* how many messages of it wait */
    Transfer read;
    const double *outputs; /* connected ones, in the row */
    int64_t connected;
    List feeds;
    /* of kernels */
    double *memory;
    const int64_t *places; /* of the connected outputs in it */
    const bool *wanted;    /* of each variable, whether it is read, if it is an output */
    const Fed *fed;
    int64_t fed_count;
} Component;

typedef struct {
    const double *sender;
    const int64_t *places; /* of what is sent */
    int64_t size;
    int32_t noisy, rounds, converts, extrapolates, read_ahead, unused;
    const double *sigma, *quantum, *scale, *offset; /* of each lane, the first two of each variable too */
    const double *noise[L];                         /* what is drawn, message by message */
    double *value;                                  /* of the message at hand */
    double *flight; /* messages on their way, in the order of sending, which is that of arrival: a ring */
    int64_t capacity, first[L], last[L];
    double *applied; /* the last two, of a first-order hold */
    int64_t applied_count[L], applied_time[2 * L];
    Transfer write; /* of FMUs: its array is what the receiver has been told */
    Inputs into;    /* of kernels */
} Channel;

typedef struct { /* runs that share a schedule */
    Schedule schedule;
    int64_t count, at, last_window; /* instants of it to go through, the next one, whether it is the last window */
    Lanes lanes;
    int64_t stop; /* [ns] */
    int64_t *now; /* [ns] of each component in continuous time */
    /* of kernels */
    Span span; /* of which the schedule has the next instant */
    int64_t times[2], stepped_at[2], posted_at[2], measured_at[2], arrivals_at[2], samples_at[2]; /* its tables */
    int64_t *moving;
    int64_t said; /* which regular instant it is; of another, ~ which own one */
    int64_t kind, more; /* [ns] when more than a step happens after it */
    const double *seen[L], *given[L]; /* sources as objectives see them, and as inputs get them, at regular instants */
    const double *seen_own[L], *given_own[L]; /* and at own ones */
    int64_t one_for_all, unused; /* whether these are the same for all lanes */
} Track;

typedef struct {
    Component *components;
    Channel *channels;
    List continuous, sampled; /* components in the order of an instant */
    int64_t some_by_themselves, settles;
    Track *tracks;
    int64_t track_count, channel_count;
    Lanes alive; /* that go on */
    int64_t outcome[L], outcome_component[L], outcome_time[L], steps[L];
    int64_t no_memory; /* for messages on their way, or for values that are kept */
    /* of FMUs */
    const Feed *feeds;
    int64_t pause_at, now; /* [ns] */
    double *row, *rows;
    int64_t width, stride, row_count, row_limit; /* in numbers; after the width come sources, which Python adds */
    int64_t *events, *arrived; /* of `arrived` those of this instant, noted after what was sent at it */
    int64_t event_count, event_limit, arrived_count;
    const Part *failed;
    int64_t component; /* whose FMU was called last */
    double end;        /* of its step [s] */
    int64_t is_over;   /* with this instant: an FMU ends the run */
    int (*look)(double);
    int (*stopped)(int, int64_t); /* whether a step that was not simply done leaves the instant undone */
    void (*collect)(int64_t);
    const void *condition; /* steps of condition.h; NULL: ask `look` each time */
    int64_t condition_length;
    const double *watched; /* sources of the condition at each instant */
    int64_t watched_size, in_rows; /* how many, and how many of them rows end with: all or none */
    int64_t calling; /* the component whose FMU is called; -1: none */
    int64_t mode;    /* how numbers are rounded in this run */
    const void *environment;
    /* of kernels */
    int64_t track; /* whose next window is asked for */
    int64_t stays; /* whether all that is held stays what it is where nothing but a step happens */
    int64_t seen_count, given_count;
    double *seen, *given, *state, *constants, *numbers;
    Lanes doubtful; /* in which a value was not a number */
    Kept *kept;
    int32_t *status;
    int64_t recorded_count, record_limit; /* columns that are kept row by row, and of how many rows: 0 for none */
    const double **recorded;
    double *records[L];
    int64_t record_counts[L];
    int64_t returned[L]; /* of threads: why each has come back */
} Loop;

/* -- that Python has the same -------------------------------------------------------------------------------------- */

typedef struct {
    const char *name;
    int64_t size;
} Size;

#define SIZE_OF(structure) {#structure, sizeof(structure)}
#define SIZES \
    SIZE_OF(Message), SIZE_OF(SampleInstant), SIZE_OF(Schedule), SIZE_OF(Instants), SIZE_OF(Span), SIZE_OF(Part), SIZE_OF(Transfer), SIZE_OF(Feed), \
    SIZE_OF(Inputs), SIZE_OF(Fed), SIZE_OF(Kept), SIZE_OF(List), SIZE_OF(Component), SIZE_OF(Channel), SIZE_OF(Track), SIZE_OF(Loop), \
    SIZE_OF(Size)
#ifndef EXPORT
#define EXPORT __attribute__((visibility("default")))
#endif
