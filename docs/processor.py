"""The processor time of the laws compared with their performance in the flights of the comparisons."""

import csv
import itertools
import json
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

import quadcosim
from orchestration.foundation.basics.documents import tables_in
from orchestration.foundation.basics.statistics import wilson
from orchestration.simulation.figures.palette import GREY, MARKS
from orchestration.simulation.figures.style import DOCS

ROOT = Path(__file__).parent.parent
AUTOPILOT = ROOT / "examples" / "autopilot"
PROCESSOR = "m7"
NINE_IN_TEN = 0.9


def steps_of(trace: str) -> list[float]:
    """The execution time of each step of a law [s]."""
    with (AUTOPILOT / "execution" / f"{PROCESSOR}.csv").open(encoding="utf-8") as file:
        return [float(row[trace]) for row in csv.DictReader(file)]


def at_ratios(velocity: int, attitude: int) -> Callable[[Sequence[float]], float]:
    """The mean cost of a sample of the cascade at other ratios, from its longest steps with the same loops due.

    In the trace the velocity loop is due every 20 steps, the attitude loop every 4.
    """

    def cost(steps: Sequence[float]) -> float:
        due = {
            True: max(steps[::20]),
            False: max(step for i, step in enumerate(steps) if i % 4 == 0 and i % 20),
            None: max(step for i, step in enumerate(steps) if i % 4),
        }
        kinds = [None if i % attitude else i % velocity == 0 for i in range(velocity)]
        return statistics.mean(due[kind] for kind in kinds)

    return cost


@dataclass(frozen=True, kw_only=True)
class Design:
    """A controller of a comparison, and the processor time of a sample."""

    comparison: str
    controller: str
    trace: str
    cost_of: Callable[[Sequence[float]], float]
    """the cost of a sample from the steps of the trace [s]: for a cascade at one rate, every step runs all loops"""
    color: str
    line: str = "-"

    @property
    def cost(self) -> float:
        """The processor time of a sample [s]."""
        return self.cost_of(steps_of(self.trace))

    def cells(self) -> list[dict[str, Any]]:
        """The cells of the comparison, by period."""
        cells = json.loads((ROOT / "docs" / "data" / f"{self.comparison}.json").read_text("utf-8"))["cells"]
        return [cell for cell in cells if cell["controller"] == self.controller]


DESIGNS = {
    "unified, κ = 1": Design(
        comparison="periods", controller="unified", trace="unified_explicit", cost_of=statistics.mean, color="C0"
    ),
    "unified, κ = 0": Design(
        comparison="periods",
        controller="unified, no coupling",
        trace="unified_explicit",
        cost_of=statistics.mean,
        color="C1",
    ),
    "unified, κ = 1, `mean`": Design(
        comparison="periods", controller="unified, mean", trace="unified_mean", cost_of=statistics.mean, color="C2"
    ),
    "geometric": Design(
        comparison="periods", controller="geometric", trace="geometric", cost_of=statistics.mean, color="C3"
    ),
    "geometric, `mean`": Design(
        comparison="periods", controller="geometric, mean", trace="geometric_mean", cost_of=statistics.mean, color="C4"
    ),
    "cascade, all loops at one rate": Design(
        comparison="periods", controller="cascade, one rate", trace="cascaded", cost_of=max, color="C5"
    ),
    "cascade, fast inner loops": Design(
        comparison="fast_inner",
        controller="cascade, fast inner loops",
        trace="cascaded",
        cost_of=statistics.mean,
        color="C6",
    ),
    "cascade, all loops at one rate, no rate derivative": Design(
        comparison="periods",
        controller="cascade, no rate derivative",
        trace="cascaded",
        cost_of=max,
        color="C5",
        line="--",
    ),
    "cascade, 4 to 2": Design(
        comparison="cascade_ratios", controller="cascade, 4 to 2", trace="cascaded", cost_of=at_ratios(4, 2), color="C7"
    ),
    "cascade, 4 to 2, no rate derivative": Design(
        comparison="cascade_ratios",
        controller="cascade, 4 to 2, no rate derivative",
        trace="cascaded",
        cost_of=at_ratios(4, 2),
        color="C7",
        line="--",
    ),
}


def equal_share() -> list[dict[str, Any]]:
    """The least share of the processor at which nine in ten flights settle and survive, by design."""
    rows = []
    for name, design in DESIGNS.items():
        row: dict[str, Any] = {"design": name, "sample": design.cost}
        for fate in ("settles", "survives"):
            period = _longest(design, fate)
            row |= {f"{fate}_period": period, f"{fate}_share": period and design.cost / period}
        rows.append(row)
    return rows


