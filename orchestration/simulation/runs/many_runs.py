"""Many runs of one system from arrays into arrays: in SIMD lanes where available, else one by one."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import Model, read_model
from orchestration.foundation.basics.errors import QuadcosimError, UsageError, expected_name, shown
from orchestration.foundation.basics.progress import CountProgress, runs_reporter
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import warn
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
from orchestration.simulation.results.objectives import FIXED, OUTCOME, Metrics
from orchestration.simulation.runs.arguments import names_in
from orchestration.simulation.runs.columns import Columns, columns, first_differences
from orchestration.simulation.runs.flights import Flights
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.check import check, connect_references, recorded_variables
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import parameter_name
from orchestration.systems.system.request import Request, errors_in_own_terms

_NOTES = logging.getLogger("quadcosim")


def fly(
    request: RequestLike,
    values: Mapping[str, Any],
    *,
    outputs: Sequence[str] | None = None,
    record: Sequence[str] = (),
    metrics: Mapping[str, str] = MappingProxyType({}),
    in_process: bool = False,
    progress: CountProgress = "bar",
) -> Flights:
    """Run a system, or a scenario, many times, from arrays into arrays, without a store or a result for each run.

    `values` are arrays by path, as axes of a study name them (`plant.initial.position.x`, `timing.period`, `seed`).
    They broadcast as NumPy's do, and outputs have the shape that they have together; with one value for each path that
    is `()`. `outputs` are names of objectives, or of `outcome`, `good`, `horizon` [s], `diverged`, `divergence_time`
    [s] and `steps`; default: all of them. `metrics` are objectives of your own by name, as expressions of the language
    of objectives. `record` are columns whose rows are kept, with their `time`
    [s], along one axis more. Numbers are float64, outcomes words; truth values are booleans, or 0.0 and 1.0
    where some run has none.

    Native FMUs run in lanes of vector registers where this machine has a C compiler and the FMUs have code for lanes,
    else each run is one of `run`. So it is with FMUs that were not built here from this project's sources, whose runs
    have a process each; `in_process`: all may run in lanes, and in this process, which they can end. `progress` is
    called with the number of runs done and the total; None for silence.

    Raises `UsageError` for a path, an output or a column that does not exist, arrays that do not broadcast, and invalid
    values; and what `run` raises for a run that fails, naming it.
    """
    loaded, record = request_of(request), names_in(record, "record")
    with errors_in_own_terms(loaded):
        system = _measured(located(loaded.as_system()), metrics)
        models = {
            name: read_model(Path(component.fmu), component.access) for name, component in system.components.items()
        }
        check(system, models)
        system = connect_references(system, models)
        fits = check_against_fmus(_recording(system, models, record), models)
        names = _outputs(fits.system, None if outputs is None else names_in(outputs, "outputs"))
        runs = columns(loaded, fits.system, models, values)
        _warn_of_mismatches(loaded, runs, fits.parameters, models)
        reason = _reason_unavailable(fits.system, models, in_process)
        table = _Table(runs, names, record)
        rows = (
            _one_by_one(runs, range(runs.count), record, in_process)
            if reason
            else _in_lanes(runs, fits.parameters, record)
        )
        with runs_reporter(progress) as report:
            for done, row in enumerate(rows, 1):
                table.put(row)
                report(done, runs.count)
    engine = table.engine if reason else BATCH
    _NOTES.debug("%d runs by the engine %s%s", runs.count, engine, f": {reason}" if reason else "")
    of_given = {target: unit_at(loaded.paths_of(target)[0], models) for target in runs.given}
    known = {"time": "s", "horizon": "s", "divergence_time": "s", **fits.units, **of_given}
    return Flights(
        arrays=table.arrays, given=runs.given, recorded=table.recorded, shape=runs.shape, engine=engine, reason=reason,
        units={name: unit for name in (*runs.given, *table.arrays) if (unit := known.get(name))},
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _RunRow:
    """The results of one run, on their way into the table."""

    place: int
    metrics: Metrics
    rows: Sequence[Floats]
    """the time, then the recorded columns"""
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
        if self.recorded:
            longer = len(run.rows[0]) - self._rows.shape[2]
            if longer > 0:
                self._rows = np.pad(self._rows, ((0, 0), (0, 0), (0, longer)), constant_values=np.nan)
            self._rows[:, run.place, : len(run.rows[0])] = run.rows


def _booleans(name: str, column: Any) -> Any:
    """The column of an output: truth values as such, if each run has one, so that they choose among the runs."""
    is_of_truth = name in ("good", "diverged") and not np.isnan(column).any()
    return np.asarray(column, dtype=np.bool_ if is_of_truth else None)


def _in_lanes(runs: Columns, parameters: Mapping[str, float], record: Sequence[str]) -> Iterator[_RunRow]:
    """All runs, in lanes but for those that must run alone; `parameters` are those of all components."""
    places = {name: i for i, name in enumerate(_of_components(runs.system, record), 1)}
    for place, summary, rows in Batches().each(
        runs.systems, list(places) if record else None, runs.parameters, runs.seeds
    ):
        if len(rows) == MAX_ROWS:
            raise UsageError(f"record: run {runs.name(place)} has more than {MAX_ROWS} rows; expected runs of fewer")
        if summary is None:
            yield from _one_by_one(runs, [place], record, True)
            continue
        signals = {"time": rows[:, 0], **{name: rows[:, i] for name, i in places.items()}} if record else {}
        if record and len(places) < len(record):
            numbers = {**parameters, **{name: float(column[place]) for name, column in runs.parameters.items()}}
            signals |= source_signals(runs.seeded(place), numbers, signals["time"])
        yield _RunRow(place=place, metrics=summary.metrics, rows=_rows(signals, record))


def _one_by_one(runs: Columns, places: Iterable[int], record: Sequence[str], in_process: bool) -> Iterator[_RunRow]:
    """Runs one by one, by `run`."""
    for place in places:
        try:
            result = run(runs.alone(place), in_process=in_process)
        except QuadcosimError as error:
            raise type(error)(f"run {runs.name(place)}: {error}") from error
        rows = _rows(result.signals, record)
        yield _RunRow(place=place, metrics=result.metrics, rows=rows, engine=result.provenance["engine"])


def _rows(signals: Mapping[str, Floats], record: Sequence[str]) -> list[Floats]:
    return [signals[name] for name in ("time", *(name for name in record if name != "time"))] if record else []


def _of_components(system: System, record: Sequence[str]) -> list[str]:
    """The recorded columns of components: lanes have no others."""
    return [name for name in record if component_of(name) in system.components]


def located(system: System) -> System:
    """The system with the paths of its FMUs: native twins where they can be built, else those that it names."""
    try:
        twins = fmus.native_twins(system)
        paths = fmus.of_components(twins.fmus)
    except QuadcosimError as error:
        _NOTES.debug("no native twins: %s", error)
        paths = fmus.of_components(system.fmus)
    components = {name: replace(each, fmu=str(paths[name])) for name, each in system.components.items()}
    return replace(system, components=components)


def _measured(system: System, metrics: Mapping[str, str]) -> System:
    """The system with objectives of the caller's own too; raises `UsageError` for what cannot be one."""
    if not isinstance(metrics, Mapping):
        raise UsageError(f"metrics = {shown(repr(metrics))}: expected a dictionary of expressions by name")
    taken = [*system.objectives, *system.optional, *FIXED]
    for name, text in metrics.items():
        if name in taken:
            raise UsageError(f"metrics: {name}: expected another name; this one is taken")
        if not isinstance(text, str):
            raise UsageError(
                f"metrics: {name} = {shown(text)}: expected an expression as text, as in 'max(plant.tilt)'"
            )
    return replace(system, objectives={**system.objectives, **metrics}) if metrics else system


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


def _warn_of_mismatches(
    request: Request, runs: Columns, parameters: Mapping[str, float], models: Mapping[str, Model]
) -> None:
    """Warn, as a run does, of components that do not fit each other, in the first run in which they do not."""
    settings = [np.unique(each, return_index=True)[1] for path, each in runs.settings.items() if parameter_name(path)]
    places = {0, *(int(place) for firsts in settings for place in firsts)}
    for place in sorted(places.union(first_differences(runs.parameters, parameters))):
        if texts := request.mismatches(numeric_parameters(runs.alone(place), models)):
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
        return f"{listed}: not built here from quadcosim's own sources: expected in_process=True"
    try:
        expect_lanes(system, models)
    except QuadcosimError as error:
        return str(error)
    return None
