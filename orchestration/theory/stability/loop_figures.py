"""Figures of loops: over the frequency, after a step, and their poles over a quantity."""

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.text import Annotation
from matplotlib.ticker import MultipleLocator

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import in_brackets, quantity
from orchestration.simulation.figures.lines import label_time, plain
from orchestration.simulation.figures.palette import BLACK, BLUE, CYCLE, DASHES, GREY, RED, SHADES
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results.display_names import signal, unit
from orchestration.simulation.results.quantities import Quantity, setting
from orchestration.theory.stability.loop_margins import Bode, LoopMargins, critical_phase
from orchestration.theory.stability.root_locus import RootLocus
from orchestration.theory.stability.step import Step
from orchestration.theory.stability.step_response import StepResponse

SHOWN = 1.4
"""Largest part of a pole that is drawn"""
NEAR, MOST = 2.0, 0.4
"""Half the width of the panel about 1, in distances of the slower half of the poles from it, and at most"""
SHALLOW = 0.1
"""Share of the largest distance of a radius from 1, below which that of another stretch, or 1, is no longer seen"""
CLOSEST = 1e-6
"""Least distance from 1 that has a decade of its own"""
TICKS = 5
"""Most powers of ten with a number on either side of 1"""
LOWEST_PHASE = -720.0
"""Phase down to which it is drawn [°]: that of a long delay falls on and on"""
ANGLES = (15.0, 30.0, 45.0, 90.0, 180.0)
"""Distances of ticks of a phase [°]: the least with which they are few"""
ROWS = 3
"""Most rows of the labels of crossings, above the curve"""
ROW = 0.12
"""Height of one, as a share of that of the curve"""
WIDTH = 0.6
"""Width of a character, as a share of its height"""
CALM = 3.0
"""Settling times of the slowest loop after which the axis of a step ends"""
BELOW_HALF = 0.995
"""Share of half the sampling rate up to which a phase is drawn: there L is real, and where it is all but 0 there its
phase turns in the last pixel"""
LEAST = 1e-12
"""Least gain that is drawn: less is rounding, as of a slow task beyond half its own rate"""

SIDEWAYS: Sequence[dict[str, Any]] = (
    {"xytext": (5.0, 0.0), "va": "center"},
    {"xytext": (-5.0, 0.0), "va": "center", "ha": "right"},
)
ACROSS: Sequence[dict[str, Any]] = (
    {"xytext": (0.0, -3.0), "va": "top", "ha": "center"},
    {"xytext": (0.0, 3.0), "va": "bottom", "ha": "center"},
)
ASIDE: Sequence[dict[str, Any]] = (
    {"xytext": (3.0, 3.0), "va": "bottom"},
    {"xytext": (-3.0, -3.0), "va": "top", "ha": "right"},
    {"xytext": (-3.0, 3.0), "va": "bottom", "ha": "right"},
    {"xytext": (3.0, -3.0), "va": "top"},
)
"""Ways to write beside a point, the last those on either side of a curve"""
PLACES = 15
"""Points of a curve beside which its name may be"""
FAR = 3.0
"""Factor on the distance, and on its further steps, where there is no room"""
Label: TypeAlias = tuple[Axes, str, str, list[tuple[float, float, dict[str, Any]]]]
"""A text with its color, and the points beside which it may be, and in which way, the best first"""


