"""Flies many systems as lanes of runs, and says of each what it came to, or that it is to be flown alone."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.engines.batch.batch import Batch, BatchResult
from orchestration.engines.batch.combining import combined
from orchestration.engines.batch.kernels import lanes_here
from orchestration.engines.batch.shape import Shape, outline
from orchestration.engines.structures import structures
from orchestration.engines.watch import watch
from orchestration.engines.wiring import checked, source_values
from orchestration.fmi.model import read_model
from orchestration.results.objectives import Metrics, told
from orchestration.schedule.schedule_cache import ScheduleCache, timing
from orchestration.schedule.streams import Streams
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS, nanoseconds

Take = Callable[[int, Floats], None]
"""Hears of a run, by its place among those that were asked for, the rows of what was recorded."""


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """What a run came to."""

    metrics: Metrics
    message: str | None
    """what diverged"""


class Batches:
    """The batches of this process, by the shape of what they run; their FMUs are files."""

    def __init__(self) -> None:
        self._schedules = ScheduleCache()
        self._lanes = lanes_here()
        self._batches: dict[Hashable, tuple[Shape, Batch]] = {}

    def run(
        self, systems: Sequence[System], record: Sequence[str] = (), take: Take | None = None
    ) -> list[RunSummary | None]:
        """What runs came to; None for one that is to be flown alone, by what flies anything.

        `record` are columns whose rows, the time [s] first, `take` is given of each run. Raises `UsageError` for what
        cannot be flown in lanes.
        """
        found: list[RunSummary | None] = [None] * len(systems)
        shapes: dict[Hashable, list[int]] = {}
        for index, system in enumerate(systems):
            shapes.setdefault(outline(system), []).append(index)
        for key, indices in shapes.items():
            shape, batch = self._batch(key, systems[indices[0]])
            timings = {index: timing(systems[index]) for index in indices}
            for group in _groups(indices, timings, self._lanes):
                result = batch.run([systems[i] for i in group], [timings[i] for i in group], record)
                for index, flown in zip(group, _told(shape, batch, result, [systems[i] for i in group])):
                    found[index] = flown
                for index, rows in zip(group, result.signals if take is not None else ()):
                    assert take is not None
                    take(index, rows)
        return found

    def _batch(self, key: Hashable, system: System) -> tuple[Shape, Batch]:
        if key not in self._batches:
            models = {name: read_model(Path(component.fmu)) for name, component in system.components.items()}
            shape = Shape(system=checked(system, models).system, models=models, lanes=self._lanes)
            self._batches[key] = shape, Batch(shape, self._schedules)
        return self._batches[key]


def _groups(indices: Sequence[int], timings: Mapping[int, Hashable], lanes: int) -> Iterator[list[int]]:
    """Runs that go together: of one timing as far as that goes."""
    alike: dict[Hashable, list[int]] = {}
    for index in indices:
        alike.setdefault(timings[index], []).append(index)
    rest: list[int] = []
    for same in alike.values():
        whole = len(same) - len(same) % lanes
        for first in range(0, whole, lanes):
            yield same[first : first + lanes]
        rest += same[whole:]
    for first in range(0, len(rest), lanes):
        yield rest[first : first + lanes]


def _told(shape: Shape, batch: Batch, result: BatchResult, systems: Sequence[System]) -> Iterator[RunSummary | None]:
    count, c = len(systems), structures(shape.lanes)
    numbers = batch.numbers(systems)
    values = {name: combined(node, result.reductions, numbers, count) for name, node in shape.nodes.items()}
    found = {name: (np.isfinite(value) & ~none, value.tolist()) for name, (value, none) in values.items()}
    for lane, system in enumerate(systems):
        steps = int(result.steps[lane])
        if result.outcome[lane] == c.RUNNING and not result.doubtful[lane]:
            end = nanoseconds(system.stop_time) / NANOSECONDS
            metrics = {name: value[lane] if there[lane] else None for name, (there, value) in found.items()}
            yield RunSummary(
                metrics=told(
                    shape.system, metrics, end=end, stop_time=system.stop_time, divergence_time=None, steps=steps
                ),
                message=None,
            )
        elif result.outcome[lane] == c.DIVERGED:
            time = int(result.time[lane]) / NANOSECONDS
            message = _complaint(shape, batch, system, lane, time)
            metrics = told(shape.system, None, end=time, stop_time=system.stop_time, divergence_time=time, steps=steps)
            yield None if message is None else RunSummary(metrics=metrics, message=message)
        else:
            yield None


def _complaint(shape: Shape, batch: Batch, system: System, lane: int, t: float) -> str | None:
    """How the values of a lane have diverged, as the look-out of a single run says it; None: it says they have not."""
    streams, parameters = Streams(system.seed, system.streams), batch.parameters(system)
    sources = {name: source_values(system, name, parameters, streams) for name in system.sources}
    signals = {name: system.sources[name].signals(name) for name in sources}
    look = watch(system.criterion.diverged, shape.board, sources, signals, parameters)
    shape.board.row[0] = t
    for column, place in shape.board.place.items():
        if column != "time":
            shape.board.row[place] = batch.value(column, lane)
    return look(t)
