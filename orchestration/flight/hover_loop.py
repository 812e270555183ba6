"""The sampled closed loop linearised about hover, by differentiating the FMUs through their saved states.

Hover is a reference at rest and no wind. The state is the vehicle's twelve coordinates at a sampling
instant (the attitude as its vector part: with all four components the norm of the quaternion would give
an eigenvalue at one), the actuators if they lag, and the commands still on their way. At an equilibrium
the derivative of a period is the product of the derivatives of the steps that make it.

Hover lies inside the boundary layer of the law, where its gain is constant. Outside, the gain depends on the
position error and is largest at the edge of the layer: `at_edge` is the scenario for the loop with that gain.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.building import fmus
from orchestration.building.inputs import files_of
from orchestration.fmi.instance import Instance
from orchestration.fmi.reuse import Instances
from orchestration.quadrotor import wiring
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.signals import DisturbanceChoice, ReferenceChoice
from orchestration.runs.meant import held_to_fmus
from orchestration.runs.simulation import prepared, set_parameters
from orchestration.system.following import AT_REST
from orchestration.system.model import System

STEP = 1e-6
"""of each coordinate in a difference; a thousandth of a boundary layer that is smaller than 1 mm"""
COORDINATES = wiring.POSITION + wiring.VELOCITY + wiring.QUATERNION[:3] + wiring.ANGULAR_VELOCITY
SCALAR_PART = wiring.QUATERNION[3]
_MEASURED = [wiring.MEASUREMENT.index(name) for name in COORDINATES]
_COMMANDS = len(wiring.COMMAND)
_INSTANT = 1e-12
"""[s]; shorter spans count as none"""
_NO_EFFECT = 1e-9
"""of an actuator's state on the vehicle's, per unit: what differences leave of none"""
_BENT = 1e-3
"""of a derivative: by how much those to both sides of hover may differ"""


class NotSmooth(UsageError):
    """About hover the plant has no derivative."""


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
    """The system that hovers as `scenario` would, by values for what its FMUs have."""
    scenario = scenario.resolved()
    system = hover_of(scenario).as_system()
    given = {"plant": scenario.plant.parameters, "controller": scenario.controller.parameters}
    models = files_of(system).models_of(system)
    components = {
        name: dataclasses.replace(
            component,
            parameters={
                key: value
                for key, value in component.parameters.items()
                if key in given[name] or key in models[name].variables
            },
        )
        for name, component in system.components.items()
    }
    return dataclasses.replace(system, components=components, operating_point={})


def at_edge(scenario: Scenario) -> Scenario | None:
    """`scenario` with the gain everywhere that its law has just outside the boundary layer.

    That is the slope of k_s |e|^β_t sgn(e) at |e| = ε. None for a controller without parameters of these names.
    """
    scenario = scenario.resolved()
    system = scenario.as_system()
    known = files_of(system).starts_of(system)
    own = {f"controller.{name}": value for name, value in scenario.controller.parameters.items()}
    names = [f"controller.{name}" for name in (wiring.SURFACE_GAIN, wiring.SURFACE_EXPONENT, wiring.BOUNDARY_LAYER)]
    if any(name not in known for name in names):
        return None
    gain, exponent, layer = (float(own.get(name, known[name])) for name in names)
    return scenario.with_changes(parameters={names[0]: exponent * gain * layer ** (exponent - 1.0)})


def _located(hover: Scenario) -> Scenario:
    """`hover` with its FMUs by their paths."""
    return hover.with_fmus(plant=fmus.locate(hover.plant.fmu), controller=fmus.locate(hover.controller.fmu))


def _expect_one_feedback(scenario: Scenario) -> None:
    """Raise `UsageError` for a controller whose feedback is another for each period, or remembers commands."""
    for name, plain in wiring.UNREDESIGNED.items():
        value = scenario.controller.parameters.get(name, plain[0])
        if value not in plain:
            raise UsageError(f"the loop about hover is for controllers with {name} = {plain[0]} only")


class HoverLoop:
    """The linear closed loop of a scenario about hover, for any period and delay."""

    def __init__(self, feedback: Floats, step: "PlantStep") -> None:
        self._feedback = feedback
        self._step = step

    @classmethod
    def of(cls, scenario: Scenario) -> "HoverLoop":
        """The loop of `scenario`; raises `UsageError` if hover is not an equilibrium of it, or its feedback not one."""
        _expect_one_feedback(scenario)
        hover, fleet = _located(hover_of(scenario)), Instances()
        trim, feedback = _controller_at_hover(hover, fleet)
        return cls(feedback, PlantStep(hover, fleet, trim))

    def with_law(self, scenario: Scenario) -> "HoverLoop":
        """The loop of the same plant with the controller of `scenario`, whose command at hover must be the same."""
        _, feedback = _controller_at_hover(_located(hover_of(scenario)), Instances())
        return HoverLoop(feedback, self._step)

    def continuous(self) -> tuple[Floats, Floats, Floats]:
        """A and B of the plant in continuous time, dx = A x + B u, and F of its controller, u = F x."""
        from scipy.linalg import logm

        size = self._step.size
        generator = np.real(logm(self._step.one_interval())) / self._step.interval
        feedback = np.zeros((_COMMANDS, size))
        feedback[:, : len(COORDINATES)] = self._feedback
        return generator[:size, :size], generator[:size, size:], feedback

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
    """Derivatives of the plant FMU over a span of time, the command held, about hover.

    Actuators that lag are states too, four of them, which the first command sets. No output shows them: they
    are known by what they do to the vehicle in one more plant interval.
    """

    def __init__(self, hover: Scenario, fleet: Instances, trim: Floats) -> None:
        self._fleet, self._trim = fleet, trim
        self._plant = held_to_fmus(hover).system.components["plant"]
        self.interval = hover.timing.plant_interval
        self._lags = True  # until the differences say otherwise
        self._at_hover = at_hover = self._saved({}, trim)
        self._expect_equilibrium(at_hover)
        vehicle = [[(self._saved(_displaced(name, size), trim), trim) for size in _BOTH_WAYS] for name in COORDINATES]
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
        total = np.linalg.matrix_power(self._one(self.interval), count) if count else np.eye(self.size + _COMMANDS)
        if rest > _INSTANT:
            total = self._one(rest) @ total
        return total[: self.size, : self.size], total[: self.size, self.size :]

    def one_interval(self) -> Floats:
        """The derivative of a plant interval, the command as further states that stay."""
        return self._one(self.interval)

    def _one(self, h: float) -> Floats:
        """The derivative of one step of `h` [s], the command as further states that stay."""
        if h not in self._known:
            found = self._differences(h)
            result = np.eye(self.size + _COMMANDS)
            result[: len(COORDINATES)] = after = found[: len(COORDINATES)]
            if self._lags:
                later = found[len(COORDINATES) :]
                result[len(COORDINATES) : self.size] = self._seen @ (later - self._next[:, : len(COORDINATES)] @ after)
            self._known[h] = result
        return self._known[h]

    def _differences(self, h: float) -> Floats:
        """d(vehicle after `h` [s])/d(what is moved), below it a plant interval later if the actuators lag.

        Raises `NotSmooth` where there is none, as with motors that rise faster than they fall.
        """
        with self._load() as plant:
            after = self._answer(plant, h)
            still = after(self._at_hover, self._trim)
            flown = [[after(*start) - still for start in pair] for pair in self._moved]
        for plus, minus in flown:
            if np.abs(plus + minus).max() > _BENT * np.abs(plus - minus).max() + STEP**2:
                raise NotSmooth("the plant answers to a rise otherwise than to a fall, so hover has no linear loop")
        return np.column_stack([(plus - minus) / (2.0 * STEP) for plus, minus in flown])

    def _saved(self, parameters: dict[str, float], command: Floats) -> bytes:
        """The plant's state after initialisation with these parameters and this first command."""
        component = dataclasses.replace(self._plant, parameters={**self._plant.parameters, **parameters})
        with self._load() as plant:
            set_parameters(plant, component)
            _initialise(plant, wiring.COMMAND, command)
            return plant.save()

    def _load(self) -> AbstractContextManager[Instance]:
        return self._fleet.load(Path(self._plant.fmu), "plant")

    def _answer(self, plant: Instance, h: float) -> Callable[[bytes, Floats], Floats]:
        """The vehicle `h` [s] after a state under a command, and if the actuators lag a plant interval later too,
        under the trim. All parameters are those of the state.
        """
        command, measured = np.zeros(_COMMANDS), np.zeros(len(wiring.MEASUREMENT))
        write, read = plant.writer(wiring.COMMAND, command), plant.reader(wiring.MEASUREMENT, measured)

        def after(state: bytes, given: Floats) -> Floats:
            plant.restore(state)
            found = []
            for start, duration, held in ((0.0, h, given), (h, self.interval, self._trim))[: 1 + self._lags]:
                command[:] = held
                write()
                plant.step(start, duration)
                read()
                found.append(measured[_MEASURED])
            return np.concatenate(found)

        return after

    def _expect_equilibrium(self, at_hover: bytes) -> None:
        with self._load() as plant:
            drift = float(np.abs(self._answer(plant, self.interval)(at_hover, self._trim)).max())
        if drift > 1e-9:
            raise UsageError(
                f"hover is no equilibrium, the vehicle drifts by {drift:.2g} in a plant interval; expected a "
                "controller with the plant's mass and gravity"
            )


