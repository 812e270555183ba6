"""Runs a comparison and draws its conclusions; reruns single cells."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from fmu_kit.new_files import new_files
from orchestration.experiments.comparison.bandwidth import Bandwidths, bandwidths
from orchestration.experiments.comparison.cells import CellSummary, cell_summaries, table_of_runs, with_second_axis
from orchestration.experiments.comparison.design import START, Comparison
from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.comparison.outcome import Outcome, outcome_of, write
from orchestration.experiments.studies.store import store_path
from orchestration.experiments.studies.study_file import FileLike
from orchestration.experiments.studies.sweep import sweep
from orchestration.experiments.studies.swept import Swept
from orchestration.experiments.studies.table import export, frame, units_in
from orchestration.foundation.basics.errors import UsageError, expect_one_of
from orchestration.foundation.basics.extras import explains_missing, needs
from orchestration.foundation.basics.terminal import CountProgress, inform
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.results import html
from orchestration.simulation.runs.run_directory import keep_run
from orchestration.simulation.runs.simulation import run as fly
from orchestration.simulation.workers.batching import TOLERATED
from orchestration.simulation.workers.choice import EngineChoice, Execution, choose_execution
from orchestration.simulation.workers.executors import RunEvaluator
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System
from orchestration.systems.system.request import errors_in_own_terms

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.simulation.figures.style import Figures, Style


@dataclass(frozen=True, kw_only=True, repr=False)
class Compared:
    """The result of a comparison."""

    comparison: Comparison
    """The comparison as it was run."""
    summary: Swept
    """The summary of the sweep of its runs, with the path of the store."""
    table: "pd.DataFrame"
    """A row for each run."""
    bandwidths: Bandwidths
    """Bandwidths of the attitude loop [rad/s], by controller, vehicle and value of the axis."""
    outcome: Outcome
    """Cells, limits, pairs and fronts, with their intervals."""
    written: list[Path]
    """The tables and pictures beside the store."""

    @property
    def verdict(self) -> str:
        """Up to which value of the axis half of the starts survive and settle, where first it was measured."""
        outcome = self.outcome
        half = [one for one in outcome.limits if one.share == "half"]
        if not half:
            counts = [f"{cell.controller} {cell.survives.count} of {cell.count}" for cell in outcome.cells]
            return f"no limits, as cells are missing; survive: {some(counts)}" if counts else "no cell has runs"
        places = dict.fromkeys((one.vehicle, one.condition) for one in half)
        first = next(iter(places))
        reached: dict[str, dict[str, list[str]]] = {}
        for one in half:
            if (one.vehicle, one.condition) == first:
                fates = reached.setdefault(one.controller, {})
                fates.setdefault(self._up_to(one.value), []).append(f"{one.fate}s")
        found = [
            f"{controller} " + " and ".join(f"{' and '.join(those)} {up_to}" for up_to, those in fates.items())
            for controller, fates in reached.items()
        ]
        others = f" ({len(places) - 1} more below)" if len(places) > 1 else ""
        where = f"{first[0]}, {first[1]}"
        return f"from half of the starts, over {self.comparison.axis.name}: {some(found)}; {where}{others}"

    def _up_to(self, value: float) -> str:
        """The words for a limit; its grid may end before it, or begin after it."""
        values = self.comparison.values
        if value not in values:
            return "at no value"
        unit = "s" if self.comparison.is_in_seconds else None
        return f"to {'at least ' if value == values[-1] else ''}{quantity(value, unit)}"

    def __repr__(self) -> str:
        return (
            f"<Compared: {len(self.outcome.cells)} cells of {self.summary.total} runs, in {self.summary.path.parent}>"
        )

    def _repr_html_(self) -> str:
        """The limits of each controller, as notebooks show them."""
        rows = [
            (
                f"{one.controller} on {one.vehicle}, {one.condition}: {one.share} of the starts {one.fate} up to",
                f"{one.value:g}",
                "",
            )
            for one in self.outcome.limits
        ]
        return html.card(
            "A comparison", None, None, f"{len(self.outcome.cells)} cells, {self.summary.total} runs", rows
        )

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The pictures by name, as `limits` and `shares_VEHICLE_CONDITION`; a notebook shows them.

        `style` sets sizes and fonts. Raises `UsageError` for an unknown style.
        """
        from orchestration.experiments.comparison import pictures
        from orchestration.simulation.figures.style import Figures, style_named

        chosen, units = style_named(style), units_in(self.summary.path)
        return Figures(pictures.figures_of(self.comparison, self.outcome, self.table, chosen, units=units), chosen)

    @explains_missing
    def to_pandas(self, what: Literal["cells", "limits", "pairs", "runs", "starts"] = "cells") -> "pd.DataFrame":
        """A row for each cell: counts of runs that survive and settle, medians; or the limits, the pairs, or the runs.

        Or for each of the starts, by the number that it has in the runs: its values by path and its seed, which `fly`
        takes. Raises `UsageError` for another name.
        """
        import pandas as pd

        expect_one_of("what", what, ("cells", "limits", "pairs", "runs", "starts"))
        if what == "runs":
            return self.table
        if what == "starts":
            return pd.DataFrame(self.comparison.start_settings).rename_axis(START)
        if what == "limits":
            return pd.DataFrame([vars(one) for one in self.outcome.limits])
        rows = [one.row() for one in (self.outcome.pairs if what == "pairs" else self.outcome.cells)]
        return pd.DataFrame(rows)


