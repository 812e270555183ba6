"""Runs what the store of a study does not have, and keeps the rows as they come."""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from fmu_kit.new_files import write_atomically
from orchestration.components.building.fmus import native_twin
from orchestration.experiments.studies import store
from orchestration.experiments.studies.checks import describe_run
from orchestration.experiments.studies.lane_agreement import lane_agreement
from orchestration.experiments.studies.run_columns import TOGETHER, RunColumns
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.interrupt import Interrupted
from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.terminal import Count
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.workers.batching import LaneAgreement, Sample, chunks
from orchestration.simulation.workers.choice import Execution
from orchestration.simulation.workers.executors import (
    TaskRunner,
    local_workers,
)
from orchestration.simulation.workers.pool import Inputs
from orchestration.simulation.workers.row import Rows
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.system.files import Files

Announce = Callable[[str], None]
"""Called with lines about the engine and failed runs."""

ENGINE, AGREEMENT = "engine", "agreement"
"""Names of entries of a store: the engine used last, and the agreement of runs in lanes with their FMUs; empty: open"""
_ANNOUNCED = 3
"""Largest number of failed runs that are announced"""


@dataclass(frozen=True, kw_only=True)
class Flight:
    """How the runs of a study are executed, with what they need."""

    columns: RunColumns
    execution: Execution
    files: Files
    """Files of the study, with those that runs in lanes are compared with"""
    local: int
    """the number of processes of this machine, without a cluster"""
    cluster: TaskRunner | None
    """The workers of a cluster that was reached; None: those of this machine"""
    time_limit: float | None
    chosen: bool
    """whether the engine was chosen for them, by what is faster"""

    def tell(self, announce: Announce) -> None:
        """Announce the engine that was chosen, or what would be faster than the one that was wanted."""
        if self.chosen:
            self.execution.tell(announce)
        elif slow := [fmu for fmu in self.columns.files.fmus if native_twin(fmu) != fmu]:
            announce(
                f"engine {self.execution.name}: slow, as {', '.join(slow)} run{'s' if len(slow) == 1 else ''} Python; "
                "--engine auto is fast, by native twins, in another folder, --out"
            )

    def workers(self) -> AbstractContextManager[TaskRunner]:
        """The workers that run tasks."""
        if self.cluster is not None:
            return contextlib.nullcontext(self.cluster)
        return local_workers(Inputs.of(self.files), self.local)

    def task(self, index: int, key: str, engine: Engine | None) -> RunTask:
        """The task of one run."""
        study = self.columns.study
        return RunTask(
            index=index, key=key, system=study.system(index, self.columns.files.start_values),
            keep_signals=study.keeps_signals(index), metrics=study.metrics, engine=engine, time_limit=self.time_limit,
        )  # fmt: skip

    def tasks(self, opened: store.Store, missing: Integers) -> Iterator[RunTask | TaskBatch]:
        """The tasks of the points that are missing, as the store has them."""
        for indices, keys in _windows(opened, missing[:, 0]):
            if self.execution.in_lanes:
                yield from self._in_lanes(indices, keys, len(missing))
            else:
                yield from (self.task(i, key, self.execution.engine) for i, key in zip(indices.tolist(), keys))

    def _in_lanes(self, indices: Integers, keys: list[str], total: int) -> Iterator[RunTask | TaskBatch]:
        """Tasks of many runs, but of one run where signals are kept."""
        kept = {index for index in indices.tolist() if self.columns.study.keeps_signals(index)}
        yield from (self.task(index, key, None) for index, key in zip(indices.tolist(), keys) if index in kept)
        if rest := [place for place, index in enumerate(indices.tolist()) if index not in kept]:
            block = self.columns.block(indices[rest])
            batch = self.columns.batch(block, [keys[place] for place in rest], self.time_limit)
            yield from chunks([batch], total=total, workers=self.local)


