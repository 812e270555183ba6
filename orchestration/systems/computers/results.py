"""The timeline of tasks and messages: their jobs and frames, and the use of processors and networks.

Times are in nanoseconds; NEVER stands for what did not happen before the end.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.foundation.recording.recording import Events

NEVER = -1
"""The time of what did not happen"""
DONE, UNFINISHED, SKIPPED, ABORTED = range(4)
"""Outcomes of a job: one that is under way or waits at the end is unfinished"""
RUN, SWITCH, CORRUPTED = range(3)
"""Uses of a processor or a network: work, the switch before it, or a corrupted frame"""


@dataclass(frozen=True, kw_only=True)
class _Records:
    """Jobs or frames, in the order of their release."""

    nominal: Integers
    """the nominal releases, from which responses and deadlines count"""
    started: Integers
    """Times at which its first instruction ran, or its first bit was first sent"""
    ended: Integers
    """Times at which it was done, or received"""
    deadline: Integers
    """the largest number for none"""
    stop: int

    def __len__(self) -> int:
        return len(self.nominal)

    @property
    def done(self) -> Booleans:
        """Which of them are done, or received."""
        found: Booleans = self.ended != NEVER
        return found

    @property
    def responses(self) -> Integers:
        """The times from nominal release to end, of those that are done."""
        found: Integers = (self.ended - self.nominal)[self.done]
        return found

    @property
    def due(self) -> Booleans:
        """Which of them have their deadline within the run."""
        found: Booleans = self.deadline <= self.stop
        return found

    @property
    def missed(self) -> Booleans:
        """Which of those that are `due` were not done by their deadline, including skipped and aborted ones."""
        found: Booleans = self.due & ((self.ended == NEVER) | (self.ended > self.deadline))
        return found


@dataclass(frozen=True, kw_only=True)
class Jobs(_Records):
    """The jobs of one task, by index in the order of release, including skipped ones."""

    released: Integers
    """the releases"""
    written: Integers
    """Times at which outputs were sent"""
    preemptions: Integers
    """the number of preemptions of each"""
    outcome: Integers
    """DONE, UNFINISHED, SKIPPED or ABORTED"""

    @property
    def done(self) -> Booleans:
        """Which of them are done, without aborted ones."""
        found: Booleans = self.outcome == DONE
        return found


@dataclass(frozen=True, kw_only=True)
class Frames(_Records):
    """The messages of one name, in the order in which they were queued."""

    queued: Integers
    attempts: Integers
    """the number of transmissions; over two links at least two"""


@dataclass(frozen=True, kw_only=True)
class Slices:
    """The use of one processor, or of one link of a network, as consecutive slices."""

    owners: tuple[str, ...]
    """the names of its tasks, or of the messages over it"""
    owner: Integers
    """the index of the owner of each slice"""
    number: Integers
    """the index of its job or frame"""
    begin: Integers
    end: Integers
    kind: Integers
    """RUN, SWITCH or CORRUPTED"""


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """The timeline of all computers and networks of a system, up to a time."""

    stop: int
    jobs: Mapping[str, Jobs]
    """Jobs by COMPUTER.TASK"""
    frames: Mapping[str, Frames]
    """Frames by NETWORK.MESSAGE"""
    processors: Mapping[str, Slices]
    """Slices by computer"""
    links: Mapping[str, Slices]
    """Slices by network or, where it has several links, by `NETWORK: NODE -> switch`"""
    happenings: Callable[[], Events]
    """the events, in order"""
