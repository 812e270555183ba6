/* Many runs at once, each in a thread: the loop is that of lanes (batch.c). */

#include "threads.h"

#include "integers.h"

#include "components.h"

#include "batch.c"

static Lanes failed_steps(Loop *l, int64_t index, Lanes lanes, q_real begin, q_real length) {
    return step_of(index, (q_place *)(l->components[index].memory + LANE), begin, length) ? lanes : 0;
}

/* Of the threads that go on together those that sample next wait for the others, as lanes do. */
static Lanes in_turn(Lanes going, Lanes sampling) {
    return __any_sync(__activemask(), (going & ~sampling) != 0) ? going & ~sampling : going;
}

/* There is as much room as there was from the beginning. */
static int make_room(Channel *, int) { return 0; }
static int make_room_to_keep(Kept *) { return 0; }

/* Go on with `count` batches to the end of the windows that their tracks have; each lane has a track of its own there,
   and its own values that are kept. */
extern "C" __global__ void fly(Loop *const *batches, int64_t count) {
    const int64_t thread = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
    if (thread >= count * L) return;
    Loop *of_all = batches[thread / L];
    if (!(of_all->alive & EVERY)) return;
    Loop own = *of_all;
    Track track = of_all->tracks[LANE];
    own.alive &= EVERY, own.doubtful = 0, own.no_memory = 0;
    own.tracks = &track, own.track_count = 1, own.kept += LANE * KEPT;
    of_all->returned[LANE] = run(&own);
    of_all->tracks[LANE] = track;
    of_all->outcome[LANE] = own.outcome[LANE], of_all->outcome_component[LANE] = own.outcome_component[LANE];
    of_all->outcome_time[LANE] = own.outcome_time[LANE], of_all->steps[LANE] = own.steps[LANE];
    of_all->record_counts[LANE] = own.record_counts[LANE];
    atomicAnd((unsigned long long *)&of_all->alive, (unsigned long long)(own.alive | ~EVERY));
    atomicOr((unsigned long long *)&of_all->doubtful, (unsigned long long)own.doubtful);
}
