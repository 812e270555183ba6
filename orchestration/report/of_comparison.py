"""The report of a comparison: cells with their shares, the runs of each, and flights of some of these."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from orchestration.comparison.cells import CellSummary, Median, cell_summaries
from orchestration.comparison.cells import Share as Counted
from orchestration.comparison.design import START, Comparison
from orchestration.report.flights import Progress
from orchestration.report.model import Cell, Compared, Report, Share
from orchestration.report.number_format import number
from orchestration.report.of_study import Stored, axes_of, read, report_of
from orchestration.report.subset import evenly
from orchestration.report.tables import ColumnAxis
from orchestration.results import display_names as labels
from orchestration.results.quantities import Quantity
from orchestration.studies.table import frame

SIZE = "size of the initial error"
"""A column of the table: of each start, as a share of the largest"""


def comparison_report(
    comparison: Comparison,
    path: Path,
    command: str,
    *,
    wanted: Sequence[int] = (),
    most: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """The report of a comparison whose store is at `path`; as that of a study, with its cells."""
    study = comparison.study
    stored = _with_sizes(read(path, study), comparison)
    found = report_of(
        comparison.name, stored, study, command, wanted=wanted, most=most, progress=progress,
        axes=[*axes_of(stored, study), ColumnAxis(name=SIZE, quantity=Quantity(name=SIZE))],
        choose=_from_each_cell(comparison, stored),
    )  # fmt: skip
    cells = cell_summaries(comparison, frame(path))
    axis = next(one for one in axes_of(stored, study) if one.name == comparison.axis.name)
    return replace(
        found,
        kind="comparison",
        shares=(),
        compared=Compared(
            axis=axis.name,
            label=axis.quantity.name,
            unit=labels.unit(axis.quantity.unit),
            controllers=tuple(one.name for one in comparison.controllers),
            cells=tuple(_cell(cell, axis.quantity) for cell in cells),
        ),
        summary=f"{len(cells)} cells of {len(comparison.initial_conditions)} starts each. {found.summary}",
    )


def _with_sizes(stored: Stored, comparison: Comparison) -> Stored:
    sizes = [start.size for start in comparison.initial_conditions]
    rows = [{**row, "settings": {**row["settings"], SIZE: sizes[int(row["settings"][START])]}} for row in stored.rows]
    return replace(stored, rows=rows)


def _from_each_cell(comparison: Comparison, stored: Stored) -> Callable[[int], list[int]]:
    """Chooses so many runs, as many of each cell as of any other."""
    starts, flown = (
        len(comparison.initial_conditions),
        {row["design_index"] for row in stored.rows if row["status"] == "done"},
    )
    cells = sum(1 for _ in comparison.cells())

    def choose(most: int) -> list[int]:
        places = [*evenly(starts, min(starts, max(1, most // cells)))]
        return [index for cell in range(cells) for place in places if (index := cell * starts + place) in flown][:most]

    return choose


def _cell(found: CellSummary, axis: Quantity) -> Cell:
    value = float(axis.of(found.value))
    return Cell(
        number=found.cell,
        vehicle=found.vehicle,
        condition=found.condition,
        controller=found.controller,
        value=value,
        survives=_share(found.survives, value, found.count),
        settles=_share(found.settles, value, found.count),
        diverged=found.diverged,
        medians={name: _ends(median) for name, median in found.medians.items()},
    )


def _share(found: Counted, value: float, runs: int) -> Share:
    return Share(label=number(value), value=value, good=found.count, runs=runs, low=found.low, high=found.high)


def _ends(median: Median) -> tuple[float | None, float | None, float | None]:
    return median.value, median.low, median.high
