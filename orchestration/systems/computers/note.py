"""Kinds of notes of the scheduler.

A note is a row of time, kind, owner, index of its job or frame, and one more value.
"""

RELEASED, STARTED, PREEMPTED, RESUMED, FINISHED, ABORTED, SKIPPED, SWITCHING, INTERRUPTED, SAMPLED, WRITTEN = range(11)
"""Happenings of a task: the number of a job, and of RELEASED and SKIPPED the nominal release. SAMPLED has the time of
the sample where that is another, WRITTEN the sample whose outputs these are. Each SWITCHING, STARTED and RESUMED is
ended on its processor by the next of these, or by PREEMPTED, FINISHED or INTERRUPTED, of one that is in its switch or
aborted."""
QUEUED, FRAME_STARTED, FRAME_CORRUPTED, FRAME_TRANSMITTED = range(11, 15)
"""Happenings of a message: the number of a frame, and of QUEUED the nominal instant, of the others the leg.
FRAME_STARTED is the first bit; FRAME_CORRUPTED the last bit of a frame that is sent again, FRAME_TRANSMITTED of one
that is not."""
SENT, ARRIVES = range(15, 17)
"""Happenings of a carrier: the number of a sample; 1 if it is lost on the way, 2 if nothing was sent, else 0; the time
when it arrives"""
KINDS = 17
COLUMNS = 5

ALL_KINDS = frozenset(range(KINDS))
