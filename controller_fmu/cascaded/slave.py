"""The cascade as an FMU: it runs each loop at its rate, holds the results, and keeps the states of the loops."""

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.attitude_loop import AttitudeLoop, attitude_of
from controller_fmu.cascaded.interface import CascadeInterface
from controller_fmu.cascaded.position_loop import PositionLoop
from controller_fmu.cascaded.rate_loop import RateLoop, RateState, control_rate, initial_rate_state
from controller_fmu.cascaded.velocity_loop import VelocityLoop, VelocityState, control_velocity, initial_velocity_state
from controller_fmu.sampled import SampledController
from controller_fmu.vehicle import Measurement
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.errors import require, require_finite_state
from fmu_kit.interface import read_fields
from fmu_kit.saved_state import State
from fmu_kit.trajectory import Reference

_RESULTS = ("thrust", "torque.x", "torque.y", "torque.z")


class CascadedController(SampledController, CascadeInterface):
    """Cascade of position, velocity, attitude and rate loops for a quadrotor, with PX4's structure, sampled.

    Each sample runs the rate loop; the other loops run every few samples.
    """

    initially_idle = SampledController.initially_idle | {
        *(f"reference.{name}.{axis}" for name in ("jerk", "snap") for axis in "xyz"),
    }

    def read_parameters(self) -> None:
        """Read the airframe and the loops."""
        super().read_parameters()
        self._airframe = read_fields(self, Airframe, "motor_")
        self._read_translation()
        self._attitude_loop = AttitudeLoop(
            gain=self.attitude_gain, yaw_weight=self.yaw_weight, rate_limit=self.rate_limit
        )
        self._rate_loop = read_fields(self, RateLoop, "rate_")

    def initialise(self, t: float) -> None:
        """Hold the command for the initial inputs; as this is not a sample, the loops keep no state of it."""
        self._now = self._velocity_time = self._rate_time = t
        self._started, self._runs = False, 0
        self._velocity_state, self._rate_state = initial_velocity_state(_zero()), initial_rate_state(_zero())
        self._thrust, self._desired_attitude, self._desired_rate = 0.0, Quaternion(_zero(), 1.0), _zero()
        super().initialise(t)
        self._started = False

    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Run the loops that are due; raises `DivergenceError` if they have no finite command."""
        if not self._started:
            self._start_loops(measurement)
        if self._runs % self.velocity_ratio == 0:
            self._run_translation(measurement, reference)
        if self._runs % self.attitude_ratio == 0:
            self._run_attitude(measurement.quaternion, reference.yaw_rate)
        self._run_rate(measurement)
        self._runs = self._runs + 1
        self._write_errors(measurement, reference)

    def internal_state(self) -> State:
        """The clock, the count of runs, and the states and held results of the loops."""
        velocity, rate = self._velocity_state, self._rate_state
        return {
            **super().internal_state(),
            "begun": self._started,
            "runs": self._runs,
            "times": [self._velocity_time, self._rate_time],
            "velocity": [list(v) for v in velocity],
            "rate": [list(v) for v in (*rate[:3], rate.excess)],
            "yaw_command": rate.yaw_command,
            "thrust": self._thrust,
            "desired_attitude": list(self._desired_attitude),
            "desired_rate": list(self._desired_rate),
        }

    def restore(self, state: State) -> None:
        """Restore all of it."""
        super().restore(state)
        self._started, self._runs = bool(state["begun"]), int(state["runs"])
        self._velocity_time, self._rate_time = map(float, state["times"])
        integral, velocity, acceleration = map(_vector, state["velocity"])
        self._velocity_state = VelocityState(integral, velocity, acceleration)
        integral, velocity, acceleration, excess = map(_vector, state["rate"])
        self._rate_state = RateState(integral, velocity, acceleration, float(state["yaw_command"]), excess)
        self._thrust = float(state["thrust"])
        x, y, z, w = map(float, state["desired_attitude"])
        self._desired_attitude = Quaternion.from_xyzw(x, y, z, w)
        self._desired_rate = _vector(state["desired_rate"])

    # -- the loops --------------------------------------------------------------------------------------------

    def sample(self, t: float, h: float) -> None:
        """Sample as any controller, recording the time for the loops."""
        self._now = t
        super().sample(t, h)

    def _start_loops(self, measurement: Measurement) -> None:
        """Start the loops at the first measurement."""
        self._started, self._runs = True, 0
        self._velocity_time = self._rate_time = self._now
        self._velocity_state = initial_velocity_state(measurement.velocity)
        self._rate_state = initial_rate_state(measurement.angular_velocity)

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
        self._thrust, self._desired_attitude = force.norm(), attitude_of(force, reference.yaw)
        self.desired_velocity, self.held_velocity_integral = desired, self._velocity_state.integral

    def _run_attitude(self, attitude: Quaternion, yaw_rate: float) -> None:
        self._desired_rate = self._attitude_loop.angular_velocity(attitude, self._desired_attitude, yaw_rate)

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
        self.thrust, self.torque, self.held_rate_integral = self._thrust, torque, self._rate_state.integral

    def _write_errors(self, measurement: Measurement, reference: Reference) -> None:
        self.position_error = measurement.position - reference.position
        self.velocity_error = measurement.velocity - reference.velocity
        self.desired_quaternion = self._desired_attitude
        self.attitude_error = self._desired_attitude.inverse() * measurement.quaternion
        self.desired_angular_velocity = self._desired_rate
        self.angular_velocity_error = measurement.angular_velocity - self._desired_rate

    def _read_translation(self) -> None:
        self._position_loop = PositionLoop(
            gain=_of_axes(self.position_horizontal, self.position_vertical),
            horizontal_limit=self.horizontal_limit,
            upward_limit=self.upward_limit,
            downward_limit=self.downward_limit,
        )
        least, most = self.least_thrust, self.most_thrust
        require(least <= most, "limit.thrust.least", least, f"at most limit.thrust.most = {most}")
        self._velocity_loop = VelocityLoop(
            proportional=_of_axes(self.velocity_horizontal, self.velocity_vertical),
            integral=_of_axes(self.velocity_integral_horizontal, self.velocity_integral_vertical),
            derivative=_of_axes(self.velocity_derivative_horizontal, self.velocity_derivative_vertical),
            derivative_cutoff=self.velocity_derivative_cutoff,
            tilt_limit=self.tilt_limit,
            least_thrust=least,
            most_thrust=most,
            horizontal_margin=self.horizontal_margin,
        )


def _of_axes(horizontal: float, vertical: float) -> Vec3:
    return Vec3(horizontal, horizontal, vertical)


def _vector(values: list[float]) -> Vec3:
    x, y, z = map(float, values)
    return Vec3(x, y, z)


def _zero() -> Vec3:
    """A new vector each time: the compiler allows no aliases in the state."""
    return Vec3(0.0, 0.0, 0.0)
