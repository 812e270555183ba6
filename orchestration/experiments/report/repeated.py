"""The maps of runs that repeat in cells: shares with their intervals, and differences of two laws or two studies."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from orchestration.experiments.report.model import CellMap, MapCell, RepeatedMaps
from orchestration.experiments.report.tables import ColumnAxis, Row
from orchestration.experiments.studies.axes import names_of
from orchestration.experiments.studies.shares import TwoLaws, differences_of, laws_of, shares_of, with_chance
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.requirements import is_number

if TYPE_CHECKING:
    import pandas as pd

STUDY, FIRST, SECOND = "study it is of", "first", "second"
"""Column of the runs of two studies, and its values"""


@dataclass(frozen=True, kw_only=True)
class RunsInCells:
    """Runs over two axes, and an axis of names that has a map for each, if there is one."""

    table: "pd.DataFrame"
    """the finished ones, as `with_chance` makes it"""
    across: ColumnAxis
    up: ColumnAxis
    law: str | None
    word: str
    """the name of the outcome of a good run"""
    repeat: str
    """the axis that repeats"""

    @property
    def by(self) -> list[str]:
        """The axes of the cells."""
        return [self.across.name, self.up.name, *([] if self.law is None else [self.law])]


def runs_in_cells(study: Study | None, rows: Sequence[Row], axes: Sequence[ColumnAxis]) -> RunsInCells | None:
    """The runs of a study that repeats over two of these axes of numbers, or over one and one of names; else None.

    An axis of names beside two of numbers is that of the laws.
    """
    import pandas as pd

    names = None if study is None else study.cell_names
    if study is None or names is None or study.repeat is None or study.origin.criterion.good is None:
        return None
    if any(axis.values is None for axis in study.axes):
        return None
    known = {axis.name: axis for axis in axes}
    numeric = [axis.name for axis in study.cell_axes if axis.is_numeric]
    named = [name for name in names if name not in numeric]
    if (len(numeric), len(named)) not in ((2, 0), (2, 1), (1, 1)) or not known.keys() >= {*names}:
        return None
    columns = ("status", "good", "design_index")
    table = pd.DataFrame([{**row["settings"], **{name: row[name] for name in columns}} for row in rows])
    return RunsInCells(
        table=with_chance(table[table["status"] == "done"], study),
        across=known[numeric[0]],
        up=known[(numeric + named)[1]],
        law=named[0] if len(numeric) == 2 and named else None,
        word=study.origin.criterion.outcomes[0],
        repeat=study.repeat,
    )


def repeated_maps(runs: RunsInCells | None) -> RepeatedMaps | None:
    """A map of each law, and of two laws one of their difference, the last."""
    if runs is None:
        return None
    laws = None if runs.law is None else laws_of(runs.table, runs.by)
    differences = [] if laws is None else [difference_map(runs, laws)]
    return RepeatedMaps(
        across=runs.across.name, up=runs.up.name, maps=(*share_maps(runs, f"share {runs.word}"), *differences)
    )


def maps_of_both(first: tuple[str, RunsInCells | None], second: tuple[str, RunsInCells | None]) -> RepeatedMaps | None:
    """The maps of two studies over the same axes, by their names, and last those of their difference, one of each law.

    Cells open runs of the first, and list those of the second. None if neither repeats; raises `UsageError` if only one
    does, or over other axes.
    """
    import pandas as pd

    (name, one), (name_of_other, other) = first, second
    if one is None and other is None:
        return None
    if one is None or other is None or (one.by, one.repeat) != (other.by, other.repeat):
        raise UsageError(f"{name_of_other}: expected the same design.repeat and order of axes as {name}, to draw both")
    both = pd.concat([one.table.assign(**{STUDY: FIRST}), other.table.assign(**{STUDY: SECOND})], ignore_index=True)
    differences = differences_of(both, [STUDY, *one.by], TwoLaws(STUDY, FIRST, SECOND))
    maps = [
        *share_maps(one, f"{name}: share {one.word}"),
        *share_maps(other, f"{name_of_other}: share {other.word}", is_other=True),
        *_maps(
            one, differences, f"difference, {name_of_other} minus {name}", one.table, other.table, is_difference=True
        ),
    ]
    return RepeatedMaps(across=one.across.name, up=one.up.name, maps=tuple(maps))


def share_maps(runs: RunsInCells, title: str, *, is_other: bool = False) -> list[CellMap]:
    """The shares of good runs in the cells, a map for each law; whether they are those of a second study."""
    none, found = runs.table[:0], shares_of(runs.table, runs.by)
    return _maps(runs, found, title, *((none, runs.table) if is_other else (runs.table, none)))


def difference_map(runs: RunsInCells, laws: TwoLaws, title: str = "difference") -> CellMap:
    """The share of the second law minus that of the first."""
    table = runs.table[runs.table[laws.axis].isin(laws[1:])]
    first, second = names_of(laws[1:]).values()
    title = f"{title}, {second} minus {first}"
    cells = _cells(runs, differences_of(table, runs.by, laws), table, table[:0], is_difference=True)
    return CellMap(title=title, is_difference=True, cells=tuple(cells))


def _maps(
    runs: RunsInCells,
    found: "pd.DataFrame",
    title: str,
    table: "pd.DataFrame",
    others: "pd.DataFrame",
    *,
    is_difference: bool = False,
) -> list[CellMap]:
    """A map for each law of some cells, which open the runs in a table, and list the `others`."""
    each, groups = (found, table, others), [("", found, table, others)]
    if runs.law is not None:
        laws = names_of(runs.table[runs.law].unique())
        groups = [(f", {name}", *(one[one[runs.law] == law] for one in each)) for law, name in laws.items()]
    return [
        CellMap(
            title=title + end,
            is_difference=is_difference,
            cells=tuple(_cells(runs, cells, opened, listed, is_difference=is_difference)),
        )
        for end, cells, opened, listed in groups
    ]


def _cells(
    runs: RunsInCells, found: "pd.DataFrame", table: "pd.DataFrame", others: "pd.DataFrame", *, is_difference: bool
) -> list[MapCell]:
    """Cells of shares, or of differences, of one law or two.

    A cell opens the runs in a table with its two values, and lists the others.
    """
    by = [runs.across.name, runs.up.name]
    opened, listed = (each.groupby(by)["design_index"].agg(list).to_dict() for each in (table, others))
    cells = []
    for row in found.to_dict("records"):
        key = tuple(row[name] for name in by)
        place = (float(runs.across.quantity.of(key[0])), _value(runs.up, key[1]))
        value, low, high = (row[name] for name in ("difference" if is_difference else "share", "low", "high"))
        counts = None if is_difference else (row["good"], row["count"], runs.word)
        own, of_other = (tuple(map(int, indices.get(key, ()))) for indices in (opened, listed))
        cells.append(replace(_cell(place, (value, low, high), own, counts), others=of_other))
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
        text=_shown(value, word) if counted is None else "{}/{}".format(*counted),
        said=f"{counts}{_shown(value, word)}, {exact}", runs=runs,
    )  # fmt: skip


def _value(axis: ColumnAxis, value: Any) -> float | str:
    return float(axis.quantity.of(value)) if is_number(value) else str(value)


def _shown(value: float, word: str | None) -> str:
    return f"{100.0 * value:+.3g} %" if word is None and value else f"{100.0 * value:.3g} %"
