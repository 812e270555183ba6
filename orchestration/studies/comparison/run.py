"""Flies a comparison, concludes from it, and flies a cell of it again."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from orchestration.errors import UsageError
from orchestration.master.engine import Engine
from orchestration.quadrotor.translation import in_its_own_words
from orchestration.results.run_directory import keep_flight
from orchestration.simulation import checked
from orchestration.simulation import run as fly
from orchestration.studies.comparison.bandwidth import Bandwidths, bandwidths
from orchestration.studies.comparison.cells import Result, frame_of, results
from orchestration.studies.comparison.design import Comparison
from orchestration.studies.comparison.outcome import Outcome, concluded, write
from orchestration.studies.engine import Pool
from orchestration.studies.lanes import TOLERATED
from orchestration.studies.sweep import Progress, Summary, store_path, sweep
from orchestration.studies.table import export, frame

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A comparison that was flown."""

    summary: Summary
    table: "pd.DataFrame"
    bandwidths: Bandwidths
    outcome: Outcome
    written: list[Path]


def compare(
    comparison: Comparison,
    *,
    folder: Path | None = None,
    workers: int = 1,
    engine: Engine | Literal["batch"] | None = None,
    figures: bool = True,
    progress: Progress | None = None,
    announce: Callable[[str], None] | None = None,
) -> Compared:
    """Fly what is missing of a comparison, conclude, and write its tables and pictures beside its store.

    Raises `UsageError` as `sweep` does. The engine `batch` is for native comparisons.
    """
    summary = sweep(
        comparison.study, folder=folder, workers=workers, engine=engine, progress=progress, announce=announce
    )
    known = bandwidths(comparison)  # after the design has been checked, which names the run that cannot be
    place = summary.path.parent
    table = frame(summary.path)
    outcome = concluded(comparison, table, known)
    written = [*export(summary.path, place), *write(comparison, outcome, known, place)]
    if figures:
        from orchestration.studies.comparison import pictures  # with it comes matplotlib

        written += pictures.draw(comparison, outcome, table, place)
    return Compared(summary=summary, table=table, bandwidths=known, outcome=outcome, written=written)


def cell_again(comparison: Comparison, index: int, *, workers: int = 1, engine: Engine | None = None) -> Result:
    """Fly all runs of one cell, whatever a store has of it; raises `UsageError` for a cell that there is not."""
    cell, study = comparison.cell(index), comparison.study
    files = study.files()
    starts, runs = files.starts_of(study.origin), comparison.runs_of(cell)
    with in_its_own_words(comparison.base):
        systems = [study.system(i, starts) for i in runs]
        checked(systems[0], files.models_of(systems[0]))
    with Pool(files, workers, engine) as pool:
        flights = pool.fly_all(systems)
    (found,) = results(comparison, frame_of(comparison, zip(runs, flights)))
    return found


def agree(one: Result, other: Result) -> bool:
    """Whether two results of a cell are the same, but for what lanes may differ by in a metric."""
    counts = all(getattr(one, key) == getattr(other, key) for key in ("cell", "runs", "flown", "diverged"))
    pairs = ((one.medians[name], other.medians.get(name)) for name in one.medians)
    return counts and all(known is not None and median.is_near(known, TOLERATED) for median, known in pairs)


def stored_cell(comparison: Comparison, index: int, folder: Path | None) -> Result | None:
    """The same cell by what is in the store; None if nothing is."""
    path = store_path(comparison.name, folder)
    if not path.is_file():
        return None
    found = results(comparison, frame(path))
    return next((cell for cell in found if cell.cell == index), None)


def flight(comparison: Comparison, index: int, start: int, out: Path, *, engine: Engine | None = None) -> None:
    """Fly one start of a cell and keep all of it in a directory of a run."""
    runs = comparison.runs_of(comparison.cell(index))
    if not 0 <= start < len(runs):
        raise UsageError(f"--start {start}: expected a number from 0 to {len(runs) - 1}")
    study = comparison.study
    scenario = comparison.scenario(runs[start], study.files().starts_of(study.origin))
    keep_flight(out, lambda to: fly(scenario, recorder=to, engine=engine))
