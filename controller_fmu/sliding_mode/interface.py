"""The variables of the unified controller's FMU: those of every controller, and what this law adds."""

from controller_fmu.gain_scaling import GAIN_SCALING
from controller_fmu.interface import (
    COMMAND,
    COMMON_LOCALS,
    COMMON_PARAMETERS,
    COUNT_AND_SWITCH,
    MEASUREMENT,
    REFERENCE,
)
from controller_fmu.redesign.interface import CHOICES, REDESIGN
from fmu_kit.variables import discrete_local, tunable_parameter, vector

GAINS = (
    *vector(
        tunable_parameter("gain.translation", "k_t, of tanh(s) in the virtual control (22)", "m/s2", 2.0, minimum=0.0)
    ),
    tunable_parameter("gain.disturbance", "beta, of tanh(s) against the disturbance (32)", "m/s2", 0.99, minimum=0.0),
    tunable_parameter(
        "gain.surface", "k_s of the sliding surface (19)-(21); in 1/s for an exponent of 1", "1/s", 5.0, minimum=0.0
    ),
    tunable_parameter("gain.eta", "k_eta, of the attitude error in Psi (29)", "rad/s", 15.0, minimum=0.0),
    tunable_parameter("gain.theta", "k_theta, of Theta in the torque (30)", "N.m.s", 15.0, minimum=0.0),
    tunable_parameter("gain.attitude", "k_q, of the attitude error in the torque (30)", "N.m", 15.0, above=0.0),
    tunable_parameter("surface_exponent", "beta_t of the sliding surface (19)-(21)", "1", 0.99, above=0.0, maximum=1.0),
    tunable_parameter(
        "boundary_layer", "epsilon: below this position error the surface is linear", "m", 0.001, above=0.0
    ),
    tunable_parameter(
        "coupling",
        "kappa >= 0, weight of s.s/2 in the energy (33) and so of its term in Psi (29): "
        "0 none, 1 as the energy is printed, k_q as Psi is printed",
        "kg",
        1.0,
    ),
)

LAW_LOCALS = (
    *vector(discrete_local("sliding", "sliding variable s as of the last sample (19)-(21)", "m/s")),
    *vector(discrete_local("theta", "Theta as of the last sample (9), body frame", "rad/s")),
    *vector(
        discrete_local("desired_angular_velocity", "Omega_d as of the last sample (13), desired body frame", "rad/s")
    ),
    discrete_local("energy", "energy function L_kappa as of the last sample (33), with coupling/2 s.s", "J"),
)

UNIFIED = (
    *MEASUREMENT,
    *REFERENCE,
    *COMMAND,
    *COMMON_PARAMETERS,
    *REDESIGN,
    *GAINS,
    *COMMON_LOCALS,
    *LAW_LOCALS,
    *COUNT_AND_SWITCH,
    *GAIN_SCALING,
    *CHOICES,
)
"""All variables of the unified controller; the place in this list is the value reference."""
