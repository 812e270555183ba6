"""Hover: a flight whose reference is at rest, without wind, and the FMUs there.

Hover lies inside the boundary layer of the law, where its gain is constant. Outside, the gain depends on the
position error and is largest at the edge of the layer: `at_edge` is the scenario for the loop with that gain.
"""

import dataclasses
import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np

from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.translation import DisturbanceChoice, ReferenceChoice
from orchestration.simulation.engines.resolved import resolve
from orchestration.simulation.runs.prepared import set_parameters
from orchestration.systems.system.check import AT_REST
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System

STEP = 1e-6
"""Step of each coordinate in a difference; a thousandth of a boundary layer that is smaller than 1 mm"""
COORDINATES = wiring.POSITION + wiring.VELOCITY + wiring.QUATERNION[:3] + wiring.ANGULAR_VELOCITY
"""Coordinates of the vehicle; the attitude by its vector part"""
SCALAR_PART = wiring.QUATERNION[3]


def hover_of(scenario: Scenario) -> Scenario:
    """`scenario` with the vehicle at rest at the origin, where its reference rests too, and no wind and no payload."""
    scenario = scenario.resolved()
    plant = dict(scenario.plant.parameters) | dict.fromkeys(wiring.DISTURBANCE, 0.0)
    plant |= {wiring.PAYLOAD: 0.0} if wiring.PAYLOAD in plant else {}
    plant |= {f"initial.{name}": 0.0 for name in wiring.MEASUREMENT} | {f"initial.{SCALAR_PART}": 1.0}
    return dataclasses.replace(
        scenario,
        plant=dataclasses.replace(scenario.plant, parameters=plant),
        reference=ReferenceChoice(name=AT_REST),
        disturbance=DisturbanceChoice(),
    )


def at_hover(scenario: Scenario) -> System:
    """The system of `scenario` at hover, with values for the parameters that its FMUs have."""
    scenario = scenario.resolved()
    system = hover_of(scenario).as_system()
    own = {"plant": scenario.plant.parameters, "controller": scenario.controller.parameters}
    models = files_of(system).models_of(system)
    components = {
        name: dataclasses.replace(
            component,
            parameters={
                key: value
                for key, value in component.parameters.items()
                if key in own[name] or key in models[name].variables
            },
        )
        for name, component in system.components.items()
    }
    return dataclasses.replace(system, components=components, operating_point={})


def at_edge(scenario: Scenario) -> Scenario | None:
    """`scenario` with the gain that its law has just outside the boundary layer, used everywhere.

    That is the slope of k_s |e|^β_t sgn(e) at |e| = ε. None for a controller without parameters of these names.
    """
    scenario = scenario.resolved()
    system = scenario.as_system()
    known = files_of(system).start_values_of(system)
    own = {f"controller.{name}": value for name, value in scenario.controller.parameters.items()}
    if any(name not in known for name in wiring.SURFACE):
        return None
    gain, exponent, layer = (float(own.get(name, known[name])) for name in wiring.SURFACE)
    return scenario.with_changes(parameters={wiring.SURFACE[0]: exponent * gain * layer ** (exponent - 1.0)})


def displaced(name: str, size: float) -> dict[str, float]:
    """Initial values of a vehicle at hover but for one coordinate, the quaternion of unit length."""
    moved = {f"initial.{name}": size}
    if name in wiring.QUATERNION:
        moved[f"initial.{SCALAR_PART}"] = math.sqrt(1.0 - size * size)
    return moved


def measurement_at(initial: dict[str, float]) -> Floats:
    """The measurement of a vehicle at hover but for these initial values, shape (13,)."""
    at_rest = {f"initial.{SCALAR_PART}": 1.0} | initial
    return np.array([at_rest.get(f"initial.{name}", 0.0) for name in wiring.MEASUREMENT])


INSTANT = 1e-12
"""Span that counts as zero [s], as do shorter ones"""
_MEASURED = [wiring.MEASUREMENT.index(name) for name in COORDINATES]
_COMMANDS = len(wiring.COMMAND)
_UNITS = np.eye(_COMMANDS)
_BOTH_WAYS = (STEP, -STEP)
_NO_EFFECT = 1e-9
"""Effect of an actuator's state on the vehicle's, per unit, that counts as none: the rounding of the differences"""
_BENT = 1e-3
"""relative difference of the one-sided derivatives about hover that is tolerated"""


class NotSmooth(UsageError):
    """The plant is not differentiable about hover."""


