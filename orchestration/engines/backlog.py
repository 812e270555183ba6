"""What a run has recorded and not handed over: rows and events, until a chunk of them is whole."""

from typing import Protocol

import numpy as np

from orchestration.basics.simulator import Floats, Integers
from orchestration.engines.at_work import AtWork
from orchestration.recording.recording import BYTES, EVENTS, ROWS, Chunk, Recorder
from orchestration.schedule.run_events import RunEvents
from orchestration.system.times import NANOSECONDS


class Tables(Protocol):
    """Where rows and events are until they are handed over."""

    def is_empty(self) -> bool:
        """Whether nothing is."""

    def rows(self) -> Floats:
        """Of the board, shape (n, number of its columns)."""

    def rows_with_sources(self) -> Floats:
        """The same with what sources say, shape (n, number of `AtWork.columns`)."""

    def events(self) -> Integers:
        """As the table of `Events`."""

    def keep_rows(self, rows: bytes) -> None:
        """Have these rows of the board instead."""

    def keep_events(self, events: Integers) -> None:
        """Have these events instead."""


class Listed:
    """Tables that grow with what Python notes."""

    def __init__(self, work: AtWork) -> None:
        self.content = bytearray()
        """rows of the board"""
        self.noted: list[int] = []
        """a table of `Events`, row after row: no object an event, for the collector to see"""
        self._work = work

    def is_empty(self) -> bool:
        """As `Tables`."""
        return not (self.content or self.noted)

    def rows(self) -> Floats:
        """As `Tables`."""
        return np.frombuffer(bytes(self.content), dtype=np.float64).reshape(-1, len(self._work.board.columns))

    def rows_with_sources(self) -> Floats:
        """As `Tables`."""
        rows = self.rows()
        return np.column_stack([rows, *(values.over(rows[:, 0]) for _, values in self._work.sources)])

    def events(self) -> Integers:
        """As `Tables`."""
        return np.fromiter(self.noted, np.int64, len(self.noted)).reshape(-1, 4)

    def keep_rows(self, rows: bytes) -> None:
        """As `Tables`."""
        self.content[:] = rows

    def keep_events(self, events: Integers) -> None:
        """As `Tables`."""
        self.noted[:] = events.ravel().tolist()


class Backlog:
    """What is in some tables, on its way to a recorder."""

    def __init__(self, work: AtWork, tables: Tables, recorder: Recorder) -> None:
        self._work, self.tables, self._recorder = work, tables, recorder
        self._run_events = RunEvents(work.system)
        self.handed_over: int | None = None
        """up to when [ns]; None: nothing has been"""
        recorder.begin(work.columns)

    def pending(self) -> Chunk:
        """What was recorded since the last chunk was handed over; messages that go out later are left out."""
        events, _ = self._past_and_later()
        return Chunk(
            columns=self._work.columns,
            rows=self.tables.rows_with_sources(),
            events=self._run_events.with_messages(events, self._work.now),
        )

    def hand_over(self) -> None:
        """Give the recorder what there is."""
        self._recorder.take(self.pending())
        self.tables.keep_events(self._past_and_later()[1])
        self.tables.keep_rows(b"")
        self.handed_over = self._work.now
        self._run_events.hand_over(self._work.now)

    def hand_over_rest(self) -> None:
        """At the end of the run: a recorder hears of at least one chunk."""
        if self.handed_over is None or not self.tables.is_empty() or len(self.pending().events):
            self.hand_over()

    def drop_later_events(self) -> None:
        """In Jacobi order a message is written down before it goes out; after the end none does."""
        self.tables.keep_events(self._past_and_later()[0])

    def expect_a_row(self) -> None:
        """A run that has ended before its first row has one of where it was."""
        if not len(self.tables.rows()) and self.handed_over is None:
            self._work.board.row[0] = self._work.now / NANOSECONDS
            self.tables.keep_rows(self._work.board.row.tobytes())

    def rows(self) -> Floats:
        """Those of the board that are not handed over."""
        return self.tables.rows()

    def events(self) -> Integers:
        """All that are not handed over."""
        return self.tables.events()

    def restore(self, rows: bytes, events: Integers, *, handed_over: int | None) -> None:
        """Continue with what a paused run had."""
        self.tables.keep_rows(rows)
        self.tables.keep_events(events)
        self.handed_over = handed_over
        if handed_over is not None:
            self._run_events.hand_over(handed_over)

    def _past_and_later(self) -> tuple[Integers, Integers]:
        """The events up to now, and those of messages that go out later."""
        table = self.tables.events()
        past = table[:, 0] <= self._work.now
        return (table, table[:0]) if past.all() else (table[past], table[~past])


def rows_of_a_chunk(work: AtWork) -> int:
    """How many rows make a chunk whole: `ROWS` of them, or those that come to `BYTES`."""
    return min(ROWS, max(1, BYTES // work.board.row.nbytes))


def events_of_a_chunk() -> int:
    """How many events make a chunk whole."""
    return EVENTS
