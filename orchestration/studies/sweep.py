"""Flies what is missing of a study, and nothing twice."""

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from orchestration.basics.errors import UsageError
from orchestration.basics.extras import explains_missing
from orchestration.basics.interrupt import Interrupted
from orchestration.basics.progress import CountProgress, runs_reporter
from orchestration.basics.terminal import Count, inform
from orchestration.building.inputs import Files
from orchestration.engines.engine import Engine
from orchestration.engines.wiring import check_against_fmus
from orchestration.requests.ranges import paths_in, unit_at
from orchestration.results.own_metrics import metrics_from_sources
from orchestration.runs.result import Result
from orchestration.studies import store
from orchestration.studies.checks import described, expect_flyable
from orchestration.studies.run_key import design_parts, difference, place_parts, run_key, study_parts
from orchestration.studies.store_columns import UNITS
from orchestration.studies.study import Study
from orchestration.studies.swept import Swept
from orchestration.studies.vouching import vouched, with_python_twins
from orchestration.system.model import System
from orchestration.workers.batching import chunks
from orchestration.workers.choice import EngineChoice, Execution, choose_execution
from orchestration.workers.executors import TaskRunner, cluster, expect_scheduler, local_workers
from orchestration.workers.pool import Inputs
from orchestration.workers.provenance import versions
from orchestration.workers.row import Row
from orchestration.workers.task import Outcome, RunTask

Announce = Callable[[str], None]
"""Hears of a run that failed."""

TOTAL, STUDY_PARTS, DESIGN_PARTS, PLACE_PARTS, AXES = "total", "study", "design", "place", "axes"
ENGINE, AGREEMENT = "engine", "agreement"
"""What a store says by these names: what has flown last, and how runs flown in lanes agree with their FMUs"""
_TOLD = 3
"""failed runs that are announced one by one"""


@explains_missing
def sweep(
    study: Study,
    *,
    metrics: Mapping[str, Callable[[Result], float | None]] | None = None,
    folder: str | Path | None = None,
    workers: int = 1,
    dask: str | None = None,
    retry_failed: bool = False,
    engine: EngineChoice = "auto",
    time_limit: float | None = None,
    progress: CountProgress = "bar",
    announce: Announce | None = inform,
) -> Swept:
    """Run what the store of a study does not have, writing each row as it comes.

    `metrics` are more of what each run comes to, by name: functions of its `Result` that give a number, or None for no
    value. Their source is what is run, in other processes, and what a run is known by, so a function has all that it
    uses in itself, but for modules. Such runs are flown one at a time.

    The store is in `folder`, default `results/NAME`: what is there is not flown again, so that a sweep may be
    stopped and called again. Runs are flown by `workers` processes of this machine, which need no guard of the main
    module and work from a notebook, or by those of a `dask` scheduler at that address. The engine `batch` flies them as
    lanes of native FMUs, `cuda` as threads of a GPU, and some of them by the FMUs too, to compare; `auto` takes lanes
    where these can be had, else native FMUs one at a time, else the FMUs as they are. A run that takes more than
    `time_limit` [s] of the processor has failed, and says so. `progress` hears how many of how many are done,
    `announce` what flies and of runs that failed; None for silence.

    Raises `UsageError`, before anything is flown, for a design with a run that cannot be, or if the store holds
    another study, saying what differs; `QuadcosimError` for what is not a run's own failure, without a row;
    `KeyboardInterrupt`, which says how far it came, after Ctrl-C.
    """
    _expect_workers(workers, dask)
    if time_limit is not None and not time_limit > 0.0:
        raise UsageError(f"--time-limit {time_limit:g}: expected a positive number of seconds")
    if metrics is not None:
        study = replace(study, metrics=metrics_from_sources(metrics))
    study, files, how, follows = ready(study, engine)
    path = store.store_path(study.name, folder)
    with runs_reporter(progress) as hear, store.open_for_writing(path, study.judged) as opened:
        _describe(opened, study, files)
        missing = _missing(opened, study, retry_failed)
        counted = _Counted(len(study.points), opened, hear, announce)
        agreement = None
        if missing:
            opened.describe({ENGINE: how.name})
            if announce is not None and engine == "auto":
                announce(str(how))
            flown_with = with_python_twins(files) if how.in_lanes else files
            task_of = partial(_task, study, files.start_values_of(study.origin), time_limit)
            tasks = (task_of(index, key, how.engine) for index, key in missing.items())
            lanes: dict[str, Row] = {}
            try:
                with _workers(Inputs.of(flown_with), workers, dask) as fly:
                    asked = chunks(tasks, len(missing), workers, how.on_gpu) if how.in_lanes else tasks
                    with contextlib.closing(fly(asked)) as outcomes:
                        for some in outcomes:
                            _keep(some, opened)
                            counted.add(some)
                            lanes |= {each.row.key: each.row for each in some if each.in_lanes}
                    agreement = vouched(lanes, flown_with, partial(task_of, engine=None), fly)
            except KeyboardInterrupt:
                raise Interrupted(f"with {counted.done} of {counted.total} runs done") from None
        if agreement is not None:
            opened.describe({AGREEMENT: agreement.as_text()})
            agreement.expect()
        failed = opened.counts().get("failed", 0)
    return Swept(
        study=study, total=counted.total, flown=len(missing), failed=failed, path=path, engine=how.name,
        agreement=agreement, follows=follows,
    )  # fmt: skip