class PlantStep:
    """Derivatives of the plant FMU over a span of time about hover, with the command held.

    Actuators that lag are four further states, set by the first command. They have no outputs: they are identified by
    their effect on the vehicle in one more plant interval.
    """

    def __init__(self, hover: Scenario, fleet: Instances, trim: Floats) -> None:
        self._fleet, self._trim = fleet, trim
        self._plant = resolve(hover).system.components["plant"]
        self.interval = hover.timing.plant_interval
        self._lags = True  # until the differences show otherwise
        self._at_hover = at_hover = self._saved({}, trim)
        self._expect_equilibrium(at_hover)
        vehicle = [[(self._saved(displaced(name, size), trim), trim) for size in _BOTH_WAYS] for name in COORDINATES]
        actuators = [[(self._saved({}, trim + size * unit), trim) for size in _BOTH_WAYS] for unit in _UNITS]
        command = [[(at_hover, trim + size * unit) for size in _BOTH_WAYS] for unit in _UNITS]
        self._moved = [*vehicle, *actuators, *command]
        self._known: dict[float, Floats] = {}
        self._next = self._differences(self.interval)[: len(COORDINATES), : len(COORDINATES) + _COMMANDS]
        by_actuators = self._next[:, len(COORDINATES) :]
        self._lags = bool(np.abs(by_actuators).max() > _NO_EFFECT)
        if not self._lags:
            self._moved = [*vehicle, *command]
        self._seen = np.linalg.pinv(by_actuators)
        self.size = len(self._moved) - _COMMANDS

    def over(self, duration: float) -> tuple[Floats, Floats]:
        """d(state)/d(state before) and d(state)/d(command) over `duration` [s]."""
        count = math.floor(duration / self.interval + 1e-9)
        rest = duration - count * self.interval
        total = np.linalg.matrix_power(self.one(self.interval), count) if count else np.eye(self.size + _COMMANDS)
        if rest > INSTANT:
            total = self.one(rest) @ total
        return total[: self.size, : self.size], total[: self.size, self.size :]

    def one(self, h: float) -> Floats:
        """The derivative of one step of `h` [s], the command as further constant states."""
        if h not in self._known:
            derivatives = self._differences(h)
            result = np.eye(self.size + _COMMANDS)
            result[: len(COORDINATES)] = after = derivatives[: len(COORDINATES)]
            if self._lags:
                later = derivatives[len(COORDINATES) :]
                result[len(COORDINATES) : self.size] = self._seen @ (later - self._next[:, : len(COORDINATES)] @ after)
            self._known[h] = result
        return self._known[h]

    def _differences(self, h: float) -> Floats:
        """d(vehicle after `h` [s])/d(state and command); below it a plant interval later if the actuators lag.

        Raises `NotSmooth` if it does not exist, as with motors that rise faster than they fall.
        """
        with self._load() as plant:
            after = self._response(plant, h)
            still = after(self._at_hover, self._trim)
            changes = [[after(*start) - still for start in pair] for pair in self._moved]
        for plus, minus in changes:
            if np.abs(plus + minus).max() > _BENT * np.abs(plus - minus).max() + STEP**2:
                raise NotSmooth("the plant responds differently to a rise and to a fall, so hover has no linear loop")
        return np.column_stack([(plus - minus) / (2.0 * STEP) for plus, minus in changes])

    def _saved(self, parameters: dict[str, float], command: Floats) -> bytes:
        """The plant's state after initialisation with these parameters and this first command."""
        component = dataclasses.replace(self._plant, parameters={**self._plant.parameters, **parameters})
        with self._load() as plant:
            set_parameters(plant, component)
            plant.initialise(wiring.COMMAND, command)
            return plant.save()

    def _load(self) -> AbstractContextManager[Instance]:
        return self._fleet.load(Path(self._plant.fmu), "plant")

    def _response(self, plant: Instance, h: float) -> Callable[[bytes, Floats], Floats]:
        """The vehicle `h` [s] after a state under a command, and if the actuators lag also a plant interval later
        under the trim. Parameters are those of the state.
        """
        command, measured = np.zeros(_COMMANDS), np.zeros(len(wiring.MEASUREMENT))
        write, read = plant.writer(wiring.COMMAND, command), plant.reader(wiring.MEASUREMENT, measured)

        def after(state: bytes, held_command: Floats) -> Floats:
            plant.restore(state)
            states = []
            for start, duration, held in ((0.0, h, held_command), (h, self.interval, self._trim))[: 1 + self._lags]:
                command[:] = held
                write()
                plant.step(start, duration)
                read()
                states.append(measured[_MEASURED])
            return np.concatenate(states)

        return after

    def _expect_equilibrium(self, at_hover: bytes) -> None:
        with self._load() as plant:
            drift = float(np.abs(self._response(plant, self.interval)(at_hover, self._trim)).max())
        if drift > 1e-9:
            raise UsageError(
                f"hover is no equilibrium, the vehicle drifts by {drift:.2g} in a plant interval; expected a "
                "controller with the plant's mass and gravity"
            )
