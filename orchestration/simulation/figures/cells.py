"""Maps drawn cell by cell: only cells with runs are coloured."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.patches import Patch, Rectangle

from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures.lines import plain
from orchestration.simulation.figures.palette import GREY, RED, SHADES
from orchestration.simulation.figures.shades import shades_of

LIMIT = {"colors": RED, "linewidths": 1.8}
"""Style of the line between good and other cells"""
FEW = 6
"""Most values of an axis that all have a tick"""
MISSING, NO_PAIRS, NO_MEAN, UNKNOWN = "////", "xxx", r"\\\\", ".."
"""Hatches of cells without a run, without a pair of runs, without a finite expectation, and where none is known"""
_HATCHED: Mapping[str, Any] = {"facecolor": "none", "edgecolor": GREY, "linewidth": 0.0}


def edges(values: Sequence[float] | Floats, *, logarithmic: bool = False) -> Floats:
    """Edges of cells around increasing values, half-way between neighbours; shape (n + 1,)."""
    at = np.log(np.asarray(values, float)) if logarithmic else np.asarray(values, float)
    if len(at) == 1:
        around = np.array([at[0] - 0.5, at[0] + 0.5])
    else:
        inner = 0.5 * (at[1:] + at[:-1])
        around = np.array([1.5 * at[0] - 0.5 * at[1], *inner, 1.5 * at[-1] - 0.5 * at[-2]])
    return np.exp(around) if logarithmic else around


def fill(panel: Axes, x: Floats, y: Floats, values: Floats, *, of: Floats | None = None, **how: Any) -> Any:
    """Colour cells between edges `x` and `y` by `values`, shape (rows, columns); none where they are nan.

    The range of the colours is that of `shades_of` these, or the values `of` all panels, or starts at `vmin`. Returns
    the mesh for a colour bar.
    """
    if "vmin" not in how and (shades := shades_of(values if of is None else of)) is not None:
        how["norm"] = (LogNorm if shades.logarithmic else Normalize)(shades.low, shades.high)
    panel.grid(False)
    mesh = panel.pcolormesh(
        x, y, np.ma.masked_invalid(values), shading="flat", **{"cmap": SHADES, "rasterized": True, **how}
    )
    panel.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    return mesh


def name_cells(panel: Axes, x: Floats | None = None, y: Floats | None = None) -> None:
    """Ticks at the values of the cells of a linear axis where these are few, not at places between them."""
    for axis, values in ((panel.xaxis, x), (panel.yaxis, y)):
        if values is not None and len(values) <= FEW and axis.get_scale() == "linear":
            axis.set_ticks([*values])


def color_bar(panels: Sequence[Axes], mesh: Any, values: Floats, label: str, **how: Any) -> None:
    """Add a colour bar for `values`, with an arrow where some lie beyond; nothing without finite values."""
    shades = shades_of(values)
    if shades is not None:
        ends = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
        figure = panels[0].get_figure()
        bar = figure.colorbar(mesh, ax=[*panels], label=label, extend=ends[shades.leaves_out], **how)  # type: ignore[union-attr]
        plain(bar.ax.yaxis if bar.orientation == "vertical" else bar.ax.xaxis)


def fill_kinds(panel: Axes, x: Floats, y: Floats, kinds: Floats, colors: Sequence[str]) -> None:
    """Colour cells by category: 0 the first colour and so on; none where nan."""
    fill(panel, x, y, kinds, cmap=ListedColormap([*colors]), vmin=-0.5, vmax=len(colors) - 0.5)


def hatch(panel: Axes, x: Floats, y: Floats, where: npt.NDArray[np.bool_], how: str = MISSING) -> None:
    """Hatch the cells without a value."""
    cells = [Rectangle((x[j], y[i]), x[j + 1] - x[j], y[i + 1] - y[i]) for i, j in zip(*np.nonzero(where), strict=True)]
    if cells:
        panel.add_collection(PatchCollection(cells, hatch=how, **_HATCHED))


def hatched(label: str = "missing", how: str = MISSING) -> Patch:
    """The legend entry of hatched cells."""
    return Patch(label=label, hatch=how, **_HATCHED)


def limit(panel: Axes, x: Floats, y: Floats, good: Floats, **how: Any) -> LineCollection | None:
    """A line along the edges between good cells and neighbours that are not good; None if there are none.

    `good` is 1, 0, or nan where it is not known, shape (rows, columns).
    """
    segments = [
        [(x[j + 1], y[i]), (x[j + 1], y[i + 1])] for i, j in zip(*np.nonzero(_differ(good[:, :-1], good[:, 1:])))
    ] + [[(x[j], y[i + 1]), (x[j + 1], y[i + 1])] for i, j in zip(*np.nonzero(_differ(good[:-1], good[1:])))]
    if not segments:
        return None
    drawn = LineCollection(segments, capstyle="projecting", **{**LIMIT, **how})
    panel.add_collection(drawn)
    return drawn


def _differ(one: Floats, other: Floats) -> npt.NDArray[np.bool_]:
    return np.asarray((one != other) & ~np.isnan(one) & ~np.isnan(other))
