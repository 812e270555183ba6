"""What has become of tasks and messages: their jobs and frames, and who had a processor or a network when.

Times are in nanoseconds; NEVER stands where something did not happen before the end.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from orchestration.basics.simulator import Booleans, Integers
from orchestration.recording.recording import Events

NEVER = -1
"""Of what did not happen"""
DONE, UNFINISHED, SKIPPED, ABORTED = range(4)
"""What becomes of a job: what is under way or waits at the end is unfinished"""
RUN, SWITCH, CORRUPTED = range(3)
"""What a processor or a network does: work, the switch before it, or a frame that has to be sent again"""


@dataclass(frozen=True, kw_only=True)
class _Served:
    """What was asked of a processor or a network, in the order in which it was."""

    nominal: Integers
    """when each should be released or queued; responses and deadlines count from here"""
    started: Integers
    """when its own first instruction was, or its first bit was sent the first time"""
    ended: Integers
    """when it was done, or received"""
    deadline: Integers
    """the largest number where it has none"""
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
        """Of those that are done, from the nominal instant to the end."""
        found: Integers = (self.ended - self.nominal)[self.done]
        return found

    @property
    def due(self) -> Booleans:
        """Which of them have their deadline within the run."""
        found: Booleans = self.deadline <= self.stop
        return found

    @property
    def missed(self) -> Booleans:
        """Which of those that are `due` were not done by their deadline, skipped and aborted ones included."""
        found: Booleans = self.due & ((self.ended == NEVER) | (self.ended > self.deadline))
        return found


@dataclass(frozen=True, kw_only=True)
class Jobs(_Served):
    """The jobs of one task, a number each in the order of their releases, those included that a skip left out."""

    released: Integers
    """when it was"""
    written: Integers
    """when its outputs were sent"""
    preemptions: Integers
    """how often another took the processor from it"""
    outcome: Integers
    """DONE, UNFINISHED, SKIPPED or ABORTED"""

    @property
    def done(self) -> Booleans:
        """Which of them are done: an aborted one has ended too."""
        found: Booleans = self.outcome == DONE
        return found


@dataclass(frozen=True, kw_only=True)
class Frames(_Served):
    """The messages of one name, in the order in which they were queued."""

    queued: Integers
    attempts: Integers
    """how often it was sent, the last time included; over two links twice"""


@dataclass(frozen=True, kw_only=True)
class Slices:
    """Who has one processor, or one link of a network, when: pieces that follow each other."""

    owners: tuple[str, ...]
    """the names of its tasks, or of the messages over it"""
    owner: Integers
    """the index of each piece's among them"""
    number: Integers
    """which job or frame of it"""
    begin: Integers
    end: Integers
    kind: Integers
    """RUN, SWITCH or CORRUPTED"""


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """What has become of all computers and networks of a system, up to a time."""

    stop: int
    jobs: Mapping[str, Jobs]
    """by COMPUTER.TASK"""
    frames: Mapping[str, Frames]
    """by NETWORK.MESSAGE"""
    processors: Mapping[str, Slices]
    """by computer"""
    links: Mapping[str, Slices]
    """by network or, where it has several links, as `NETWORK: NODE -> switch`"""
    happenings: Callable[[], Events]
    """what happened, in order"""
