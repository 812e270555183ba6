"""The geometric controller as an FMU: its parameters and locals."""

from controller_fmu.geometric.law import Evaluation, Gains, Heading, evaluate
from controller_fmu.interface import ScaledGains
from controller_fmu.redesign.controller import RedesignedController
from controller_fmu.vehicle import Measurement
from fmu_kit import frames
from fmu_kit.algebra import ZERO
from fmu_kit.interface import Local, Parameter, read_fields
from fmu_kit.trajectory import Reference

_GAINS = Gains()


class GeometricController(ScaledGains, RedesignedController):
    """Geometric tracking controller on SE(3) for a quadrotor, sampled."""

    k_x = Parameter(
        "k_x/m, of the position error in the force A", "1/s2", _GAINS.k_x, name="gain.position", minimum=0.0
    )
    k_v = Parameter("k_v/m, of the velocity error in the force A", "1/s", _GAINS.k_v, name="gain.velocity", minimum=0.0)
    k_R = Parameter(  # noqa: N815
        "k_R, of the attitude error e_R in the torque", "N.m", _GAINS.k_R, name="gain.attitude", minimum=0.0
    )
    k_Omega = Parameter(  # noqa: N815
        "k_Omega, of the angular velocity error e_Omega in the torque",
        "N.m.s",
        _GAINS.k_Omega,
        name="gain.angular_velocity",
        minimum=0.0,
    )
    heading = Parameter(
        "direction of the nose that is added to the yaw that is asked for", "rad", 0.0, frame=frames.about_z
    )

    rotation_error = Local("e_R as of the last sample, body frame", "1", ZERO, frame=frames.body)
    error_function = Local("attitude error function Psi as of the last sample: 0 none, 2 upside down", "1", minimum=0.0)
    desired_angular_velocity = Local(
        "Omega_c as of the last sample, desired body frame", "rad/s", ZERO, frame=frames.body
    )
    energy = Local("energy of position, velocity, attitude and angular velocity errors at the last sample", "J")

    def read_parameters(self) -> None:
        """Read the gains."""
        super().read_parameters()
        self._gains = read_fields(self, Gains)

    def evaluation(self, measurement: Measurement, reference: Reference, implicit: float) -> Evaluation:
        """Evaluate the law; it has no semi-implicit form."""
        heading = Heading.at(self.heading + reference.yaw, reference.yaw_rate)
        return evaluate(measurement, reference, self._gains, self._model, heading=heading)
