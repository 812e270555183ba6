"""Draws the icons of the FMUs, model.png, beside their slaves: run as `make figures`."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Polygon
from PIL import Image

from orchestration.simulation.figures.palette import BLUE, ORANGE

ROOT = Path(__file__).parent.parent
PIXELS = 256
COLOURS = 64
"""Colours of the palette: enough for smooth edges, and a file of a few kilobytes"""
PALE, DARK = "#f3f7fa", "#33414d"


def main() -> None:
    """Draw all icons."""
    for place, draw in (
        ("controller_fmu/sliding_mode/UnifiedController", controller),
        ("controller_fmu/geometric/GeometricController", geometric),
        ("controller_fmu/cascaded/CascadedController", cascade),
        ("plant_fmu/QuadrotorPlant", plant),
    ):
        figure = Figure(figsize=(1.0, 1.0), dpi=PIXELS)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0))
        axes.axis("off")
        draw(axes)
        target = ROOT / f"{place}.png"
        figure.savefig(target, transparent=True)
        with Image.open(target) as image:
            small = image.quantize(COLOURS)
        small.save(target, optimize=True)


def controller(axes: Axes) -> None:
    """A signal, and its held samples, as of a sampled controller."""
    _tile(axes, BLUE)
    t = np.linspace(-0.74, 0.74, 200)
    samples = np.linspace(-0.74, 0.74, 6)
    signal = 0.45 * np.sin(2.6 * t - 0.2) + 0.12 * np.sin(6.0 * t)
    held = np.interp(samples, t, signal)
    held[-1] = held[-2]  # the picture ends before the next sample
    axes.plot(t, signal, color="white", linewidth=1.0, alpha=0.6)
    axes.step(samples, held, where="post", color=PALE, linewidth=2.2)
    axes.plot(
        samples[:-1], held[:-1], "o", color=ORANGE, markersize=5.0, markeredgecolor=PALE, markeredgewidth=0.8
    )  # fmt: skip


def geometric(axes: Axes) -> None:
    """The axes of the body, and the great circle to the desired axes."""
    _tile(axes, BLUE)
    angles = np.linspace(0.0, 2.0 * np.pi, 100)
    axes.plot(0.66 * np.cos(angles), 0.66 * np.sin(angles), color="white", linewidth=1.0, alpha=0.6)
    for angle in np.radians((90.0, 205.0, 330.0)):
        axes.plot((0.0, 0.66 * np.cos(angle)), (0.0, 0.66 * np.sin(angle)), color=PALE, linewidth=2.2)
    way = np.radians(np.linspace(90.0, 42.0, 40))
    x, y = 0.66 * np.cos(way), 0.66 * np.sin(way)
    axes.plot(x, y, color=ORANGE, linewidth=2.2)
    axes.plot((0.0, x[-1]), (0.0, y[-1]), color=ORANGE, linewidth=2.2)
    axes.plot(x[-1], y[-1], "o", color=ORANGE, markersize=5.0, markeredgecolor=PALE, markeredgewidth=0.8)


def cascade(axes: Axes) -> None:
    """Loops one above the other, each sampled more often than the one above it."""
    _tile(axes, BLUE)
    t = np.linspace(-0.74, 0.74, 200)
    for height, count in ((0.5, 3), (0.0, 6), (-0.5, 14)):
        samples = np.linspace(-0.74, 0.74, count + 1)
        signal = height + 0.2 * np.sin(4.2 * t + 0.5)
        held = np.interp(samples, t, signal)
        held[-1] = held[-2]
        axes.plot(t, signal, color="white", linewidth=0.8, alpha=0.5)
        axes.step(samples, held, where="post", color=PALE, linewidth=1.8)
        axes.plot(samples[:-1], held[:-1], "o", color=ORANGE, markersize=2.8)


def plant(axes: Axes) -> None:
    """The vehicle from above, an arrow at its front."""
    _tile(axes, PALE)
    for x, y in ((-0.44, -0.44), (-0.44, 0.44), (0.44, -0.44), (0.44, 0.44)):
        axes.add_patch(Circle((x, y), 0.33, facecolor="#bcd4e2", edgecolor=BLUE, linewidth=1.6))
        axes.plot((0.0, x), (0.0, y), color=DARK, linewidth=3.5, solid_capstyle="round")
    body = (-0.12, -0.17), 0.24, 0.34
    axes.add_patch(FancyBboxPatch(*body, boxstyle="round,pad=0.08", facecolor=DARK, edgecolor="none", zorder=3))
    axes.add_patch(Polygon(((-0.12, 0.02), (0.12, 0.02), (0.0, 0.21)), facecolor=ORANGE, zorder=4))


def _tile(axes: Axes, colour: str) -> None:
    """The background of the icon, in its own colour so that it is visible on light and dark."""
    tile = (-0.76, -0.76), 1.52, 1.52
    axes.add_patch(FancyBboxPatch(*tile, boxstyle="round,pad=0.2", facecolor=colour, edgecolor=BLUE, linewidth=1.2))


if __name__ == "__main__":
    main()
