"""Memory of a run that is there when its process has died: files of a folder, which that process maps."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.basics.simulator import Floats, Integers
from orchestration.engines.structures import structures

c = structures(1)
"""What C has of one run"""
LOOP, ROWS, EVENTS = "loop", "rows", "events"
Bytes = npt.NDArray[np.uint8]
Room = Callable[[str, int], Bytes]
"""Gives so many bytes by a name; by the same name the next time others, and those before are no longer found by it"""


def private(name: str, size: int) -> Bytes:
    """Room that ends with the process."""
    return np.empty(size, dtype=np.uint8)


@dataclass(frozen=True)
class Shared:
    """Room in the files of `folder`."""

    folder: Path

    def __call__(self, name: str, size: int) -> Bytes:
        """As `Room`."""
        path = self.folder / name
        path.unlink(missing_ok=True)  # what was given before is still mapped
        return np.memmap(path, dtype=np.uint8, mode="w+", shape=(max(size, 1),))[:size].view(np.ndarray)


@dataclass(frozen=True, kw_only=True)
class Left:
    """What a run has left in its room: the rows and events that it had not handed over."""

    rows: Floats
    """shape (n, number of columns); what sources say is not filled in"""
    events: Integers
    """up to the last row, in the order in which they were noted"""
    steps: int
    calling: int | None
    """the index of the component whose FMU was being called; None: none was"""


def left_in(folder: Path, columns: Sequence[str]) -> Left | None:
    """What the compiled loop of a process that is no more has left; None if it had not begun."""
    try:
        content: Mapping[str, bytes] = {name: (folder / name).read_bytes() for name in (LOOP, ROWS, EVENTS)}
        loop = c.Loop.from_buffer_copy(content[LOOP])
    except (OSError, ValueError):
        return None
    rows = np.frombuffer(content[ROWS], count=loop.row_count * len(columns)).reshape(-1, len(columns))
    events = np.frombuffer(content[EVENTS], np.int64, count=4 * loop.event_count).reshape(-1, 4)
    until = round(float(rows[-1, 0]) * 1e9) if len(rows) else -1
    return Left(
        rows=rows.copy(),
        events=events[events[:, 0] <= until],
        steps=int(loop.steps[0]),
        calling=None if loop.calling < 0 else int(loop.calling),
    )


def loop_in(room: Room) -> Any:
    """The structure of a run, in room of its own."""
    memory = room(LOOP, ctypes.sizeof(c.Loop))
    memory[:] = 0
    return c.Loop.from_buffer(memory.data)