def bode_figure(results: Sequence[Bode], style: Style = SCREEN) -> Figure:
    """The gain of each loop of some components, its phase, and its sensitivity, up to half its sampling rate.

    Lines are gain and phase margins, at their crossovers; each curve of several has its name beside it.
    """
    figure = style.figure(66.0)
    above, middle, below = figure.subplots(3, sharex=True)
    curves = [
        (result.frequencies, gain, phase, output, result.loops[i] if result.stable else None)
        for result in results
        for i, (gain, phase, output) in enumerate(zip(result.gains, result.phases, result.outputs, strict=True))
    ]
    several = len(curves) > 1
    margins, labels = [0.0], list[Label]()
    for i, (frequencies, gain, phase, output, loop) in enumerate(curves):
        color = CYCLE[i % len(CYCLE)]
        how = {"color": color, "linestyle": DASHES[i % len(DASHES)]}
        phase[np.abs(gain) < LEAST] = np.nan
        name, decibels = signal(output, {}), _decibels(np.abs(gain))
        above.plot(frequencies, decibels, **how)
        below_half = frequencies < BELOW_HALF * frequencies[-1]
        middle.plot(frequencies[below_half], phase[below_half], **how)
        below.plot(frequencies, _decibels(np.abs(1.0 / (1.0 + gain))), **how)
        if loop is not None:
            margins.append(critical_phase(loop, frequencies, phase) + min(0.0, loop.phase_margin or 0.0))
            labels += _mark_margins((above, middle), loop, frequencies, phase, color, labelled=not several)
        text = f"{name}\n{_sizes(loop)}" if several and loop is not None else name
        labels.append((above, text, color, _beside(frequencies, decibels)))
    if not all(result.stable for result in results):
        above.set_title("closed, the loop is unstable: it has no margins")
    for axes in (above, below):
        axes.axhline(0.0, color=GREY, linewidth=1.0, linestyle=":")
    middle.axhline(-180.0, color=GREY, linewidth=1.0, linestyle=":")
    lowest, highest = middle.dataLim.intervaly
    lowest = max(lowest, min(LOWEST_PHASE, highest - 360.0, *margins))
    beyond = 0.15 * (highest - lowest)
    low, high = middle.set_ylim(lowest - beyond, highest + beyond)
    for turns in range(math.ceil((low + 180.0) / 360.0), math.floor((high + 180.0) / 360.0) + 1):
        if turns:
            middle.axhline(360.0 * turns - 180.0, color=GREY, linewidth=1.0, linestyle=":")
    middle.yaxis.set_major_locator(MultipleLocator(next((a for a in ANGLES if high - low <= 5.0 * a), ANGLES[-1])))
    which = "the" if len(results) == 1 else "each"
    above.set(ylabel="loop gain |L| [dB]", xscale="log")
    middle.set(ylabel="phase of L [°]")
    below.set(ylabel="sensitivity |1 / (1 + L)| [dB]", xlabel=f"frequency [rad/s], up to half {which} sampling rate")
    lowest, highest = (end(result.frequencies[i] for result in results) for i, end in ((0, min), (-1, max)))
    below.set_xlim(lowest, highest)
    hertz = above.twiny()
    hertz.set(xscale="log", xlabel="frequency [Hz]", xlim=(lowest / math.tau, highest / math.tau))
    hertz.grid(visible=False)
    hertz.spines["top"].set_visible(True)
    for axes in (below, hertz):
        plain(axes.xaxis)
    _label_freely(figure, labels)
    return figure


def _beside(frequencies: Floats, curve: Floats) -> list[tuple[float, float, dict[str, Any]]]:
    """Places for the name of a curve: beside points of it, from its middle to its ends."""
    seen = np.flatnonzero(np.isfinite(curve))
    across = np.log(frequencies[seen])
    at = np.interp(np.linspace(across[0], across[-1], PLACES), across, seen).astype(int) if len(seen) else ()
    nearest = sorted(at, key=lambda k: abs(math.log(frequencies[k] ** 2 / frequencies[0] / frequencies[-1])))
    return [(float(frequencies[k]), float(curve[k]), how) for k in nearest for how in (*ASIDE, *SIDEWAYS)]


def _decibels(gain: Floats) -> Floats:
    return np.asarray(20.0 * np.log10(np.where(gain < LEAST, np.nan, gain)))


def _sizes(loop: LoopMargins) -> str:
    """The margins of a loop below its name, where those of several loops would hide each other."""
    sizes = [f"× {one.factor:.3g}" for one in loop.gain_margins]
    return ", ".join([*sizes, "infinite" if loop.phase_margin is None else f"{loop.phase_margin:.3g}°"])


