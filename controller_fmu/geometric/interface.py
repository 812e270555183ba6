"""The variables of the geometric controller's FMU: those of every controller, and what this law adds."""

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
    tunable_parameter("gain.position", "k_x/m, of the position error in the force A", "1/s2", 4.0, minimum=0.0),
    tunable_parameter("gain.velocity", "k_v/m, of the velocity error in the force A", "1/s", 2.8, minimum=0.0),
    tunable_parameter("gain.attitude", "k_R, of the attitude error e_R in the torque", "N.m", 104.26, minimum=0.0),
    tunable_parameter(
        "gain.angular_velocity",
        "k_Omega, of the angular velocity error e_Omega in the torque",
        "N.m.s",
        30.06,
        minimum=0.0,
    ),
    tunable_parameter("heading", "direction that the body's x axis is to have: from north, to the east", "rad", 0.0),
)

LAW_LOCALS = (
    *vector(discrete_local("rotation_error", "e_R as of the last sample, body frame", "1")),
    discrete_local("error_function", "attitude error function Psi as of the last sample: 0 none, 2 upside down", "1"),
    *vector(discrete_local("desired_angular_velocity", "Omega_c as of the last sample, desired body frame", "rad/s")),
    discrete_local("energy", "of position, velocity, attitude and angular velocity errors, at the last sample", "J"),
)

GEOMETRIC = (
    *MEASUREMENT,
    *REFERENCE,
    *COMMAND,
    *COMMON_PARAMETERS,
    *REDESIGN,
    *GAINS,
    *COMMON_LOCALS,
    *LAW_LOCALS,
    *COUNT_AND_SWITCH,
    *CHOICES,
    *GAIN_SCALING,
)
"""All variables of the geometric controller; the place in this list is the value reference."""