_UNITS = np.eye(_COMMANDS)
_BOTH_WAYS = (STEP, -STEP)
_FORGOTTEN = 1e-9
"""of a command: how far it may be from what it was before the controller measured something else"""


def _controller_at_hover(hover: Scenario, fleet: Instances) -> tuple[Floats, Floats]:
    """The command at hover and its derivative by the coordinates, shape (4, 12).

    Raises `UsageError` for a controller with a memory: its command is no function of the vehicle's state.
    """
    with prepared(hover, load=fleet.load) as flight:
        controller = flight.instances["controller"]
        at_rest = _measurement({})
        _initialise(controller, wiring.MEASUREMENT, at_rest)
        step = min(STEP, 1e-3 * _value(controller, wiring.BOUNDARY_LAYER, absent=1.0))

        instants = itertools.count()

        def command(measurement: Floats) -> Floats:
            result: Floats = np.zeros(_COMMANDS)
            controller.writer(wiring.MEASUREMENT, measurement)()
            controller.step(next(instants) * hover.timing.period, hover.timing.period)
            controller.reader(wiring.COMMAND, result)()
            return result

        columns = []
        for name in COORDINATES:
            plus, minus = (command(_measurement(_displaced(name, size))) for size in (step, -step))
            columns.append((plus - minus) / (2.0 * step))
        trim = command(at_rest)
        away = at_rest + 1e3 * step
        later = [command(x) for x in (away, away, at_rest)]
        if np.abs(later[-1] - trim).max() > _FORGOTTEN * max(1.0, float(np.abs(trim).max())):
            raise UsageError("the controller's command depends on what it measured before")
        return trim, np.column_stack(columns)


def _value(fmu: Instance, name: str, *, absent: float) -> float:
    """What a Real variable of an FMU is; `absent` if it has none of that name."""
    if name not in fmu.variables:
        return absent
    value: Floats = np.zeros(1)
    fmu.reader((name,), value)()
    return float(value[0])


def _displaced(name: str, size: float) -> dict[str, float]:
    """Initial values of a vehicle at hover but for one coordinate, the quaternion of unit length."""
    moved = {f"initial.{name}": size}
    if name in wiring.QUATERNION:
        moved[f"initial.{SCALAR_PART}"] = math.sqrt(1.0 - size * size)
    return moved


def _measurement(initial: dict[str, float]) -> Floats:
    at_rest = {f"initial.{SCALAR_PART}": 1.0} | initial
    return np.array([at_rest.get(f"initial.{name}", 0.0) for name in wiring.MEASUREMENT])


def _initialise(fmu: Instance, inputs: tuple[str, ...], values: Floats) -> None:
    fmu.enter_initialization(0.0, math.inf)
    fmu.writer(inputs, values)()
    fmu.exit_initialization()