def share_table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The rows of a table: by design, the cost of a sample, and the period and share at which nine in ten settle."""
    return [
        f"| {row['design']} | {1e6 * row['sample']:.1f} | {1e3 * row['settles_period']:g} ms "
        f"| {1e2 * row['settles_share']:.3f} % |"
        for row in rows
    ]


def _longest(design: Design, fate: str) -> float | None:
    """The longest period up to which nine in ten flights have a fate at each period of the grid."""
    found = None
    for cell in design.cells():
        if cell[fate] < NINE_IN_TEN * cell["count"]:
            break
        found = float(cell["value"])
    return found


def figure() -> Figure:
    """Shares that settle and survive over the share of the processor."""
    made = DOCS.figure(34.0)
    panels = made.subplots(1, 2, sharey=True)
    for panel, (fate, word) in zip(panels, {"settles": "settle", "survives": "survive"}.items(), strict=True):
        for (name, design), mark in zip(DESIGNS.items(), itertools.cycle(MARKS)):
            cells = design.cells()
            shares = [100.0 * design.cost / cell["value"] for cell in cells]
            bands = [wilson(cell[fate], cell["count"]) for cell in cells]
            panel.fill_between(shares, *zip(*bands), color=design.color, alpha=0.12, linewidth=0.0)
            panel.plot(
                shares,
                [cell[fate] / cell["count"] for cell in cells],
                design.line,
                marker=mark,
                markersize=3.5,
                color=design.color,
                label=name.replace("`", ""),
            )
        panel.set(xscale="log", xlabel="share of the processor [%]", title=f"that {word}", xlim=(0.003, 5.0))
    panels[0].set_ylabel("share of 200 initial conditions")
    made.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return made


STALLED = "computers.autopilot.tasks.storage.execution"
LAWS: dict[str, tuple[str, dict[str, Any], str]] = {
    "unified, κ = 1": ("UnifiedController", {}, "unified_explicit"),
    "unified, κ = 0": ("UnifiedController", {"coupling": 0.0}, "unified_explicit"),
    "unified, κ = 1, `mean`": ("UnifiedController", {"discretisation": "mean"}, "unified_mean"),
    "geometric": ("GeometricController", {}, "geometric"),
    "cascade, all loops at one rate": ("CascadedController", {"velocity_ratio": 1, "attitude_ratio": 1}, "cascaded"),
}
"""Laws for the example of an autopilot: FMU, parameters, and trace of execution times"""


def stalls() -> dict[str, quadcosim.Limit]:
    """By law: for how long the memory card may occupy the processor, once a second, in the example of an autopilot."""
    return {
        name: quadcosim.limit(
            without_chance(*law),
            STALLED,
            first=0.01,
            last=0.6,
            scan=0.02,
            tolerance=0.001,
            progress=None,
            announce=None,
        )
        for name, law in LAWS.items()
    }


def stall_table(found: Mapping[str, quadcosim.Limit]) -> list[dict[str, Any]]:
    """For each law, the largest stall that is good [s], and the least that is not, with why."""
    return [
        {"law": name, "stall": one.large_signal_limit or 0.0, "beyond": one.notes[0]} for name, one in found.items()
    ]


def errors(found: Mapping[str, quadcosim.Limit]) -> Figure:
    """The error at the end of the flight over the stall; diverged flights have no point."""
    made = DOCS.figure(32.0)
    panel = made.add_subplot()
    for (name, one), marker in zip(found.items(), "os^vx", strict=True):
        known = {1e3 * each.value: each.measured for each in one.tried if each.measured is not None}
        panel.plot([*known], [*known.values()], f"{marker}-", markersize=4, label=name.replace("`", ""))
    panel.axhline(0.05, color=GREY, linestyle=":", linewidth=1.0, label="good: at most 5 cm")
    panel.set(yscale="log", xlabel="stall, once a second [ms]", ylabel="largest error of the last third [m]")
    made.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return made


def without_chance(fmu: str, parameters: dict[str, Any], trace: str) -> dict[str, Any]:
    """The example with a law, and with means in place of all random values."""
    tables = tables_in((AUTOPILOT / "flight.toml").read_text("utf-8"))
    tables["components"]["controller"] |= {"fmu": f"native/{fmu}", "parameters": parameters}
    tasks, network = tables["computers"]["autopilot"]["tasks"], tables["networks"]["bus"]
    tasks["radio"] |= {"jitter": 0.0, "execution": 0.001}
    tasks["control"]["execution"] = round(statistics.mean(steps_of(trace)), 9)
    network["error"], network["messages"]["airspeed"]["jitter"] = 0.0, 0.0
    return tables
