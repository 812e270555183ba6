"""The geometric controller as an FMU: evaluates the law at its samples, and writes what it computed."""

import math
from typing import NamedTuple

from controller_fmu.gain_scaling import GainScaling
from controller_fmu.geometric.interface import GEOMETRIC
from controller_fmu.geometric.law import Gains, Heading, evaluate
from controller_fmu.redesign.controller import RedesignedController
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
    rotation_error: Vec3
    error_function: float
    desired_angular_velocity: Vec3
    energy: float


class GeometricController(RedesignedController):
    """The geometric tracking controller on SE(3) behind its own sample clock."""

    variables = GEOMETRIC
    description = "Geometric tracking controller on SE(3) for a quadrotor, sampled"

    def read_gains(self) -> None:
        """Take over the gains and the heading."""
        self._gains = Gains(
            k_x=self.real("gain.position"),
            k_v=self.real("gain.velocity"),
            k_R=self.real("gain.attitude"),
            k_Omega=self.real("gain.angular_velocity"),
            per_inertia=self.enumeration("gain_scaling") == GainScaling.INERTIA,
        )
        heading = self.real("heading")
        self._direction = Vec3(math.cos(heading), math.sin(heading), 0.0)

    def control(self, measurement: Measurement, reference: Reference) -> None:
        """Evaluate the law; raises `DivergenceError` if it has no finite command."""
        evaluation = self._evaluation(measurement, reference)
        require_finite_state(_RESULTS, (evaluation.thrust, *evaluation.torque, evaluation.energy))
        self._write(evaluation)

    def command(self, measurement: Measurement, reference: Reference, implicit: float) -> Wrench:
        """Evaluate the law for thrust and torque alone; it has no semi-implicit form."""
        evaluation = self._evaluation(measurement, reference)
        return Wrench(evaluation.thrust, evaluation.torque)

    def _evaluation(self, measurement: Measurement, reference: Reference) -> _Shown:
        found = evaluate(measurement, reference, self._gains, self._model, heading=Heading(self._direction))
        return _Shown(*(getattr(found, name) for name in _Shown._fields))

    def _write(self, evaluation: _Shown) -> None:
        self.put("thrust", evaluation.thrust)
        self.put_vec3("torque", evaluation.torque)
        self.put_quaternion("desired_quaternion", evaluation.desired_quaternion)
        self.put_vec3("position_error", evaluation.position_error)
        self.put_vec3("velocity_error", evaluation.velocity_error)
        self.put_quaternion("attitude_error", evaluation.attitude_error)
        self.put_vec3("angular_velocity_error", evaluation.angular_velocity_error)
        self.put_vec3("rotation_error", evaluation.rotation_error)
        self.put("error_function", evaluation.error_function)
        self.put_vec3("desired_angular_velocity", evaluation.desired_angular_velocity)
        self.put("energy", evaluation.energy)
