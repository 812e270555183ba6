"""A Gantt chart of the tasks and messages on the processors and networks of a system."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.foundation.basics.times import NANOSECONDS, seconds
from orchestration.simulation.figures.drawn_run import DrawnRun, Window
from orchestration.simulation.figures.palette import BLACK, BLUE, BROWN, GREEN, GREY, ORANGE, PURPLE, RED, SKY
from orchestration.simulation.figures.style import Style
from orchestration.simulation.results.quantities import quantity
from orchestration.systems.computers import timeline
from orchestration.systems.schedule.resources import timeline_of

PIECES = 60
"""Pieces of the busiest processor or link, as many as can be told apart"""
BAR, LATE = 0.62, 0.16
"""Heights in a row of bars for running and for waiting"""
VISIBLE = 1e-3
"""Share of the window from which a bar is seen, and explained"""
COLORS = (BLUE, GREEN, ORANGE, PURPLE, SKY, BROWN)
"""Colours of tasks and messages; a context switch is grey, a missed deadline or an error red"""


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A task or a message on one processor or link."""

    name: str
    color: str
    slices: timeline.Slices
    owner: int
    of: timeline.Jobs | timeline.Frames


def chart(runs: Sequence[DrawnRun], style: Style) -> Figure | None:
    """The chart of one run; None without computers and networks, or for several runs."""
    system = runs[0].system
    if len(runs) > 1 or not (system.computers or system.networks):
        return None
    return draw(timeline_of(system), style, runs[0].window)


def draw(timeline: timeline.Timeline, style: Style, window: Window | None = None) -> Figure:
    """A panel for each processor and link with a row for each task and message; `window` [s]: default of the timeline.

    A bar is execution, a thin one waiting since the release; switches are grey. An arrow is a release, a short stroke
    at the foot of the bar a deadline, a red one a missed deadline.
    """
    shown = window or default_window(timeline)
    panels = {name: rows for name, rows in _panels(timeline).items() if rows}
    heights = [len(rows) for rows in panels.values()]
    time = quantity("time", "s", shown)
    figure = style.figure(5.0 + sum(2.0 * height + 2.2 for height in heights), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=[h + 0.6 for h in heights])
    for panel, (name, rows) in zip(axes[:, 0], panels.items(), strict=True):
        for place, row in enumerate(rows):
            _draw_row(panel, row, place, shown, time.factor, style)
        panel.set_title(name, loc="left", fontsize=style.font)
        panel.set(ylim=(len(rows) - 0.35, -0.85), xlim=(time.factor * shown[0], time.factor * shown[1]))
        panel.set_yticks(range(len(rows)), [row.name for row in rows])
        panel.tick_params(axis="y", length=0)
        panel.grid(axis="y", visible=False)
    axes[-1, 0].set_xlabel(time.title)
    figure.legend(handles=_legend(panels, shown), loc="outside lower center", ncols=7 if style.is_wide else 3)
    return figure


def default_window(timeline: timeline.Timeline) -> Window:
    """From 0 to the time at which the busiest processor or link has had `PIECES` pieces, or to the end [s]."""
    shared = (*timeline.processors.values(), *timeline.links.values())
    ends = [int(each.begin[PIECES]) for each in shared if len(each.begin) > PIECES]
    return 0.0, seconds(min([timeline.stop, *ends]))


def _panels(timeline: timeline.Timeline) -> dict[str, list[_Row]]:
    colors = {name: COLORS[i % len(COLORS)] for i, name in enumerate((*timeline.jobs, *timeline.frames))}
    panels: dict[str, list[_Row]] = {}
    for what, shared in ((timeline.jobs, timeline.processors), (timeline.frames, timeline.links)):
        for place, slices in shared.items():
            panels[place] = [
                _Row(name=name.partition(".")[2], color=colors[name], slices=slices, owner=i, of=what[name])
                for i, name in enumerate(slices.owners)
                if name in what
            ]
    return panels


