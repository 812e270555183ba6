"""The pictures of a comparison: basins, shares and limits with intervals, fronts."""

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from orchestration.experiments.comparison.cells import FATES, WORDS, sizes, tables_of_maps
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, VEHICLE, Comparison
from orchestration.experiments.comparison.figures import BINS, Reach, basins, colors_of, fronts_of, limits_of, shares
from orchestration.experiments.comparison.fronts import Point
from orchestration.experiments.comparison.limits import GridLimit
from orchestration.experiments.comparison.outcome import Outcome
from orchestration.experiments.studies.axes import Axis, quantity_of
from orchestration.experiments.studies.cell_maps import cell_maps
from orchestration.experiments.studies.figures import save
from orchestration.experiments.studies.shares import GOOD
from orchestration.foundation.basics.simulator import Integers
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results import display_names as labels

if TYPE_CHECKING:
    import pandas as pd

MAX_PANELS = 6


Picture = tuple[str, Callable[[Style], Figure]]
"""The name of a figure, and what makes it"""


def draw(
    comparison: Comparison,
    outcome: Outcome,
    table: "pd.DataFrame",
    folder: Path,
    style: Style = SCREEN,
    *,
    units: Mapping[str, str],
) -> list[Path]:
    """Draw all pictures into a folder; their paths. `units` are those of the store, by name of axis and metric."""
    pictures = _pictures(comparison, outcome, table, units)
    return [path for name, make in pictures for path in save(make, folder / name, style)]


def figures_of(
    comparison: Comparison, outcome: Outcome, table: "pd.DataFrame", style: Style, *, units: Mapping[str, str]
) -> dict[str, Figure]:
    """The figures of all pictures, by name."""
    with style.applied():
        return {name: make(style) for name, make in _pictures(comparison, outcome, table, units)}


def _pictures(
    comparison: Comparison, outcome: Outcome, table: "pd.DataFrame", units: Mapping[str, str]
) -> Iterator[Picture]:
    axis, done = quantity_of(comparison.axis, units), table[table["status"] == "done"]
    if comparison.second is not None:
        yield from _maps(comparison, comparison.second, table, units)
    else:
        for (vehicle, condition), rows in done.groupby([VEHICLE, CONDITION], sort=False):
            yield from _of_one(comparison, units, outcome, rows, (vehicle, condition))
    if outcome.limits:
        reaches, in_seconds = reaches_of(comparison, outcome.limits), comparison.is_in_seconds
        yield "limits", partial(limits_of, reaches, axis, in_seconds)


def _of_one(
    comparison: Comparison, units: Mapping[str, str], outcome: Outcome, rows: "pd.DataFrame", of: tuple[str, str]
) -> Iterator[Picture]:
    """The pictures of one vehicle under one condition."""
    axis, colors = quantity_of(comparison.axis, units), colors_of([one.name for one in comparison.controllers])
    summaries = [cell for cell in outcome.cells if (cell.vehicle, cell.condition) == of]
    points = [point for point in outcome.fronts if (point.vehicle, point.condition) == of and _is_known(point)]
    several = (len(comparison.vehicles) > 1, len(comparison.conditions) > 1)
    title, end = ", ".join(name for name, is_one_of in zip(of, several) if is_one_of), _file_name(of)
    for fate in FATES:
        by_size = {
            name: (comparison.values, _by_size(comparison, group, fate))
            for name in colors
            if len(group := rows[rows[CONTROLLER] == name])
        }
        yield f"basin_{fate}_{end}", partial(basins, by_size, axis, fate, title)
    two = [pair for pair in outcome.pairs if (pair.vehicle, pair.condition) == of] if len(colors) == 2 else []
    yield f"shares_{end}", partial(shares, {title: summaries}, axis, colors, pairs=two)
    if points:
        values = [*dict.fromkeys(point.value for point in points)]
        shown = [values[round(i)] for i in np.linspace(0, len(values) - 1, min(len(values), MAX_PANELS))]
        front = comparison.front
        names = tuple(labels.metric_with_unit(metric, units.get(metric)) for metric in (front.effort, front.error))
        yield f"front_{end}", partial(fronts_of, points, shown, axis, names, colors, title)


def _maps(comparison: Comparison, second: Axis, table: "pd.DataFrame", units: Mapping[str, str]) -> Iterator[Picture]:
    """The share that survives, and that settles, over both axes, for each vehicle under each condition of the file."""
    laws = Axis(name=CONTROLLER, targets=(), values=tuple(one.name for one in comparison.controllers))
    for of, fate, rows in tables_of_maps(comparison, table):
        draw = partial(_map, rows, (comparison.axis, second), laws, WORDS[fate], units)
        yield f"map_{fate}_{_file_name(of)}", draw


def _map(
    table: "pd.DataFrame",
    axes: tuple[Axis, Axis],
    laws: Axis,
    words: tuple[str, str],
    units: Mapping[str, str],
    style: Style,
) -> Figure:
    return cell_maps(table, axes, laws, GOOD, words, units=units, style=style)


def _file_name(names: Iterable[str]) -> str:
    return "_".join(re.sub(r"[^\w.-]+", "_", name) for name in names)


def reaches_of(comparison: Comparison, limits: Sequence[GridLimit]) -> list[Reach]:
    """The limits of each controller, on each vehicle and under each condition if there are several."""
    several = (len(comparison.vehicles) > 1, len(comparison.conditions) > 1)
    groups = itertools.groupby(limits, lambda one: (one.vehicle, one.condition, one.controller))
    return [
        Reach(
            name=", ".join((key[2], *(name for name, is_one_of in zip(key, several) if is_one_of))),
            limits=[*group],
            last=float(comparison.values[-1]),
        )
        for key, group in groups
    ]


def _by_size(comparison: Comparison, rows: "pd.DataFrame", fate: str) -> Integers:
    """How many survive, or settle, of how many, by bin of the size of the initial error and value of the axis."""
    bins = (BINS * sizes(comparison, rows).to_numpy(float)).astype(int).clip(max=BINS - 1)
    places = rows[comparison.axis.name].map({value: k for k, value in enumerate(comparison.values)})
    counts = np.zeros((BINS, len(comparison.values), 2), int)
    np.add.at(
        counts, (bins, places.to_numpy(int)), np.column_stack([FATES[fate](rows), np.ones(len(rows))]).astype(int)
    )
    return counts


def _is_known(point: Point) -> bool:
    return point.error.value is not None and point.effort.value is not None
