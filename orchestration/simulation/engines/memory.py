"""Memory of rows and events that are not handed over, shared with C; in files of a folder it survives its process."""

import ctypes
import mmap
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.c_structures import address
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.foundation.basics.times import nanoseconds
from orchestration.simulation.engines.backlog import events_of_a_chunk, rows_of_a_chunk
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.simulation.engines.structures import ONE_LANE
from orchestration.systems.schedule.instant_arrays import Schedule

LOOP, ROWS, EVENTS = "loop", "rows", "events"
Bytes = npt.NDArray[np.uint8]
Allocator = Callable[[str, int], Bytes]
"""Allocates memory of a size [byte] by name; a later allocation with the same name replaces the earlier one"""
_PRIVATE: dict[str, int] = {} if os.name == "nt" else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS}


def process_memory(name: str, size: int) -> Bytes:
    """Allocate memory that ends with the process.

    A page of it is touched when it is first written to: a short run needs few. It is not NumPy's, which asks for huge
    pages: on virtual machines the first touch of these takes three to four times as long, which was most of the time of
    a step that is recorded.
    """
    return np.frombuffer(mmap.mmap(-1, max(size, 1), **_PRIVATE), dtype=np.uint8, count=size)


@dataclass(frozen=True)
class FolderMemory:
    """Memory in the files of `folder`."""

    folder: Path

    def __call__(self, name: str, size: int) -> Bytes:
        """As `Allocator`."""
        path = self.folder / name
        path.unlink(missing_ok=True)  # the earlier memory is still mapped
        return np.memmap(path, dtype=np.uint8, mode="w+", shape=(max(size, 1),))[:size].view(np.ndarray)


@dataclass(frozen=True, kw_only=True)
class Unrecorded:
    """Rows and events of a run that its process had not handed over when it ended."""

    rows: Floats
    """shape (n, number of columns); the values of sources are not filled in"""
    events: Integers
    """up to the last row, in the order in which they were recorded"""
    steps: int
    calling: int | None
    """the index of the component whose FMU was being called; None if none was"""


def read_unrecorded(folder: Path, columns: Sequence[str]) -> Unrecorded | None:
    """Read what the compiled loop of an ended process had recorded; None if it had not begun."""
    try:
        content: Mapping[str, bytes] = {name: (folder / name).read_bytes() for name in (LOOP, ROWS, EVENTS)}
        loop = ONE_LANE.Loop.from_buffer_copy(content[LOOP])
    except (OSError, ValueError):
        return None
    rows = np.frombuffer(content[ROWS], count=loop.row_count * len(columns)).reshape(-1, len(columns))
    events = np.frombuffer(content[EVENTS], np.int64, count=4 * loop.event_count).reshape(-1, 4)
    until = nanoseconds(rows[-1, 0]) if len(rows) else -1
    return Unrecorded(
        rows=rows.copy(),
        events=events[events[:, 0] <= until],
        steps=int(loop.steps[0]),
        calling=None if loop.calling < 0 else int(loop.calling),
    )


def allocated_loop(allocate: Allocator) -> Any:
    """The structure of a run, zeroed, in memory that is allocated for it."""
    memory = allocate(LOOP, ctypes.sizeof(ONE_LANE.Loop))
    memory[:] = 0
    return ONE_LANE.Loop.from_buffer(memory.data)


class SharedTables:
    """Tables in memory of an `Allocator`; C has their addresses and counts."""

    def __init__(self, running: RunningSystem, loop: Any, allocate: Allocator) -> None:
        self._running, self._loop, self._allocate = running, loop, allocate
        self._most_rows, self._most_events = rows_of_a_chunk(running), events_of_a_chunk()
        self.content: Floats = self._new_rows()
        """memory for the rows of a chunk; the columns of sources are filled in when it is handed over, if not by C"""
        self._noted: Integers = self._new_events(0)
        loop.row, loop.rows = address(running.board.row), address(self.content)
        loop.width, loop.stride = len(running.board.columns), len(running.columns)
        loop.row_limit, loop.event_limit = self._most_rows, self._most_events

    def is_empty(self) -> bool:
        """As `Tables`."""
        return not (self._loop.row_count or self._loop.event_count)

    def rows(self) -> Floats:
        """As `Tables`."""
        return self.content[: self._loop.row_count, : self._loop.width]

    def rows_with_sources(self) -> Floats:
        """As `Tables`."""
        rows = self.content[: self._loop.row_count]
        if not self._loop.in_rows:
            self._fill_in_sources(rows)
        return rows

    def _fill_in_sources(self, rows: Floats) -> None:
        first = self._loop.width
        for signals, values in self._running.sources:
            rows[:, first : first + len(signals)] = values.over(rows[:, 0])
            first += len(signals)

    def events(self) -> Integers:
        """As `Tables`."""
        return self._noted[: self._loop.event_count]

    def replace_rows(self, rows: bytes) -> None:
        """As `Tables`."""
        table = np.frombuffer(rows, dtype=np.float64).reshape(-1, self._loop.width)
        self.content = self._new_rows()
        self.content[: len(table), : table.shape[1]] = table
        if self._loop.in_rows and len(table):
            self._fill_in_sources(self.content[: len(table)])
        self._loop.rows, self._loop.row_count = address(self.content), len(table)

    def replace_events(self, events: Integers) -> None:
        """As `Tables`."""
        if len(events) > len(self._noted):
            self._noted = self._new_events(len(events))
        self._noted[: len(events)] = events
        self._loop.event_count = len(events)

    def make_room(self, schedule: Schedule) -> None:
        """Make room for the events of any instant beside those of a complete chunk."""
        most = schedule.most_events()
        loop, count = self._loop, self._loop.event_count
        if len(self._noted) < max(self._most_events, count) + most:
            table = self._new_events(max(self._most_events, count) + 2 * most)
            table[:count] = self._noted[:count]
            self._noted = table
        self._arrived: Integers = np.empty((most, 4), dtype=np.int64)
        loop.events, loop.arrived = address(self._noted), address(self._arrived)

    def _new_rows(self) -> Floats:
        shape = (self._most_rows, len(self._running.columns))
        return self._allocate(ROWS, 8 * shape[0] * shape[1]).view(np.float64).reshape(shape)

    def _new_events(self, count: int) -> Integers:
        return self._allocate(EVENTS, 32 * count).view(np.int64).reshape(count, 4)
