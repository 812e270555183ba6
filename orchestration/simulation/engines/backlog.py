"""Recorded rows and events of a run that have not been handed over, until a chunk of them is complete.

Events of messages come from the engine, those of tasks and frames from the scheduler, those within FMUs from them.
"""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.foundation.basics.times import nanoseconds, seconds
from orchestration.foundation.recording.recording import BYTES, EVENT, EVENTS, ROWS, Chunk, Events, Recorder
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System

_AT_ONCE = 1_000_000_000
"""Time advanced at once over unneeded events [ns]"""


class _OnComputers:
    """The events of the tasks and frames of a system, computed as far as requested."""

    def __init__(self, system: System) -> None:
        from orchestration.systems.computers.compiled import scheduler  # not before: few systems have any
        from orchestration.systems.computers.scheduler_events import NEEDED
        from orchestration.systems.schedule.resources import Resources

        resources = Resources(system, nanoseconds(system.stop_time))
        parts = resources.of_run(Streams(system.seed, system.streams))
        self._scheduler, self._events = scheduler(parts, NEEDED), resources.event_builder()
        self.names = self._events.names
        self.reached = -1

    def up_to(self, time: int) -> Integers:
        """The events after the last requested time, up to `time` [ns]."""
        self.reached = time
        self._scheduler.run(time + 1)
        return self._events.before(time + 1, self._scheduler.take_notes())