def ready(study: Study, engine: EngineChoice) -> tuple[Study, Files, Execution, tuple[str, ...]]:
    """A study as it is flown by an engine, its files, how, and what is followed in it, by whom.

    Raises `UsageError` for a run that cannot be.
    """
    found: dict[bool, tuple[Study, Files, tuple[str, ...]]] = {}

    def first(native: bool) -> tuple[System, Files]:
        asked = replace(study, native=native)
        files = asked.files()
        found[native] = asked, files, expect_flyable(asked, files)
        return asked.system(0, files.start_values_of(asked.origin)), files

    apart = "metrics that are functions need whole runs, one at a time" if study.metrics else None
    how = choose_execution(engine, study.native, first, no_lanes=apart)
    if how.native not in found:
        first(how.native)
    flown, files, follows = found[how.native]
    return flown, files, how, follows


def _expect_workers(workers: int, dask: str | None) -> None:
    if workers < 1:
        raise UsageError(f"--workers {workers}: expected at least 1")
    if dask is not None:
        expect_scheduler(dask)


def _workers(inputs: Inputs, workers: int, dask: str | None) -> AbstractContextManager[TaskRunner]:
    """Those that fly tasks, here or on a cluster."""
    return local_workers(inputs, workers) if dask is None else cluster(inputs, dask)


def expect_current(opened: store.Store, study: Study) -> None:
    """Raise `UsageError` if `study` is not, or no longer, the one whose rows are in the store."""
    about = opened.about()
    if STUDY_PARTS not in about:
        raise UsageError(f"{opened.path}: expected the store of a study that has begun")
    changes = difference(
        {**json.loads(about[STUDY_PARTS]), **json.loads(about[DESIGN_PARTS])},
        {**study_parts(study), **design_parts(study)},
    )
    if changes:
        raise UsageError(
            f"{opened.path}: the study file has changed since ({changes}); expected the study that was flown: "
            "quadcosim sweep flies what is missing"
        )


class _Counted:
    """How far a sweep is, for those who want to hear of it."""

    def __init__(self, total: int, opened: store.Store, hear: Count, announce: Announce | None) -> None:
        self.total, self.failed = total, 0
        self._hear, self._announce = hear, announce
        self._lacking = opened.missing_counts()
        self.done = total - sum(self._lacking.values())
        self._tell()

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """More runs have a row."""
        for row in (outcome.row for outcome in outcomes):
            if row.status == "failed":
                self.failed += 1
                if self._announce is not None and self.failed <= _TOLD:
                    more = "; further ones are not told" if self.failed == _TOLD else ""
                    self._announce(f"{described(row.index, row.settings)} failed: {row.message}{more}")
            self.done += self._lacking.pop(row.key, 0)
        self._tell()

    def _tell(self) -> None:
        self._hear(self.done, self.total)


