"""Maps of a metric of a study over two axes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.axis_labels import SCALES, edges, quantity_of
from orchestration.experiments.studies.figures import by_horizon, good_runs
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures import cells
from orchestration.simulation.figures.palette import DIVERGED as DARK
from orchestration.simulation.figures.palette import NOT_GOOD, RED, SHADES
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results import display_names as labels
from orchestration.systems.system.model import DIVERGED, TERMINATED

if TYPE_CHECKING:
    import pandas as pd


def heat_map(
    table: "pd.DataFrame",
    axes: tuple[Axis, ...],
    metric: str,
    words: tuple[str, str],
    *,
    units: Mapping[str, str],
    style: Style = SCREEN,
) -> Figure:
    """A metric where runs are good, the outcome elsewhere, and the limit between the two; missing runs are hatched.

    If none is good, it is the metric of those that have not diverged.

    The legend lists the outcomes that occur.
    """
    kinds = {words[0]: 0, words[1]: 1, TERMINATED: 1, DIVERGED: 2}
    coded = table.assign(good_run=good_runs(table).astype(float), kind=table["outcome"].map(kinds).astype(float))
    coded.loc[table["outcome"].isna(), "good_run"] = np.nan
    values, good, kind = (_grid(coded, axes, name) for name in (metric, "good_run", "kind"))
    across, up = (quantity_of(axis, units) for axis in axes[:2])
    x, y = (edges(axis, each.of(coded[axis.name])) for axis, each in zip(axes, (across, up)))
    figure = style.figure(36.0)
    panel = figure.add_subplot()
    cells.fill_kinds(panel, x, y, np.where(kind > 0.0, kind - 1.0, np.nan), (NOT_GOOD, DARK))
    valued = 0 if (good > 0.5).any() else 1
    shown = np.where(kind == valued, values, np.nan)
    mesh = cells.fill(panel, x, y, shown)
    cells.hatch(panel, x, y, np.isnan(kind))
    has_limit = cells.limit(panel, x, y, good) is not None
    panel.set(xlabel=across.title, ylabel=up.title, xscale=SCALES[axes[0].scale], yscale=SCALES[axes[1].scale])
    cells.name_cells(panel, *(each.of(np.unique(coded[axis.name])) for axis, each in zip(axes, (across, up))))
    named = labels.metric_with_unit(metric, units.get(metric))
    cells.color_bar(panel, mesh, shown, f"{named}, where {words[valued]}")
    outcomes = {*table["outcome"].dropna()}
    bad = " or ".join(word for word in (words[1], TERMINATED) if word in outcomes)
    shade = matplotlib.colormaps[SHADES](0.5)
    handles: list[Patch | Line2D] = [
        Patch(color=color, label=word)
        for word, color in (
            (words[0], shade),
            (bad, shade if valued and np.isfinite(shown).any() else NOT_GOOD),
            (DIVERGED, DARK),
        )
        if word and (word == bad or word in outcomes)
    ]
    handles += [cells.hatched()] if np.isnan(kind).any() else []
    handles += [Line2D([], [], color=RED, label=f"limit of what is {words[0]}{by_horizon(table)}")] if has_limit else []
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles) if style.is_wide else 2)
    return figure


def _grid(table: "pd.DataFrame", axes: tuple[Axis, ...], name: str) -> Floats:
    """Values by cell, shape (values of the second axis, values of the first); nan where there is no run."""
    grid: Floats = table.pivot_table(index=axes[1].name, columns=axes[0].name, values=name, dropna=False).to_numpy(
        float
    )
    return grid
