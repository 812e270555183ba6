"""The unified controller as an FMU: its parameters and locals."""

from controller_fmu.interface import ScaledGains
from controller_fmu.redesign.controller import RedesignedController
from controller_fmu.sliding_mode.law import Evaluation, Gains, evaluate
from controller_fmu.vehicle import Measurement
from fmu_kit import frames
from fmu_kit.algebra import ZERO
from fmu_kit.interface import Local, Parameter, read_fields
from fmu_kit.trajectory import Reference

_GAINS = Gains()


class UnifiedController(RedesignedController, ScaledGains):
    """Unified finite-time sliding-mode quaternion tracking controller for a quadrotor, sampled."""

    offers_semi_implicit = True

    k_t = Parameter(
        "k_t, of tanh(s) in the virtual control (22)",
        "m/s2",
        _GAINS.k_t,
        name="gain.translation",
        minimum=0.0,
        frame=frames.inertial_sizes,
    )
    beta = Parameter(
        "beta, of tanh(s) against the disturbance (32)", "m/s2", _GAINS.beta, name="gain.disturbance", minimum=0.0
    )
    k_s = Parameter(
        "k_s of the sliding surface (19)-(21); in 1/s for an exponent of 1",
        "1/s",
        _GAINS.k_s,
        name="gain.surface",
        minimum=0.0,
    )
    k_eta = Parameter("k_eta, of the attitude error in Psi (29)", "rad/s", _GAINS.k_eta, name="gain.eta", minimum=0.0)
    k_theta = Parameter("k_theta, of Theta in the torque (30)", "N.m.s", _GAINS.k_theta, name="gain.theta", minimum=0.0)
    k_q = Parameter("k_q, of the attitude error in the torque (30)", "N.m", _GAINS.k_q, name="gain.attitude", above=0.0)
    beta_t = Parameter(
        "beta_t of the sliding surface (19)-(21)", "1", _GAINS.beta_t, name="surface_exponent", above=0.0, maximum=1.0
    )
    epsilon = Parameter(
        "epsilon: below this position error the surface is linear",
        "m",
        _GAINS.epsilon,
        name="boundary_layer",
        above=0.0,
        nominal=_GAINS.epsilon,
    )
    kappa = Parameter(
        "kappa >= 0, weight of s.s/2 in the energy (33) and so of its term in Psi (29): "
        "0 none, 1 as the energy is printed, k_q as Psi is printed",
        "kg",
        _GAINS.kappa,
        name="coupling",
    )

    sliding = Local("sliding variable s as of the last sample (19)-(21)", "m/s", ZERO, frame=frames.inertial)
    theta = Local("Theta as of the last sample (9), body frame", "rad/s", ZERO, frame=frames.body)
    desired_angular_velocity = Local(
        "Omega_d as of the last sample (13), desired body frame", "rad/s", ZERO, frame=frames.body
    )
    energy = Local("energy function L_kappa as of the last sample (33), with coupling/2 s.s", "J")

    def read_parameters(self) -> None:
        """Read the gains."""
        super().read_parameters()
        self._gains = read_fields(self, Gains)

    def evaluation(self, measurement: Measurement, reference: Reference, implicit: float) -> Evaluation:
        """Evaluate the law."""
        return evaluate(measurement, reference, self._gains, self._model, implicit=implicit)
