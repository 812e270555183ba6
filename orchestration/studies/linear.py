"""The sampled closed loop linearised about hover, by differentiating the FMUs through their saved states.

Hover is a reference at rest and no wind. The state is the vehicle's twelve coordinates at a sampling
instant (the attitude as its vector part: with all four components the norm of the quaternion would give
an eigenvalue at one), the actuators if they lag, and the commands still on their way. At an equilibrium
the derivative of a period is the product of the derivatives of the steps that make it.
"""

import dataclasses
import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from orchestration import wiring
from orchestration.errors import UsageError
from orchestration.fleet import Fleet
from orchestration.flight import prepared
from orchestration.fmpy_adapter import FmuSimulator
from orchestration.scenario import Scenario
from orchestration.simulator import Floats
from orchestration.studies.study import locate_fmus

STEP = 1e-6
"""of each coordinate in a difference, small against the boundary layer of 1 mm"""
COORDINATES = wiring.POSITION + wiring.VELOCITY + wiring.QUATERNION[:3] + wiring.ANGULAR_VELOCITY
SCALAR_PART = wiring.QUATERNION[3]
_MEASURED = [wiring.MEASUREMENT.index(name) for name in COORDINATES]
_COMMANDS = len(wiring.COMMAND)
_INSTANT = 1e-12
"""[s]; shorter spans count as none"""


def hover_of(scenario: Scenario) -> Scenario:
    """`scenario` with the vehicle at rest at the origin, where its reference rests too, and no wind."""
    controller = {k: v for k, v in scenario.controller.parameters.items() if k != wiring.USE_REFERENCE_INPUTS}
    controller |= dict.fromkeys(wiring.TRAJECTORY, 0.0)
    plant = dict(scenario.plant.parameters) | dict.fromkeys(wiring.DISTURBANCE, 0.0)
    plant |= {f"initial.{name}": 0.0 for name in wiring.MEASUREMENT} | {f"initial.{SCALAR_PART}": 1.0}
    return dataclasses.replace(
        scenario,
        controller=dataclasses.replace(scenario.controller, parameters=controller),
        plant=dataclasses.replace(scenario.plant, parameters=plant),
        reference=dataclasses.replace(scenario.reference, file=None),
    )


class HoverLoop:
    """The linear closed loop of a scenario about hover, for any period and delay."""

    def __init__(self, feedback: Floats, step: "PlantStep") -> None:
        self._feedback = feedback
        self._step = step

    @classmethod
    def of(cls, scenario: Scenario) -> "HoverLoop":
        """The loop of `scenario`; raises `UsageError` if hover is not an equilibrium of it."""
        fmus = locate_fmus(scenario)
        hover, fleet = hover_of(scenario).with_fmus(plant=fmus.plant, controller=fmus.controller), Fleet()
        trim, feedback = _controller_at_hover(hover, fleet)
        return cls(feedback, PlantStep(hover, fleet, trim))

    def spectral_radius(self, period: float, delay: float) -> float:
        """The largest modulus of the eigenvalues of one sample period [s] with a delay [s]."""
        return float(np.abs(np.linalg.eigvals(self.matrix(period, delay))).max())

    def matrix(self, period: float, delay: float) -> Floats:
        """d(state after one period)/d(state): vehicle, actuators, then commands on their way, oldest first."""
        whole = math.floor(delay / period + 1e-9)
        rest = delay - whole * period if delay - whole * period > _INSTANT else 0.0
        pending = whole + (rest > 0.0)
        size = self._step.size + _COMMANDS * pending
        newest = np.zeros((_COMMANDS, size))
        newest[:, : len(COORDINATES)] = self._feedback
        sent = [np.eye(_COMMANDS, size, self._step.size + _COMMANDS * i) for i in range(pending)] + [newest]
        flow = np.eye(self._step.size, size)
        for duration, command in ((rest, sent[0]), (period - rest, sent[1] if rest else sent[0])):
            A, B = self._step.over(duration)
            flow = A @ flow + B @ command
        return np.vstack([flow, *sent[1:]])


