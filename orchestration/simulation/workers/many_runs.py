"""Many runs of one system from arrays into arrays, in SIMD lanes or one by one, here or by workers."""

import contextlib
import logging
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from orchestration.components.fmi.read_description import Model, read_model
from orchestration.foundation.basics.errors import QuadcosimError, UsageError, expected_name
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import CountProgress, runs_reporter, warn
from orchestration.simulation.engines.batch.batch import MAX_ROWS
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.engines.batch.shape import expect_lanes
from orchestration.simulation.engines.master import BATCH
from orchestration.simulation.engines.resolved import (
    check_against_fmus,
    columns_of,
    numeric_parameters,
    source_signals,
)
from orchestration.simulation.requests.ranges import unit_at
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.results.objectives import FIXED, OUTCOME, Metrics, with_own_objectives
from orchestration.simulation.runs.arguments import names_in
from orchestration.simulation.runs.columns import Columns, columns, first_differences
from orchestration.simulation.runs.flights import Flights
from orchestration.simulation.runs.simulation import run
from orchestration.simulation.workers.batching import chunks
from orchestration.simulation.workers.executors import expect_workers, local_workers
from orchestration.simulation.workers.pool import Inputs
from orchestration.simulation.workers.task import TaskBatch, of_components, rows_of
from orchestration.systems.expressions.over_run import vectors
from orchestration.systems.schedule.overload import overloads_in_words
from orchestration.systems.system.check import check, connect_references, recorded_variables
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.files import files_of, files_read_by, located
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import parameter_name
from orchestration.systems.system.request import Request, errors_in_own_terms

IN_PROCESS = "in_process=True"
_NOTES = logging.getLogger("quadcosim")


