"""What the scheduler is told: processors, tasks, networks and messages as whole numbers, and where others come from.

Parts name one another by their place in the lists of `Parts`; NONE stands for nobody.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Integers

NONE = -1
LATER = 2**62
"""[ns], after every time that there is"""

Stream: TypeAlias = Callable[[int], Integers]
"""The next so many numbers: times [ns], or 0 and 1"""
AT_ONCE = 1024
"""Numbers that are drawn at once"""
STAYS = -1
"""In place of how many numbers of a stream are used: it has one, for good"""

MOST_WAITING = 2**20
"""Jobs of a task, or frames of a message on a link, that may wait: 100 MB or less"""

FIXED_PRIORITY, EARLIEST_DEADLINE, FIRST_COME = range(3)
QUEUE, SKIP, ABORT = range(3)


class Processor(NamedTuple):
    """What jobs run on."""

    policy: int
    """FIXED_PRIORITY, EARLIEST_DEADLINE or FIRST_COME"""
    preemptive: int
    switch: int
    """[ns], before a job begins or goes on"""


class Task(NamedTuple):
    """What is released again and again; tasks stand in the order of the file."""

    processor: int
    priority: int
    deadline: int
    """[ns] from the nominal release"""
    overrun: int
    """QUEUE, SKIP or ABORT"""
    reads_at_release: int
    writes_at_deadline: int
    nominal: int
    """the stream of its nominal releases; NONE: arrivals release it"""
    late: int
    """the stream of how late they are"""
    execution: int
    """the stream of what its jobs take"""
    reports_samples: int = 1
    """whether anybody is told of its samples"""


class Carrier(NamedTuple):
    """A connection that tasks or frames write to."""

    sender: int
    """the task whose jobs write to it; NONE: instants of the message do"""
    message: int
    """over which it goes; NONE: over no network"""
    late: int
    """the stream of its own delays, which count from when a message is received"""
    lost: int
    """the stream of what the receiver loses, 1"""
    releases: tuple[int, ...]
    """tasks that its arrivals release"""


class Message(NamedTuple):
    """What goes over a network as frames; messages stand in the order of the file."""

    rank: int
    """the least of those that wait goes first; then who was queued first, then who stands first"""
    legs: tuple["Leg", ...]
    """the links that it takes, one after the other"""
    pause: int
    """[ns] from the end of a leg to where it is queued for the next one"""
    nominal: int
    """the stream of its nominal instants; NONE: it is queued when somebody writes"""
    late: int
    corrupted: int
    """the stream of which attempts fail, 1"""
    carrier: int
    """the connection that it belongs to; NONE: load"""


class Leg(NamedTuple):
    """A frame's way over one link."""

    link: int
    slot: int
    """of a link with slots, the one that it goes in"""
    length: int
    """[ns]"""
    corrupted_length: int
    """[ns], of one that has to be sent again"""


class Link(NamedTuple):
    """What carries one frame at a time."""

    slots: int
    """how many a cycle has; 0: it can be taken whenever it is free"""
    begins: int
    """the stream of when slots begin, one after the other"""


@dataclass(frozen=True, kw_only=True)
class Parts:
    """All of them."""

    stop: int
    """[ns]: nothing is released from here on"""
    processors: Sequence[Processor]
    tasks: Sequence[Task]
    carriers: Sequence[Carrier]
    messages: Sequence[Message]
    links: Sequence[Link]
    streams: Sequence[Stream]
    places: Sequence[str] = ()
    """the paths of tasks, then of messages, for errors"""

    def overfull(self, owner: int) -> UsageError:
        """What is said of a task, or with a number after those of all tasks of a message, of which too many wait."""
        place = self.places[owner] if owner < len(self.places) else str(owner)
        if owner < len(self.tasks):
            expected = "that it gets its processor as often, or overrun skip or abort"
            return UsageError(f"{place}: more than {MOST_WAITING} of its jobs wait: expected {expected}")
        return UsageError(f"{place}: more than {MOST_WAITING} of its frames wait: expected a network that carries them")


# What is noted: rows of time, what, whose, which, and one number more.

RELEASED, STARTED, PREEMPTED, RESUMED, FINISHED, ABORTED, SKIPPED, SWITCHING, INTERRUPTED, SAMPLED, WRITTEN = range(11)
"""Of a task: the number of a job, and of RELEASED and SKIPPED the nominal release. SAMPLED has the time of the sample
where that is another, WRITTEN the sample whose outputs these are. Each
SWITCHING, STARTED and RESUMED is ended on its processor by the next of these, or by PREEMPTED, FINISHED or INTERRUPTED,
of one that is in its switch or aborted."""
QUEUED, FRAME_STARTED, FRAME_CORRUPTED, FRAME_TRANSMITTED = range(11, 15)
"""Of a message: the number of a frame, and of QUEUED the nominal instant, of the others the leg. FRAME_STARTED is the
first bit; FRAME_CORRUPTED the last bit of a frame that is sent again, FRAME_TRANSMITTED of one that is not."""
SENT, ARRIVES = range(15, 17)
"""Of a carrier: the number of a sample; 1 if it is lost on the way, 2 if nothing was sent, else 0; the time when it
arrives"""
KINDS = 17
COLUMNS = 5

ALL_KINDS = frozenset(range(KINDS))


@dataclass(frozen=True)
class Constant:
    """The stream of a number that is the same each time."""

    value: int

    def __call__(self, count: int) -> Integers:
        """As `Stream`."""
        return np.full(count, self.value, dtype=np.int64)