@needs("filelock", "pandas")
def compare(
    comparison: Comparison | FileLike,
    *,
    out: str | Path | None = None,
    workers: int = 1,
    dask: str | None = None,
    engine: EngineChoice = "auto",
    time_limit: float | None = None,
    figures: bool = True,
    style: "Style | None" = None,
    progress: CountProgress = "bar",
    announce: Callable[[str], None] | None = inform,
) -> Compared:
    """Run what is missing of a comparison, and write its tables and pictures beside its store.

    `comparison` may be the path of its file, or the content of the file as a dictionary, as `load_comparison` takes
    them.
    `out`, `workers`, `dask`, `engine`, `time_limit`, `progress` and `announce` are those of `sweep`, which raises
    what this does. Pictures are drawn unless `figures` is false, in a `style`, by default for a screen.
    """
    comparison = load_comparison(comparison)
    summary = sweep(
        comparison.study, out=out, workers=workers, dask=dask, engine=engine, time_limit=time_limit,
        progress=progress, announce=announce,
    )  # fmt: skip
    comparison = replace(comparison, native=summary.study.native)
    known = bandwidths(comparison)  # after the check of the design, which names an invalid run
    place = summary.path.parent
    table = with_second_axis(comparison, frame(summary.path))
    outcome = outcome_of(comparison, table, known)
    with new_files(place) as new:
        written = [*export(summary.path, new, rows=table), *write(comparison, outcome, known, new)]
        if figures:
            from orchestration.experiments.comparison import pictures
            from orchestration.simulation.figures.style import SCREEN  # with it comes matplotlib

            written += pictures.draw(comparison, outcome, table, new, style or SCREEN, units=units_in(summary.path))
    return Compared(
        comparison=comparison, summary=summary, table=table, bandwidths=known, outcome=outcome,
        written=[place / path.name for path in written],
    )  # fmt: skip


def rerun_cells(
    comparison: Comparison, indices: Sequence[int], *, workers: int = 1, engine: EngineChoice = "auto"
) -> list[CellSummary]:
    """Run all runs of some cells, whether or not a store has them; in the order of the cells.

    Raises `UsageError` for a cell that does not exist.
    """
    runs = [comparison.runs_of(comparison.cell(index)) for index in indices]
    comparison, files, how = _prepared(comparison, [of_cell[0] for of_cell in runs], engine)
    study = comparison.study
    starts = files.start_values
    systems = [study.system(i, starts) for i in chain(*runs)]
    with RunEvaluator(files, workers, how.engine) as pool:
        flights = pool.run_all(systems, in_lanes=how.in_lanes)
    return cell_summaries(comparison, table_of_runs(comparison, zip(chain(*runs), flights)))


def agree(one: CellSummary, other: CellSummary) -> bool:
    """Whether two summaries of a cell are equal, up to the tolerance of metrics of a SIMD batch."""
    same = ("cell", "count", "survives", "settles", "diverged")
    counts = all(getattr(one, key) == getattr(other, key) for key in same)
    pairs = ((one.medians[name], other.medians.get(name)) for name in one.medians)
    return counts and all(known is not None and median.is_near(known, TOLERATED) for median, known in pairs)


def stored_cell(comparison: Comparison, index: int, folder: Path | None) -> CellSummary | None:
    """The summary of a cell from the store; None if it has no runs there."""
    path = store_path(comparison.name, folder)
    if not path.is_file():
        return None
    summaries = cell_summaries(comparison, frame(path))
    return next((cell for cell in summaries if cell.cell == index), None)


def flight(
    comparison: Comparison, index: int, start: int, out: Path, *, engine: EngineChoice = "auto", figures: bool = True
) -> None:
    """Run one initial condition of a cell by itself, and keep it in a run directory."""
    runs = comparison.runs_of(comparison.cell(index))
    if not 0 <= start < len(runs):
        raise UsageError(f"--start {start}: expected a number from 0 to {len(runs) - 1}")
    comparison, files, how = _prepared(comparison, [runs[start]], engine)
    request = comparison.request(runs[start], files.start_values)
    keep_run(out, lambda to: fly(request, recorder=to, engine=how.engine), figures=figures)


def _prepared(
    comparison: Comparison, indices: Sequence[int], engine: EngineChoice
) -> tuple[Comparison, Files, Execution]:
    """A comparison as an engine runs some of its runs, its files and the choice of the engine.

    Raises `UsageError` for an invalid run.
    """

    def first(native: bool) -> tuple[System, Files]:
        study = replace(comparison, native=native).study
        files = study.files()
        with errors_in_own_terms(comparison.base):
            systems = [study.system(index, files.start_values) for index in indices]
            for system in systems:
                check_against_fmus(system, files.models_of(system))
        return systems[0], files

    how = choose_execution(engine, comparison.native, first)
    return replace(comparison, native=how.native), first(how.native)[1], how
