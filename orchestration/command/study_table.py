"""The cells of a study as a table for a paper, with intervals at 95 %."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.command.printed_tables import PrintedTable, decimals_of, to_digits, with_interval
from orchestration.experiments.studies.axes import name_of, names_of, picked, place_of, quantity_of
from orchestration.experiments.studies.infinite_means import InfiniteMeans
from orchestration.experiments.studies.shares import (
    BOOLEAN,
    GOOD,
    INTERVALS,
    MEAN,
    MEDIAN,
    REMARK,
    WITH_VALUE,
    WITHOUT_INTERVAL,
    cells_of,
    differences_in,
    expect_mean,
    is_unknown,
    laws_of,
    left_out,
    remarked,
    with_chance,
)
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.table import (
    OF_CELLS,
    expect_metric_of_cells,
    frame,
    meaning_of,
    rows_at,
    units_in,
)
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.results import display_names as labels
from orchestration.systems.system.requirements import is_number
from orchestration.theory.exact.mean_square import NO_EXPECTATION

if TYPE_CHECKING:
    import pandas as pd


def study_table(
    study: Study, store: Path, metric: str = GOOD, at: Sequence[str] = (), *, mean: bool = False
) -> PrintedTable:
    """A row for each cell with its share of good runs, or of those with another metric that is true, or an average.

    `at` chooses values of axes, as `delay=0.02`. Of two laws both stand side by side with their difference. The numbers
    are those of the files that `export` writes. Raises `UsageError` for a study without repetitions, and for a metric
    or a value that is none.
    """
    if study.cell_names is None:
        raise UsageError(f"--table: {OF_CELLS}")
    expect_metric_of_cells(study, metric)
    if mean:
        expect_mean(metric, study.repeat)
    chosen = picked(study.cell_axes, at)
    axes = [axis for axis in study.cell_axes if axis.name not in chosen]
    rows = with_chance(rows_at(frame(store), chosen), study, InfiniteMeans.in_store(store, study))
    names = [axis.name for axis in axes]
    if not axes:
        raise UsageError("--at: expected an axis besides, for a table of cells")
    laws, units, word = laws_of(rows, names), units_in(store), study.origin.criterion.outcomes[0]
    is_share, average = metric in BOOLEAN, MEAN if mean else MEDIAN
    word = labels.metric(metric) if is_share and metric != GOOD else word
    cells = cells_of(rows, names, metric, average)
    others = [axis for axis in axes if laws is None or axis.name != laws.axis]
    quantities = {axis.name: quantity_of(axis, units) for axis in others}
    first = cells if laws is None else cells[cells[laws.axis] == laws.first]
    columns = {
        name_of(axis) if not all(map(is_number, first[axis.name])) else quantities[axis.name].title: [
            f"{quantities[axis.name].factor * value:g}" if is_number(value) else names_of(axis.values or ())[value]
            for value in first[axis.name]
        ]
        for axis in others
    }
    if is_share:
        texts = partial(_texts, column="share", decimals=decimals_of(cells["count"].max()))
        caption = f"Share of {word} runs of {cells['count'].max()} in each cell, with 95 % Wilson intervals"
    else:
        texts = partial(_averages, column=average, count=WITH_VALUE)
        title = labels.metric_with_unit(metric, units.get(metric))
        caption = (
            f"{average.capitalize()} of {title} over the {'' if mean else f'{word} '}runs of each cell that have a "
        )
        caption += f"value, with 95 % intervals {INTERVALS[average]} and, in parentheses, their number"
        if absent := left_out(cells, word):
            caption += f"; {absent}"
        if remarks := remarked(cells, "?: "):
            caption += f"; {remarks}"
    if laws is None:
        columns[f"share {word}" if is_share else average] = texts(cells)
    else:
        by, named = [axis.name for axis in others], names_of(laws[1:])

        def in_rows(found: "pd.DataFrame") -> "pd.DataFrame":
            return first[by].merge(found, how="left", on=by) if by else found.reset_index(drop=True).reindex([0])

        for law in (laws.first, laws.second):
            columns[named[law]] = texts(in_rows(cells[cells[laws.axis] == law]))
        minus = f"{named[laws.second]} minus {named[laws.first]}"
        found = differences_in(rows, names, laws, metric, average)
        if is_share:
            texts = partial(texts, column="difference")
            caption += f"; difference: {minus}, with 95 % intervals by Newcombe's method for pairs"
        else:
            texts = partial(texts, column="difference", count="pairs")
            caption += (
                f"; difference: {average} of {minus} over the pairs that both {'have one' if mean else f'are {word}'}"
            )
        columns["difference"] = texts(in_rows(found))
    if not mean and (meaning := meaning_of(study, metric, units)):
        caption += f"; {meaning}"
    if chosen:
        caption += f"; at {place_of(study.axes, chosen, units)}"
    without = cells[REMARK].isin(WITHOUT_INTERVAL) if mean else cells["count"].isna()
    if (cells["low"].isna() & ~without).any():
        caption += "; no interval where nothing is random" + ("" if is_share else ", or runs are too few")
    table = cells
    if laws is not None:  # in the rows of the second law, as in the file of differences
        ends = found.rename(columns={end: f"difference_{end}" for end in ("low", "high", REMARK)})
        table = table.merge(ends.assign(**{laws.axis: laws.second, "minus": laws.first}), how="left", on=list(names))
    numbers = table.astype(object).where(table.notna(), None).to_dict("records")
    return PrintedTable(caption=caption, heads=[*columns], rows=[*zip(*columns.values())], numbers=numbers)


def _texts(table: "pd.DataFrame", column: str, decimals: int) -> list[str]:
    """Values with their intervals, as far as they have one; a dash for a missing cell."""
    return [with_interval(*row, decimals) for row in zip(table[column], table["low"], table["high"])]


def _averages(table: "pd.DataFrame", column: str, count: str) -> list[str]:
    """Averages with their intervals and the number of runs, of all if some are left out; a dash for a missing cell."""
    rows = zip(*(table[name] for name in (column, "low", "high", count, "count" if count == WITH_VALUE else count)))
    remarks = [""] * len(table)
    if REMARK in table:
        remarks = ["?" if doubt else said for doubt, said in zip(is_unknown(table[REMARK]), table[REMARK])]
    return [
        f"{remark if remark == NO_EXPECTATION else to_digits(value, low, high, DIGITS)}{'?' * (remark == '?')} "
        f"({number:.0f}{f' of {of:.0f}' if number < of else ''})"
        if of > 0
        else "-"
        for (value, low, high, number, of), remark in zip(rows, remarks)
    ]


DIGITS = 3
"""Digits of an average"""
