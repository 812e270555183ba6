"""The cascade as an FMU: runs each loop when its turn is, holds what it has come to, and keeps what it remembers."""

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.attitude_loop import AttitudeLoop, attitude_of
from controller_fmu.cascaded.interface import CASCADED
from controller_fmu.cascaded.position_loop import PositionLoop
from controller_fmu.cascaded.rate_loop import RateLoop, RateState, control_rate, rate_state_at
from controller_fmu.cascaded.velocity_loop import VelocityLoop, VelocityState, control_velocity, velocity_state_at
from controller_fmu.sampled import SampledController
from controller_fmu.vehicle import Measurement
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.errors import require, require_finite_state
from fmu_kit.saved_state import State
from fmu_kit.trajectory import Reference

_RESULTS = ("thrust", "torque.x", "torque.y", "torque.z")


class CascadedController(SampledController):
    """Position, velocity, attitude and rate loops; a sample runs the rate loop, and the others every few samples."""

    variables = CASCADED
    description = (
        "Cascade of position, velocity, attitude and rate loops for a quadrotor, with PX4's structure, sampled"
    )

    initially_idle = SampledController.initially_idle | {
        "angular_velocity.z",
        *(f"reference.{name}.{axis}" for name in ("jerk", "snap") for axis in "xyz"),
    }

    def read_gains(self) -> None:
        """Take over the loops, the airframe and the ratios."""
        self._airframe = Airframe(
            motor_thrust=self.real("motor.thrust_max"),
            arm_x=self.real("motor.arm.x"),
            arm_y=self.real("motor.arm.y"),
            drag_to_thrust=self.real("motor.drag_to_thrust"),
        )
        self._read_translation()
        self._read_rotation()
        self._velocity_ratio = self.count("velocity_ratio")
        self._attitude_ratio = self.count("attitude_ratio")

    def initialise(self, t: float) -> None:
        """Hold the command for the initial inputs; nothing of them is remembered, as this is not a sample."""
        self._now = self._velocity_time = self._rate_time = t
        self._begun, self._runs = False, 0
        self._velocity_state, self._rate_state = velocity_state_at(_zero()), rate_state_at(_zero())
        self._thrust, self._desired_attitude, self._desired_rate = 0.0, Quaternion(_zero(), 1.0), _zero()
        super().initialise(t)
        self._begun = False

    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Run the loops whose turn it is; raises `DivergenceError` if they have no finite command."""
        if not self._begun:
            self._begin(measurement)
        if self._runs % self._velocity_ratio == 0:
            self._run_translation(measurement, reference)
        if self._runs % self._attitude_ratio == 0:
            self._run_attitude(measurement.quaternion)
        self._run_rate(measurement)
        self._runs = self._runs + 1
        self._write_errors(measurement, reference)

    def internal_state(self) -> State:
        """The clock, the turns and what the loops remember; what they hold is among it."""
        velocity, rate = self._velocity_state, self._rate_state
        return {
            **super().internal_state(),
            "begun": self._begun,
            "runs": self._runs,
            "times": [self._velocity_time, self._rate_time],
            "velocity": [list(v) for v in velocity],
            "rate": [list(v) for v in (*rate[:3], rate.cut)],
            "yaw_command": rate.yaw_command,
            "thrust": self._thrust,
            "desired_attitude": list(self._desired_attitude),
            "desired_rate": list(self._desired_rate),
        }

    def restore(self, state: State) -> None:
        """Put all of it back."""
        super().restore(state)
        self._begun, self._runs = bool(state["begun"]), int(state["runs"])
        self._velocity_time, self._rate_time = map(float, state["times"])
        integral, velocity, acceleration = map(_vector, state["velocity"])
        self._velocity_state = VelocityState(integral, velocity, acceleration)
        integral, velocity, acceleration, cut = map(_vector, state["rate"])
        self._rate_state = RateState(integral, velocity, acceleration, float(state["yaw_command"]), cut)
        self._thrust = float(state["thrust"])
        x, y, z, w = map(float, state["desired_attitude"])
        self._desired_attitude = Quaternion.from_xyzw(x, y, z, w)
        self._desired_rate = _vector(state["desired_rate"])

    # -- the loops --------------------------------------------------------------------------------------------

    def sample(self, t: float, h: float) -> None:
        """As any controller; the loops know the time."""
        self._now = t
        super().sample(t, h)

    def _begin(self, measurement: Measurement) -> None:
        """The first measurement: from here on there are changes and elapsed times."""
        self._begun, self._runs = True, 0
        self._velocity_time = self._rate_time = self._now
        self._velocity_state = velocity_state_at(measurement.velocity)
        self._rate_state = rate_state_at(measurement.angular_velocity)

    def _run_translation(self, measurement: Measurement, reference: Reference) -> None:
        desired = self._position_loop.velocity(measurement.position, reference.position, reference.velocity)
        force, self._velocity_state = control_velocity(
            self._velocity_loop,
            self._velocity_state,
            measurement.velocity,
            desired,
            reference.acceleration,
            self._now - self._velocity_time,
            self._model,
            self._airframe.full_thrust,
        )
        self._velocity_time = self._now
        self._thrust, self._desired_attitude = force.norm(), attitude_of(force)
        self.put_vec3("desired_velocity", desired)
        self.put_vec3("velocity_integral", self._velocity_state.integral)

    def _run_attitude(self, attitude: Quaternion) -> None:
        self._desired_rate = self._attitude_loop.angular_velocity(attitude, self._desired_attitude)

    def _run_rate(self, measurement: Measurement) -> None:
        torque, self._rate_state = control_rate(
            self._rate_loop,
            self._rate_state,
            measurement.angular_velocity,
            self._desired_rate,
            self._now - self._rate_time,
            self._model.inertia,
            self._airframe,
        )
        self._rate_time = self._now
        require_finite_state(_RESULTS, (self._thrust, *torque))
        self.put("thrust", self._thrust)
        self.put_vec3("torque", torque)
        self.put_vec3("rate_integral", self._rate_state.integral)

    def _write_errors(self, measurement: Measurement, reference: Reference) -> None:
        self.put_vec3("position_error", measurement.position - reference.position)
        self.put_vec3("velocity_error", measurement.velocity - reference.velocity)
        self.put_quaternion("desired_quaternion", self._desired_attitude)
        self.put_quaternion("attitude_error", self._desired_attitude.inverse() * measurement.quaternion)
        self.put_vec3("desired_angular_velocity", self._desired_rate)
        self.put_vec3("angular_velocity_error", measurement.angular_velocity - self._desired_rate)

    # -- parameters -------------------------------------------------------------------------------------------

    def _read_translation(self) -> None:
        self._position_loop = PositionLoop(
            gain=self._plane("gain.position"),
            horizontal_limit=self.real("limit.velocity.horizontal"),
            upward_limit=self.real("limit.velocity.up"),
            downward_limit=self.real("limit.velocity.down"),
        )
        least, most = self.real("limit.thrust.least"), self.real("limit.thrust.most")
        require(least <= most, "limit.thrust.least", least, f"at most limit.thrust.most = {most}")
        self._velocity_loop = VelocityLoop(
            proportional=self._plane("gain.velocity"),
            integral=self._plane("gain.velocity_integral"),
            derivative=self._plane("gain.velocity_derivative"),
            derivative_cutoff=self.real("cutoff.velocity_derivative"),
            tilt_limit=self.real("limit.tilt"),
            least_thrust=least,
            most_thrust=most,
            horizontal_margin=self.real("limit.thrust.horizontal_margin"),
        )

    def _read_rotation(self) -> None:
        self._attitude_loop = AttitudeLoop(
            gain=self.vec3("gain.attitude"),
            yaw_weight=self.real("yaw_weight"),
            rate_limit=self.vec3("limit.angular_velocity"),
        )
        self._rate_loop = RateLoop(
            proportional=self.vec3("gain.rate"),
            integral=self.vec3("gain.rate_integral"),
            derivative=self.vec3("gain.rate_derivative"),
            feedforward=self.vec3("gain.rate_feedforward"),
            integral_limit=self.vec3("limit.rate_integral"),
            derivative_cutoff=self.real("cutoff.rate_derivative"),
            yaw_cutoff=self.real("cutoff.yaw_torque"),
        )

    def _plane(self, name: str) -> Vec3:
        horizontal = self.real(f"{name}.horizontal")
        return Vec3(horizontal, horizontal, self.real(f"{name}.vertical"))


def _vector(values: list[float]) -> Vec3:
    x, y, z = map(float, values)
    return Vec3(x, y, z)


def _zero() -> Vec3:
    """One of its own each time, as it is kept."""
    return Vec3(0.0, 0.0, 0.0)
