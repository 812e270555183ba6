"""The controller as an FMU: reads the inputs, evaluates the law, holds the command."""

from controller_fmu.interface import UNIFIED
from controller_fmu.law import Evaluation, Gains, Measurement, Model, evaluate
from controller_fmu.sample_clock import SampleClock
from fmu_kit.errors import require, require_finite_state
from fmu_kit.saved_state import State
from fmu_kit.slave import Slave
from fmu_kit.trajectory import Reference, Trajectory

SHORTEST_PERIOD = 1e-9
"""[s]; sample times further apart than a nanosecond stay distinct floats for days"""
_RESULTS = ("thrust", "torque.x", "torque.y", "torque.z", "energy")


class UnifiedController(Slave):
    """The unified finite-time sliding-mode controller behind its own sample clock."""

    variables = UNIFIED
    description = "Unified finite-time sliding-mode quaternion tracking controller for a quadrotor, sampled"
    initial_outputs_depend_on_inputs = True

    def read_parameters(self) -> None:
        """Build the nominal model, the gains, the trajectory and the clock."""
        self._model = Model(mass=self.real("mass"), inertia=self.inertia(), gravity=self.real("gravity"))
        self._gains = Gains(
            k_t=self.vec3("gain.translation"),
            beta=self.real("gain.disturbance"),
            k_s=self.real("gain.surface"),
            beta_t=self.real("surface_exponent"),
            epsilon=self.real("boundary_layer"),
            k_eta=self.real("gain.eta"),
            k_theta=self.real("gain.theta"),
            k_q=self.real("gain.attitude"),
            kappa=self.real("coupling"),
        )
        self._trajectory = Trajectory(
            amplitude_x=self.real("trajectory.amplitude_x"),
            amplitude_y=self.real("trajectory.amplitude_y"),
            frequency=self.real("trajectory.frequency"),
            start_z=self.real("trajectory.start_z"),
            rate_z=self.real("trajectory.rate_z"),
        )
        period = self.real("sample_period")
        require(
            period == 0.0 or period >= SHORTEST_PERIOD, "sample_period", period, f"0 or at least {SHORTEST_PERIOD} s"
        )
        self._use_reference_inputs = self.boolean("use_reference_inputs")

    def initialise(self, t: float) -> None:
        """Hold the command for the initial inputs; this is not a sample."""
        self._clock = SampleClock(self.real("sample_period"), self.real("sample_offset"))
        self._clock.start(t)
        self._sample(t)

    def step(self, t: float, h: float) -> None:
        """Sample at `t` if it is time, and hold over [t, t + h]."""
        period = self._clock.period
        if h > period * (1.0 + 1e-6) and period > 0.0:
            self.warn_once(
                "long step", f"communication step {h} s is longer than sample_period {period} s: one sample a step"
            )
        if self._clock.is_due(t):
            self._sample(t)
            self.put_count("sample_count", self.count("sample_count") + 1)

    def internal_state(self) -> State:
        """The clock; the held command and the count are among the variables."""
        return {"next_index": self._clock.next_index}

    def restore(self, state: State) -> None:
        """Put the clock back."""
        self._clock = SampleClock(self.real("sample_period"), self.real("sample_offset"), int(state["next_index"]))

    def _sample(self, t: float) -> None:
        quaternion = self.quaternion("quaternion")
        if not any(quaternion):
            self._hover()
            return
        measurement = Measurement(
            self.vec3("position"),
            self.vec3("velocity"),
            quaternion.unit(),
            self.vec3("angular_velocity"),
        )
        evaluation = evaluate(measurement, self._reference(t), self._gains, self._model)
        require_finite_state(_RESULTS, (evaluation.thrust, *evaluation.torque, evaluation.energy))
        self._write(evaluation)

    def _reference(self, t: float) -> Reference:
        if not self._use_reference_inputs:
            return self._trajectory.at(t)
        return Reference(
            position=self.vec3("reference.position"),
            velocity=self.vec3("reference.velocity"),
            acceleration=self.vec3("reference.acceleration"),
            jerk=self.vec3("reference.jerk"),
            snap=self.vec3("reference.snap"),
        )

    def _hover(self) -> None:
        """A zero quaternion means that nothing is connected yet."""
        self.warn_once(
            "no measurement", "quaternion = (0, 0, 0, 0): no measurement, commanding hover thrust and no torque"
        )
        self.put("thrust", self._model.mass * self._model.gravity)
        for axis in "xyz":
            self.put(f"torque.{axis}", 0.0)

    def _write(self, evaluation: Evaluation) -> None:
        self.put("thrust", evaluation.thrust)
        self.put_vec3("torque", evaluation.torque)
        self.put_quaternion("desired_quaternion", evaluation.desired_quaternion)
        self.put_vec3("position_error", evaluation.position_error)
        self.put_vec3("velocity_error", evaluation.velocity_error)
        self.put_quaternion("attitude_error", evaluation.attitude_error)
        self.put_vec3("angular_velocity_error", evaluation.angular_velocity_error)
        self.put_vec3("sliding", evaluation.sliding)
        self.put_vec3("theta", evaluation.theta)
        self.put_vec3("desired_angular_velocity", evaluation.desired_angular_velocity)
        self.put("energy", evaluation.energy)