class RunEvents:
    """The events of a run that are not handed over yet."""

    def __init__(self, system: System, fmus: Sequence[str] = ()) -> None:
        """`fmus` are the components whose FMUs have events."""
        connections = tuple(x.name for x in system.connections)
        self._on_computers = _OnComputers(system) if system.computers or system.networks else None
        self._first = len(connections)
        self._names = connections if self._on_computers is None else (*connections, *self._on_computers.names)
        self.first_fmu, self._names = len(self._names), (*self._names, *fmus)
        self._kept: Integers = np.zeros((0, 4), dtype=np.int64)

    def with_messages(self, events: Integers, time: int) -> Events:
        """Events of tasks and frames up to `time` [ns] and other `events`, as a table of `Events`, in order.

        At one instant computers and networks come first, then messages.
        """
        if self._on_computers is not None:
            found = self._on_computers.up_to(time)
            found[:, 2] += self._first
            self._kept = np.concatenate([self._kept, found]) if len(self._kept) else found
            events = np.concatenate([self._kept, events])
        return Events(self._names, _in_order(events))

    def discard_until(self, time: int) -> None:
        """Discard the events up to `time` [ns]."""
        if self._on_computers is not None:
            begin = self._on_computers.reached
            for until in range(begin, time, max(_AT_ONCE, (time - begin) // 1000)):
                self._on_computers.up_to(until)
            self._on_computers.up_to(time)
            self._kept = self._kept[:0]


def _in_order(events: Integers) -> Integers:
    """A table of events sorted by time, a new one."""
    if (events[1:, 0] >= events[:-1, 0]).all():
        return np.array(events)
    return events[np.argsort(events[:, 0], kind="stable")]


@runtime_checkable
class _HasEvents(Protocol):
    """A simulator that may have events within its steps."""

    has_events: bool
    """whether it has any"""

    def take_events(self) -> Floats:
        """The number of events that were taken before, and the times of those since [s]."""


class Tables(Protocol):
    """Storage of rows and events until they are handed over."""

    def is_empty(self) -> bool:
        """Whether there are neither rows nor events."""

    def rows(self) -> Floats:
        """Rows of the board, shape (n, number of its columns)."""

    def rows_with_sources(self) -> Floats:
        """The same with the values of sources, shape (n, number of `RunningSystem.columns`)."""

    def events(self) -> Integers:
        """A table as that of `Events`."""

    def replace_rows(self, rows: bytes) -> None:
        """Store these rows of the board instead."""

    def replace_events(self, events: Integers) -> None:
        """Store these events instead."""


class ListTables:
    """Tables that the loop in Python appends to."""

    def __init__(self, running: RunningSystem) -> None:
        self.content = bytearray()
        """rows of the board"""
        self.noted: list[int] = []
        """a table of `Events`, row after row: numbers, so that the garbage collector has no objects to track"""
        self._running = running

    def is_empty(self) -> bool:
        """As `Tables`."""
        return not (self.content or self.noted)

    def rows(self) -> Floats:
        """As `Tables`."""
        return np.frombuffer(bytes(self.content), dtype=np.float64).reshape(-1, len(self._running.board.columns))

    def rows_with_sources(self) -> Floats:
        """As `Tables`."""
        rows = self.rows()
        return np.column_stack([rows, *(values.over(rows[:, 0]) for _, values in self._running.sources)])

    def events(self) -> Integers:
        """As `Tables`."""
        return np.fromiter(self.noted, np.int64, len(self.noted)).reshape(-1, 4)

    def replace_rows(self, rows: bytes) -> None:
        """As `Tables`."""
        self.content[:] = rows

    def replace_events(self, events: Integers) -> None:
        """As `Tables`."""
        self.noted[:] = events.ravel().tolist()


class Backlog:
    """The contents of some tables, on their way to a recorder."""

    def __init__(self, running: RunningSystem, tables: Tables, recorder: Recorder) -> None:
        self._running, self.tables, self._recorder = running, tables, recorder
        self._fmus = {
            name: one for name, one in running.simulators.items() if isinstance(one, _HasEvents) and one.has_events
        }
        self._run_events = RunEvents(running.system, tuple(self._fmus))
        self._of_fmus: Integers = np.zeros((0, 4), dtype=np.int64)
        self.handed_over: int | None = None
        """up to this time [ns]; None: nothing has been handed over"""
        recorder.begin(running.columns)

    def pending(self) -> Chunk:
        """What was recorded since the last chunk was handed over, without messages that are sent later."""
        events, of_fmus = self._past_and_later()[0], self._past(self._taken_events())[0]
        return Chunk(
            columns=self._running.columns,
            rows=self.tables.rows_with_sources(),
            events=self._run_events.with_messages(np.concatenate([events, of_fmus]), self._running.now),
        )

    def hand_over(self) -> None:
        """Hand the pending chunk over to the recorder."""
        self._recorder.take(self.pending())
        self.tables.replace_events(self._past_and_later()[1])
        self._of_fmus = self._past(self._of_fmus)[1]
        self.tables.replace_rows(b"")
        self.handed_over = self._running.now
        self._run_events.discard_until(self._running.now)

    def hand_over_rest(self) -> None:
        """Hand over the rest at the end of the run; a recorder receives at least one chunk."""
        if self.handed_over is None or not self.tables.is_empty() or len(self.pending().events):
            self.hand_over()

    def drop_later_events(self) -> None:
        """Drop the events of messages that would be sent after the end: in Jacobi order they are noted before.

        A sampled component may have reached its next sample, so FMUs have later events too.
        """
        self.tables.replace_events(self._past_and_later()[0])
        self._of_fmus = self._past(self._taken_events())[0]

    def has_row(self) -> bool:
        """Whether a row was recorded, be it handed over or not."""
        return self.handed_over is not None or len(self.tables.rows()) > 0

    def ensure_row(self) -> None:
        """Add a row with the current values for a run that ended before its first row."""
        if not self.has_row():
            self._running.board.row[0] = seconds(self._running.now)
            self.tables.replace_rows(self._running.board.row.tobytes())

    def events(self) -> Integers:
        """All events that have not been handed over, as a table."""
        return np.concatenate([self.tables.events(), self._taken_events()])

    def restore(self, rows: bytes, events: Integers, *, handed_over: int | None) -> None:
        """Continue with the rows and `events` of a paused run."""
        self.tables.replace_rows(rows)
        within = events[:, 1] == EVENT
        self.tables.replace_events(events[~within])
        self._of_fmus = events[within]
        self.handed_over = handed_over
        if handed_over is not None:
            self._run_events.discard_until(handed_over)

    def _past_and_later(self) -> tuple[Integers, Integers]:
        """The events of messages up to now, and of those that are sent later."""
        return self._past(self.tables.events())

    def _past(self, table: Integers) -> tuple[Integers, Integers]:
        """The events of a table up to now, and the later ones."""
        past = table[:, 0] <= self._running.now
        return (table, table[:0]) if past.all() else (table[past], table[~past])

    def _taken_events(self) -> Integers:
        """The events within FMUs, after those that have happened by now were taken from them."""
        for place, (name, fmu) in enumerate(self._fmus.items(), self._run_events.first_fmu):
            first, *times = fmu.take_events().tolist()
            sampling = self._running.system.components[name].sampling
            ratio = 1.0 if sampling is None else sampling.clock_ratio
            found = [(nanoseconds(t / ratio), EVENT, place, int(first) + k) for k, t in enumerate(times)]
            if found:
                self._of_fmus = np.concatenate([self._of_fmus, np.array(found, dtype=np.int64)])
        return self._of_fmus


def rows_of_a_chunk(running: RunningSystem) -> int:
    """The number of rows of a complete chunk: `ROWS`, or as many as have `BYTES`."""
    return min(ROWS, max(1, BYTES // running.board.row.nbytes))


def events_of_a_chunk() -> int:
    """The number of events of a complete chunk."""
    return EVENTS
