"""The cells of a study as a table for a paper, with intervals at 95 %."""

from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.command.printed_tables import PrintedTable, decimals_of, with_interval
from orchestration.experiments.studies.axes import name_of, quantity_of
from orchestration.experiments.studies.shares import differences_of, laws_of, shares_of, with_chance
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.table import frame, units_in
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.requirements import is_number

if TYPE_CHECKING:
    import pandas as pd


def study_table(study: Study, store: Path) -> PrintedTable:
    """A row for each cell with its share of good runs; of two laws both shares and their difference side by side.

    The numbers are those of `shares.csv`. Raises `UsageError` for a study without repetitions.
    """
    if study.cell_names is None:
        raise UsageError("--table: expected a study whose design.repeat has the name of the axis that repeats, as seed")
    rows, names = with_chance(frame(store), study), study.cell_names
    shares, laws = shares_of(rows, names), laws_of(rows, names)
    others = [axis for axis in study.cell_axes if laws is None or axis.name != laws.axis]
    word, units = study.origin.criterion.outcomes[0], units_in(store)
    quantities = {axis.name: quantity_of(axis, units) for axis in others}
    decimals = decimals_of(shares["count"].max())
    first = shares if laws is None else shares[shares[laws.axis] == laws.first]
    columns = {
        name_of(axis) if not all(map(is_number, first[axis.name])) else quantities[axis.name].title: [
            f"{quantities[axis.name].factor * value:g}" if is_number(value) else _short(str(value))
            for value in first[axis.name]
        ]
        for axis in others
    }
    caption = f"Share of {word} runs of {shares['count'].max()} in each cell, with 95 % Wilson intervals"
    if laws is None:
        columns[f"share {word}"] = _texts(shares, "share", decimals)
    else:
        second = shares[shares[laws.axis] == laws.second]
        by = [axis.name for axis in others]
        for law, group in ((laws.first, first), (laws.second, second)):
            columns[_short(law)] = _texts(first[by].merge(group, how="left", on=by), "share", decimals)
        found = first[by].merge(differences_of(rows, names, laws), how="left", on=by)
        columns["difference"] = _texts(found, "difference", decimals)
        minus = f"{_short(laws.second)} minus {_short(laws.first)}"
        caption += f"; difference: {minus}, with 95 % intervals by Newcombe's method for pairs"
    if shares["low"].isna().any():
        caption += "; no interval where nothing is random"
    numbers = shares.astype(object).where(shares.notna(), None).to_dict("records")
    return PrintedTable(caption=caption, heads=[*columns], rows=[*zip(*columns.values())], numbers=numbers)


def _short(law: str) -> str:
    return law.rpartition("/")[2]


def _texts(table: "pd.DataFrame", column: str, decimals: int) -> list[str]:
    """Values with their intervals, as far as they have one; a dash for a missing cell."""
    return [with_interval(*row, decimals) for row in zip(table[column], table["low"], table["high"])]
