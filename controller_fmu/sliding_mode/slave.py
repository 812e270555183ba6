"""The controller as an FMU: evaluates the law at its samples, and writes what it computed."""

from typing import NamedTuple

from controller_fmu.gain_scaling import GainScaling
from controller_fmu.redesign.controller import RedesignedController
from controller_fmu.sliding_mode.interface import UNIFIED
from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.vehicle import Measurement
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.errors import require_finite_state
from fmu_kit.rigid_body import Wrench
from fmu_kit.trajectory import Reference

_RESULTS = ("thrust", "torque.x", "torque.y", "torque.z", "energy")


class _Shown(NamedTuple):
    """Of an evaluation of the law, what variables show."""

    thrust: float
    torque: Vec3
    desired_quaternion: Quaternion
    position_error: Vec3
    velocity_error: Vec3
    attitude_error: Quaternion
    angular_velocity_error: Vec3
    sliding: Vec3
    theta: Vec3
    desired_angular_velocity: Vec3
    energy: float


class UnifiedController(RedesignedController):
    """The unified finite-time sliding-mode controller behind its own sample clock."""

    variables = UNIFIED
    description = "Unified finite-time sliding-mode quaternion tracking controller for a quadrotor, sampled"
    offers_semi_implicit = True

    def read_gains(self) -> None:
        """Take over the gains."""
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
            per_inertia=self.enumeration("gain_scaling") == GainScaling.INERTIA,
        )

    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Evaluate the law; raises `DivergenceError` if it has no finite command."""
        evaluation = self._evaluation(measurement, reference, 0.0)
        require_finite_state(_RESULTS, (evaluation.thrust, *evaluation.torque, evaluation.energy))
        self._write(evaluation)

    def command(self, measurement: Measurement, reference: Reference, implicit: float) -> Wrench:
        """Evaluate the law for thrust and torque alone."""
        evaluation = self._evaluation(measurement, reference, implicit)
        return Wrench(evaluation.thrust, evaluation.torque)

    def _evaluation(self, measurement: Measurement, reference: Reference, implicit: float) -> _Shown:
        found = evaluate(measurement, reference, self._gains, self._model, implicit=implicit)
        return _Shown(*(getattr(found, name) for name in _Shown._fields))

    def _write(self, evaluation: _Shown) -> None:
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
