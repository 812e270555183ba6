"""The sampled closed loop linearised about hover, by differentiating the FMUs through their saved states.

The state is the vehicle's twelve coordinates at a sampling instant (the attitude as its vector part: with all four
components the norm of the quaternion would give an eigenvalue at one), the actuators if they lag, and the commands
sent before. At an equilibrium the derivative of a period is the product of the derivatives of its steps.
"""

import itertools
import math
from typing import cast

import numpy as np

from orchestration.components.building import fmus
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.flight.hover import (
    COORDINATES,
    STEP,
    PlantStep,
    at_hover,
    displaced,
    hover_of,
    measurement_at,
)
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.model import System
from orchestration.systems.system.request import ControlLoop
from orchestration.theory.stability.delay_bounds import turn_of
from orchestration.theory.stability.in_double import are_in_double, expect_same_law, in_double

_COMMANDS = len(wiring.COMMAND)
_FORGOTTEN = 1e-9
"""relative change of a command that is tolerated after the controller measured another state in between"""


class HoverLoop:
    """The linear closed loop of a scenario about hover, for any period and delay."""

    def __init__(self, feedback: Floats, step: PlantStep, in_double: tuple[str, ...]) -> None:
        self.in_double = in_double
        self._feedback = np.pad(feedback, ((0, 0), (0, step.size - len(COORDINATES))))
        self._step = step

    @classmethod
    def of(cls, scenario: Scenario) -> "HoverLoop":
        """The loop of `scenario`; raises `UsageError` if hover is no equilibrium, or the feedback not a single one."""
        _expect_one_feedback(scenario)
        hover, fleet = located(hover_of(scenario)), Instances()
        trim, feedback = controller_at_hover(hover, fleet)
        return cls(feedback, PlantStep(hover, fleet, trim), are_in_double(hover.as_system().components))

    def with_law(self, scenario: Scenario) -> "HoverLoop":
        """The loop of the same plant with the controller of `scenario`, whose command at hover must be the same."""
        _, feedback = controller_at_hover(located(hover_of(scenario)), Instances())
        return HoverLoop(feedback, self._step, self.in_double)

    def continuous(self) -> tuple[Floats, Floats, Floats]:
        """A and B of the plant in continuous time, dx = A x + B u, and F of its controller, u = F x."""
        from scipy.linalg import logm

        size = self._step.size
        generator = np.real(logm(self._step.one(self._step.interval))) / self._step.interval
        return generator[:size, :size], generator[:size, size:], self._feedback

    def spectral_radius(self, period: float, delay: float) -> float:
        """The largest modulus of the eigenvalues of one sample period [s] with a delay [s]."""
        return float(np.abs(np.linalg.eigvals(self.matrix(period, delay))).max())

    def matrix(self, period: float, delay: float) -> Floats:
        """d(state after one period)/d(state): vehicle, actuators, then the commands sent before, newest first."""
        return turn_of(self._step.over, self._feedback, period, delay)


def controller_at_hover(hover: Scenario, fleet: Instances) -> tuple[Floats, Floats]:
    """The command at hover and its derivative by the coordinates, shape (4, 12).

    Raises `UsageError` for a controller with memory: its command is not a function of the vehicle's state.
    """
    at_rest = measurement_at({})
    held = {"plant": {}, "controller": dict(zip(wiring.MEASUREMENT, at_rest.tolist()))}
    expect_same_law(hover.as_system(), fleet, held)
    with prepared(hover, load=fleet.load) as flight:
        controller = flight.instances["controller"]
        controller.initialise(wiring.MEASUREMENT, at_rest)
        has_layer = wiring.BOUNDARY_LAYER in controller.variables
        layer = float(controller.get(wiring.BOUNDARY_LAYER)) if has_layer else 1.0
        step = min(STEP, 1e-3 * layer)

        instants = itertools.count()

        def command(measurement: Floats) -> Floats:
            result: Floats = np.zeros(_COMMANDS)
            controller.writer(wiring.MEASUREMENT, measurement)()
            controller.step(next(instants) * hover.timing.period, hover.timing.period)
            controller.reader(wiring.COMMAND, result)()
            return result

        columns = []
        for name in COORDINATES:
            plus, minus = (command(measurement_at(displaced(name, size))) for size in (step, -step))
            columns.append((plus - minus) / (2.0 * step))
        trim = command(at_rest)
        away = at_rest + 1e3 * step
        later = [command(x) for x in (away, away, at_rest)]
        if np.abs(later[-1] - trim).max() > _FORGOTTEN * max(1.0, float(np.abs(trim).max())):
            raise UsageError(
                "the controller's command depends on what it measured before: expected a law without memory"
            )
        return trim, np.column_stack(columns)


def located(hover: Scenario) -> Scenario:
    """`hover` with its FMUs by their paths, float code in C in double precision."""
    hover = in_double(hover)
    return hover.with_fmus(plant=fmus.locate(hover.plant.fmu), controller=fmus.locate(hover.controller.fmu))


def _expect_one_feedback(scenario: Scenario) -> None:
    """Raise `UsageError` for a controller whose feedback depends on the period or on earlier commands."""
    for name, plain in wiring.UNREDESIGNED.items():
        value = scenario.controller.parameters.get(name, plain[0])
        if value not in plain:
            raise UsageError(f"the loop about hover is for controllers with {name} = {plain[0]} only")


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
    return float(fmus.read_model(scenario.plant.fmu).variables[name].start or 1.0)
