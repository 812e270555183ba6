"""Runs what is missing of a study, without repeating runs."""

import contextlib
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

from orchestration.experiments.studies import store
from orchestration.experiments.studies.checks import Checked, check_design
from orchestration.experiments.studies.infinite_means import INFINITE, InfiniteMeans
from orchestration.experiments.studies.lane_agreement import with_python_twins
from orchestration.experiments.studies.missing_runs import ENGINE, Announce, Flight, run_missing
from orchestration.experiments.studies.overloaded_points import overloads_in_words
from orchestration.experiments.studies.run_columns import RunColumns
from orchestration.experiments.studies.run_key import CONTENT, design_parts, difference, place_parts, study_parts
from orchestration.experiments.studies.store_columns import GUIDS, UNITS
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import FileLike, load_study
from orchestration.experiments.studies.swept import Swept
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.interrupt import Interrupted
from orchestration.foundation.basics.terminal import CountProgress, inform, runs_reporter, warn
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.requests.ranges import paths_in, unit_at
from orchestration.simulation.results.own_metrics import metrics_from_sources
from orchestration.simulation.runs.result import Result
from orchestration.simulation.workers.choice import EngineChoice, Execution, choose_execution
from orchestration.simulation.workers.executors import (
    cluster,
    expect_scheduler,
    expect_workers,
)
from orchestration.simulation.workers.pool import Inputs
from orchestration.simulation.workers.provenance import versions
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System

TOTAL, STUDY_PARTS, DESIGN_PARTS, PLACE_PARTS, AXES = "total", "study", "design", "place", "axes"


@explains_missing
def sweep(
    study: Study | FileLike,
    *,
    metrics: Mapping[str, Callable[[Result], float | None]] | None = None,
    out: str | Path | None = None,
    workers: int = 1,
    dask: str | None = None,
    retry_failed: bool = False,
    engine: EngineChoice = "auto",
    time_limit: float | None = None,
    progress: CountProgress = "bar",
    announce: Announce | None = inform,
) -> Swept:
    """Run what the store of a study does not have, writing each row as it comes.

    `study` may be the path of its file, or the content of the file as a dictionary, as `load_study` takes them.
    `metrics` are further metrics by name: functions of a run's `Result` that return a number, or None for no value.
    Their source is executed in other processes and identifies the run, so a function must contain everything that it
    uses, except modules. Such runs are executed one at a time.

    The store is in the folder `out`, default `results/NAME`; runs in it are not repeated, so a sweep may be stopped and
    called again. Runs are executed by `workers` processes of this machine, which need no guard of the main module and
    work from a notebook, or by those of the `dask` scheduler at this address. The engine `batch` runs native FMUs in
    SIMD lanes, and repeats some runs with the FMUs to compare; `auto` continues a store by the engine that it has, and
    else uses lanes if available, else native FMUs one at a time, else the FMUs as they are. A run that takes more than
    `time_limit` [s] of processor time fails. `progress` is called with the number of runs done and the total,
    `announce` with the engine and failed runs; None for silence.

    Raises `UsageError`, before any run, for a design with an invalid run, or if the store holds another study, stating
    the difference; `QuadcosimError` for failures not caused by a run, without a row, as if `auto` cannot have the
    engine of a store; `KeyboardInterrupt`, stating how far it came, after Ctrl-C.
    """
    study = load_study(study)
    _expect_possible(workers, dask, time_limit)
    if metrics is not None:
        study = replace(study, metrics=metrics_from_sources(metrics))
    columns, execution, follows = prepare(study, engine)
    study, path = columns.study, store.store_path(study.name, out)
    with store.open_for_writing(path, study.metric_names) as opened:
        with runs_reporter(progress) as report, contextlib.ExitStack() as stack:
            _expect_same_study(opened, columns)
            if engine == "auto":
                before = opened.about().get(ENGINE, execution.name)
                execution = execution.as_before(before, str(path), "another one needs another folder, --out")
            files = with_python_twins(columns.files) if execution.in_lanes else columns.files
            reached = None if dask is None else stack.enter_context(cluster(Inputs.of(files), dask))
            _describe(opened, columns)  # last, so that what is refused changes nothing
            flight = Flight(
                columns=columns, execution=execution, files=files, local=workers, cluster=reached,
                time_limit=time_limit, chosen=engine == "auto",
            )  # fmt: skip
            if announce is not None:
                for text in overloads_in_words(study, columns.files.start_values, json.loads(opened.about()[UNITS])):
                    warn(text)
            flown, agreement = run_missing(opened, flight, report, announce, retry_failed=retry_failed)
        infinite = _infinite_means(opened, columns)
        if announce is not None:
            infinite.tell(study, json.loads(opened.about()[UNITS]), announce)
        failed, engines = opened.counts().get("failed", 0), opened.engines()
    return Swept(
        study=study, total=len(study.points), flown=flown, failed=failed, path=path, engine=execution.name,
        engines=engines, agreement=agreement, follows=follows, infinite_means=infinite,
    )  # fmt: skip


def _expect_possible(workers: int, dask: str | None, time_limit: float | None) -> None:
    """Raise `UsageError` for workers or a time limit that cannot be."""
    expect_workers(workers)
    if dask is not None:
        expect_scheduler(dask)
    if time_limit is not None and not time_limit > 0.0:
        raise UsageError(f"--time-limit {time_limit:g}: expected a positive number of seconds")


