"""The maps of a study that repeats: shares of its cells with their intervals, and the difference of two laws."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from orchestration.experiments.report.model import CellMap, MapCell, RepeatedMaps
from orchestration.experiments.report.tables import ColumnAxis, Row
from orchestration.experiments.studies.shares import (
    cells_of,
    differences_of,
    interval_of_difference,
    laws_of,
    with_chance,
)
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError
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


def maps_of_both(
    first: tuple[str, RepeatedMaps | None], second: tuple[str, RepeatedMaps | None]
) -> RepeatedMaps | None:
    """The maps of two studies over the same axes, by their names; of a map each also their difference, the last.

    Cells of the second open no runs. None if neither repeats; raises `UsageError` if only one does, or over other axes.
    """
    (name, one), (name_of_other, other) = first, second
    if one is None and other is None:
        return None
    if one is None or other is None or (one.across, one.up) != (other.across, other.up):
        raise UsageError(f"{name_of_other}: expected the same design.repeat and order of axes as {name}, to draw both")
    others = [replace(each, cells=tuple(replace(cell, runs=()) for cell in each.cells)) for each in other.maps]
    named = [(name, each) for each in one.maps] + [(name_of_other, each) for each in others]
    maps = [replace(each, title=f"{of}: {each.title}") for of, each in named]
    if len(one.maps) == len(others) == 1:
        title = f"difference, {name_of_other} minus {name}"
        maps.append(CellMap(title=title, is_difference=True, cells=tuple(_minus(others[0], one.maps[0]))))
    return replace(one, maps=tuple(maps))


def _minus(one: CellMap, other: CellMap) -> Iterator[MapCell]:
    """The cells of a map minus those of another, whose runs they have."""
    known = {(cell.x, cell.y): cell for cell in one.cells}
    for cell in other.cells:
        if (above := known.get((cell.x, cell.y))) is not None:
            low, high = interval_of_difference(*map(_as_share, (above, cell)))
            yield _cell((cell.x, cell.y), (above.value - cell.value, low, high), cell.runs, None)


def _as_share(cell: MapCell) -> dict[str, float]:
    low, high = (math.nan if end is None else end for end in (cell.low, cell.high))
    return {"share": cell.value, "low": low, "high": high}


def _cells(
    found: "pd.DataFrame", across: ColumnAxis, up: ColumnAxis, table: "pd.DataFrame", by: list[str], word: str | None
) -> list[MapCell]:
    """Cells of shares that are `word`, or of differences; their runs have the same values of the axes `by`."""
    runs = table.groupby(by)["design_index"].agg(list).to_dict()
    cells = []
    for row in found.to_dict("records"):
        key = tuple(row[name] for name in by)
        value, low, high = (row[name] for name in ("difference" if word is None else "share", "low", "high"))
        place = (float(across.quantity.of(row[across.name])), _value(up, row[up.name]))
        counts = None if word is None else (row["good"], row["count"], word)
        cells.append(_cell(place, (value, low, high), tuple(map(int, runs[key])), counts))
    return cells


def _cell(
    place: tuple[float, float | str],
    share: tuple[float, float, float],
    runs: tuple[int, ...],
    counted: tuple[int, int, str] | None,
) -> MapCell:
    """A cell with a share, or without counts a difference, and the ends of its interval, nan if it has none."""
    value, low, high = share
    is_exact, word = math.isnan(low), None if counted is None else counted[2]
    exact = "nothing is random" if is_exact else f"95 % interval {_shown(low, word)} to {_shown(high, word)}"
    counts = "" if counted is None else "{} of {} {}: ".format(*counted)
    return MapCell(
        x=place[0], y=place[1], value=value, low=None if is_exact else low, high=None if is_exact else high,
        text=_shown(value, word) if counted is None or is_exact else "{}/{}".format(*counted),
        said=f"{counts}{_shown(value, word)}, {exact}", runs=runs,
    )  # fmt: skip


def _value(axis: ColumnAxis, value: Any) -> float | str:
    return float(axis.quantity.of(value)) if is_number(value) else str(value)


def _shown(value: float, word: str | None) -> str:
    return f"{100.0 * value:+.0f} %" if word is None and value else f"{100.0 * value:.0f} %"


def _short(law: str) -> str:
    return law.rpartition("/")[2]
