"""The report of a comparison: cells with their shares, their runs, and signals of some of these."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.experiments.comparison.cells import (
    WORDS,
    CellSummary,
    Median,
    cell_summaries,
    tables_of_maps,
    with_second_axis,
)
from orchestration.experiments.comparison.cells import Share as CellShare
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, START, Comparison
from orchestration.experiments.report.model import (
    CellMap,
    ComparisonCells,
    RepeatedMaps,
    Report,
    ReportCell,
    ReportShare,
)
from orchestration.experiments.report.of_study import Stored, axes_of, column_axis, read, study_report
from orchestration.experiments.report.repeated import RunsInCells, difference_map, share_maps
from orchestration.experiments.report.subset import Wanted, evenly
from orchestration.experiments.report.tables import ColumnAxis
from orchestration.experiments.studies.shares import TwoLaws
from orchestration.experiments.studies.table import frame
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity

if TYPE_CHECKING:
    import pandas as pd

SIZE = "size of the initial error"
"""A column of the table: the size of each initial condition, as a share of the largest"""


def comparison_report(comparison: Comparison, path: Path, command: str, wanted: Wanted) -> Report:
    """The report of a comparison with its store at `path`: that of its study, and its cells."""
    study = comparison.study
    stored = _with_columns(read(path, study), comparison)
    axes = axes_of(stored, study)
    second = [] if comparison.second is None else [column_axis(comparison.second, stored.units)]
    of_study = study_report(
        comparison.name, stored, study, command, wanted,
        axes=[*axes, *second, ColumnAxis(name=SIZE, quantity=Quantity(name=SIZE))],
        choose=_from_each_cell(comparison, stored),
    )  # fmt: skip
    table = with_second_axis(comparison, frame(path))
    cells = cell_summaries(comparison, table)
    axis = next(one for one in axes if one.name == comparison.axis.name)
    repeated = [each for up in second for each in _maps(comparison, table, axis, up)]
    compared = ComparisonCells(
        axis=axis.name,
        label=axis.quantity.name,
        unit=labels.unit(axis.quantity.unit),
        controllers=tuple(one.name for one in comparison.controllers),
        cells=tuple(_cell(cell, axis.quantity) for cell in cells),
    )
    return replace(
        of_study,
        kind="comparison",
        shares=(),
        compared=None if second else compared,
        repeated=RepeatedMaps(across=axis.name, up=second[0].name, maps=tuple(repeated)) if second else None,
        summary=f"{len(cells)} cells of {len(comparison.initial_conditions)} starts each. {of_study.summary}",
    )


def _maps(comparison: Comparison, table: "pd.DataFrame", across: ColumnAxis, up: ColumnAxis) -> Iterator[CellMap]:
    """The shares over both axes that survive, and that settle: of each controller, then minus that of the first."""
    several = (len(comparison.vehicles) > 1, len({one.condition for one in comparison.on_second.values()}) > 1)
    first, *others = (one.name for one in comparison.controllers)
    for of, fate, rows in tables_of_maps(comparison, table):
        end = "".join(f" ({name})" for name, is_one_of in zip(of, several) if is_one_of)
        runs = RunsInCells(table=rows, across=across, up=up, law=CONTROLLER, word=WORDS[fate][0], repeat=START)
        yield from share_maps(runs, f"share {runs.word}{end}")
        for other in others:
            yield difference_map(runs, TwoLaws(CONTROLLER, first, other), f"difference of the shares {runs.word}{end}")


def _with_columns(stored: Stored, comparison: Comparison) -> Stored:
    """The content of a store with the size of each run's initial error, and the value of a second axis."""
    sizes = [start.size for start in comparison.initial_conditions]
    rows = []
    for row in stored.rows:
        settings = {**row["settings"], SIZE: sizes[int(row["settings"][START])]}
        if comparison.second is not None:
            settings[comparison.second.name] = comparison.on_second[row["settings"][CONDITION]].value
        rows.append({**row, "settings": settings})
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
