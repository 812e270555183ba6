"""The report of a comparison: cells with their shares, their runs, and signals of some of these."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from orchestration.experiments.comparison.cells import CellSummary, Median, cell_summaries
from orchestration.experiments.comparison.cells import Share as CellShare
from orchestration.experiments.comparison.design import START, Comparison
from orchestration.experiments.report.model import ComparisonCells, Report, ReportCell, ReportShare
from orchestration.experiments.report.of_study import Stored, axes_of, read, study_report
from orchestration.experiments.report.subset import Wanted, evenly
from orchestration.experiments.report.tables import ColumnAxis
from orchestration.experiments.studies.table import frame
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity

SIZE = "size of the initial error"
"""A column of the table: the size of each initial condition, as a share of the largest"""


def comparison_report(comparison: Comparison, path: Path, command: str, wanted: Wanted) -> Report:
    """The report of a comparison with its store at `path`: that of its study, and its cells."""
    study = comparison.study
    stored = _with_sizes(read(path, study), comparison)
    of_study = study_report(
        comparison.name, stored, study, command, wanted,
        axes=[*axes_of(stored, study), ColumnAxis(name=SIZE, quantity=Quantity(name=SIZE))],
        choose=_from_each_cell(comparison, stored),
    )  # fmt: skip
    cells = cell_summaries(comparison, frame(path))
    axis = next(one for one in axes_of(stored, study) if one.name == comparison.axis.name)
    return replace(
        of_study,
        kind="comparison",
        shares=(),
        compared=ComparisonCells(
            axis=axis.name,
            label=axis.quantity.name,
            unit=labels.unit(axis.quantity.unit),
            controllers=tuple(one.name for one in comparison.controllers),
            cells=tuple(_cell(cell, axis.quantity) for cell in cells),
        ),
        summary=f"{len(cells)} cells of {len(comparison.initial_conditions)} starts each. {of_study.summary}",
    )


def _with_sizes(stored: Stored, comparison: Comparison) -> Stored:
    sizes = [start.size for start in comparison.initial_conditions]
    rows = [{**row, "settings": {**row["settings"], SIZE: sizes[int(row["settings"][START])]}} for row in stored.rows]
    return replace(stored, rows=rows)


def _from_each_cell(comparison: Comparison, stored: Stored) -> Callable[[int], list[int]]:
    """A function that selects runs, equally many of each cell."""
    starts = len(comparison.initial_conditions)
    done = {row["design_index"] for row in stored.rows if row["status"] == "done"}
    cells = sum(1 for _ in comparison.cells())

    def choose(most: int) -> list[int]:
        places = [*evenly(starts, min(starts, max(1, most // cells)))]
        return [index for cell in range(cells) for place in places if (index := cell * starts + place) in done][:most]

    return choose


def _cell(summary: CellSummary, axis: Quantity) -> ReportCell:
    value = float(axis.of(summary.value))
    return ReportCell(
        number=summary.cell,
        vehicle=summary.vehicle,
        condition=summary.condition,
        controller=summary.controller,
        value=value,
        survives=_share(summary.survives, value, summary.count),
        settles=_share(summary.settles, value, summary.count),
        diverged=summary.diverged,
        medians={name: _ends(median) for name, median in summary.medians.items()},
    )


def _share(share: CellShare, value: float, runs: int) -> ReportShare:
    return ReportShare(label=f"{value:.6g}", value=value, good=share.count, runs=runs, low=share.low, high=share.high)


def _ends(median: Median) -> tuple[float | None, float | None, float | None]:
    return median.value, median.low, median.high
