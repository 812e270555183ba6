"""A block diagram of a system: components in a row, forward messages in lanes above them, backward ones below."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from orchestration.foundation.basics.errors import UsageError, listed
from orchestration.simulation.figures.names import expect_figure
from orchestration.simulation.figures.palette import CONTINUOUS, LINE, SAMPLED, SOURCE
from orchestration.simulation.figures.style import SCREEN, save
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.description import describe_faults, describe_rate, describe_source
from orchestration.systems.system.model import System

MAX_BOXES = 40
"""Boxes in a row that are still legible"""
PITCH, WIDTH, HEIGHT, LANE = 4.2, 2.6, 1.5, 0.75
"""Distances between boxes, sizes of a box, distance between lanes [inch]"""


@dataclass(frozen=True, kw_only=True)
class _Box:
    title: str
    lines: tuple[str, ...]
    color: str


@dataclass(frozen=True, kw_only=True)
class _Arrow:
    start: int
    end: int
    name: str
    text: str
    """the variables, and the timing of the connection"""
    is_late: bool

    @property
    def span(self) -> tuple[int, int]:
        """The range of the boxes that it passes."""
        return min(self.start, self.end), max(self.start, self.end)


def write(system: System, path: Path) -> Path:
    """Draw a system into a file in the format of its ending; raises `UsageError` for an unknown ending."""
    expect_figure(path)
    style = replace(SCREEN, formats=(path.suffix[1:],))
    with style.applied():
        figure = draw(system)
    return save({path.stem: figure}, path.parent, style)[0]


def draw(system: System) -> Figure:
    """Boxes with their rates, arrows with their variables; dashed where messages may be late or lost."""
    boxes = _boxes(system)
    if len(boxes) > MAX_BOXES:
        raise UsageError(f"--out: {len(boxes)} components and sources; expected at most {MAX_BOXES} in a figure")
    places = {name: i for i, name in enumerate(boxes)}
    arrows = _arrows(system, places)
    ahead = _lanes([a for a in arrows if a.start < a.end])
    back = _lanes([a for a in arrows if a.start >= a.end])
    above, below = (1 + max(lanes.values(), default=-1) for lanes in (ahead, back))
    top, bottom = HEIGHT / 2 + LANE * (above + 0.6), -HEIGHT / 2 - LANE * (below + 0.6)
    left, right = -0.7 * PITCH / 2 - 0.4, PITCH * (len(boxes) - 1) + 0.7 * PITCH / 2 + 0.4
    figure = Figure(figsize=(right - left, top - bottom))
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set_axis_off()
    for lanes, side in ((ahead, 1.0), (back, -1.0)):
        ports = _ports(lanes)
        for arrow, lane in lanes.items():
            _draw_arrow(axes, arrow, side, HEIGHT / 2 + LANE * (lane + 0.8), ports)
    for place, box in enumerate(boxes.values()):
        _draw_box(axes, PITCH * place, box)
    return figure


def _boxes(system: System) -> dict[str, _Box]:
    """Boxes by name, in the order of the row: the sources that are connected, then the components."""
    sources = {
        f"sources.{name}": _Box(title=name, lines=(describe_source(source),), color=SOURCE)
        for name, source in system.sources.items()
        if source.to
    }
    components = {
        name: _Box(
            title=name,
            lines=(Path(component.fmu).name, describe_rate(component)),
            color=CONTINUOUS if component.sampling is None else SAMPLED,
        )
        for name, component in system.components.items()
    }
    return {**sources, **{name: components[name] for name in _in_a_row(system)}}


def _in_a_row(system: System) -> list[str]:
    """Components ordered so that neighbours feed each other, starting with the first of the file."""
    left = list(system.components)
    row: list[str] = []
    while left:
        nexts = [x.receiver for x in system.connections if row and x.sender == row[-1] and x.receiver in left]
        row.append(nexts[0] if nexts else left[0])
        left.remove(row[-1])
    return row


def _arrows(system: System, places: Mapping[str, int]) -> list[_Arrow]:
    arrows = []
    for name, source in system.sources.items():
        for receiver in dict.fromkeys(map(component_of, source.to)):
            inputs = [variable_of(end) for end in source.to if component_of(end) == receiver]
            start, end = places[f"sources.{name}"], places[receiver]
            arrows.append(_Arrow(start=start, end=end, name="", text=_few(inputs), is_late=False))
    for x in system.connections:
        arrows.append(
            _Arrow(
                start=places[x.sender],
                end=places[x.receiver],
                name="" if x.name.isdecimal() else x.name,
                text="\n".join(filter(None, (_few([variable_of(end) for end in x.start]), describe_faults(x)))),
                is_late=bool(x.delay or x.delay_jitter or x.loss),
            )
        )
    return arrows


def _few(names: Sequence[str]) -> str:
    return listed(names if len(names) <= 4 else {name.rpartition(".")[0] or name: None for name in names}, 4)


def _lanes(arrows: Sequence[_Arrow]) -> dict[_Arrow, int]:
    """The lane of each arrow, short ones near the boxes, so that no two overlap."""
    lanes: dict[_Arrow, int] = {}
    for arrow in sorted(arrows, key=lambda a: (a.span[1] - a.span[0], a.span)):
        low, high = arrow.span
        taken = {
            lane
            for other, lane in lanes.items()
            if other.span[0] < max(high, low + 1) and low < max(other.span[1], other.span[0] + 1)
        }
        lanes[arrow] = next(lane for lane in range(len(arrows)) if lane not in taken)
    return lanes


Port = tuple[_Arrow, str]


def _ports(lanes: Mapping[_Arrow, int]) -> dict[Port, float]:
    """Where arrows leave and enter, spread over the width of their boxes; far ends outside to avoid crossings."""
    ends: dict[int, list[tuple[float, Port]]] = {}
    for arrow, lane in lanes.items():
        low, high = arrow.span
        for which, here, other in (("start", arrow.start, arrow.end), ("end", arrow.end, arrow.start)):
            side = 0.0 if low == high else (1.0 if other > here else -1.0)
            near = side * (100.0 - lane) + (0.1 if which == "start" else 0.0)
            ends.setdefault(here, []).append((near, (arrow, which)))
    ports = {}
    for place, members in ends.items():
        for k, (_, port) in enumerate(sorted(members, key=lambda member: member[0])):
            ports[port] = PITCH * place + WIDTH * ((k + 1) / (len(members) + 1) - 0.5)
    return ports


def _draw_box(axes: Axes, x: float, box: _Box) -> None:
    style = "round,pad=0,rounding_size=0.12"
    axes.add_patch(
        FancyBboxPatch((x - WIDTH / 2, -HEIGHT / 2), WIDTH, HEIGHT, boxstyle=style, facecolor=box.color, edgecolor=LINE)
    )
    lines = [part for line in box.lines for part in textwrap.wrap(line, 28)]
    axes.text(x, 0.42, "\n".join(textwrap.wrap(box.title, 22)[:1]), ha="center", va="center", weight="bold", size=11)
    axes.text(x, -0.16, "\n".join(lines[:4]), ha="center", va="center", size=8.5)


def _draw_arrow(axes: Axes, arrow: _Arrow, side: float, height: float, ports: Mapping[Port, float]) -> None:
    start, end = ports[arrow, "start"], ports[arrow, "end"]
    style = "--" if arrow.is_late else "-"
    axes.plot([start, start, end, end], [side * y for y in (HEIGHT / 2, height, height, HEIGHT / 2 + 0.1)],
              linestyle=style, color=LINE, linewidth=1.2)  # fmt: skip
    axes.plot(end, side * (HEIGHT / 2 + 0.07), marker="v" if side > 0 else "^", color=LINE, markersize=7)
    width = max(30, int(abs(end - start) * 13))
    name = f"{arrow.name}: " if arrow.name else ""
    text = "\n".join(part for line in f"{name}{arrow.text}".split("\n") for part in textwrap.wrap(line, width)[:2])
    axes.text((start + end) / 2, side * height, text, ha="center", va="center", size=8.5,
              bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5})  # fmt: skip