class PlantStep:
    """Derivatives of the plant FMU over a span of time, the command held, about hover."""

    def __init__(self, hover: Scenario, fleet: Fleet, trim: Floats) -> None:
        self._hover, self._fleet, self._trim = hover, fleet, trim
        self._interval = hover.timing.plant_interval
        self._lag = float(hover.plant.parameters.get(wiring.ACTUATOR_TIME_CONSTANT, 0.0))
        self.size = len(COORDINATES) + (_COMMANDS if self._lag else 0)
        self._at_hover = self._saved({}, trim)
        self._moved = [
            [self._saved(_displaced(name, sign * STEP), trim) for sign in (1.0, -1.0)] for name in COORDINATES
        ]
        if self._lag:  # the actuators start at the first command
            self._moved += [[self._saved({}, trim + sign * STEP * unit) for sign in (1.0, -1.0)] for unit in _UNITS]
        self._known: dict[float, Floats] = {}
        self._expect_equilibrium()

    def over(self, duration: float) -> tuple[Floats, Floats]:
        """d(state)/d(state before) and d(state)/d(command) over `duration` [s]."""
        count = math.floor(duration / self._interval + 1e-9)
        rest = duration - count * self._interval
        total = np.linalg.matrix_power(self._one(self._interval), count) if count else np.eye(self.size + _COMMANDS)
        if rest > _INSTANT:
            total = self._one(rest) @ total
        return total[: self.size, : self.size], total[: self.size, self.size :]

    def _one(self, h: float) -> Floats:
        """The derivative of one step of `h` [s], the command as further states that stay."""
        if h not in self._known:
            with self._plant() as plant:
                after = [[self._after(plant, state, self._trim, h) for state in pair] for pair in self._moved]
                after += [
                    [self._after(plant, self._at_hover, self._trim + sign * STEP * unit, h) for sign in (1.0, -1.0)]
                    for unit in _UNITS
                ]
            result = np.eye(self.size + _COMMANDS)
            result[: len(COORDINATES)] = np.array([(plus - minus) / (2.0 * STEP) for plus, minus in after]).T
            if self._lag:
                left = math.exp(-h / self._lag)
                rows = slice(len(COORDINATES), self.size)
                result[rows, rows] = left * np.eye(_COMMANDS)
                result[rows, self.size :] = (1.0 - left) * np.eye(_COMMANDS)
            self._known[h] = result
        return self._known[h]

    @contextmanager
    def _plant(self, parameters: dict[str, float] | None = None) -> Iterator[FmuSimulator]:
        changed = {f"plant.{name}": value for name, value in (parameters or {}).items()}
        with prepared(self._hover.with_changes(parameters=changed), load=self._fleet.load) as flight:
            yield flight.plant

    def _saved(self, parameters: dict[str, float], command: Floats) -> bytes:
        """The plant's state after initialisation with these parameters and this first command."""
        with self._plant(parameters) as plant:
            _initialise(plant, wiring.COMMAND, command)
            return plant.save()

    def _after(self, plant: FmuSimulator, state: bytes, command: Floats, h: float) -> Floats:
        plant.restore(state)
        plant.writer(wiring.COMMAND, command)()
        plant.step(0.0, h)
        measured: Floats = np.zeros(len(wiring.MEASUREMENT))
        plant.reader(wiring.MEASUREMENT, measured)()
        return measured[_MEASURED]

    def _expect_equilibrium(self) -> None:
        with self._plant() as plant:
            drift = float(np.abs(self._after(plant, self._at_hover, self._trim, self._interval)).max())
        if drift > 1e-9:
            raise UsageError(
                f"hover is no equilibrium, the vehicle drifts by {drift:.2g} in a plant interval; expected a "
                "controller with the plant's mass and gravity"
            )


_UNITS = np.eye(_COMMANDS)


def _controller_at_hover(hover: Scenario, fleet: Fleet) -> tuple[Floats, Floats]:
    """The command at hover and its derivative by the coordinates, shape (4, 12)."""
    with prepared(hover, load=fleet.load) as flight:
        controller = flight.controller
        at_rest = _measurement({})
        _initialise(controller, wiring.MEASUREMENT, at_rest)

        def command(measurement: Floats) -> Floats:
            result: Floats = np.zeros(_COMMANDS)
            controller.writer(wiring.MEASUREMENT, measurement)()
            controller.step(0.0, hover.timing.period)
            controller.reader(wiring.COMMAND, result)()
            return result

        columns = []
        for name in COORDINATES:
            plus, minus = (command(_measurement(_displaced(name, sign * STEP))) for sign in (1.0, -1.0))
            columns.append((plus - minus) / (2.0 * STEP))
        return command(at_rest), np.column_stack(columns)


def _displaced(name: str, size: float) -> dict[str, float]:
    """Initial values of a vehicle at hover but for one coordinate, the quaternion of unit length."""
    moved = {f"initial.{name}": size}
    if name in wiring.QUATERNION:
        moved[f"initial.{SCALAR_PART}"] = math.sqrt(1.0 - size * size)
    return moved


def _measurement(initial: dict[str, float]) -> Floats:
    at_rest = {f"initial.{SCALAR_PART}": 1.0} | initial
    return np.array([at_rest.get(f"initial.{name}", 0.0) for name in wiring.MEASUREMENT])


def _initialise(fmu: FmuSimulator, inputs: tuple[str, ...], values: Floats) -> None:
    fmu.enter_initialization(0.0, 1.0)
    fmu.writer(inputs, values)()
    fmu.exit_initialization()
