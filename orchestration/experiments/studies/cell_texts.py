"""Words and numbers in figures of cells, and the groups of cells that each has a line or a panel of."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from orchestration.experiments.studies.axes import Axis, names_of, quantity_of
from orchestration.experiments.studies.shares import GOOD, MEAN, WITH_VALUE, TwoLaws
from orchestration.simulation.figures.palette import BLACK
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results import display_names as labels

if TYPE_CHECKING:
    import pandas as pd

HALF = 0.5
"""Share at which a map has its line"""
MAX_LETTERS = 120
"""Most letters of a row of cells, over all panels, with a space after each: more do not fit into a figure"""
OF_ALL, ALONE, MARKED = "{}/{}", "{}", "{}  •  −"
"""Texts of the number of good runs in a cell, of all or, where there is less room, alone; of pairs, with their marks"""


def names_in(*axes: Axis | None) -> list[str]:
    """The names of some axes, of those that are there."""
    return [axis.name for axis in axes if axis is not None]


def groups_along(
    table: "pd.DataFrame", axis: Axis | None, units: Mapping[str, str]
) -> "list[tuple[str, pd.DataFrame]]":
    """The cells of each value of an axis, with its name: of laws in their order; without an axis all of them."""
    if axis is None:
        return [("", table)]
    of, values = quantity_of(axis, units), axis.values or ()
    named = names_of(values)
    if axis.is_numeric:
        named = {value: f"{of.name} {of.text_of(float(value))}" for value in sorted(map(float, values))}
    return [(name, table[table[axis.name] == value]) for value, name in named.items()]


def two_laws(axis: Axis | None) -> TwoLaws | None:
    """The two laws of an axis of two names, of which there is a difference; None: it is no such axis."""
    if axis is None or axis.is_numeric or len(axis.values or ()) != 2:
        return None
    return TwoLaws(axis.name, *map(str, axis.values or ()))


def letters_of(style: Style, columns: int) -> float:
    """The letters of numbers in cells that fit side by side into one of several panels abreast."""
    return MAX_LETTERS * min(1.0, style.width / style.font * SCREEN.font / SCREEN.width) / columns


def write_counts(
    panel: Axes, x: Iterable[float], y: Iterable[float], good: Iterable[int], count: Iterable[int], form: str
) -> None:
    """Write into the cells at `x` and `y` how many runs are good, in one of the forms of such texts."""
    for across, up, some, all_ in zip(x, y, good, count):
        color = "white" if some < HALF * all_ else BLACK
        panel.text(across, up, form.format(some, all_), color=color, ha="center", va="center", fontsize="x-small")


def numbers_averaged(cells: "pd.DataFrame", of: "pd.Series") -> "pd.Series":
    """The number of runs averaged, with that of all where they are fewer."""
    counts = cells[WITH_VALUE].astype(str)
    return counts.where(cells[WITH_VALUE] == of, counts + "/" + of.astype(str))


def title_of(
    metric: str, words: tuple[str, str], units: Mapping[str, str], average: str, *, numbered: bool, repeats: bool
) -> str:
    """The title of what is drawn of cells, and of the numbers in them."""
    if metric == GOOD:
        return f"share of {words[0]} runs" + (", and their number" if numbered else "")
    named = labels.metric_with_unit(metric, units.get(metric))
    if not repeats:
        return named if average == MEAN else f"{named},\nwhere {words[0]}"
    good = "" if average == MEAN else f"{words[0]} "
    return f"{average} of {named},\n{'number of' if numbered else 'of the'} {good}runs with a value"


def repetitions(cells: "pd.DataFrame", metric: str) -> str:
    """The number of runs of a cell, and how wide the intervals of their shares are; empty where none repeats."""
    counts = cells["count"][cells["low"].notna()]
    fewest, most = counts.min(), counts.max()
    if not most > 1:
        return ""
    runs = f"{fewest}" if fewest == most else f"{fewest} to {most}"
    width = (cells["high"] - cells["low"]).max()
    alike = "; one where nothing is random" if cells["low"].isna().any() else ""
    known = metric == GOOD and np.isfinite(width)
    return f"{runs} runs a cell{alike}" + (f"; Wilson intervals at 95 % up to {width:.2f} wide" if known else "")
