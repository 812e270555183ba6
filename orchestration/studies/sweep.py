"""Flies what is missing of a study, and nothing twice."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.errors import UsageError
from orchestration.studies import engine, store
from orchestration.studies.study import Fmus, Study, fingerprint, locate_fmus, run_key, versions
from orchestration.studies.worker import Outcome, Task

Progress = Callable[[int, int], None]
"""Hears how many of how many runs are done."""

TOTAL, STUDY_PARTS, AXES = "total", "study", "axes"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """How a sweep went."""

    total: int
    flown: int
    """runs of this sweep"""
    failed: int
    """failed runs in the store"""
    path: Path


def store_path(study: str, folder: Path | None = None) -> Path:
    """Where the rows of a study are: `results/NAME/study.sqlite` unless a folder is given."""
    return (folder or Path("results") / study) / "study.sqlite"


def sweep(
    study: Study,
    *,
    folder: Path | None = None,
    workers: int = 1,
    dask: str | None = None,
    retry_failed: bool = False,
    progress: Progress | None = None,
) -> Summary:
    """Fly the runs of `study` that its store does not have, writing each row as it comes.

    Raises `UsageError` if the store holds another study, saying what differs.
    """
    if workers < 1:
        raise UsageError(f"--workers {workers}: expected at least 1")
    path = store_path(study.name, folder)
    fmus = locate_fmus(study.base)
    with store.open_for_writing(path) as opened:
        _expect_same_study(opened, study, fmus)
        tasks = _missing(opened, study, fmus, retry_failed)
        total = len(study.points)
        done = total - len(tasks)
        if progress is not None:
            progress(done, total)
        outcomes = (
            engine.run_on_dask(tasks, fmus, dask) if dask is not None else engine.run_locally(tasks, fmus, workers)
        )
        for chunk in outcomes:
            _keep(chunk, opened)
            done += len(chunk)
            if progress is not None:
                progress(done, total)
        failed = opened.counts().get("failed", 0)
    return Summary(total=total, flown=len(tasks), failed=failed, path=path)


def _missing(opened: store.Store, study: Study, fmus: Fmus, retry_failed: bool) -> list[Task]:
    """The runs without a row, or with a failed one that is to be tried again."""
    present = opened.statuses()
    tasks, impossible = [], []
    for index, point in enumerate(study.points):
        try:
            scenario = study.scenario(index, fmus.starts)
        except UsageError as error:  # a point that cannot be is a run that failed
            impossible.append(_impossible(index, point, study.base.seed, str(error)))
            continue
        key = run_key(scenario, fmus.guids)
        keeps = study.keeps_signals(index)
        stored, status = present.get(index, ("", ""))
        there = stored == key and not (keeps and status == "done" and not _signals_path(opened, index).is_file())
        if not there or (retry_failed and status == "failed"):
            tasks.append(Task(index=index, key=key, settings=point, scenario=scenario, keep_signals=keeps))
    opened.add(row for row in impossible if row.index not in present)
    return tasks


def _impossible(index: int, point: Mapping[str, Any], seed: int, message: str) -> store.Row:
    key = hashlib.sha256(json.dumps([point, message]).encode()).hexdigest()
    return store.Row(index=index, key=key, settings=point, seed=seed, metrics=None, message=message, duration=0.0)


def _signals_path(opened: store.Store, index: int) -> Path:
    return opened.path.parent / "signals" / f"{index:06d}.parquet"


def _keep(outcomes: Iterable[Outcome], opened: store.Store) -> None:
    """Signals first, then the row, so that a row never lacks what it promises."""
    outcomes = list(outcomes)
    for outcome in outcomes:
        if outcome.signals is not None:
            target = _signals_path(opened, outcome.row.index)
            target.parent.mkdir(exist_ok=True)
            partial = target.with_suffix(".partial")
            partial.write_bytes(outcome.signals)
            partial.replace(target)
    opened.add(outcome.row for outcome in outcomes)


def _expect_same_study(opened: store.Store, study: Study, fmus: Fmus) -> None:
    """A store belongs to one study; a changed one is told what changed."""
    parts = fingerprint(study, fmus.guids)
    about = opened.about()
    if STUDY_PARTS not in about:
        opened.describe(
            {
                STUDY_PARTS: json.dumps(parts),
                TOTAL: str(len(study.points)),
                AXES: json.dumps([axis.name for axis in study.axes]),
                "grid": json.dumps(
                    {a.name: a.values for a in study.axes} if all(a.values for a in study.axes) else None
                ),
                "guids": json.dumps(fmus.guids),
                "versions": json.dumps(versions()),
            }
        )
        return
    before = json.loads(about[STUDY_PARTS])
    differing = [name for name in sorted({*before, *parts}) if before.get(name) != parts.get(name)]
    if differing:
        changes = "; ".join(f"{n} was {before.get(n, 'absent')}, is {parts.get(n, 'absent')}" for n in differing)
        raise UsageError(
            f"{opened.path}: holds another study ({changes}); expected the same one: take another --out, "
            "or remove the store"
        )
