"""The input of the scheduler: processors, tasks, networks and messages as whole numbers, and streams of numbers.

Parts refer to one another by their index in the lists of `Parts`; NONE stands for no part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Integers

NONE = -1
LATER = 2**62
"""Time after all others [ns]"""

Stream: TypeAlias = Callable[[int], Integers]
"""The next `count` numbers: times [ns], or 0 and 1"""
AT_ONCE = 1024
"""Numbers drawn at once"""
IS_CONSTANT = -1
"""Mark of a constant stream, in place of its used numbers"""

MAX_WAITING = 2**20
"""The most jobs of a task, or frames of a message on a link, that may wait: 100 MB or less"""

FIXED_PRIORITY, EARLIEST_DEADLINE, FIRST_COME = range(3)
QUEUE, SKIP, ABORT = range(3)


class Processor(NamedTuple):
    """A processor."""

    policy: int
    """FIXED_PRIORITY, EARLIEST_DEADLINE or FIRST_COME"""
    preemptive: int
    switch: int
    """Overhead before a job starts or resumes [ns]"""


class ScheduledTask(NamedTuple):
    """A task; tasks are in the order of the file."""

    processor: int
    priority: int
    deadline: int
    """Time from the nominal release to the deadline [ns]"""
    overrun: int
    """QUEUE, SKIP or ABORT"""
    reads_at_release: int
    writes_at_deadline: int
    nominal: int
    """the stream of its nominal releases; NONE: arrivals release it"""
    late: int
    """the stream of how late they are"""
    execution: int
    """the stream of execution times of its jobs"""
    reports_samples: int = 1
    """whether it notes SAMPLED"""


class Carrier(NamedTuple):
    """A connection of a task or a message."""

    sender: int
    """the task whose jobs write to it; NONE: it is sent at the instants of the message"""
    message: int
    """the message over which it goes; NONE: it goes over no network"""
    late: int
    """the stream of the delays of the connection itself, which count from when a frame is received"""
    lost: int
    """the stream of losses, 1 for a lost message"""
    releases: tuple[int, ...]
    """tasks that its arrivals release"""


class ScheduledFrame(NamedTuple):
    """A message that goes over a network as frames; messages are in the order of the file."""

    rank: int
    """the least of the waiting ones is sent first; then the first queued, then the first in the file"""
    legs: tuple["Leg", ...]
    """its links, in order"""
    pause: int
    """Time from the end of a leg until it is queued for the next one [ns]"""
    nominal: int
    """the stream of its nominal instants; NONE: it is queued when its task writes"""
    late: int
    corrupted: int
    """the stream of errors, 1 for a corrupted attempt"""
    carrier: int
    """its connection; NONE: load"""


class Leg(NamedTuple):
    """The way of a frame over one link."""

    link: int
    slot: int
    """its slot, on a link with slots"""
    length: int
    """Length [ns]"""
    corrupted_length: int
    """Length of a corrupted frame [ns]"""


class NetworkLink(NamedTuple):
    """A link, which carries one frame at a time."""

    slots: int
    """the number of slots in a cycle; 0: a frame can start whenever the link is free"""
    begins: int
    """the stream of slot start times, in order"""


@dataclass(frozen=True, kw_only=True)
class Parts:
    """All parts."""

    stop: int
    """End [ns]: nothing is released from here on"""
    processors: Sequence[Processor]
    tasks: Sequence[ScheduledTask]
    carriers: Sequence[Carrier]
    messages: Sequence[ScheduledFrame]
    links: Sequence[NetworkLink]
    streams: Sequence[Stream]
    places: Sequence[str] = ()
    """the paths of tasks, then of messages, for errors"""

    def queue_overflow(self, owner: int) -> UsageError:
        """The error for a task, or with an index after those of all tasks a message, of which too many wait."""
        place = self.places[owner] if owner < len(self.places) else str(owner)
        if owner < len(self.tasks):
            expected = "that it gets its processor as often, or overrun skip or abort"
            return UsageError(f"{place}: more than {MAX_WAITING} of its jobs wait: expected {expected}")
        return UsageError(f"{place}: more than {MAX_WAITING} of its frames wait: expected a network that carries them")
