"""Draws figure.png of every example: `python examples/make_figures.py [NAME …]`, run from anywhere."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from orchestration.simulation.figures import gantt
from orchestration.simulation.figures.palette import BLUE, GREEN, GREY, ORANGE, RED
from orchestration.simulation.figures.style import DOCS, save
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.scheduling import schedule
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.file import load_system
from orchestration.systems.system.files import files_of
from orchestration.systems.system.paths import changed
from orchestration.theory.exact.loops import Loops

HERE = Path(__file__).resolve().parent
SMALL = 26.0
"""Height of a small figure in lines of text"""


def simulate(name: str, **changes: Any) -> Result:
    """Run an example; changes are by path, with `__` for dots."""
    system = load_system(HERE / name / "system.toml")
    return run(changed(system, {path.replace("__", "."): value for path, value in changes.items()}))


def line(axes: Axes, result: Result, signal: str, color: str, label: str, **style: Any) -> None:
    """A signal over time."""
    axes.plot(result.signals["time"], result.signals[signal], color=color, label=label, **style)


def held(axes: Axes, result: Result, signal: str, color: str, label: str) -> None:
    """A signal that is held between its changes."""
    line(axes, result, signal, color, label, drawstyle="steps-post")


def water_tank() -> Figure:
    """The level with a prompt and with late valves, and the bound."""
    figure = DOCS.figure(SMALL)
    axes = figure.subplots()
    for delay, color, dashes in ((0.0, GREEN, "-"), (0.25, BLUE, "--"), (0.6, ORANGE, "-.")):
        result = simulate("water_tank", stop_time=10.0, connections__valve__delay=delay)
        label = f"valve {delay:g} s late: peak {result.metrics['peak']:.2f} m"
        line(axes, result, "tank.level", color, label, linestyle=dashes)
        axes.axhline(2.0 + 0.1 + delay, color=color, linestyle=":", linewidth=1.0)
    axes.axhspan(1.0, 2.0, color=GREY, alpha=0.12, label="where the valve is left as it is")
    axes.set(
        xlabel="time [s]", ylabel="level [m]", title="dotted: the bound, 2 m + (0.1 s + delay) · 1 m/s", ylim=(0.0, 3.9)
    )
    axes.legend(loc="upper left", ncols=2)
    return figure


def double_integrator() -> Figure:
    """The position at periods on both sides of the limit."""
    figure = DOCS.figure(SMALL)
    axes = figure.subplots()
    for period, color, dashes in ((0.5, GREEN, "-"), (1.8, BLUE, "--"), (2.1, RED, "-.")):
        result = simulate("double_integrator", stop_time=25.0, components__controller__sampling__period=period)
        line(axes, result, "plant.x", color, f"period {period:g} s", linestyle=dashes)
    axes.set(
        xlabel="time [s]", ylabel="position [m]", ylim=(-8.0, 8.0), title="by theory it dies out below a period of 2 s"
    )
    axes.legend(loc="lower left", ncols=3, frameon=True, framealpha=0.9)
    return figure


def dc_servo() -> Figure:
    """The angle over wires of different quality."""
    figure = DOCS.figure(SMALL)
    axes = figure.subplots()
    wires = (
        ("2 ms late", 0.002, 0.0, 0.0, GREEN, "-"),
        ("2 to 6 ms late, a tenth lost", 0.002, 0.004, 0.1, BLUE, "--"),
        ("12 ms late", 0.012, 0.0, 0.0, ORANGE, "-."),
        ("12 to 16 ms late, a tenth lost", 0.012, 0.004, 0.1, RED, ":"),
    )
    for label, delay, jitter, loss, color, dashes in wires:
        result = simulate(
            "dc_servo", stop_time=0.6, connections__command__delay=delay,
            connections__command__delay_jitter=jitter, connections__command__loss=loss,
        )  # fmt: skip
        line(axes, result, "servo.angle", color, label, linestyle=dashes)
    axes.set(xlabel="time [s]", ylabel="angle [rad]", ylim=(-1.6, 2.1), title="seed 0; sampled every 6 ms")
    axes.legend(loc="upper right", ncols=2)
    return figure


def dc_motor() -> Figure:
    """The speed with commands at once and late."""
    figure = DOCS.figure(SMALL)
    axes = figure.subplots()
    for late, color, dashes in ((0.0, GREEN, "-"), (0.001, BLUE, "--"), (0.0013, ORANGE, "-.")):
        result = simulate("dc_motor", stop_time=0.06, connections__command__delay=late)
        line(axes, result, "motor.speed", color, f"{1e3 * late:g} ms late", linestyle=dashes)
    axes.set(xlabel="time [s]", ylabel="speed [rad/s]", title="unstable from 1.355 ms on")
    axes.legend(loc="lower right", ncols=3)
    return figure


def minimum_variance() -> Figure:
    """Cost over gain: theory, and eight runs at each of some gains."""
    figure = DOCS.figure(SMALL)
    axes = figure.subplots()
    gains = np.linspace(0.3, 1.8, 200)
    variance = 1.0 / (2.0 * gains - gains**2)
    axes.plot(gains, variance * (1.0 - gains + gains**2 / 3.0) + 0.5, color=BLUE, label="x², theory")
    axes.plot(
        gains,
        variance * (1.0 - gains + 4.0 * gains**2 / 3.0) + 0.5,
        color=ORANGE,
        linestyle="--",
        label="x² + u², theory",
    )
    for gain in (0.4, 0.65, 3.0 - math.sqrt(3.0), 1.6):
        runs = [simulate("minimum_variance", seed=s, components__controller__parameters__gain=gain) for s in range(8)]
        variances, efforts = (np.array([r.metrics[name] for r in runs], float) for name in ("variance", "effort"))
        for costs, color in ((variances, BLUE), (variances + efforts, ORANGE)):
            axes.plot([gain] * len(costs), costs, ".", color=color, markersize=4)
    axes.plot([], [], ".", color=GREY, label="runs of 2000 s")
    axes.set(
        xlabel="gain [1/s]",
        ylabel="cost, per unit time",
        ylim=(0.5, 4.0),
        title="least of x²: (3 + √3)/6 at a gain of 3 − √3",
    )
    axes.legend(loc="upper left")
    return figure


def four_components() -> Figure:
    """Speed and forces over time."""
    figure = DOCS.figure(38.0)
    speeds, forces = figure.subplots(2, 1, sharex=True)
    result = simulate("four_components")
    speeds.axhline(25.0, color=GREY, linestyle=":", label="set speed")
    held(speeds, result, "sensor.filtered", ORANGE, "sensor, every 10 ms")
    line(speeds, result, "car.speed", BLUE, "car", linestyle="--")
    held(forces, result, "controller.force", GREEN, "asked by the controller, every 100 ms")
    line(forces, result, "engine.force", RED, "engine, every 20 ms", drawstyle="steps-post", linestyle="--")
    speeds.set(ylabel="speed [m/s]", title="uphill from 20 s on; demands up to 80 ms late, a tenth of them lost")
    forces.set(xlabel="time [s]", ylabel="force [N]")
    speeds.legend(loc="lower right")
    forces.legend(loc="upper center")
    return figure


def three_servos() -> Figure:
    """The angles, with the processor scheduled by rates and by deadlines."""
    figure = DOCS.figure(SMALL)
    both = figure.subplots(1, 2, sharey=True)
    for axes, how in zip(both, ("fixed-priority", "earliest-deadline-first")):
        result = simulate("three_servos", stop_time=0.6, computers__node__scheduling=how)
        looks = (("slow", 6, RED, "-"), ("middle", 5, BLUE, "--"), ("fast", 4, GREEN, ":"))
        for name, period, color, dashes in looks:
            line(axes, result, f"{name}_servo.angle", color, f"every {period} ms", linestyle=dashes)
        axes.set(xlabel="time [s]", ylim=(-3.0, 3.0), title=how.replace("-", " "))
    both[0].set(ylabel="angle [rad]")
    both[1].legend(loc="upper right")
    return figure


def autopilot() -> Figure:
    """The schedule of processor and bus at the beginning."""
    found = schedule(HERE / "autopilot" / "flight.toml", until=0.2)
    return gantt.draw(found.timeline, DOCS, (0.0, 0.05))


def distributed_servo() -> Figure:
    """The exact cost over period and delay, with the line beyond which it is not finite."""
    system = load_system(HERE / "distributed_servo" / "system.toml")
    periods, delays = np.linspace(0.001, 0.016, 31), np.linspace(0.0, 0.016, 33)
    cost, radius = (np.full((len(delays), len(periods)), np.nan) for _ in range(2))
    for j, period in enumerate(periods.tolist()):
        varied = changed(system, {"components.controller.sampling.period": period})
        loops = Loops(files_of(system).models)
        for i, delay in enumerate(delays.tolist()):
            found = loops.solve(changed(varied, {"connections.command.delay": delay}))
            radius[i, j] = found.loop.result.radius
            cost[i, j] = sum(found.means.values()) if found.means is not None else NO_END
    figure = DOCS.figure(34.0)
    axes = figure.subplots()
    levels = [40.0, 50.0, 65.0, 80.0, 100.0, 150.0, 250.0, 500.0, 1000.0]
    shades = axes.contourf(1e3 * periods, 1e3 * delays, cost, levels, norm=LogNorm(), cmap="viridis", extend="both")
    axes.contourf(1e3 * periods, 1e3 * delays, radius, [1.0, np.inf], colors=["white"])
    axes.contour(1e3 * periods, 1e3 * delays, radius, [1.0], colors=[RED])
    known = np.array([0.0, 3.0, 6.0])
    axes.plot(
        np.full(3, 6.0), known, "o", color="white", markeredgecolor="black", clip_on=False,
        label="known: 65.5, 86.2, 123.0",
    )  # fmt: skip
    figure.colorbar(shades, label="J, mean of y² + u²", ticks=levels, format="%g")
    axes.set(xlabel="period [ms]", ylabel="delay [ms]", title="beyond the line the expectation is not finite")
    axes.legend(loc="lower right", frameon=True, framealpha=0.9)
    return figure


NO_END = 1e9
"""replaces a cost that is not finite, for the contours beside it"""

FIGURES: dict[str, Callable[[], Figure]] = {
    draw.__name__: draw
    for draw in (
        *(water_tank, double_integrator, dc_servo, dc_motor, distributed_servo, three_servos),
        *(minimum_variance, four_components, autopilot),
    )
}


def main(names: list[str]) -> None:
    """Draw the figures of these examples; of all if none is named."""
    for name in names or FIGURES:
        with DOCS.applied():
            figure = FIGURES[name]()
        print(*save({"figure": figure}, HERE / name, DOCS))


if __name__ == "__main__":
    main(sys.argv[1:])
