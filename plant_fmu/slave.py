"""The quadrotor as an FMU: integrates the rigid body over each communication step."""

import math
from dataclasses import replace

from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.authors import AUTHOR, LICENSE
from fmu_kit.errors import require, require_finite_state
from fmu_kit.integrator import internal_steps, rk4_step
from fmu_kit.interface import read_fields
from fmu_kit.rigid_body import Body, RigidState, Wrench, derivative
from fmu_kit.saved_state import State
from fmu_kit.scalar import FLOAT, repeat
from fmu_kit.variables import INDEX
from plant_fmu.actuators import Actuators, Box, Channels, Motors
from plant_fmu.interface import PlantInterface
from plant_fmu.observed import Observed
from plant_fmu.payload import Payload
from plant_fmu.wind import Wind

MAX_INTERNAL_STEPS = 100_000
"""Limit for one communication step: some seconds of work, which a master cannot interrupt"""
RECALL = 1.0
"""Rate at which the length of the attitude returns to one, in model exchange [1/s]"""
_MOTION = tuple(each.name for each in PlantInterface.variables if each.causality == "output")


class QuadrotorPlant(Observed):
    """Quadrotor as a rigid body: thrust and body torques in, motion out.

    With wind, actuator limits and lag.
    """

    author, license = AUTHOR, LICENSE
    continuous_states = ("position", "velocity", "quaternion", "angular_velocity", "_channels")

    @classmethod
    def initial_dependencies(cls, output: str) -> frozenset[str] | None:
        """The motion depends on its initial value; the quaternion on all of its parts, and on the axes convention.

        An output that is observed is not said to depend on some alone.
        """
        if output not in _MOTION:
            return None
        vector, _, axis = output.rpartition(".")
        if vector == "quaternion":
            return frozenset({"frame", f"frame{INDEX}", *(f"initial.quaternion.{other}" for other in "xyzw")})
        return frozenset({f"initial.{vector}.{axis}"})

    def read_parameters(self) -> None:
        """Build the body, the wind, the payload and the actuators."""
        self._body = read_fields(self, Body)
        self._wind, self._payload = read_fields(self, Wind, "wind_"), read_fields(self, Payload, "payload_")
        self._actuators = self._read_actuators()

    def initialise(self, t: float) -> None:
        """Start at the initial state, the actuators at the limited initial command."""
        quaternion = self.initial_quaternion
        require(any(quaternion), "initial.quaternion", tuple(quaternion), "a quaternion that is not zero")
        self._state = RigidState(
            self.initial_position, self.initial_velocity, quaternion.unit(), self.initial_angular_velocity
        )
        self._channels = self._actuators.limited(self._command())
        self._write(t)

    def step(self, t: float, h: float) -> None:
        """Integrate from `t` to `t + h` in equal internal steps, with the command held.

        If the payload is dropped within it, each part of the step is divided into equal internal steps.
        """
        body, wind, actuators = self._body, self._wind, self._actuators
        largest = self.max_internal_step
        start, target = self._channels, actuators.limited(self._command())
        external = self.external_force
        require(
            h <= MAX_INTERNAL_STEPS * largest,
            "communicationStepSize",
            h,
            f"at most {MAX_INTERNAL_STEPS} times max_internal_step = {largest} s",
        )
        carried = self._payload.until_drop(t, h)
        loaded, bare, drop = self._mass_at(t), self._mass_at(t + carried), t + carried
        first = FLOAT.where(carried > 0.0, internal_steps(carried, largest), 0)
        second = internal_steps(h - carried, largest)
        before, after = carried / internal_steps(carried, largest), (h - carried) / second

        def move(i: int, state: RigidState) -> RigidState:
            current = body.with_mass(FLOAT.where(i < first, loaded, bare))
            time = FLOAT.where(i < first, t + i * before, drop + (i - first) * after)

            def f(at: float, x: RigidState) -> RigidState:
                wrench = actuators.wrench(actuators.response(start, target, at - t))
                return derivative(x, wrench, wind.force(at) + external, current)

            return rk4_step(f, time, state, FLOAT.where(i < first, before, after)).normalised()

        self._state = repeat(first + second, move, self._state)
        self._channels = actuators.response(start, target, h)
        self._write(t + h)

    def derivatives(self, t: float, since: float) -> tuple[Vec3, Vec3, Quaternion, Vec3, Channels]:
        """The right-hand side of the motion and of the actuators, with the payload that is carried `since` [s].

        A solver does not keep the length of the attitude Q: dQ/dt has the term RECALL (1 - |Q|²) Q, which vanishes at
        length one, and forces act along the axes of the unit quaternion in its direction.
        """
        actuators, target = self._actuators, self._actuators.limited(self._command())
        channels = actuators.response(self._channels, target, 0.0)
        state = RigidState(self.position, self.velocity, self.quaternion, self.angular_velocity)
        force = self._wind.force(t) + self.external_force
        moving = derivative(
            state.normalised(), actuators.wrench(channels), force, self._body.with_mass(self._mass_at(since))
        )
        attitude = state.quaternion
        recall = RECALL * (1.0 - attitude.vector @ attitude.vector - attitude.scalar * attitude.scalar)
        turning = attitude.rate(state.angular_velocity).plus(recall, attitude)
        rates = (*moving.position, *moving.velocity, *turning, *moving.angular_velocity)
        if not math.isfinite(sum(rates)):
            require_finite_state([f"der({name})" for name in _MOTION], rates)
        self._look(t, attitude.normalised(), channels, self._mass_at(since))
        return moving.position, moving.velocity, turning, moving.angular_velocity, actuators.rate(channels, target)

    def next_jump(self) -> float:
        """The time [s] at which the payload is dropped."""
        dropped: float = self.payload_drop_time
        return dropped

    def internal_state(self) -> State:
        """The actuators and the attitude; the rest of the motion is among the variables."""
        return {"actuators": list(self._channels), "attitude": list(self._state.quaternion)}

    def restore(self, state: State) -> None:
        """Restore the actuators and the motion."""
        a, b, c, d = map(float, state["actuators"])
        self._channels = Channels(a, b, c, d)
        x, y, z, w = map(float, state["attitude"])
        attitude = Quaternion.from_xyzw(x, y, z, w)  # in other axes, the variable differs in the last bit
        self._state = RigidState(self.position, self.velocity, attitude, self.angular_velocity)

    def _read_actuators(self) -> Actuators:
        lag, motors = self.actuator_time_constant, read_fields(self, Motors, "motor_")
        highest, lowest = self.thrust_max, self.thrust_min
        require(lowest <= highest, "thrust_min", lowest, f"at most {highest}, the largest")
        box = Box(thrust_max=highest, thrust_min=lowest, torque_max=self.torque_max, time_constant=lag)
        motors = replace(motors, up=_unless_zero(motors.up, lag), down=_unless_zero(motors.down, lag))
        if motors.thrust_max > 0.0:
            highest = motors.thrust_max
            require(
                motors.thrust_min <= highest, "motor.thrust_min", motors.thrust_min, f"at most {highest}, the largest"
            )
        return Actuators(box=box, motors=motors)

    def _mass_at(self, t: float) -> float:
        mass: float = self._body.mass + self._payload.carried(t)
        return mass

    def _command(self) -> Wrench:
        return Wrench(self.thrust, self.torque)

    def _write(self, t: float) -> None:
        state = self._state
        values = (*state.position, *state.velocity, *state.quaternion, *state.angular_velocity)
        if not math.isfinite(sum(values)):
            require_finite_state(_MOTION, values)
        self.position, self.velocity = state.position, state.velocity
        self.quaternion, self.angular_velocity = state.quaternion, state.angular_velocity
        self._look(t, state.quaternion, self._channels, self._mass_at(t))

    def _look(self, t: float, attitude: Quaternion, channels: Channels, mass: float) -> None:
        """Set what is observed."""
        self.observe(attitude, self._actuators.wrench(channels), self._wind.force(t), self._body.with_mass(mass))


def _unless_zero(own: float, general: float) -> float:
    """The value of the motors if given, else that of all actuators."""
    if own == 0.0:
        return general
    return own
