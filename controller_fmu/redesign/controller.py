"""A controller whose command may be redesigned for the time during which it is held, and for a known delay."""

import math
from abc import abstractmethod
from typing import Any, ClassVar

from controller_fmu.redesign.interface import Discretisation, RedesignInterface
from controller_fmu.redesign.matching import matched_command
from controller_fmu.redesign.nominal import closed_loop, under_command
from controller_fmu.redesign.prediction import MAX_PENDING, SentCommand, all_sent, predicted_state, with_command
from controller_fmu.sampled import SHORTEST_PERIOD, SampledController
from controller_fmu.vehicle import Measurement
from fmu_kit.algebra import Vec3
from fmu_kit.errors import require, require_finite_state
from fmu_kit.interface import set_fields
from fmu_kit.rigid_body import RigidState, Wrench
from fmu_kit.saved_state import State
from fmu_kit.trajectory import Reference

_COMMAND = ("thrust", "torque.x", "torque.y", "torque.z")


def _of(condition: bool, one: float, other: float) -> float:
    """One of two values; chosen by a function, so that the C that uses it is not duplicated."""
    return one if condition else other


class RedesignedController(SampledController, RedesignInterface):
    """Holds the redesigned command of a law that is a pure function: laws define `evaluation`.

    Thrust and torque are the redesign's; all other outputs and locals are the law's at the sample.
    """

    offers_semi_implicit: ClassVar[bool] = False
    """Whether `evaluation` accepts an `implicit` time other than zero."""

    @abstractmethod
    def evaluation(self, measurement: Measurement, reference: Reference, implicit: float) -> Any:
        """The result of the law, with thrust, torque and energy, as a named tuple with the names of variables.

        With `implicit` > 0 [s], that of its semi-implicit form over this time.
        """

    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Evaluate the law and set the variables; raises `DivergenceError` if it has no finite command."""
        result = self.evaluation(measurement, reference, 0.0)
        require_finite_state((*_COMMAND, "energy"), (result.thrust, *result.torque, result.energy))
        set_fields(self, result)

    def read_parameters(self) -> None:
        """Read the parameters, those of the redesign included."""
        super().read_parameters()
        period = self.hold_period
        require(period == 0.0 or period >= SHORTEST_PERIOD, "hold_period", period, f"0 or at least {SHORTEST_PERIOD} s")
        self._hold_period = period if period > 0.0 else self.sample_period
        require(
            self.offers_semi_implicit or self.discretisation != Discretisation.SEMI_IMPLICIT,
            "discretisation",
            "semi_implicit",
            "another: this law has no semi-implicit form",
        )

    def initialise(self, t: float) -> None:
        """Hold the command for the initial inputs, which acts at once and until that of the first sample."""
        self._pending = all_sent(t, self._held_command())  # a placeholder: nothing is predicted from it
        super().initialise(t)
        self._pending = all_sent(t - self.prediction, self._held_command())

    def internal_state(self) -> State:
        """The clock, and the pending commands."""
        pending = [[sent.time, sent.command.thrust, *sent.command.torque] for sent in self._pending]
        return {**super().internal_state(), "pending": pending}

    def restore(self, state: State) -> None:
        """Restore the clock and the pending commands."""
        super().restore(state)
        pending = [[float(number) for number in sent] for sent in state["pending"]]
        self._pending = tuple(SentCommand(t, Wrench(thrust, Vec3(x, y, z))) for t, thrust, x, y, z in pending)
        if len(self._pending) != MAX_PENDING:
            raise ValueError(len(self._pending))

    def sample(self, t: float, h: float) -> None:
        """Hold the redesigned command, and record it as pending if there is a delay."""
        super().sample(t, h)
        if self.prediction > 0.0 and h > 0.0:
            self._record_command(t)

    def respond(self, t: float, h: float, measurement: Measurement) -> None:
        """Write the law's command at the sample; then, if configured, the redesigned one."""
        super().respond(t, h, measurement)
        if self.discretisation != Discretisation.EXPLICIT or self.prediction > 0.0:
            self._redesign(t, h, measurement)

    def _record_command(self, t: float) -> None:
        self._pending = with_command(self._pending, t, self._held_command())

    def _held_command(self) -> Wrench:
        return Wrench(self.thrust, self.torque)

    def _redesign(self, t: float, h: float, measurement: Measurement) -> None:
        """Hold the redesigned command; at initialisation (`h` = 0) none is pending, and it acts at once."""
        hold = self._hold_period if self._hold_period > 0.0 else h
        state, start = RigidState(*measurement), t
        if self.prediction > 0.0 and h > 0.0:
            state, start = self._predicted(t, state, hold), t + self.prediction
        elif hold == 0.0:
            return
        command = self._discretised(t, start, state, hold)
        require_finite_state(_COMMAND, (command.thrust, *command.torque))
        self.thrust, self.torque = command

    def _discretised(self, sampled: float, t: float, state: RigidState, hold: float) -> Wrench:
        """The command to be held over [t, t + hold] from `state`, known at the time `sampled`."""
        kind, count = self.discretisation, self.stages
        if kind <= Discretisation.SEMI_IMPLICIT:
            return self._law(sampled, t, state, _of(kind == Discretisation.SEMI_IMPLICIT, hold, 0.0))
        horizon = _of(kind == Discretisation.MIDPOINT, 0.5 * hold, hold)
        end = closed_loop(
            lambda time, x: self._law(sampled, time, x, 0.0), self._model, t, state, horizon / count, count
        )
        if kind == Discretisation.MIDPOINT:
            return self._law(sampled, t + horizon, end.state, 0.0)
        mean = Wrench(end.impulse.thrust / hold, end.impulse.torque / hold)
        if kind == Discretisation.MEAN:
            return mean
        return self._matched(state, end.state, mean, hold)

    def _matched(self, state: RigidState, target: RigidState, first: Wrench, hold: float) -> Wrench:
        def simulate(command: Wrench) -> RigidState:
            return self._advanced(state, command, hold / self.stages, self.stages)

        return matched_command(simulate, self._model, target, first, self.weight / hold)

    def _predicted(self, t: float, state: RigidState, hold: float) -> RigidState:
        """The predicted state at the time when a command sent at `t` acts."""
        oldest, delay = self._pending[0].time, self.prediction
        require(
            oldest + delay <= t + 1e-6 * delay,
            "prediction",
            delay,
            f"at most {t - oldest:g} s: {MAX_PENDING} commands can be pending",
        )
        longest = hold / self.stages

        def advanced(x: RigidState, command: Wrench, time: float) -> RigidState:
            count = math.ceil(time / longest - 1e-6)
            return self._advanced(x, command, time / max(count, 1), count)

        return predicted_state(advanced, state, t, delay, self._pending)

    def _advanced(self, state: RigidState, command: Wrench, step: float, count: int) -> RigidState:
        """The nominal model after some steps under a held command."""
        return under_command(self._model, state, command, step, count)

    def _law(self, sampled: float, t: float, state: RigidState, implicit: float) -> Wrench:
        """The law's command at `t` in a state of the nominal model, with the reference known at the time `sampled`."""
        measurement = Measurement(state.position, state.velocity, state.quaternion, state.angular_velocity)
        result = self.evaluation(measurement, self._reference_ahead(sampled, t), implicit)
        return Wrench(result.thrust, result.torque)

    def _reference_ahead(self, sampled: float, t: float) -> Reference:
        """The built-in trajectory at `t`, or the extrapolation of the reference inputs."""
        if not self.use_reference_inputs:
            return self._built_in(t)
        return self._reference(sampled).after(t - sampled)
