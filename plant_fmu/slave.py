"""The quadrotor as an FMU: integrates the rigid body over each communication step."""

import math

from fmu_kit.algebra import Vec3
from fmu_kit.errors import require, require_finite_state
from fmu_kit.integrator import internal_steps, rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, acceleration, derivative, tilt
from fmu_kit.saved_state import State
from fmu_kit.scalar import repeat
from fmu_kit.slave import Slave
from plant_fmu.dynamics import Actuators, Wind
from plant_fmu.interface import MOTION, QUADROTOR

MOST_INTERNAL_STEPS = 100_000
"""In one communication step: some seconds of work, during which no master can get in between"""
_MOTION_NAMES = tuple(variable.name for variable in MOTION)


class QuadrotorPlant(Slave):
    """A quadrotor as a rigid body with wind, actuator limits and lag."""

    variables = QUADROTOR
    description = "Quadrotor as a rigid body: thrust and body torques in, motion out"
    initial_outputs_depend_on_inputs = False

    def read_parameters(self) -> None:
        """Build the body, the wind and the actuators."""
        self._body = Body(mass=self.real("mass"), inertia=self.inertia(), gravity=self.real("gravity"))
        self._wind = Wind(amplitude=self.vec3("wind.amplitude"), frequency=self.real("wind.frequency"))
        self._actuators = Actuators(
            thrust_max=self.real("thrust_max"),
            torque_max=self.real("torque_max"),
            time_constant=self.real("actuator_time_constant"),
        )
        self._largest_step = self.real("max_internal_step")

    def initialise(self, t: float) -> None:
        """Start at the initial state, the actuators at the limited initial command."""
        quaternion = self.quaternion("initial.quaternion")
        require(any(quaternion), "initial.quaternion", tuple(quaternion), "a quaternion that is not zero")
        self._state = RigidState(
            self.vec3("initial.position"),
            self.vec3("initial.velocity"),
            quaternion.unit(),
            self.vec3("initial.angular_velocity"),
        )
        self._wrench = self._actuators.limited(self._command())
        self._write(t)

    def step(self, t: float, h: float) -> None:
        """Integrate from `t` to `t + h` in equal internal steps, the command held."""
        body, wind, actuators = self._body, self._wind, self._actuators
        start, target = self._wrench, actuators.limited(self._command())
        external = self.vec3("external_force")

        def f(time: float, x: RigidState) -> RigidState:
            wrench = actuators.response(start, target, time - t)
            return derivative(x, wrench, wind.force(time) + external, body)

        require(
            h <= MOST_INTERNAL_STEPS * self._largest_step,
            "communicationStepSize",
            h,
            f"at most {MOST_INTERNAL_STEPS} times max_internal_step = {self._largest_step} s",
        )
        count = internal_steps(h, self._largest_step)
        internal = h / count
        self._state = repeat(
            count, lambda i, state: rk4_step(f, t + i * internal, state, internal).normalised(), self._state
        )
        self._wrench = actuators.response(start, target, h)
        self._write(t + h)

    def internal_state(self) -> State:
        """The actuators; the motion is among the variables."""
        torque = self._wrench.torque
        return {"thrust": self._wrench.thrust, "torque": [torque.x, torque.y, torque.z]}

    def restore(self, state: State) -> None:
        """Put the actuators and the motion back."""
        x, y, z = map(float, state["torque"])
        self._wrench = Wrench(float(state["thrust"]), Vec3(x, y, z))
        self._state = RigidState(
            self.vec3("position"), self.vec3("velocity"), self.quaternion("quaternion"), self.vec3("angular_velocity")
        )

    def _command(self) -> Wrench:
        return Wrench(self.real("thrust"), self.vec3("torque"))

    def _write(self, t: float) -> None:
        state = self._state
        values = (*state.position, *state.velocity, *state.quaternion, *state.angular_velocity)
        if not math.isfinite(sum(values)):
            require_finite_state(_MOTION_NAMES, values)
        first = self._index["position.x"]
        self._reals[first : first + len(values)] = values
        wind = self._wind.force(t)
        force = wind + self.vec3("external_force")
        self.put_vec3("acceleration", acceleration(state.quaternion, self._wrench.thrust, force, self._body))
        self.put_vec3("wind.force", wind)
        self.put("tilt", tilt(state.quaternion))
