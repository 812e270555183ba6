/* Many runs at once, each in a thread, by the loop for SIMD lanes (batch.c). */

#include "threads.h"

#include "integers.h"

#include "components.h"

#include "batch.c"

static Lanes failed_steps(Loop *l, int64_t index, Lanes lanes, q_real begin, q_real length) {
    return step_of(index, (q_place *)(l->components[index].memory + LANE), begin, length) ? lanes : 0;
}

/* Among the threads of a warp, those that sample next wait for the others, as lanes do. */
static Lanes in_turn(Lanes ready, Lanes sampling) {
    return __any_sync(__activemask(), (ready & ~sampling) != 0) ? ready & ~sampling : ready;
}

/* The buffers do not grow in a kernel. */
static int make_room(Channel *, int) { return 0; }
static int make_room_to_keep(Kept *) { return 0; }

/* Advance `count` batches to the end of the windows of their tracks; each lane has its own track and its own kept
   values. */
extern "C" __global__ void fly(Loop *const *batches, int64_t count) {
    const int64_t thread = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
    if (thread >= count * L) return;
    Loop *shared = batches[thread / L];
    if (!(shared->alive & EVERY)) return;
    Loop own = *shared;
    Track track = shared->tracks[LANE];
    own.alive &= EVERY, own.doubtful = 0, own.no_memory = 0;
    own.tracks = &track, own.track_count = 1, own.kept += LANE * KEPT;
    shared->returned[LANE] = run(&own);
    shared->tracks[LANE] = track;
    shared->outcome[LANE] = own.outcome[LANE], shared->outcome_component[LANE] = own.outcome_component[LANE];
    shared->outcome_time[LANE] = own.outcome_time[LANE], shared->steps[LANE] = own.steps[LANE];
    shared->record_counts[LANE] = own.record_counts[LANE];
    atomicAnd((unsigned long long *)&shared->alive, (unsigned long long)(own.alive | ~EVERY));
    atomicOr((unsigned long long *)&shared->doubtful, (unsigned long long)own.doubtful);
}
