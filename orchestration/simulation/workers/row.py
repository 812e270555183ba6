"""What comes of runs: by run, by column as a worker sends it, and as the rows of a store."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.foundation.processes.passable import passable

TEXT = "outcome"
"""The metric that is a text; all others are numbers"""
_KINDS = {"good": bool, "diverged": bool, "steps": int}
"""Metrics that are no floats to who asks for a single run"""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one run."""

    metrics: Mapping[str, Any] | None
    """None if the run failed"""
    message: str | None
    """why it failed, or what diverged"""
    duration: float = 0.0
    """wall-clock time of the run [s]"""
    engine: str | None = None
    """the engine that its metrics are of, by its name in `--engine`; None if it failed"""
    signals: bytes | None = None
    """its signals as the bytes of a Parquet file if they are kept"""
    rows: Floats | None = None
    """the rows of the columns that are recorded, the time [s] first"""
    ended: bool = False
    """whether it was stopped at a limit"""


@passable
@dataclass(frozen=True, kw_only=True)
class Results:
    """What came of runs by column, in the order of their task."""

    numbers: Mapping[str, Floats]
    """metrics by name; NaN for no value"""
    texts: list[str | None]
    """the metric `TEXT`"""
    failed: Booleans
    messages: list[str | None]
    durations: Floats
    engines: list[str | None]
    machine: str | None = None
    """the kind of machine that ran them"""
    signals: Mapping[int, bytes] = field(default_factory=dict)
    """Signals by the place of the run"""
    rows: Mapping[int, Floats] = field(default_factory=dict)
    """Recorded rows by the place of the run"""
    ended: frozenset[int] = frozenset()
    """Places of those that were stopped at a limit"""

    def __len__(self) -> int:
        """The number of runs."""
        return len(self.failed)

    @classmethod
    def of(cls, outcomes: Sequence[Outcome], machine: str | None = None) -> "Results":
        """Those of single runs."""
        metrics = [each.metrics or {} for each in outcomes]
        names = dict.fromkeys(name for each in metrics for name in each if name != TEXT)
        return cls(
            numbers={name: np.array([_number(each.get(name)) for each in metrics]) for name in names},
            texts=[None if each.get(TEXT) is None else str(each[TEXT]) for each in metrics],
            failed=np.array([each.metrics is None for each in outcomes], dtype=np.bool_),
            messages=[each.message for each in outcomes],
            durations=np.array([each.duration for each in outcomes], dtype=np.float64),
            engines=[each.engine for each in outcomes], machine=machine,
            signals={i: each.signals for i, each in enumerate(outcomes) if each.signals is not None},
            rows={i: each.rows for i, each in enumerate(outcomes) if each.rows is not None},
            ended=frozenset(i for i, each in enumerate(outcomes) if each.ended),
        )  # fmt: skip

    @classmethod
    def joined(cls, parts: Sequence["Results"]) -> "Results":
        """Those of several tasks as those of one; none of them has signals."""
        names = dict.fromkeys(name for part in parts for name in part.numbers)
        begins = [*accumulate(map(len, parts), initial=0)]
        return cls(
            numbers={
                name: np.concatenate([part.numbers.get(name, np.full(len(part), np.nan)) for part in parts])
                for name in names
            },
            texts=[text for part in parts for text in part.texts],
            failed=np.concatenate([part.failed for part in parts]),
            messages=[message for part in parts for message in part.messages],
            durations=np.concatenate([part.durations for part in parts]),
            engines=[engine for part in parts for engine in part.engines],
            machine=next((part.machine for part in parts if part.machine is not None), None),
            rows={first + place: rows for first, part in zip(begins, parts) for place, rows in part.rows.items()},
            ended=frozenset(first + place for first, part in zip(begins, parts) for place in part.ended),
        )

    def metrics(self, place: int) -> dict[str, Any] | None:
        """The metrics of one run; None if it failed."""
        if self.failed[place]:
            return None
        numbers = {name: float(values[place]) for name, values in self.numbers.items()}
        found = {name: None if np.isnan(value) else _KINDS.get(name, float)(value) for name, value in numbers.items()}
        return {TEXT: self.texts[place], **found}

    def fits(self, count: int) -> bool:
        """Whether every column has an entry for each of `count` runs."""
        arrays = (self.failed, self.durations, *self.numbers.values())
        return (
            all(each.shape == (count,) and each.dtype.kind in "bif" for each in arrays)
            and all(len(each) == count for each in (self.texts, self.messages, self.engines))
            and all(place < count and each.ndim == 2 for place, each in self.rows.items())
        )


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Rows of a store: which runs they are of, and what came of them."""

    index: Sequence[int]
    """positions in the design"""
    key: Sequence[str]
    """hashes of everything that determines the runs"""
    seed: Sequence[int]
    results: Results

    def __len__(self) -> int:
        """The number of rows."""
        return len(self.index)
