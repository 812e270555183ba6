"""What a flight leaves: its rows and events, handed over in chunks as it goes on."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from orchestration.simulator import Floats

ROWS = 2**15
"""in each chunk but the last, so that what is computed by chunks does not depend on where they are kept"""


class Event(NamedTuple):
    """Something that happened to one message."""

    time: int
    """[ns]"""
    kind: str
    """sampled, sent, arrived or lost"""
    what: str
    """name of the connection"""
    sample: int
    """index of the message"""


@dataclass(frozen=True, kw_only=True)
class Chunk:
    """Rows that follow each other, and what happened after the row before them up to the last one."""

    columns: tuple[str, ...]
    rows: Floats
    """shape (n, number of columns), at most `ROWS` of them"""
    events: tuple[Event, ...]
    """in order of time; the last chunk has those after its last row too"""

    @property
    def signals(self) -> dict[str, Floats]:
        """Every column as an array of shape (n,)."""
        return {name: self.rows[:, i] for i, name in enumerate(self.columns)}


class Recording(Protocol):
    """What was recorded; to be gone through as often as one likes."""

    @property
    def columns(self) -> tuple[str, ...]:
        """`time`, then COMPONENT.NAME, then the signals of the sources."""

    def __len__(self) -> int:
        """Number of rows."""

    def chunks(self, columns: Collection[str] | None = None) -> Iterator[Chunk]:
        """In order of time, at least one; with all columns, or those of `columns` that there are."""


class Recorder(Protocol):
    """Takes what a flight leaves."""

    def begin(self, columns: tuple[str, ...]) -> None:
        """The names of what every row has; before the first chunk."""

    def take(self, chunk: Chunk) -> None:
        """The next chunk; one with less than `ROWS` rows is the last."""

    def finish(self) -> Recording:
        """What was taken."""


class InMemory:
    """A recorder that keeps everything, and the recording that it has made."""

    def __init__(self) -> None:
        self.columns: tuple[str, ...] = ()
        self._chunks: list[Chunk] = []

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
        """As `Recording`; with all columns in any case, they are there."""
        return iter(self._chunks)


def thinned(recording: Recording, columns: Collection[str], window: tuple[float, float], most: int) -> Recording:
    """All rows in the `window` of time [s]; of the others every n-th, so that they are at most about `most`.

    Only those of `columns`, and of the events those at the rows that stay.
    """
    stride = -(-len(recording) // most)
    result = InMemory()
    for chunk in recording.chunks(columns):
        t = chunk.signals["time"]
        keep = (np.arange(len(t)) % stride == 0) | ((t >= window[0]) & (t <= window[1]))
        times = set(np.round(t[keep] * 1e9).astype(np.int64).tolist()) if stride > 1 else set()
        result.begin(chunk.columns)
        result.take(
            Chunk(
                columns=chunk.columns,
                rows=chunk.rows[keep],
                events=tuple(event for event in chunk.events if stride == 1 or event.time in times),
            )
        )
    return result
