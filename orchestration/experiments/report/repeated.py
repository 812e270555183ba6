"""The maps of a study that repeats: shares of its cells with their intervals, and the difference of two laws."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from orchestration.experiments.report.model import CellMap, MapCell, RepeatedMaps
from orchestration.experiments.report.tables import ColumnAxis, Row
from orchestration.experiments.studies.shares import cells_of, differences_of, laws_of, with_chance
from orchestration.experiments.studies.study import Study
from orchestration.systems.system.requirements import is_number

if TYPE_CHECKING:
    import pandas as pd


def repeated_maps(study: Study, rows: Sequence[Row], axes: Sequence[ColumnAxis]) -> RepeatedMaps | None:
    """The maps over two axes of numbers, or over one and one of names; None of other studies.

    An axis of names beside two of numbers has a map for each, and for two names one of their difference, the last.
    """
    import pandas as pd

    known = {axis.name: axis for axis in axes}
    names = study.cell_names
    if names is None or study.origin.criterion.good is None or any(axis.values is None for axis in study.axes):
        return None
    numeric = [axis.name for axis in study.cell_axes if all(map(is_number, axis.values or ()))]
    named = [name for name in names if name not in numeric]
    if (len(numeric), len(named)) not in ((2, 0), (2, 1), (1, 1)):
        return None
    across, up = known[numeric[0]], known[(numeric + named)[1]]
    columns = ("status", "good", "design_index")
    table = pd.DataFrame([{**row["settings"], **{name: row[name] for name in columns}} for row in rows])
    table = with_chance(table[table["status"] == "done"], study)
    word, law = study.origin.criterion.outcomes[0], named[0] if len(numeric) == 2 and named else None
    found = cells_of(table, names)
    groups = [("", found)] if law is None else [(str(name), found[found[law] == name]) for name in table[law].unique()]
    maps = [
        CellMap(
            title=f"share {word}" + (f", {_short(name)}" if name else ""),
            is_difference=False,
            cells=tuple(_cells(group, across, up, table, [*names], word)),
        )
        for name, group in groups
    ]
    if law is not None and (laws := laws_of(table, names)) is not None:
        others = [name for name in names if name != law]
        title = f"difference, {_short(laws.second)} minus {_short(laws.first)}"
        cells = _cells(differences_of(table, names, laws), across, up, table, others, None)
        maps.append(CellMap(title=title, is_difference=True, cells=tuple(cells)))
    return RepeatedMaps(across=across.name, up=up.name, maps=tuple(maps))


def _cells(
    found: "pd.DataFrame", across: ColumnAxis, up: ColumnAxis, table: "pd.DataFrame", by: list[str], word: str | None
) -> list[MapCell]:
    """Cells of shares that are `word`, or of differences; their runs have the same values of the axes `by`."""
    runs = table.groupby(by)["design_index"].agg(list).to_dict()
    cells = []
    for row in found.to_dict("records"):
        key = tuple(row[name] for name in by)
        value, low, high = (row[name] for name in ("difference" if word is None else "share", "low", "high"))
        is_exact = math.isnan(low)
        exact = "nothing is random" if is_exact else f"95 % interval {_shown(low, word)} to {_shown(high, word)}"
        counts = "" if word is None else f"{row['good']} of {row['count']} {word}: "
        short = _shown(value, word) if word is None or is_exact else f"{row['good']}/{row['count']}"
        cells.append(
            MapCell(
                x=float(across.quantity.of(row[across.name])), y=_value(up, row[up.name]),
                value=value, low=None if is_exact else low, high=None if is_exact else high, text=short,
                said=f"{counts}{_shown(value, word)}, {exact}",
                runs=tuple(map(int, runs[key])),
            )
        )  # fmt: skip
    return cells


def _value(axis: ColumnAxis, value: Any) -> float | str:
    return float(axis.quantity.of(value)) if is_number(value) else str(value)


def _shown(value: float, word: str | None) -> str:
    return f"{100.0 * value:+.0f} %" if word is None and value else f"{100.0 * value:.0f} %"


def _short(law: str) -> str:
    return law.rpartition("/")[2]
