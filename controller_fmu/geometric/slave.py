"""The geometric controller as an FMU: evaluates the law at its samples, and writes what it computed."""

import math

from controller_fmu.gain_scaling import GainScaling
from controller_fmu.geometric.interface import GEOMETRIC
from controller_fmu.geometric.law import Evaluation, Gains, Heading, evaluate
from controller_fmu.sampled import SampledController
from controller_fmu.vehicle import Measurement
from fmu_kit.algebra import Vec3
from fmu_kit.errors import require_finite_state
from fmu_kit.trajectory import Reference

_RESULTS = ("thrust", "torque.x", "torque.y", "torque.z", "energy")


class GeometricController(SampledController):
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
        evaluation = evaluate(measurement, reference, self._gains, self._model, heading=Heading(self._direction))
        require_finite_state(_RESULTS, (evaluation.thrust, *evaluation.torque, evaluation.energy))
        self._write(evaluation)

    def _write(self, evaluation: Evaluation) -> None:
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
