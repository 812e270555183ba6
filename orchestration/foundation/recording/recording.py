"""The recording of a run: its rows and events, handed over in chunks while it runs."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, overload

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.foundation.basics.times import instants_of
from orchestration.foundation.processes.passable import passable

ROWS, EVENTS = 2**15, 2**18
"""A chunk is complete with this many rows or events, so that what is computed by chunks does not depend on where they
are stored."""
BYTES = 2**27
"""Largest number of bytes of rows in a chunk, where a row is wide"""


class Event(NamedTuple):
    """An event of one message, of one job of a task, or within an FMU."""

    time: int
    """Time [ns]"""
    kind: str
    """One of `KINDS`"""
    what: str
    """The name of the connection; COMPUTER.TASK for a job, NETWORK.MESSAGE for a frame, the component for an event of
    its FMU"""
    sample: int
    """The index of the message, of the job or frame, or of the event"""


KINDS = (
    "sampled", "sent", "arrived", "lost",
    "released", "started", "preempted", "resumed", "finished", "missed", "skipped", "aborted",
    "queued", "transmitted", "retransmitted", "event",
)  # fmt: skip
"""Kinds of events: of messages, of jobs of tasks, of frames of messages over networks, and within FMUs"""
SAMPLED, SENT, ARRIVED, LOST = range(4)
EVENT = KINDS.index("event")


@passable
@dataclass(frozen=True, eq=False)
class Events(Sequence[Event]):
    """Events in order, as columns: one object for all of them, as there may be millions."""

    names: tuple[str, ...]
    """connections, tasks, messages and components that have events"""
    table: Integers
    """shape (n, 4): time [ns], index in `KINDS`, index in `names`, index of the message, job, frame or event"""

    @classmethod
    def of(cls, events: Iterable[Event]) -> "Events":
        """Make columns of a list of events."""
        listed = list(events)
        names = tuple(dict.fromkeys(event.what for event in listed))
        rows = [(time, KINDS.index(kind), names.index(what), sample) for time, kind, what, sample in listed]
        return cls(names, np.array(rows, dtype=np.int64).reshape(-1, 4))

    def are(self, kind: str, what: str | None = None) -> npt.NDArray[np.bool_]:
        """Which are of a kind, and of `what` if it is given; shape (n,)."""
        selected: npt.NDArray[np.bool_] = self.table[:, 1] == KINDS.index(kind)
        if what is not None:
            selected &= self.table[:, 2] == (self.names.index(what) if what in self.names else -1)
        return selected

    def __len__(self) -> int:
        return len(self.table)

    def __iter__(self) -> Iterator[Event]:
        names = self.names
        return (Event(time, KINDS[kind], names[what], sample) for time, kind, what, sample in self.table.tolist())

    @overload
    def __getitem__(self, place: int) -> Event: ...
    @overload
    def __getitem__(self, place: slice) -> "Events": ...
    def __getitem__(self, place: int | slice) -> "Event | Events":
        if isinstance(place, slice):
            return Events(self.names, self.table[place])
        (event,) = Events(self.names, self.table[place].reshape(1, 4))
        return event


@passable
@dataclass(frozen=True, kw_only=True)
class Chunk:
    """Consecutive rows, and the events after the row before them up to their last row."""

    columns: tuple[str, ...]
    rows: Floats
    """shape (n, number of columns), at most `ROWS` of them"""
    events: Events
    """Events in order of time; the last chunk also has those after its last row"""

    @property
    def signals(self) -> dict[str, Floats]:
        """Every column as an array of shape (n,)."""
        return {name: self.rows[:, i] for i, name in enumerate(self.columns)}


class Recording(Protocol):
    """Recorded rows and events; can be iterated any number of times."""

    @property
    def columns(self) -> tuple[str, ...]:
        """`time`, then COMPONENT.NAME, then the signals of the sources."""

    def __len__(self) -> int:
        """Number of rows."""

    def chunks(self, columns: Collection[str] | None = None) -> Iterator[Chunk]:
        """In order of time, at least one; with all columns, or those of `columns` that exist."""


About = Mapping[str, Mapping[str, str]]
"""The `unit` and the `description` of columns, where they have them, by column"""


def rows_of(recording: Recording) -> Floats:
    """All rows, shape (n, number of columns)."""
    return np.concatenate([chunk.rows for chunk in recording.chunks()])


def events_of(recording: Recording) -> Events:
    """All events, in order of time."""
    parts = [chunk.events for chunk in recording.chunks(("time",))]
    names = tuple(dict.fromkeys(name for part in parts for name in part.names))
    places = [np.array([names.index(name) for name in part.names], dtype=np.int64) for part in parts]
    tables = [
        np.column_stack([part.table[:, :2], place[part.table[:, 2]], part.table[:, 3]])
        for part, place in zip(parts, places, strict=True)
    ]
    return Events(names, np.concatenate(tables))


class Recorder(Protocol):
    """Receives the chunks of a run."""

    def describe(self, about: About) -> None:
        """Units and descriptions of the columns, for recorders that write them; called before `begin`."""

    def begin(self, columns: tuple[str, ...]) -> None:
        """The names of all columns; called before the first chunk."""

    def take(self, chunk: Chunk) -> None:
        """Receive the next chunk."""

    def finish(self) -> Recording:
        """End; returns what was received."""


class InMemory:
    """A recorder that keeps everything, and is its own recording."""

    def __init__(self) -> None:
        self.columns: tuple[str, ...] = ()
        self._chunks: list[Chunk] = []

    def describe(self, about: About) -> None:
        """As `Recorder`; not kept: the result has it."""

    def begin(self, columns: tuple[str, ...]) -> None:
        """As `Recorder`."""
        self.columns = columns

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""
        self._chunks.append(chunk)

    def finish(self) -> Recording:
        """As `Recorder`."""
        return self

    def __len__(self) -> int:
        return sum(len(chunk.rows) for chunk in self._chunks)

    def chunks(self, columns: Collection[str] | None = None) -> Iterator[Chunk]:
        """As `Recording`; always with all columns."""
        return iter(self._chunks)


def thinned(recording: Recording, columns: Collection[str], window: tuple[float, float], most: int) -> Recording:
    """All rows in the `window` of time [s]; of the others every n-th, so that they are about `most` at most.

    Only with `columns`, and with the events at the rows that are kept.
    """
    stride = -(-len(recording) // most)
    result = InMemory()
    for chunk in recording.chunks(columns):
        t = chunk.signals["time"]
        keep = (np.arange(len(t)) % stride == 0) | ((t >= window[0]) & (t <= window[1]))
        events = chunk.events
        if stride > 1:
            kept = np.isin(events.table[:, 0], instants_of(t[keep]))
            events = Events(events.names, events.table[kept])
        result.begin(chunk.columns)
        result.take(Chunk(columns=chunk.columns, rows=chunk.rows[keep], events=events))
    return result
