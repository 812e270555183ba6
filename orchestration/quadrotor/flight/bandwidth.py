"""The bandwidth of the attitude loop of a controller, by which controllers of any structure are compared."""

import math
from typing import cast

import numpy as np

from orchestration.components.building import fmus
from orchestration.components.fmi.reuse import Instances
from orchestration.quadrotor.flight.hover import at_hover
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.model import System
from orchestration.systems.system.request import ControlLoop

PERIOD = 1e-3
"""Time between samples while it is measured [s]; a redesign for longer ones has other gains by design"""
RANGE, FIRST = (0.1, 1000.0), 20.0
"""Range of the search, and its initial value [rad/s]"""
ACCURACY = 1e-3
"""Accuracy of the gain"""
AMPLITUDE = 1e-4
"""Amplitude of roll [rad]"""
CYCLES = 6
"""Cycles of the oscillation; the second half is evaluated"""
_ROLL, _SCALAR, _RATE = (
    wiring.MEASUREMENT.index(name) for name in ("quaternion.x", "quaternion.w", "angular_velocity.x")
)
_TORQUE = wiring.COMMAND.index("torque.x")


def crossover(loop: ControlLoop) -> float:
    """The frequency [rad/s] at which the open attitude loop, from roll through the controller and 1/(J s²), has gain 1.

    It is measured on the FMU, for any law and memory: the controller receives a small oscillation of roll about hover,
    all else at rest, and its torque about x is recorded. J is the plant's. `math.inf` or 0 if the gain does not cross
    one within `RANGE`.
    """
    scenario = cast(Scenario, loop)
    inertia, fleet = _inertia(scenario), Instances()
    hover = at_hover(scenario.with_changes(timing={"period": PERIOD, "plant_interval": PERIOD}))
    frequency, (low, high) = FIRST, RANGE
    while low < frequency < high:
        gain = response(hover, frequency, fleet) / (inertia * frequency**2)
        if abs(gain - 1.0) < ACCURACY:
            return frequency
        frequency *= gain ** (1.0 / 1.5)  # it falls with the first to the second power of the frequency
    return 0.0 if frequency <= low else math.inf


def response(hover: System, frequency: float, fleet: Instances) -> float:
    """The gain from an oscillation of roll at hover to the torque about x [N.m/rad]; `frequency` in rad/s."""
    count = max(40, math.ceil(2.0 * math.pi * CYCLES / frequency / PERIOD))
    times = PERIOD * np.arange(count)
    torque, command = np.empty(count), np.zeros(len(wiring.COMMAND))
    measured = np.zeros(len(wiring.MEASUREMENT))
    with prepared(hover, load=fleet.load) as flight:
        controller = flight.instances["controller"]
        write, read = controller.writer(wiring.MEASUREMENT, measured), controller.reader(wiring.COMMAND, command)
        measured[_SCALAR] = 1.0
        controller.initialise(wiring.MEASUREMENT, measured, stop=float(times[-1]) + 1.0)
        for k, t in enumerate(times):
            half = 0.5 * AMPLITUDE * math.sin(frequency * t)
            measured[_ROLL], measured[_SCALAR] = math.sin(half), math.cos(half)
            measured[_RATE] = AMPLITUDE * frequency * math.cos(frequency * t)
            write()
            controller.step(float(t), PERIOD)
            read()
            torque[k] = command[_TORQUE]
    late = times >= times[-1] / 2.0  # transients have died out
    phase = frequency * times[late]
    shapes = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase)), times[late]])
    (a, b, *_), *_ = np.linalg.lstsq(shapes, torque[late], rcond=None)
    return math.hypot(a, b) / AMPLITUDE


def _inertia(scenario: Scenario) -> float:
    name = "inertia.xx"
    if name in scenario.plant.parameters:
        return float(scenario.plant.parameters[name])
    return float(fmus.model_of(scenario.plant.fmu).variables[name].start or 1.0)