def _mark_margins(
    panels: tuple[Axes, Axes], loop: LoopMargins, frequencies: Floats, phase: Floats, color: str, *, labelled: bool
) -> list[Label]:
    """The margins as lines at their crossovers, from where they would be none; their sizes, and places for them."""
    above, middle = panels
    lines = [
        (above, at, 0.0, -decibels, f"× {one.factor:.3g} ({decibels:.3g} dB)")
        for one in loop.gain_margins
        for at in [float(np.clip(one.frequency, frequencies[0], frequencies[-1]))]
        for decibels in [20.0 * math.log10(one.factor)]
    ]
    if loop.crossover is not None and loop.phase_margin is not None:
        above.plot(loop.crossover, 0.0, "o", color=color)
        reached = float(np.interp(loop.crossover, frequencies, phase))
        lines.append((middle, loop.crossover, reached - loop.phase_margin, reached, f"{loop.phase_margin:.3g}°"))
    labels = list[Label]()
    for axes, at, none, end, size in lines:
        axes.plot([at, at], [none, end], color=color, linewidth=2.0, clip_on=False)
        if not labelled:
            continue
        near = [(0.5 * (none + end), SIDEWAYS), (none, SIDEWAYS), (end, SIDEWAYS)]
        near.insert(0 if axes is middle else 1, (none, ACROSS if end > none else ACROSS[::-1]))
        far = [(at, none, {**how, "xytext": (0.0, FAR * how["xytext"][1] * k)}) for k in (1, 2, 3) for how in ACROSS]
        labels.append((axes, size, color, [(at, place, how) for place, ways in near for how in ways] + far))
    return labels


def _label_freely(figure: Figure, labels: Sequence[Label]) -> None:
    """Each label at the first of its places where it crosses no line and no other label, or the fewest."""
    figure.draw_without_rendering()  # so that axes have their sizes
    for axes, size, color, places in labels:
        curves = [
            (each.get_transform().transform_path(each.get_path()), 1 if each.get_color() == GREY else 10)
            for each in axes.lines
        ]
        others = [each.get_window_extent() for each in axes.texts]

        def crossed(text: Annotation, curves: Any = curves, others: Any = others, axes: Axes = axes) -> int:
            box = text.get_window_extent()
            inside = axes.bbox.containsx(box.x0) and axes.bbox.containsx(box.x1)
            inside = inside and axes.bbox.containsy(box.y0) and axes.bbox.containsy(box.y1)
            across = sum(weight for path, weight in curves if path.intersects_bbox(box, filled=False))
            return int(across + 10 * box.count_overlaps(others) + (0 if inside else 100))

        texts = [
            axes.annotate(size, (at, place), textcoords="offset points", color=color, **how)
            for at, place, how in places
        ]
        best = min(texts, key=crossed)
        for text in texts:
            if text is not best:
                text.remove()


def step_figure(result: Step, style: Style = SCREEN) -> Figure:
    """What the law takes back of a step that is added to each command, sample by sample."""
    figure = style.figure(38.0)
    axes = figure.add_subplot()
    units = {unit(loop.unit) for loop in result.loops}
    shared = units.pop() if len(units) == 1 else None
    for i, (response, loop) in enumerate(zip(result.responses, result.loops, strict=True)):
        axes.step(
            result.times, response, where="post", color=CYCLE[i % len(CYCLE)], linestyle=DASHES[i % len(DASHES)],
            label=in_brackets(signal(loop.output, {}), None if shared else unit(loop.unit)),
        )  # fmt: skip
    axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle=":")
    axes.set_ylabel(in_brackets("taken back of a step of 1", shared))
    _limit_time(axes, result.times, result.slowest.settling_time)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def response_figure(result: StepResponse, style: Style = SCREEN) -> Figure:
    """What an output does after a step of an input; its final value is dotted."""
    figure = style.figure(38.0)
    axes = figure.add_subplot()
    axes.plot(result.times, result.response, color=BLUE, drawstyle="steps-post" if result.is_held else "default")
    axes.axhline(result.steady_state, color=GREY, linewidth=1.0, linestyle=":")
    axes.set_title(f"after a step of {quantity(1.0, unit(result.input_unit))} of {result.input}")
    axes.set_ylabel(in_brackets(signal(result.output, {}), unit(result.unit)))
    _limit_time(axes, result.times, result.settling_time)
    return figure


