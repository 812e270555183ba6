"""Figures of `references.md`: motions and way-points, gusts and their spectra, a dropped payload."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.sources import gusts, motion_values
from orchestration.simulation.figures.palette import BLACK, BLUE, GREEN, GREY, ORANGE, RED
from orchestration.simulation.figures.style import Style
from orchestration.systems.signals.dryden import DRAWS, Dryden
from orchestration.systems.signals.library import make_signal
from orchestration.systems.signals.waypoints import read_waypoints
from quadcosim import load_scenario, run

EXAMPLES = Path(__file__).parents[1] / "examples" / "references"
SPEED, ACCELERATION = 2.0, 1.5
"""Limits of the way-points of the example"""
AXES = (("north", BLUE, "-"), ("east", ORANGE, "--"), ("down", GREEN, "-."))


def references(style: Style) -> Figure:
    """Named motions from above, and the way-points of the example in space and time."""
    figure = style.figure(30.0)
    halves: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.15))
    left, right = halves
    above = left.add_subplot(aspect="equal")
    for name, color, line in (("circle", BLUE, "-"), ("lemniscate", RED, "-."), ("paper", GREEN, "--")):
        motion = motion_values(make_signal(name, {"radius": 2.0} if name != "paper" else {}))(
            np.linspace(0.0, 43.0, 1500)
        )
        above.plot(motion[:, 1], motion[:, 0], line, color=color, label=name)
    above.plot(0.0, 0.0, "o", color=BLACK, markersize=4, label="start")
    above.set(xlabel="east [m]", ylabel="north [m]", ylim=(-2.4, 4.2))
    above.legend(ncols=2, loc="upper center", fontsize="small")
    curve = read_waypoints(EXAMPLES / "waypoints.csv", {"acceleration": ACCELERATION})
    points = np.loadtxt(EXAMPLES / "waypoints.csv", delimiter=",", skiprows=1)
    t = np.linspace(0.0, curve.knots[-1], 2000)
    found = curve.at(t)
    panels: Any = right.subplots(2, 1, sharex=True)
    for axis, (name, color, dashes) in enumerate(AXES):
        panels[0].plot(t, found[:, 0, axis], dashes, color=color, label=name)
    arrivals = [float(t[np.linalg.norm(found[:, 0] - point, axis=1).argmin()]) for point in points[:-1, :3]]
    for axis, (_, color, _) in enumerate(AXES):
        label = None if axis else "way-points"
        panels[0].plot([*arrivals, t[-1]], points[:, axis], "o", color=color, markersize=4, label=label)
    panels[0].set_ylabel("position [m]")
    panels[0].legend(ncols=4, fontsize="small", loc="upper right", columnspacing=1.0)
    panels[0].set_ylim(-3.0, 5.0)
    panels[1].plot(t, np.linalg.norm(found[:, 1], axis=1), color=BLUE, label="speed")
    panels[1].plot(t, np.linalg.norm(found[:, 2], axis=1), "--", color=RED, label="acceleration")
    panels[1].axhline(ACCELERATION, color=RED, linestyle=":", label="its limit")
    panels[1].set(xlabel="time [s]", ylabel="speed [m/s],\nacceleration [m/s²]", ylim=(0.0, 2.3))
    panels[1].legend(ncols=3, fontsize="small", loc="upper right")
    right.align_ylabels(panels)
    return figure


def wind(style: Style) -> Figure:
    """Gusts over time, and the mean of their spectra over many intervals, compared with the formulas."""
    air, figure = Dryden(wind_speed=8.0, airspeed=8.0), style.figure(40.0)
    above, below = figure.subplots(2, 1)
    table = gusts(air, 20.0, np.random.default_rng(7))
    for axis, (name, color, dashes) in enumerate(AXES):
        above.plot(table.time, table.columns[:, axis], dashes, color=color, linewidth=0.8, label=name)
    above.set(xlabel="time [s]", ylabel="gusts [m/s]", xlim=(0.0, 20.0), ylim=(-3.0, 4.5))
    above.legend(ncols=3, fontsize="small", loc="upper right")
    count, stretches = 4096, 60
    draws = np.random.default_rng(8).standard_normal((count * stretches, DRAWS)).tolist()
    window = np.hanning(count)[:, None]
    values = np.array(air.velocities(draws)).reshape(stretches, count, 3) * window
    power = (np.abs(np.fft.rfft(values, axis=1)) ** 2).mean(axis=0) * air.step / (math.pi * (window**2).sum())
    omega: Floats = 2.0 * math.pi * np.fft.rfftfreq(count, air.step).astype(np.float64)
    for axis, (name, color, _) in enumerate(AXES):
        below.loglog(omega[2:900], power[2:900, axis], color=color, linewidth=0.7, alpha=0.7, label=f"{name}, drawn")
    for axis, (name, _, dashes) in enumerate(AXES):
        below.loglog(
            omega[2:900], spectrum(air, axis, omega[2:900]), dashes, color=BLACK, linewidth=0.9,
            label=f"{name}, formula",
        )  # fmt: skip
    below.set(xlabel="angular frequency [rad/s]", ylabel="spectrum [(m/s)²/(rad/s)]")
    below.legend(ncols=2, fontsize="small", loc="lower left")
    return figure


def spectrum(air: Dryden, axis: int, omega: Floats) -> Floats:
    """The one-sided spectrum over the angular frequency: Φ(ω/V)/V of the component along, across or down."""
    sigma, length = air.intensities()[axis], air.lengths()[axis]
    x2 = (length * omega / air.airspeed) ** 2
    shape: Floats = 2.0 / (1.0 + x2) if axis == 0 else (1.0 + 3.0 * x2) / (1.0 + x2) ** 2
    return sigma**2 * length / (math.pi * air.airspeed) * shape


def payload(style: Style) -> Figure:
    """The flight of the example with a dropped payload: continuous and discontinuous signals, and the command."""
    flight = run(load_scenario(EXAMPLES / "payload.toml"))
    t, figure = flight.signals["time"], style.figure(27.0)
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    panels: Any = left.subplots(2, 1, sharex=True)
    near = np.abs(t - 5.0) < 0.05
    for panel, name, unit, color in (
        (panels[0], "acceleration", "m/s²", RED),
        (panels[1], "velocity", "m/s", BLUE),
    ):
        panel.plot(t[near], flight.signals[f"plant.{name}.z"][near], ".-", color=color, markersize=3)
        panel.axvline(5.0005, color=GREY, linestyle=":")
        panel.set_ylabel(f"{name}\ndown [{unit}]")
    panels[1].set_xlabel("time [s]")
    left.align_ylabels(panels)
    whole = right.add_subplot()
    whole.plot(t, -1e3 * flight.signals["plant.position.z"], color=BLUE)
    whole.axvline(5.0005, color=GREY, linestyle=":", label="let go")
    whole.set(xlabel="time [s]", ylabel="height above the reference [mm]")
    whole.legend(fontsize="small")
    return figure
