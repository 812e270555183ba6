"""The agreement chart: the difference of each tool to this project's master, by kind of signal."""

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from orchestration.simulation.figures.palette import BLUE, GREEN, GREY, INDIGO, ORANGE, RED
from orchestration.simulation.figures.style import SCREEN, save
from orchestration.simulation.interop.compare import TOLERANCE, Agreement
from orchestration.systems.system.connection import component_of

AIM = f"aim, $10^{{{math.log10(TOLERANCE):g}}}$"
ZERO_DRAWN_AT = 1e-17
"""Place at which a difference of zero is drawn"""

_KINDS = {
    "position": ("plant.position", "o", BLUE),
    "velocity": ("plant.velocity", "s", GREEN),
    "quaternion": ("plant.quaternion", "^", ORANGE),
    "angular velocity": ("plant.angular_velocity", "D", RED),
    "command": ("controller.", "P", INDIGO),
}
"""Kinds of signals of the quadrotor, by name: prefix, marker, colour; any other system has one by component"""


def draw(agreements: Sequence[Agreement], folder: Path) -> list[Path]:
    """Write `interop` into `folder`; the paths."""
    with SCREEN.applied():
        chart = agreement_chart(agreements)
    return save({"interop": chart}, folder)


def agreement_chart(agreements: Sequence[Agreement]) -> Figure:
    """A row for each tool; open: as it comes; filled: with the tool's first inputs in this master, too."""
    figure = SCREEN.figure(10.0 + 3.0 * len(agreements))
    panel = figure.add_subplot()
    kinds = _kinds({signal for agreement in agreements for signal in agreement.as_it_comes})
    for row, agreement in enumerate(agreements):
        for kind, (name, (prefix, marker, color)) in enumerate(kinds.items()):
            y = row + 0.7 * ((kind + 0.5) / len(kinds) - 0.5)
            for differences, filled in zip(agreement.both(), (False, True), strict=True):
                values = [value for signal, value in differences.items() if signal.startswith(prefix)]
                if values:
                    panel.plot(
                        max(max(values), ZERO_DRAWN_AT), y, marker, color=color, markersize=5,
                        markerfacecolor=color if filled else "none", linestyle="none",
                        label=name if filled else None,
                    )  # fmt: skip
    panel.axvline(TOLERANCE, color=GREY, linestyle="--", linewidth=1.0, label=AIM)
    panel.set(xscale="log", xlabel="largest difference from quadcosim's master [SI units]")
    panel.set_yticks(range(len(agreements)), [agreement.tool.name for agreement in agreements])
    panel.invert_yaxis()
    SCREEN.set_title(figure, "open: as the tool comes; filled: with the tool's inputs of the first step in both")
    lines = {line.get_label(): line for line in reversed(panel.get_legend_handles_labels()[0])}
    names = [name for name in (*kinds, AIM) if name in lines]
    figure.legend([lines[name] for name in names], names, loc="outside lower center", ncols=len(names))
    return figure


def _kinds(signals: Collection[str]) -> Mapping[str, tuple[str, str, str]]:
    prefixes = tuple(prefix for prefix, _, _ in _KINDS.values())
    if all(signal.startswith(prefixes) for signal in signals):
        return _KINDS
    styles = itertools.cycle((marker, color) for _, marker, color in _KINDS.values())
    components = sorted({component_of(signal) for signal in signals})
    return {name: (f"{name}.", *style) for name, style in zip(components, styles)}
