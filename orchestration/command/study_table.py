"""The cells of a study as a table for a paper, with intervals at 95 %."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.command.printed_tables import PrintedTable, decimals_of, to_digits, with_interval
from orchestration.experiments.studies.axes import name_of, picked, quantity_of
from orchestration.experiments.studies.shares import (
    BOOLEAN,
    GOOD,
    WITH_VALUE,
    differences_of,
    differences_of_medians,
    judged_by,
    laws_of,
    medians_of,
    shares_of,
    with_chance,
    without_value,
)
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.table import (
    OF_CELLS,
    expect_metric_of_cells,
    frame,
    meaning_of,
    place_of,
    rows_at,
    units_in,
)
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.results import display_names as labels
from orchestration.systems.system.requirements import is_number

if TYPE_CHECKING:
    import pandas as pd


def study_table(study: Study, store: Path, metric: str = GOOD, at: Sequence[str] = ()) -> PrintedTable:
    """A row for each cell with its share of good runs, or of those with another metric that is true, or a median.

    `at` chooses values of axes, as `delay=0.02`. Of two laws both stand side by side with their difference. The numbers
    are those of the files that `export` writes. Raises `UsageError` for a study without repetitions, and for a metric
    or a value that is none.
    """
    if study.cell_names is None:
        raise UsageError(f"--table: {OF_CELLS}")
    expect_metric_of_cells(study, metric)
    chosen = picked(study.cell_axes, at)
    axes = [axis for axis in study.cell_axes if axis.name not in chosen]
    rows, names = with_chance(rows_at(frame(store), chosen), study), [axis.name for axis in axes]
    if not axes:
        raise UsageError("--at: expected an axis besides, for a table of cells")
    laws, units, word = laws_of(rows, names), units_in(store), study.origin.criterion.outcomes[0]
    is_share = metric in BOOLEAN
    if is_share:
        rows, word = judged_by(rows, metric), word if metric == GOOD else labels.metric(metric)
    cells = shares_of(rows, names) if is_share else medians_of(rows, names, metric)
    others = [axis for axis in axes if laws is None or axis.name != laws.axis]
    quantities = {axis.name: quantity_of(axis, units) for axis in others}
    first = cells if laws is None else cells[cells[laws.axis] == laws.first]
    columns = {
        name_of(axis) if not all(map(is_number, first[axis.name])) else quantities[axis.name].title: [
            f"{quantities[axis.name].factor * value:g}" if is_number(value) else _short(str(value))
            for value in first[axis.name]
        ]
        for axis in others
    }
    if is_share:
        texts = partial(_texts, column="share", decimals=decimals_of(cells["count"].max()))
        caption = f"Share of {word} runs of {cells['count'].max()} in each cell, with 95 % Wilson intervals"
    else:
        texts = partial(_medians, column="median", count=WITH_VALUE)
        title = labels.metric_with_unit(metric, units.get(metric))
        caption = f"Median of {title} over the {word} runs of each cell that have a value, with 95 % intervals of "
        caption += "order statistics and, in parentheses, their number"
        if left_out := without_value(cells):
            caption += f"; {left_out}"
    if laws is None:
        columns[f"share {word}" if is_share else "median"] = texts(cells)
    else:
        by = [axis.name for axis in others]
        for law in (laws.first, laws.second):
            columns[_short(law)] = texts(first[by].merge(cells[cells[laws.axis] == law], how="left", on=by))
        minus = f"{_short(laws.second)} minus {_short(laws.first)}"
        if is_share:
            found, texts = differences_of(rows, names, laws), partial(texts, column="difference")
            caption += f"; difference: {minus}, with 95 % intervals by Newcombe's method for pairs"
        else:
            found = differences_of_medians(rows, names, laws, metric)
            texts = partial(texts, column="difference", count="pairs")
            caption += f"; difference: median of {minus} over the pairs that are both {word}"
        columns["difference"] = texts(first[by].merge(found, how="left", on=by))
    if meaning := meaning_of(study, metric, units):
        caption += f"; {meaning}"
    if chosen:
        caption += f"; at {place_of(study, chosen, units)}"
    if cells["low"].isna().any():
        caption += "; no interval where nothing is random" + ("" if is_share else ", or runs are too few")
    table = cells.rename(columns={GOOD: metric}) if is_share else cells
    if laws is not None:  # in the rows of the second law, as in the file of differences
        ends = found.rename(columns={end: f"difference_{end}" for end in ("low", "high")})
        table = table.merge(ends.assign(**{laws.axis: laws.second, "minus": laws.first}), how="left", on=list(names))
    numbers = table.astype(object).where(table.notna(), None).to_dict("records")
    return PrintedTable(caption=caption, heads=[*columns], rows=[*zip(*columns.values())], numbers=numbers)


def _short(law: str) -> str:
    return law.rpartition("/")[2]


def _texts(table: "pd.DataFrame", column: str, decimals: int) -> list[str]:
    """Values with their intervals, as far as they have one; a dash for a missing cell."""
    return [with_interval(*row, decimals) for row in zip(table[column], table["low"], table["high"])]


def _medians(table: "pd.DataFrame", column: str, count: str) -> list[str]:
    """Medians with their intervals and the number of runs, of all good ones if some have none; a dash for none."""
    rows = zip(*(table[name] for name in (column, "low", "high", count, GOOD if count == WITH_VALUE else count)))
    return [
        f"{to_digits(value, low, high, DIGITS)} ({number:.0f}{f' of {good:.0f}' if number < good else ''})"
        if good > 0
        else "-"
        for value, low, high, number, good in rows
    ]


DIGITS = 3
"""Digits of a median"""
