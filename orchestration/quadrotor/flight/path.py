"""The flight in space."""

import itertools
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from fmu_kit.frames import Frame
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios.nominal_model import frame_of
from orchestration.quadrotor.scenarios.wiring import POSITION, POSITION_REFERENCE
from orchestration.simulation.figures.drawn_run import DrawnRun, title
from orchestration.simulation.figures.lines import abreast
from orchestration.simulation.figures.palette import ORANGE
from orchestration.simulation.figures.style import Style

ROUNDS = 4
"""iterations of the layout, after which changes are invisible"""
MIN_SIDE = 0.45
"""shortest side of the box as a share of the longest"""


def path(runs: Sequence[DrawnRun], style: Style) -> Figure:
    """The path of the vehicle and its reference, with equal scales of the axes and up upwards."""
    figure, axes = stage(runs, style)
    if style.has_titles:
        figure.suptitle(title(runs))
    fill(figure, axes, crops=style.height is None)
    return figure


def stage(runs: Sequence[DrawnRun], style: Style) -> tuple[Figure, Any]:
    """A figure with paths in space and its legend, and the axes, which do not `fill` it yet."""
    figure = style.figure(38.0, width=0.75 if style.is_wide else 1.0)
    figure.set_layout_engine("none")
    axes = figure.add_subplot(projection="3d")
    draw_in_space(axes, runs, style)
    handles, names = axes.get_legend_handles_labels()
    if len(runs) > 1:
        handles += [Line2D([], [], color=run.color, linestyle=run.dashes) for run in runs]
        names += [run.name for run in runs]
    figure.legend(handles, names, loc="lower center", ncols=abreast(names, style, width=0.75))
    return figure, axes


def fill(figure: Figure, axes: Any, *, crops: bool = False) -> None:
    """Enlarge the axes to the room between title and legend; `crops`: reduce the height of the figure to their need.

    The labels of three-dimensional axes do not scale with them, so this iterates, with the axes alone: their lines, and
    what else is in the figure, have no part in it.
    """
    width, height = (float(side) for side in figure.get_size_inches() * figure.dpi)
    (legend,) = figure.legends
    low, high = (float(y) for y in legend.get_window_extent().intervaly)
    air = 0.5 * low
    bottom, top = high + air, height - air
    if figure.get_suptitle():
        top -= figure.texts[0].get_window_extent().height + 2.0 * air
    room, center = np.array([width - 2.0 * air, top - bottom]), np.array([0.5 * width, 0.5 * (top + bottom)])
    side, middle = float(room.min()), center
    hidden = [artist for artist in (*axes.get_lines(), *figure.legends, *figure.texts) if artist.get_visible()]
    for artist in hidden:
        artist.set_visible(False)
    for _ in range(ROUNDS):
        left, low = (middle - 0.5 * side).tolist()
        axes.set_position((left / width, low / height, side / width, side / height))
        figure.draw_without_rendering()
        seen = extent(axes)
        middle = middle + center - 0.5 * np.array([seen.x0 + seen.x1, seen.y0 + seen.y1])
        larger = float((room / np.array([seen.width, seen.height])).min())
        side *= larger
        if crops:
            spare = np.array([0.0, room[1] - larger * seen.height])
            room, center, middle, height = room - spare, center - 0.5 * spare, middle - 0.5 * spare, height - spare[1]
            figure.set_figheight(height / figure.dpi)
    left, low = (middle - 0.5 * side).tolist()
    axes.set_position((left / width, low / height, side / width, side / height))
    for artist in hidden:
        artist.set_visible(True)


def extent(axes: Any) -> Bbox:
    """The extent of the box with its content and the labels of its axes, in pixels."""
    corners = np.array([*itertools.product(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())])
    projected = np.column_stack([corners, np.ones(len(corners))]) @ axes.get_proj().T
    labels = [axis.get_tightbbox() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    seen = axes.transData.transform(projected[:, :2] / projected[:, 3:])
    return Bbox.union([*labels, Bbox([seen.min(axis=0), seen.max(axis=0)])])


def draw_in_space(axes: Any, runs: Sequence[DrawnRun], style: Style) -> None:
    """Draw paths and references on existing three-dimensional axes."""
    paths = [run.stacked([f"plant.{name}" for name in POSITION]) for run in runs]
    references = [run.stacked(POSITION_REFERENCE) for run in runs]
    for i, points in enumerate(references):
        if not any(np.array_equal(points, other) for other in references[:i]):
            rests = not np.ptp(points, axis=0).any()
            axes.plot(
                *(points[:1] if rests else points).T, "D" if rests else "-", color=ORANGE,
                linewidth=3.5 * style.line, alpha=0.6, zorder=1, label="reference" if i == 0 else None,
            )  # fmt: skip
    for run, points in zip(runs, paths, strict=True):
        label = "flown" if len(runs) == 1 else None
        axes.plot(*points.T, color=run.color, linestyle=run.dashes, label=label, zorder=2)
        for place, marker, what in ((0, "o", "start"), (-1, "s", "end")):
            axes.plot(
                *points[place, :, None], marker, color=run.color, zorder=3, label=what if run.place == 0 else None,
                markerfacecolor="white" if what == "start" else run.color,
            )  # fmt: skip
    is_enu = frame_of(runs[0].parameters, "plant") == Frame.ENU
    _equal(axes, np.concatenate([*paths, *references]), is_enu=is_enu, is_wide=style.is_wide)
    names = ("east", "north", "up") if is_enu else ("north", "east", "down")
    axes.set(**{f"{axis}label": f"{axis}, {name} [m]" for axis, name in zip("xyz", names, strict=True)})
    axes.view_init(elev=24, azim=-50)


def _equal(axes: Any, points: Floats, *, is_enu: bool, is_wide: bool) -> None:
    """Equal scales in a box that holds all points; x to the viewer's right, up upwards."""
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = 0.5 * (low + high), 1.08 * (high - low)
    size = np.maximum(size, max(MIN_SIDE * float(size.max()), 1e-6))
    starts, ends = middle - 0.5 * size, middle + 0.5 * size
    axes.set(xlim=(starts[0], ends[0]), ylim=(starts[1], ends[1]), zlim=(starts[2], ends[2]))
    if not is_enu:
        axes.invert_yaxis()
        axes.invert_zaxis()
    axes.set_box_aspect(size, zoom=0.95 if is_wide and size[2] < size[:2].max() else 0.8)  # labels have room
    for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), size / size.max()):
        axis.set_major_locator(MaxNLocator(max(2, round(6 * share))))
        axis.labelpad = 1.2 * matplotlib.rcParams["font.size"] - 8.0  # [pt]; large numbers are long
    if is_enu:
        axes.zaxis.labelpad += 0.8 * matplotlib.rcParams["font.size"]  # upward, numbers lie where the name is
