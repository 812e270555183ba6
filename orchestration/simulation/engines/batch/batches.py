"""Runs many systems in SIMD lanes; the result of each is a summary, or that the run must be done alone."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.records import replaced
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import seconds
from orchestration.simulation.engines.batch.batch import Batch, BatchResult, Group
from orchestration.simulation.engines.batch.folds import combined
from orchestration.simulation.engines.batch.kernels import preferred_lanes
from orchestration.simulation.engines.batch.run_numbers import NO_COLUMNS, ParameterColumns, end_of
from orchestration.simulation.engines.batch.shape import Shape, outline
from orchestration.simulation.engines.condition import Condition
from orchestration.simulation.engines.resolved import check_against_fmus, source_values
from orchestration.simulation.engines.structures import structures
from orchestration.simulation.results.objectives import Metrics, metrics_of
from orchestration.systems.schedule.schedule_cache import ScheduleCache, schedule_key
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.check import connect_references
from orchestration.systems.system.model import System


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """The results of a run."""

    metrics: Metrics
    message: str | None
    """Text of how it diverged; None if it did not"""


BatchOutcome = tuple[int, RunSummary | None, Floats]
"""The place of a run among the requested ones, its summary, its rows"""
_NO_ROWS: Floats = np.zeros((0, 0))


class Batches:
    """The batches of this process by the shape of their systems, whose FMUs are files."""

    def __init__(self) -> None:
        self._schedules = ScheduleCache()
        self._lanes = preferred_lanes()
        self._shapes: dict[Hashable, tuple[Shape, Batch]] = {}

    def run(
        self, systems: Sequence[System], parameters: ParameterColumns = NO_COLUMNS, seeds: Sequence[int] | None = None
    ) -> list[RunSummary | None]:
        """The summaries of runs, in their order; None for one that must be run alone. Raises as `each`."""
        summaries: list[RunSummary | None] = [None] * len(systems)
        for place, summary, _ in self.each(systems, parameters=parameters, seeds=seeds):
            summaries[place] = summary
        return summaries

    def each(
        self,
        systems: Sequence[System],
        record: Sequence[str] | None = None,
        parameters: ParameterColumns = NO_COLUMNS,
        seeds: Sequence[int] | None = None,
    ) -> Iterator[BatchOutcome]:
        """Runs as they end: their places among `systems`, their summaries, and the rows of the columns in `record`.

        The summary is None for a run that must be repeated alone, by an engine for any FMUs; rows have the time [s]
        first and are valid until the next run. `parameters` and `seeds` of each run override those of its system, which
        many may share. Raises `UsageError` for systems that cannot be run in lanes.
        """
        several = {id(system): system for system in systems}
        known = {key: (outline(system), schedule_key(system)) for key, system in several.items()}
        seeded = {key for key, system in several.items() if seeds is not None and system.depends_on_seed}
        shapes: dict[Hashable, list[int]] = {}
        for place, system in enumerate(systems):
            shapes.setdefault(known[id(system)][0], []).append(place)
        for key, places in shapes.items():
            shape, batch = self._batch_of(key, systems[places[0]])
            several = {id(systems[place]): systems[place] for place in places}
            connected = {key: connect_references(system, shape.models) for key, system in several.items()}
            seed_of = {i: seeds[i] for i in places if id(systems[i]) in seeded} if seeds is not None else {}
            timings = {
                i: timing.with_seed(seed_of[i]) if i in seed_of else timing
                for i, (_, timing) in ((i, known[id(systems[i])]) for i in places)
            }
            for group in groups(places, timings, self._lanes):
                own = (connected[id(systems[i])] for i in group)
                runs = Group(
                    systems=[replaced(x, seed=seed_of[i]) if i in seed_of else x for i, x in zip(group, own)],
                    timings=[timings[i] for i in group],
                    parameters={name: values[group] for name, values in parameters.items()},
                )  # fmt: skip
                result = batch.run(runs, record)
                rows = result.signals or [_NO_ROWS] * len(group)
                yield from zip(group, [*_summaries(shape, batch, result, runs.systems)], rows)

    def _batch_of(self, key: Hashable, system: System) -> tuple[Shape, Batch]:
        if key not in self._shapes:
            models = {
                name: read_model(Path(component.fmu), component.access) for name, component in system.components.items()
            }
            shape = Shape(system=check_against_fmus(system, models).system, models=models, lanes=self._lanes)
            self._shapes[key] = shape, Batch(shape, self._schedules)
        return self._shapes[key]


def groups(indices: Sequence[int], timings: Mapping[int, Hashable], lanes: int) -> Iterator[list[int]]:
    """Runs that are simulated together, of one timing as far as possible."""
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


def _summaries(
    shape: Shape, batch: Batch, result: BatchResult, systems: Sequence[System]
) -> Iterator[RunSummary | None]:
    count, c = len(systems), structures(shape.lanes)
    numbers = batch.numbers.over(systems)
    values = zip(shape.nodes, combined([*shape.nodes.values()], result.reductions, numbers, count))
    metric_values = {name: ((np.isfinite(value) & ~none).tolist(), value.tolist()) for name, (value, none) in values}
    for lane, system in enumerate(systems):
        steps = int(result.steps[lane])
        if result.outcome[lane] == c.RUNNING and not result.doubtful[lane]:
            end = end_of(system)
            metrics = {name: value[lane] if valid[lane] else None for name, (valid, value) in metric_values.items()}
            yield RunSummary(
                metrics=metrics_of(
                    shape.system, metrics, end=end, stop_time=system.stop_time, divergence_time=None, steps=steps
                ),
                message=None,
            )
        elif result.outcome[lane] == c.DIVERGED:
            time = seconds(int(result.time[lane]))
            message = _divergence_message(shape, batch, system, lane, time)
            metrics = metrics_of(
                shape.system, None, end=time, stop_time=system.stop_time, divergence_time=time, steps=steps
            )
            yield None if message is None else RunSummary(metrics=metrics, message=message)
        else:
            yield None


def _divergence_message(shape: Shape, batch: Batch, system: System, lane: int, t: float) -> str | None:
    """How the values of a lane have diverged, as reported by the monitor of a single run; None if it disagrees."""
    streams, parameters = Streams(system.seed, system.streams), batch.numbers.parameters(lane, system)
    sources = {name: source_values(system, name, parameters, streams) for name in system.sources}
    signals = {name: system.sources[name].signals(name) for name in sources}
    condition = Condition(text=system.criterion.diverged, sources=sources, signals_of=signals, numbers=parameters)
    monitor = condition.watch(shape.board)
    shape.board.row[0] = t
    for i, index, place in shape.on_board:
        shape.board.row[i] = batch.arrays.memories[index][place, lane]
    return monitor(t)