def prepare(study: Study, engine: EngineChoice) -> tuple[RunColumns, Execution, tuple[str, ...]]:
    """The runs of a study as an engine runs them, how they are executed, and its references with their followers.

    Raises `UsageError` for an invalid run.
    """
    candidates: dict[bool, tuple[RunColumns, Checked]] = {}

    def first(native: bool) -> tuple[System, Files]:
        candidate = replace(study, native=native)
        columns = RunColumns(candidate, candidate.files())
        candidates[native] = columns, check_design(columns)
        return candidate.system(0, columns.files.start_values), columns.files

    def no_lanes() -> str | None:
        needs = "metrics that are functions need whole runs, one at a time"
        return needs if study.metrics else candidates[True][1].no_lanes

    execution = choose_execution(engine, study.native, first, no_lanes=no_lanes)
    if execution.native not in candidates:
        first(execution.native)
    columns, checked = candidates[execution.native]
    return columns, execution, checked.follows


def expect_current(opened: store.Store, study: Study) -> None:
    """Raise `UsageError` if `study` is not, or no longer, the one whose rows are in the store."""
    about = opened.about()
    if STUDY_PARTS not in about:
        raise UsageError(f"{opened.path}: expected the store of a study that has begun")
    before, now = json.loads(about[STUDY_PARTS]), study_parts(study)
    changes = difference({**before, **json.loads(about[DESIGN_PARTS])}, {**now, **design_parts(study)})
    if changes:
        what_runs_it = "with another --out runs it" if difference(before, now) else "runs what is missing"
        raise UsageError(
            f"{opened.path}: the study file has changed since ({changes}); expected the study that was run: "
            f"quadcosim sweep {what_runs_it}"
        )


def _expect_same_study(opened: store.Store, columns: RunColumns) -> None:
    """Raise `UsageError` if the store holds another study; its design may differ."""
    about, study = opened.about(), columns.study
    if STUDY_PARTS not in about:
        return
    before, place = json.loads(about[PLACE_PARTS]), place_parts(study, columns.files)
    of_design = {key for key in before.keys() ^ place.keys() if key.startswith(CONTENT)}
    before, place = ({key: part[key] for key in part.keys() - of_design} for part in (before, place))
    if changes := difference({**json.loads(about[STUDY_PARTS]), **before}, {**study_parts(study), **place}):
        raise UsageError(
            f"{opened.path}: holds another study ({changes}); expected the same one: take another folder, --out, "
            "or remove the store"
        )


def _infinite_means(opened: store.Store, columns: RunColumns) -> InfiniteMeans:
    """The points without a finite expectation, examined once for each design of a store.

    They are examined after the runs, which an interruption then leaves complete; the next sweep examines them.
    """
    if known := opened.about()[INFINITE]:
        return InfiniteMeans.from_text(known)
    try:
        found = InfiniteMeans.of(columns.study, columns.files)
    except KeyboardInterrupt:
        raise Interrupted("with all runs done, but means of squares not yet examined") from None
    opened.describe({INFINITE: found.as_text()})
    return found


def _describe(opened: store.Store, columns: RunColumns) -> None:
    """Describe the study and its design in its store."""
    study, files = columns.study, columns.files
    design, place = json.dumps(design_parts(study)), json.dumps(place_parts(study, files))
    about = opened.about()
    if (about.get(DESIGN_PARTS), about.get(PLACE_PARTS)) == (design, place) and INFINITE in about:
        return
    grid: dict[str, Any] | None = {axis.name: axis.values for axis in study.axes}
    opened.describe(
        {
            STUDY_PARTS: json.dumps(study_parts(study)),
            PLACE_PARTS: place,
            DESIGN_PARTS: design,
            TOTAL: str(len(study.points)),
            AXES: json.dumps([axis.name for axis in study.axes]),
            "grid": json.dumps(grid if all(axis.values is not None for axis in study.axes) else None),
            GUIDS: json.dumps(_guids(study, files)),
            "versions": json.dumps(versions()),
            UNITS: json.dumps(_units(study, files)),
            INFINITE: "",
        },
        (
            point
            for block in columns.blocks()
            for point in zip(block.indices.tolist(), columns.keys(block), block.settings)
        ),
    )


def _guids(study: Study, files: Files) -> dict[str, Any]:
    """The GUIDs of FMUs by component; where axes choose the FMU, those axes, and the GUID for each of their values."""
    guids: dict[str, Any] = {}
    first = study.points[0]
    for name, model in files.models_of(study.origin).items():
        values = {axis.name: axis.values or () for axis in study.axes_of(f"components.{name}.fmu")}
        guids[name] = {"axes": [*values], "of": []} if values else model.description.guid
        for chosen in product(*values.values()) if values else ():
            system = study.system_at({**first, **dict(zip(values, chosen))}, files.start_values)
            guids[name]["of"].append([[*chosen], files.models_of(system)[name].description.guid])
    return guids


def _units(study: Study, files: Files) -> dict[str, str]:
    """The units of axes and metrics, as in the first run."""
    first = study.system(0, files.start_values)
    models = files.models_of(first)
    of_axes = {
        axis.name: unit_at(paths_in(study.base, axis.targets[0])[0], models)
        for axis in study.axes
        if axis.targets and not axis.multiplies
    }
    return {name: unit for name, unit in of_axes.items() if unit} | check_against_fmus(first, models).units