def run_missing(
    opened: store.Store, flight: Flight, report: Count, announce: Announce | None, *, retry_failed: bool
) -> tuple[int, LaneAgreement | None]:
    """Run what is missing, and compare runs in lanes with those of FMUs.

    Returns the number of runs, and the agreement; None: nothing is new to compare.
    """
    missing = _missing(opened, flight.columns.study, retry_failed)
    progress = _Progress(flight.columns.study, missing, report, announce)
    sample = _not_known_to_agree(opened) if flight.execution.in_lanes else Sample()
    if not len(missing) and not sample.runs:
        return 0, None
    opened.describe({ENGINE: flight.execution.name, AGREEMENT: ""})
    if announce is not None:
        flight.tell(announce)
    try:
        with flight.workers() as run:
            with contextlib.closing(run(flight.tasks(opened, missing))) as results:
                for rows in results:
                    _keep(rows, opened)
                    progress.add(rows)
                    sample.add(rows)
            agreement = lane_agreement(
                sample, flight.files, partial(flight.task, engine=None), run, here=flight.cluster is None
            )
    except KeyboardInterrupt:
        raise Interrupted(f"with {progress.done} of {progress.total} runs done") from None
    if agreement is not None:
        opened.describe({AGREEMENT: agreement.as_text()})
        agreement.expect()
    return len(missing), agreement


class _Progress:
    """Counts the runs of a sweep, and reports progress and failures."""

    def __init__(self, study: Study, missing: Integers, report: Count, announce: Announce | None) -> None:
        """`missing` as the store has it."""
        self.total, self.failed = len(study.points), 0
        self._study, self._callback, self._announce = study, report, announce
        self._indices, self._points = missing.T
        self.done = self.total - int(self._points.sum())
        self._report()

    def add(self, rows: Rows) -> None:
        """Count runs that have been written."""
        for place in np.flatnonzero(rows.results.failed).tolist():
            self.failed += 1
            if self._announce is not None and self.failed <= _ANNOUNCED:
                more = "; further ones are not shown" if self.failed == _ANNOUNCED else ""
                run = describe_run(rows.index[place], self._study.points[rows.index[place]])
                self._announce(f"{run} failed: {rows.results.messages[place]}{more}")
        self.done += int(self._points[np.searchsorted(self._indices, rows.index)].sum())
        self._report()

    def _report(self) -> None:
        self._callback(self.done, self.total)


def _windows(opened: store.Store, indices: Integers) -> Iterator[tuple[Integers, list[str]]]:
    """Indices and keys of runs, some thousands at a time."""
    for first in range(0, len(indices), TOGETHER):
        some = indices[first : first + TOGETHER]
        yield some, opened.keys(some)


def _missing(opened: store.Store, study: Study, retry_failed: bool) -> Integers:
    """The points of the design to run, as the store has them: without a row, or without the signals to keep."""
    missing = opened.missing(failed_too=retry_failed)
    if not study.keep_signals:
        return missing
    without_signals = [
        (row["design_index"], 0)
        for row in opened.rows()
        if study.keeps_signals(row["design_index"])
        and row["status"] == "done"
        and not _signals_path(opened, row["key"]).is_file()
    ]
    both = np.concatenate([missing, np.array(without_signals, dtype=np.int64).reshape(-1, 2)])
    return both[np.unique(both[:, 0], return_index=True)[1]]


def _not_known_to_agree(opened: store.Store) -> Sample:
    """A sample of the runs in lanes of a store; empty where runs have agreed, with none added since."""
    sample, before = Sample(), opened.about().get(AGREEMENT)
    if not before or not LaneAgreement.from_text(before).agrees:
        sample.add_stored(opened.rows(), opened.metrics)
    return sample


def _signals_path(opened: store.Store, key: str) -> Path:
    return opened.path.parent / "signals" / f"{key[:16]}.parquet"


def _keep(rows: Rows, opened: store.Store) -> None:
    """Write signals first, then the rows, so that every row has its signals."""
    for place, signals in rows.results.signals.items():
        write_atomically(_signals_path(opened, rows.key[place]), signals)
    opened.add(rows)