def fly(
    request: RequestLike,
    values: Mapping[str, Any],
    *,
    outputs: Sequence[str] | None = None,
    record: Sequence[str] = (),
    metrics: Mapping[str, str] = MappingProxyType({}),
    workers: int = 1,
    in_process: bool = False,
    progress: CountProgress = "bar",
) -> Flights:
    """Run a system, or a scenario, many times, from arrays into arrays, without a store or a result for each run.

    `values` are arrays by path, as axes of a study name them (`plant.initial.position.x`, `timing.period`, `seed`).
    They broadcast as NumPy's do, those of xarray by the names of their dimensions, and outputs have the shape that they
    have together; with one value for each path that is `()`. `outputs` are names of objectives, or of `outcome`,
    `good`, `horizon` [s], `diverged`, `divergence_time` [s] and `steps`; default: all of them. `metrics` are objectives
    of your own by name, as expressions of the language of objectives. `record` are columns, or vectors, whose rows are
    kept, with their `time` [s], along one axis more. Numbers are float64, outcomes words; truth values are booleans, or
    0.0 and 1.0 where some run has none.

    Native FMUs run in lanes of vector registers where this machine has a C compiler and the FMUs have code for lanes,
    else each run is one of `run`. So it is with FMUs that were not built here from this project's sources, whose runs
    have a process each; `in_process`: all may run in lanes, and in this process, which they can end. With `workers`
    above one, so many processes of this machine share the runs, whose numbers are the same to the bit; it pays where
    the runs take longer than some 3 s, as starting the processes takes one or two. `progress` is called with the number
    of runs done and the total; None for silence.

    Raises `UsageError` for a path, an output or a column that does not exist, arrays that do not broadcast, and invalid
    values; and what `run` raises for a run that fails, naming it; of workers, which repeat a run that ends its process,
    a `QuadcosimError`.
    """
    expect_workers(workers)
    loaded, record = request_of(request), names_in(record, "record")
    with errors_in_own_terms(loaded):
        system = with_own_objectives(located(loaded.as_system()), metrics, "metrics")
        models = {
            name: read_model(Path(component.fmu), component.access) for name, component in system.components.items()
        }
        check(system, models)
        system = connect_references(system, models)
        record = _components_of_vectors(record, system, models)
        fits = check_against_fmus(_recording(system, models, record), models)
        names = _outputs(fits.system, None if outputs is None else names_in(outputs, "outputs"))
        runs = columns(loaded, fits.system, models, values)
        _warn_of_mistakes(loaded, runs, fits.parameters, models)
        reason = _reason_unavailable(fits.system, models, in_process)
        if reason and runs.count > 1 and IN_PROCESS in reason:
            warn(f"{runs.count} runs one by one, each in a process of its own: {reason}")
        for name in ("time", "row"):
            if record and name in runs.axes:
                raise UsageError(f"values: a dimension is called {name}, as that of what is recorded: expected another")
        table = _Table(runs, names, record)
        if workers > 1:
            rows = _by_workers(runs, fits.parameters, record, workers, in_lanes=reason is None)
        elif reason:
            rows = _one_by_one(runs, range(runs.count), record, in_process)
        else:
            rows = _in_lanes(runs, fits.parameters, record)
        with runs_reporter(progress) as report, contextlib.closing(rows):
            for done, row in enumerate(rows, 1):
                table.put(row)
                report(done, runs.count)
    engine = table.engine if reason else BATCH
    _NOTES.debug("%d runs by the engine %s%s", runs.count, engine, f": {reason}" if reason else "")
    of_given = {target: unit_at(loaded.paths_of(target)[0], models) for target in runs.given}
    known = {"time": "s", "horizon": "s", "divergence_time": "s", **fits.units, **of_given}
    return Flights(
        arrays=table.arrays, given=runs.given, axes=runs.axes, recorded=table.recorded, shape=runs.shape, engine=engine,
        reason=reason, units={name: unit for name in (*runs.given, *table.arrays) if (unit := known.get(name))},
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _RunRow:
    """The results of one run, on their way into the table."""

    place: int
    metrics: Metrics
    rows: Floats | None
    """columns: the time, then what is recorded; None if nothing is"""
    engine: str = BATCH


class _Table:
    """Arrays that fill with runs."""

    def __init__(self, runs: Columns, outputs: Sequence[str], record: Sequence[str]) -> None:
        self._shape = runs.shape
        self._outputs: dict[str, Any] = {
            name: [None] * runs.count if name == OUTCOME else np.full(runs.count, np.nan) for name in outputs
        }
        self.recorded = ("time", *(name for name in record if name != "time")) if record else ()
        self._rows: Floats = np.full((len(self.recorded), runs.count, 0), np.nan)
        self.engine = BATCH

    @property
    def arrays(self) -> dict[str, Any]:
        """All of them by name."""
        outputs = {name: _booleans(name, column).reshape(self._shape) for name, column in self._outputs.items()}
        return outputs | {name: rows.reshape(*self._shape, -1) for name, rows in zip(self.recorded, self._rows)}

    def put(self, run: _RunRow) -> None:
        """Add a run."""
        self.engine = run.engine
        for name, column in self._outputs.items():
            value = run.metrics[name]
            column[run.place] = value if name == OUTCOME else np.nan if value is None else float(value)
        if run.rows is not None:
            longer = len(run.rows) - self._rows.shape[2]
            if longer > 0:
                self._rows = np.pad(self._rows, ((0, 0), (0, 0), (0, longer)), constant_values=np.nan)
            self._rows[:, run.place, : len(run.rows)] = run.rows.T


def _booleans(name: str, column: Any) -> Any:
    """The column of an output: truth values as such, if each run has one, so that they choose among the runs."""
    is_of_truth = name in ("good", "diverged") and not np.isnan(column).any()
    return np.asarray(column, dtype=np.bool_ if is_of_truth else None)


def _in_lanes(runs: Columns, parameters: Mapping[str, float], record: Sequence[str]) -> Generator[_RunRow, None, None]:
    """All runs, in lanes but for those that must run alone; `parameters` are those of all components."""
    found = Batches().each(
        runs.systems, of_components(runs.system, record) if record else None, runs.parameters, runs.seeds
    )
    for place, summary, rows in found:
        if summary is None:
            yield from _one_by_one(runs, [place], record, True)
        else:
            whole = _with_sources(runs, parameters, record, place, rows) if record else None
            yield _RunRow(place=place, metrics=summary.metrics, rows=whole)


def _one_by_one(
    runs: Columns, places: Iterable[int], record: Sequence[str], in_process: bool
) -> Generator[_RunRow, None, None]:
    """Runs one by one, by `run`."""
    for place in places:
        try:
            result = run(runs.alone(place), in_process=in_process)
        except QuadcosimError as error:
            raise type(error)(f"run {runs.name(place)}: {error}") from error
        rows = rows_of(result.signals, record) if record else None
        yield _RunRow(place=place, metrics=result.metrics, rows=rows, engine=result.provenance["engine"])


def _by_workers(
    runs: Columns, parameters: Mapping[str, float], record: Sequence[str], workers: int, *, in_lanes: bool
) -> Generator[_RunRow, None, None]:
    """All runs as worker processes end them, with the numbers that they have here."""
    different = {id(system): place for place, system in enumerate(runs.systems)}
    tables = [str(file) for place in different.values() for file in files_read_by(runs.systems[place])]
    place_of = {system: place for place, system in enumerate(different)}
    batch = TaskBatch(
        index=range(runs.count), key=[""] * runs.count,
        seed=[runs.system.seed] * runs.count if runs.seeds is None else runs.seeds,
        systems=[runs.systems[place] for place in different.values()],
        places=[place_of[id(system)] for system in runs.systems], parameters=runs.parameters, record=record or None,
    )  # fmt: skip
    tasks = chunks([batch], runs.count, workers) if in_lanes else map(batch.alone, range(runs.count))
    files = files_of(runs.system, tables_too=tables)
    with local_workers(Inputs.of(files), workers) as fly_tasks, contextlib.closing(fly_tasks(tasks)) as found:
        for place, results, at in ((place, part.results, at) for part in found for at, place in enumerate(part.index)):
            metrics, rows = results.metrics(at), results.rows.get(at)
            if metrics is None:
                raise QuadcosimError(f"run {runs.name(place)}: {results.messages[at]}")
            engine = str(results.engines[at])
            if rows is not None and engine == BATCH:
                rows = _with_sources(runs, parameters, record, place, rows)
            yield _RunRow(place=place, metrics=metrics, rows=rows, engine=engine)


def _with_sources(
    runs: Columns, parameters: Mapping[str, float], record: Sequence[str], place: int, rows: Floats
) -> Floats:
    """The rows of what is recorded of one run, of rows in lanes, which have columns of components alone."""
    if len(rows) == MAX_ROWS:
        raise UsageError(f"record: run {runs.name(place)} has more than {MAX_ROWS} rows; expected runs of fewer")
    columns_in_lanes = ("time", *of_components(runs.system, record))
    signals = dict(zip(columns_in_lanes, rows.T))
    if len(signals) < len({"time", *record}):
        numbers = {**parameters, **{name: float(column[place]) for name, column in runs.parameters.items()}}
        signals |= source_signals(runs.seeded(place), numbers, signals["time"])
    return rows_of(signals, record)


def _components_of_vectors(record: Sequence[str], system: System, models: Mapping[str, Model]) -> tuple[str, ...]:
    """The columns, with .x, .y, .z (and .w) of a vector for its name."""
    variables = [f"{name}.{variable}" for name, model in models.items() for variable in model.variables]
    known = vectors(dict.fromkeys((*columns_of(system), *variables)))
    return tuple(dict.fromkeys(column for name in record for column in known.get(name, (name,))))


def _recording(system: System, models: Mapping[str, Model], record: Sequence[str]) -> System:
    """The system, recording these columns too; raises `UsageError` for one that cannot be recorded."""
    known, usual = {"time", *columns_of(system)}, recorded_variables(system, models)
    components = dict(system.components)
    for column in record:
        name, variable = component_of(column), variable_of(column)
        if column in known or variable in usual.get(name, ()):
            continue
        if name not in components:
            listed = [*components, *system.sources]
            raise UsageError(f"record: {column}: expected COMPONENT.VARIABLE of {', '.join(listed)}")
        usual[name] = (*usual[name], variable)
        components[name] = replace(components[name], record=usual[name])
    return replace(system, components=components)


def _warn_of_mistakes(
    request: Request, runs: Columns, parameters: Mapping[str, float], models: Mapping[str, Model]
) -> None:
    """Warn, as a run does, of components that do not fit each other, and of runs too short for their timing.

    In the first run in which it is so.
    """
    settings = [np.unique(each, return_index=True)[1] for path, each in runs.settings.items() if parameter_name(path)]
    of_time = {
        target: np.broadcast_to(each, runs.shape).reshape(-1)
        for target, each in runs.given.items()
        if (target.endswith((".period", ".offset", ".delay")) or target == "stop_time") and each.dtype.kind in "fiu"
    }
    settings += [
        np.array([each.argmin(), each.argmax()]) for each in of_time.values()
    ]  # the shortest run has fewest samples
    places = {0, *(int(place) for firsts in settings for place in firsts)}
    for place in sorted(places.union(first_differences(runs.parameters, parameters))):
        system = runs.alone(place)
        of_model = request.mismatches(numeric_parameters(system, models))
        if texts := [*of_model, *map(request.in_own_terms, system.oversights()), *overloads_in_words([system])]:
            for text in texts:
                warn(text)
            return


def _outputs(system: System, names: Sequence[str] | None) -> tuple[str, ...]:
    """The names of the results of a run; default: all. Raises `UsageError` for an unknown one."""
    known = [*dict.fromkeys((*system.objectives, *system.optional, *FIXED))]
    for name in names or ():
        if name not in known:
            raise UsageError(f"outputs: {name}: {expected_name(name, known)}")
    return tuple(known if names is None else dict.fromkeys(names))


def _reason_unavailable(system: System, models: Mapping[str, Model], in_process: bool) -> str | None:
    """Why a system that its FMUs fit cannot run in lanes of this process, in a line; None: it can."""
    foreign = [name for name, model in models.items() if not model.is_own]
    if foreign and not in_process:
        listed = ", ".join(f"components.{name}" for name in foreign)
        return (
            f"{listed}: not built here from quadcosim's own sources: expected {IN_PROCESS}, to run them in this process"
        )
    try:
        expect_lanes(system, models)
    except QuadcosimError as error:
        return str(error)
    return None
