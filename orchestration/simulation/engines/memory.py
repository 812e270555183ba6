"""Memory of a run that survives its process: files of a folder, which the process maps into memory."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.foundation.basics.times import nanoseconds
from orchestration.simulation.engines.structures import ONE_LANE

LOOP, ROWS, EVENTS = "loop", "rows", "events"
Bytes = npt.NDArray[np.uint8]
Allocator = Callable[[str, int], Bytes]
"""Allocates memory of a size [byte] by name; a later allocation with the same name replaces the earlier one"""


def process_memory(name: str, size: int) -> Bytes:
    """Allocate memory that ends with the process."""
    return np.empty(size, dtype=np.uint8)


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