def _draw_row(axes: Axes, row: _Row, place: int, shown: Window, factor: float, style: Style) -> None:
    scale = seconds(1) * factor
    of, slices = row.of, row.slices
    first, last = shown[0] * NANOSECONDS, shown[1] * NANOSECONDS
    waits = _released(of)
    ends = np.where(of.ended == timeline.NEVER, last, of.ended)
    here = (waits <= last) & (ends >= first) & ~_are_skipped(of)
    bars = _spans(waits[here], ends[here], scale)
    axes.broken_barh(bars, (place - LATE / 2, LATE), facecolors=row.color, alpha=0.35, linewidth=0)
    visible = (slices.owner == row.owner) & (slices.begin <= last) & (slices.end >= first)
    for kind, how in _kinds(row.color).items():
        of_kind = visible & (slices.kind == kind)
        axes.broken_barh(_spans(slices.begin[of_kind], slices.end[of_kind], scale), (place - BAR / 2, BAR), **how)
    released = waits[(waits >= first) & (waits <= last) & ~_are_skipped(of)].tolist()
    size = 0.4 * style.font
    axes.plot([t * scale for t in released], [place - BAR / 2 - 0.12] * len(released), "^", color=BLACK, ms=size)
    due = of.deadline[(of.deadline >= first) & (of.deadline <= last)]
    missed = np.isin(due, of.deadline[of.missed])
    for which, color in ((~missed, BLACK), (missed, RED)):
        axes.vlines(due[which] * scale, place + BAR / 4, place + BAR / 2 + 0.12, colors=color, linewidth=style.line)


def _released(of: timeline.Jobs | timeline.Frames) -> Integers:
    return of.released if isinstance(of, timeline.Jobs) else of.queued


def _are_skipped(of: timeline.Jobs | timeline.Frames) -> Booleans:
    return of.outcome == timeline.SKIPPED if isinstance(of, timeline.Jobs) else np.zeros(len(of), dtype=np.bool_)


def _spans(begins: Integers, ends: Integers, scale: float) -> list[tuple[float, float]]:
    """Start and length of each bar in the unit of the axis."""
    return [(begin * scale, (end - begin) * scale) for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)]


def _kinds(color: str) -> Mapping[int, dict[str, Any]]:
    return {
        timeline.RUN: {"facecolors": color, "linewidth": 0},
        timeline.SWITCH: {"facecolors": GREY, "linewidth": 0},
        timeline.CORRUPTED: {"facecolors": "white", "edgecolors": RED, "hatch": "////", "linewidth": 0.5},
    }


def _legend(panels: Mapping[str, list[_Row]], shown: Window) -> list[Line2D | Patch]:
    return [*_common_entries(), *_optional_entries(panels, shown)]


def _common_entries() -> Iterator[Line2D | Patch]:
    yield Patch(facecolor=BLUE, label="runs")
    yield Patch(facecolor=BLUE, alpha=0.35, label="waits")
    yield Line2D([], [], color=BLACK, marker="^", linestyle="", label="released")
    yield Line2D([], [], color=BLACK, marker="|", linestyle="", label="deadline")


def _optional_entries(panels: Mapping[str, list[_Row]], shown: Window) -> Iterator[Line2D | Patch]:
    first, last = shown[0] * NANOSECONDS, shown[1] * NANOSECONDS
    least = VISIBLE * (last - first)
    rows = [row for of_panel in panels.values() for row in of_panel]
    if any(row.of.missed.any() for row in rows):
        yield Line2D([], [], color=RED, marker="|", linestyle="", label="missed")
    kinds = {
        int(kind)
        for slices in (row.slices for row in rows)
        for kind in slices.kind[(slices.begin <= last) & (slices.end >= first) & (slices.end - slices.begin >= least)]
    }
    if timeline.SWITCH in kinds:
        yield Patch(facecolor=GREY, label="switch")
    if timeline.CORRUPTED in kinds:
        yield Patch(facecolor="white", edgecolor=RED, hatch="////", label="sent again")
