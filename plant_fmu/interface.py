"""The variables of the plant FMU."""

from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.rigid_body import Body
from fmu_kit.variables import (
    INERTIA_AXES,
    QUATERNION_AXES,
    continuous_input,
    continuous_local,
    continuous_output,
    fixed_parameter,
    tunable_parameter,
    vector,
)
from plant_fmu.actuators import Box, Motors
from plant_fmu.wind import Wind

PAPER_ATTITUDE = Quaternion.from_xyzw(0.1699, 0.3058, 0.1699, 0.9212)
"""Q(0) of section V; normalised at initialisation."""

LARGEST_INTERNAL_STEP = 0.002
"""[s]"""

_BODY, _WIND, _BOX, _MOTORS, _ORIGIN = Body(), Wind(), Box(), Motors(), Vec3(0.0, 0.0, 0.0)


COMMAND = (
    continuous_input(
        "thrust", "total thrust along -z of the body, before limits and lag", "N", _BODY.mass * _BODY.gravity
    ),
    *vector(continuous_input("torque", "body torque, before limits and lag", "N.m")),
)

MOTION = (
    *vector(continuous_output("position", "position P, inertial frame (north-east-down)", "m")),
    *vector(continuous_output("velocity", "velocity V, inertial frame", "m/s")),
    *vector(continuous_output("quaternion", "attitude Q, inertial to body, scalar last", "1"), QUATERNION_AXES),
    *vector(continuous_output("angular_velocity", "angular velocity, body frame (forward-right-down)", "rad/s")),
)

MOTOR = (
    fixed_parameter(
        "motor.thrust_max",
        "largest thrust of each of four motors on an X frame; 0: no motors",
        "N",
        _MOTORS.thrust_max,
        minimum=0.0,
    ),
    fixed_parameter("motor.thrust_min", "least thrust of each motor", "N", _MOTORS.thrust_min),
    fixed_parameter("motor.arm.x", "from the centre to each motor along x of the body", "m", _MOTORS.arm_x, above=0.0),
    fixed_parameter("motor.arm.y", "from the centre to each motor along y of the body", "m", _MOTORS.arm_y, above=0.0),
    fixed_parameter(
        "motor.drag_to_thrust", "torque about z by thrust of a propeller", "m", _MOTORS.drag_to_thrust, above=0.0
    ),
    fixed_parameter(
        "motor.time_constant.up",
        "lag of a motor's thrust that grows; 0: actuator_time_constant",
        "s",
        _MOTORS.up,
        minimum=0.0,
    ),
    fixed_parameter(
        "motor.time_constant.down",
        "lag of a motor's thrust that falls; 0: actuator_time_constant",
        "s",
        _MOTORS.down,
        minimum=0.0,
    ),
)

PARAMETERS = (
    fixed_parameter("mass", "mass m", "kg", _BODY.mass, above=0.0),
    fixed_parameter("gravity", "gravity g, along +z of the inertial frame", "m/s2", _BODY.gravity, minimum=0.0),
    *vector(
        fixed_parameter("inertia", "entry of the inertia matrix J, body frame", "kg.m2"),
        INERTIA_AXES,
        (1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
    ),
    *vector(fixed_parameter("initial.position", "P(0)", "m"), start=_ORIGIN),
    *vector(fixed_parameter("initial.velocity", "V(0)", "m/s"), start=_ORIGIN),
    *vector(
        fixed_parameter("initial.quaternion", "Q(0), normalised at initialisation", "1"),
        QUATERNION_AXES,
        PAPER_ATTITUDE,
    ),
    *vector(fixed_parameter("initial.angular_velocity", "angular velocity at 0, body frame", "rad/s"), start=_ORIGIN),
    *vector(
        tunable_parameter("wind.amplitude", "a of the wind force a cos(w t), inertial frame", "N"),
        start=_WIND.amplitude,
    ),
    tunable_parameter("wind.frequency", "w of the wind force a cos(w t)", "rad/s", _WIND.frequency),
    fixed_parameter("thrust_max", "thrust is limited to [0, thrust_max]", "N", _BOX.thrust_max, minimum=0.0),
    fixed_parameter("torque_max", "each torque is limited to +-torque_max", "N.m", _BOX.torque_max, minimum=0.0),
    fixed_parameter(
        "actuator_time_constant",
        "first-order lag of thrust and torques, or of the motors, after the limits; 0: none",
        "s",
        _BOX.time_constant,
        minimum=0.0,
    ),
    fixed_parameter("max_internal_step", "largest internal integration step", "s", LARGEST_INTERNAL_STEP, above=0.0),
    *MOTOR,
    tunable_parameter("payload.mass", "payload at the centre of gravity, added to the mass", "kg", 0.0, minimum=0.0),
    tunable_parameter("payload.drop_time", "when the payload is let go; 0: never", "s", 0.0, minimum=0.0),
)

LOCALS = (
    *vector(continuous_local("acceleration", "dV/dt, inertial frame", "m/s2")),
    *vector(continuous_local("wind.force", "wind force, inertial frame", "N")),
    continuous_local("tilt", "angle between the z axes of body and inertial frame", "rad"),
)

QUADROTOR = (
    *COMMAND,
    *vector(continuous_input("external_force", "force in the inertial frame, added to the wind", "N")),
    *MOTION,
    *PARAMETERS,
    *LOCALS,
)
"""All variables of the plant; the place in this list is the value reference."""