def _limit_time(axes: Axes, times: Floats, settling_time: float) -> None:
    axes.set_xlim(0.0, min(times[-1], CALM * settling_time) or times[-1])
    label_time(axes)


def locus_figure(result: RootLocus, style: Style = SCREEN) -> Figure:
    """The poles beside the unit circle, shaded by the quantity, and the spectral radius over it; crosses leave it."""
    across = setting(result.of if "." in result.of else f"timing.{result.of}", result.values, result.unit)
    known = result.poles[np.isfinite(result.poles)]
    crossings = [one for one in result.crossings if not one.jumps]
    titles = ["×: where poles cross the circle"] * bool(crossings) + ["○: as in the file"] * (result.own is not None)
    titles = [", ".join(titles)] * bool(titles)
    if outside := int((np.maximum(np.abs(known.real), np.abs(known.imag)) > SHOWN).sum()):
        titles.append(f"not shown: {outside} of {len(known)} poles, up to |z| = {np.abs(known).max():.3g}")
    figure = style.figure((50.0 if style.is_wide else 90.0) + len(titles))
    rows = [["plane", "close"], ["over", "over"]] if style.is_wide else [["plane"], ["close"], ["over"]]
    panels: dict[str, Axes] = figure.subplot_mosaic(rows, height_ratios=[2.0] * (len(rows) - 1) + [1.0])
    plane, close, over = panels["plane"], panels["close"], panels["over"]
    values, is_wide = across.of(result.values), _has_logarithm(result)
    is_there = np.isfinite(result.poles) & (np.abs(result.poles) < 2.0 * SHOWN)
    poles = result.poles[is_there]
    shade = np.broadcast_to(values[:, None], result.poles.shape)[is_there]
    for axes in (plane, close):
        axes.axhline(0.0, color=GREY, linewidth=0.5)
        axes.axvline(0.0, color=GREY, linewidth=0.5)
        axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color=BLACK, linewidth=1.0))
        dots = axes.scatter(
            poles.real, poles.imag, c=shade, cmap=SHADES, norm="log" if is_wide else None, s=10.0, linewidths=0.0
        )
        if result.own is not None:
            own = result.poles[result.values == result.own]
            axes.plot(own.real.ravel(), own.imag.ravel(), "o", color=BLACK, fillstyle="none", linestyle="none")
        for one in crossings:
            axes.plot([one.z.real] * 2, [one.z.imag, -one.z.imag], "x", color=RED, linestyle="none")
        axes.set(xlabel="real part", ylabel="imaginary part", aspect="equal")
    apart = np.sort(np.abs(known - 1.0))
    apart = apart[: (len(apart) + 1) // 2]
    half = min(MOST, NEAR * float(np.median(apart))) or MOST if len(apart) else MOST
    plane.set(xlim=(-SHOWN, SHOWN), ylim=(-SHOWN, SHOWN), title="\n".join(titles))
    close.set(xlim=(1.0 - half, 1.0 + half), ylim=(-half, half), title="about z = 1")
    close.locator_params(nbins=5)
    bar = figure.colorbar(dots, ax=[plane, close], label=across.title, location="bottom", aspect=40.0)
    plain(bar.ax.xaxis)
    _draw_radius(over, result, across)
    return figure


def _draw_radius(axes: Axes, result: RootLocus, across: Quantity) -> None:
    """The spectral radius over the quantity; lines lead from where it is 1 to the values, in room above the curve."""
    tried, radius, edge = across.of(result.curve[0]), result.curve[1], 1.0
    axes.set(xlabel=across.title, ylabel="spectral radius", xlim=(tried[0], tried[-1]))
    if (closest := _closest(radius)) is not None:
        radius, edge = radius - 1.0, 0.0
        axes.set_yscale("symlog", linthresh=closest, linscale=0.5)
        axes.set_ylabel("spectral radius − 1")
    axes.plot(tried, radius, marker=".", markersize=4.0, color=BLUE)
    axes.axhline(edge, color=BLACK, linewidth=1.0)
    if _has_logarithm(result):
        axes.set_xscale("log")
    plain(axes.xaxis)
    ends = [across.of(one.ends) for one in result.crossings]
    places = [float(end.mean()) for end in ends]
    shown = ([across.text_of(value, one.digits) for value in one.ends] for one in result.crossings)
    labels = [" to ".join([*(text.split()[0] for text in each[:-1]), each[-1]]) for each in shown]
    rows, lefts = _rows_of(axes, places, labels)
    scale = axes.yaxis.get_transform()
    low, high = scale.transform([min(np.nanmin(radius), edge), max(np.nanmax(radius), edge)])
    count, margin = max((row + 1 for row in rows if row is not None), default=0), 0.05 * (high - low)
    top = high + margin + count * ROW * (high - low)
    heights = np.array([low - margin, top, *(top - ROW * (high - low) * (np.arange(count) + 0.9))])
    lowest, highest, *texts = scale.inverted().transform(heights)
    axes.set_ylim(lowest, highest)
    if closest is not None:
        axes.yaxis.set_ticks(_powers(closest, lowest, highest))
    for end, at, label, row, left in zip(ends, places, labels, rows, lefts):
        if len(end) > 1:
            axes.axvspan(*end, color=RED, alpha=0.3, linewidth=0.0)
        else:
            axes.plot(at, edge, "x", color=RED)
        if row is None:
            continue
        axes.plot([at, at], [edge, texts[row]], color=RED, linewidth=1.0, linestyle=":")
        beside: dict[str, Any] = {"xytext": (-4.0 if left else 4.0, 0.0), "ha": "right" if left else "left"}
        axes.annotate(label, (at, texts[row]), textcoords="offset points", **beside)


def _closest(radius: Floats) -> float | None:
    """The distance from 1 within which an axis about it is linear; None: each stretch is seen if all of it is.

    A power of ten that all stretches between crossings exceed.
    """
    known = radius[np.isfinite(radius)] - 1.0
    begins = np.flatnonzero(np.diff(known < 0.0, prepend=known[0] >= 0.0))
    depths = np.maximum.reduceat(np.abs(known), begins)
    least = min(1.0, float(depths.min()))
    return None if least >= SHALLOW * depths.max() else 10.0 ** math.floor(math.log10(max(least, CLOSEST)))


def _powers(first: float, lowest: float, highest: float) -> list[float]:
    """Ticks of an axis about 0 that is logarithmic from `first` on: few powers of ten, 0 and their negatives."""
    decades = [math.log10(max(abs(end), first) / first) for end in (lowest, highest)]
    apart = 1 + math.floor(max(decades)) // TICKS
    above = [first * 10.0**k for k in range(0, math.floor(max(decades)) + 1, apart)]
    return [x for x in (*(-x for x in reversed(above)), 0.0, *above) if lowest <= x <= highest]


def _has_logarithm(result: RootLocus) -> bool:
    return result.geometric and bool(result.values[0] > 0.0)


def _rows_of(axes: Axes, places: list[float], labels: list[str]) -> tuple[list[int | None], list[bool]]:
    """The row of each label, 0 is the uppermost, and whether it stands left of its place; None: there is no room.

    No label lies over another, nor over the line that leads up to another.
    """
    character = WIDTH * rcParams["font.size"] / 72.0 * axes.figure.dpi / axes.bbox.width
    taken, rows, lefts = [list[tuple[float, float]]() for _ in range(ROWS)], list[int | None](), list[bool]()
    lines = list[tuple[float, int]]()
    to_share = axes.transScale + axes.transLimits
    for place, label in zip(places, labels):
        share, width = float(to_share.transform((place, 1.0))[0]), character * (len(label) + 1)
        sides = [(share, share + width), (share - width, share)]

        def is_free(row: int, low: float, high: float) -> bool:
            across = any(low < line < high for line, end in lines if end <= row)
            over = across or any(a < high and low < b for a, b in taken[row])
            under = any(a < share < b for each in taken[row:] for a, b in each)  # noqa: B023
            return low >= 0.0 and high <= 1.0 and not over and not under

        row, side = next(((r, s) for r in range(ROWS) for s in (0, 1) if is_free(r, *sides[s])), (None, 0))
        rows.append(row)
        lefts.append(side == 1)
        if row is not None:
            taken[row].append(sides[side])
            lines.append((share, row))
    return rows, lefts
