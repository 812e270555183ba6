"""Derivatives of the plant FMU over a span of time about hover, by differences through its saved states."""

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
from orchestration.quadrotor.flight.hover import COORDINATES, STEP, displaced
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.engines.resolved import resolve
from orchestration.simulation.runs.prepared import set_parameters

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
