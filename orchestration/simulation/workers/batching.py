"""Runs of a sweep in SIMD lanes: chunks for the workers, and a sample that is repeated with FMUs for comparison."""

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import islice
from typing import Any, NamedTuple

from orchestration.foundation.basics.errors import QuadcosimError, told_apart
from orchestration.foundation.basics.unit_algebra import counted
from orchestration.simulation.engines.batch.kernels import preferred_lanes
from orchestration.simulation.engines.batch.shape import outline
from orchestration.simulation.engines.master import BATCH
from orchestration.simulation.workers.row import Rows
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.schedule.schedule_cache import schedule_key
from orchestration.systems.system.requirements import is_number

SAMPLE = 8
"""Runs that are repeated with FMUs"""
TOLERATED = 1e-9
"""largest relative difference of a metric"""
CHUNK, SORTED = 256, 4096
"""Largest number of runs in a chunk, and number of runs sorted at a time so that those of a chunk are alike"""


def batched(tasks: Iterable[RunTask]) -> Iterator[TaskBatch]:
    """Single tasks by column, as many as are sorted at a time."""
    waiting = iter(tasks)
    while window := list(islice(waiting, SORTED)):
        yield TaskBatch.of(window)


def chunks(batches: Iterable[TaskBatch], total: int, workers: int) -> Iterator[TaskBatch]:
    """Batches in chunks, several for each worker, each of runs that are alike."""
    size = max(preferred_lanes(), min(CHUNK, total // (4 * workers) // preferred_lanes() * preferred_lanes()))
    for batch in batches:
        alike, same, order = dict[Any, int](), dict[Any, int](), []
        timings = [schedule_key(system) for system in batch.systems]
        kinds = [
            alike.setdefault((outline(system), timing.regular), len(alike))
            for system, timing in zip(batch.systems, timings)
        ]
        for run, (place, seed) in enumerate(zip(batch.places, batch.seed)):
            drawn = None if timings[place].drawn is None else seed
            order.append((kinds[place], same.setdefault((kinds[place], drawn), len(same)), run))
        ordered = [run for *_, run in sorted(order)]
        for begin in range(0, len(ordered), size):
            yield batch.some(ordered[begin : begin + size])


class Sample:
    """The runs in lanes to repeat with FMUs, chosen by the content of their keys alone."""

    def __init__(self) -> None:
        self._chosen: list[tuple[bytes, str, Repeated]] = []

    def add(self, rows: Rows) -> None:
        """Consider rows, of which those in lanes may be chosen."""
        for place, (key, engine) in enumerate(zip(rows.key, rows.results.engines)):
            if self._wants(key, engine):
                self._choose(key, Repeated.of(rows, place))

    def add_stored(self, rows: Iterable[Mapping[str, Any]], metrics: Iterable[str]) -> None:
        """Likewise the rows of a store, by column."""
        for row in rows:
            if self._wants(row["key"], row["engine"]):
                self._choose(row["key"], Repeated(row["design_index"], {name: row[name] for name in metrics}))

    def _wants(self, key: str, engine: str | None) -> bool:
        return engine == BATCH and (len(self._chosen) < SAMPLE or _digest(key) < self._chosen[-1][0])

    def _choose(self, key: str, run: "Repeated") -> None:
        others = (one for one in self._chosen if one[1] != key)
        self._chosen = sorted([*others, (_digest(key), key, run)], key=lambda one: one[:2])[:SAMPLE]

    @property
    def runs(self) -> dict[str, "Repeated"]:
        """Those that are chosen so far, by key, sorted."""
        return {key: run for _, key, run in sorted(self._chosen, key=lambda run: run[1])}


def _digest(key: str) -> bytes:
    return hashlib.sha256(f"sample {key}".encode()).digest()


class Repeated(NamedTuple):
    """A run, and what came of it."""

    run: int
    metrics: Mapping[str, Any]

    @classmethod
    def of(cls, rows: Rows, place: int) -> "Repeated":
        """One of some rows; that of a run that failed has its message."""
        metrics = rows.results.metrics(place)
        return cls(rows.index[place], {"status": rows.results.messages[place]} if metrics is None else metrics)


Pair = tuple[int, Mapping[str, Any], Mapping[str, Any]]
"""The index of a run, its metrics in lanes, and its metrics with FMUs"""


@dataclass(frozen=True, kw_only=True)
class LaneAgreement:
    """Agreement of a sample of runs in lanes with the same runs by FMUs."""

    runs: int
    difference: float
    """the largest relative difference of any metric"""
    metric: str | None
    index: int | None
    """the run in which it occurs; None if there is none"""
    python: "LaneAgreement | None" = None
    """the same for the beginning of non-chaotic runs with FMUs in Python; None: there are no such FMUs"""

    def __str__(self) -> str:
        text = f"{counted(self.runs, 'run')} repeated with FMUs: largest relative difference {self._largest}"
        if self.python is None:
            return text
        return f"{text}; the beginning of {self.python.runs} with FMUs in Python: {self.python._largest}"

    @property
    def agrees(self) -> bool:
        """Whether no difference exceeds the tolerance."""
        return self.difference <= TOLERATED and (self.python is None or self.python.agrees)

    @property
    def _largest(self) -> str:
        at = "" if self.metric is None else f" ({self.metric} of run {self.index})"
        return f"{self.difference:.1g}{at}"

    def as_text(self) -> str:
        """The form in which a store keeps it."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> "LaneAgreement":
        """From the form in which a store keeps it."""
        fields = json.loads(text)
        python = fields.pop("python", None)
        return cls(**fields, python=None if python is None else cls(**python))

    @classmethod
    def of(cls, pairs: Iterable[Pair]) -> "LaneAgreement":
        """Compare runs in lanes with the same runs by FMUs."""
        differences = [
            (_difference(lanes.get(name), value), name, index)
            for index, lanes, alone in pairs
            for name, value in alone.items()
        ]
        largest, name, index = max(differences, key=lambda each: each[0], default=(0.0, "", 0))
        runs = len({index for _, _, index in differences})
        if largest == 0.0:
            return cls(runs=runs, difference=0.0, metric=None, index=None)
        return cls(runs=runs, difference=largest, metric=name, index=index)

    def expect(self, by: str = "its FMUs") -> None:
        """Raise `QuadcosimError`, naming run and metric, if the difference exceeds the tolerance."""
        if self.difference > TOLERATED:
            by_what, most = told_apart(self.difference, TOLERATED, digits=3)
            raise QuadcosimError(
                f"run {self.index}: {self.metric} in lanes differs by {by_what} from that by {by}; "
                f"expected at most {most}"
                f"expected at most {most}"
            )
        if self.python is not None:
            self.python.expect("its FMUs in Python, at the beginning of the run")


def _difference(one: Any, other: Any) -> float:
    if one == other:
        return 0.0
    numbers = [value for value in (one, other) if is_number(value)]
    if len(numbers) < 2:
        return math.inf
    return abs(one - other) / max(abs(one), abs(other))  # type: ignore[no-any-return]