def _task(
    study: Study,
    starts: Mapping[str, float],
    time_limit: float | None,
    index: int,
    key: str,
    engine: Engine | None,
) -> RunTask:
    settings, system = study.settings_and_system(index, starts)
    return RunTask(
        index=index, key=key, settings=settings, system=system,
        keep_signals=study.keeps_signals(index), metrics=study.metrics, engine=engine, time_limit=time_limit,
    )  # fmt: skip


def _missing(opened: store.Store, study: Study, retry_failed: bool) -> dict[int, str]:
    """The places of the design that are to be flown, with their keys: without a row, or without signals to be kept."""
    missing = opened.missing(failed_too=retry_failed)
    if not study.keep_signals:
        return missing
    lacking = {
        row["design_index"]: row["key"]
        for row in opened.rows()
        if study.keeps_signals(row["design_index"])
        and row["status"] == "done"
        and not _signals_path(opened, row["key"]).is_file()
    }
    return dict(sorted({**missing, **lacking}.items()))


def _signals_path(opened: store.Store, key: str) -> Path:
    return opened.path.parent / "signals" / f"{key[:16]}.parquet"


def _keep(outcomes: Sequence[Outcome], opened: store.Store) -> None:
    """Signals first, then the rows, so that a row never lacks what it promises."""
    for outcome in outcomes:
        if outcome.signals is not None:
            target = _signals_path(opened, outcome.row.key)
            target.parent.mkdir(exist_ok=True)
            partial = target.with_suffix(".partial")
            partial.write_bytes(outcome.signals)
            partial.replace(target)
    opened.add([outcome.row for outcome in outcomes])


def _describe(opened: store.Store, study: Study, files: Files) -> None:
    """A store belongs to one study, whose design may grow; a changed one is told what changed."""
    about = opened.about()
    parts, place = study_parts(study), place_parts(study, files)
    if STUDY_PARTS in about:
        changes = difference(
            {**json.loads(about[STUDY_PARTS]), **json.loads(about[PLACE_PARTS])}, {**parts, **place}
        )  # fmt: skip
        if changes:
            raise UsageError(
                f"{opened.path}: holds another study ({changes}); expected the same one: take another --out, "
                "or remove the store"
            )
    design = json.dumps(design_parts(study))
    if about.get(DESIGN_PARTS) == design:
        return
    grid: dict[str, Any] | None = {axis.name: axis.values for axis in study.axes}
    opened.describe(
        {
            STUDY_PARTS: json.dumps(parts),
            PLACE_PARTS: json.dumps(place),
            DESIGN_PARTS: design,
            TOTAL: str(len(study.points)),
            AXES: json.dumps([axis.name for axis in study.axes]),
            "grid": json.dumps(grid if all(axis.values is not None for axis in study.axes) else None),
            "guids": json.dumps({name: m.description.guid for name, m in files.models_of(study.origin).items()}),
            "versions": json.dumps(versions()),
            UNITS: json.dumps(_units(study, files)),
        },
        _places(study, files),
    )


def _units(study: Study, files: Files) -> dict[str, str]:
    """Of the axes, and of what its runs come to, as the first of them has them."""
    first = study.system(0, files.start_values_of(study.origin))
    models = files.models_of(first)
    of_axes = {
        axis.name: unit_at(paths_in(study.base, axis.targets[0])[0], models)
        for axis in study.axes
        if axis.targets and not axis.multiplies
    }
    return {name: unit for name, unit in of_axes.items() if unit} | check_against_fmus(first, models).units


def _places(study: Study, files: Files) -> Iterator[store.DesignPoint]:
    starts = files.start_values_of(study.origin)
    for index in range(len(study.points)):
        settings, system = study.settings_and_system(index, starts)
        yield store.DesignPoint(index=index, key=run_key(system, files, study.metrics), settings=settings)
