"""The variables of the plant FMU."""

from typing import Any

from fmu_kit import frames
from fmu_kit.algebra import ZERO, Quaternion
from fmu_kit.framed import Framed
from fmu_kit.interface import FixedParameter, Input, Output, Parameter
from fmu_kit.rigid_body import Body
from plant_fmu.actuators import Box, Motors
from plant_fmu.wind import Wind

PAPER_ATTITUDE = Quaternion.from_xyzw(0.1699, 0.3058, 0.1699, 0.9212)
"""Q(0) of section V; normalised at initialisation."""

LARGEST_INTERNAL_STEP = 0.002
"""Largest internal step [s]"""

_BODY, _WIND, _BOX, _MOTORS = Body(), Wind(), Box(), Motors()
_HOVER = _BODY.mass * _BODY.gravity


def _motion(description: str, unit: str, start: Any, frame: Any) -> Output:
    return Output(description, unit, start, variability="continuous", frame=frame, terminal="motion")


def _motor(name: str, description: str, unit: str, start: float, **bounds: Any) -> FixedParameter:
    """A parameter of the motors; without other bounds one that is not negative."""
    return FixedParameter(description, unit, start, name=f"motor.{name}", **bounds or {"minimum": 0.0})


class PlantInterface(Framed):
    """Inputs, parameters and motion of the vehicle; other outputs are declared in `plant_fmu.observed`."""

    thrust = Input(
        "total thrust, upward in the body, before limits and lag", "N", _HOVER, nominal=_HOVER, terminal="command"
    )
    torque = Input("body torque, body frame, before limits and lag", "N.m", ZERO, frame=frames.body, terminal="command")
    external_force = Input("force in the inertial frame, added to the wind", "N", ZERO, frame=frames.inertial)

    position = _motion("position P, inertial frame", "m", ZERO, frames.inertial)
    velocity = _motion("velocity V, inertial frame", "m/s", ZERO, frames.inertial)
    quaternion = _motion("attitude Q, body to inertial, scalar last", "1", Quaternion(ZERO, 0.0), frames.attitude)
    angular_velocity = _motion("angular velocity, body frame", "rad/s", ZERO, frames.body)

    mass = FixedParameter("mass m", "kg", _BODY.mass, above=0.0)
    gravity = FixedParameter("gravity g, downward", "m/s2", _BODY.gravity, minimum=0.0)
    inertia = FixedParameter(
        "entry of the inertia matrix J, body frame", "kg.m2", _BODY.inertia, frame=frames.body_matrix
    )
    initial_position = FixedParameter("P(0)", "m", ZERO, name="initial.position", frame=frames.inertial)
    initial_velocity = FixedParameter("V(0)", "m/s", ZERO, name="initial.velocity", frame=frames.inertial)
    initial_quaternion = FixedParameter(
        "Q(0), normalised at initialisation", "1", PAPER_ATTITUDE, name="initial.quaternion", frame=frames.attitude
    )
    initial_angular_velocity = FixedParameter(
        "angular velocity at 0, body frame", "rad/s", ZERO, name="initial.angular_velocity", frame=frames.body
    )
    wind_amplitude = Parameter(
        "a of the wind force a cos(w t), inertial frame",
        "N",
        _WIND.amplitude,
        name="wind.amplitude",
        nominal=_WIND.amplitude.x,
        frame=frames.inertial,
    )
    wind_frequency = Parameter(
        "w of the wind force a cos(w t)",
        "rad/s",
        _WIND.frequency,
        name="wind.frequency",
        nominal=_WIND.frequency,
        quantity="AngularFrequency",
    )
    thrust_max = FixedParameter(
        "largest thrust; thrust is limited to [thrust_min, thrust_max]", "N", _BOX.thrust_max, minimum=0.0
    )
    thrust_min = FixedParameter("least thrust; negative: propellers can push downwards", "N", _BOX.thrust_min)
    torque_max = FixedParameter("largest torque; each is limited to +-torque_max", "N.m", _BOX.torque_max, minimum=0.0)
    actuator_time_constant = FixedParameter(
        "first-order lag of thrust and torques, or of the motors, after the limits; 0: none",
        "s",
        _BOX.time_constant,
        minimum=0.0,
    )
    max_internal_step = FixedParameter(
        "largest internal integration step", "s", LARGEST_INTERNAL_STEP, above=0.0, nominal=LARGEST_INTERNAL_STEP
    )

    motor_thrust_max = _motor(
        "thrust_max", "largest thrust of each of four motors on an X frame; 0: no motors", "N", _MOTORS.thrust_max
    )
    motor_thrust_min = FixedParameter("least thrust of each motor", "N", _MOTORS.thrust_min, name="motor.thrust_min")
    motor_arm_x = _motor(
        "arm.x", "distance from the centre to each motor along x of the body", "m", _MOTORS.arm_x, above=0.0
    )
    motor_arm_y = _motor(
        "arm.y", "distance from the centre to each motor along y of the body", "m", _MOTORS.arm_y, above=0.0
    )
    motor_drag_to_thrust = _motor(
        "drag_to_thrust", "torque about z by thrust of a propeller", "m", _MOTORS.drag_to_thrust, above=0.0
    )
    motor_up = _motor(
        "time_constant.up", "lag of a motor's thrust that grows; 0: actuator_time_constant", "s", _MOTORS.up
    )
    motor_down = _motor(
        "time_constant.down", "lag of a motor's thrust that falls; 0: actuator_time_constant", "s", _MOTORS.down
    )
    payload_mass = Parameter(
        "payload at the centre of gravity, added to the mass", "kg", 0.0, name="payload.mass", minimum=0.0
    )
    payload_drop_time = Parameter(
        "time at which the payload is let go; 0: never", "s", 0.0, name="payload.drop_time", minimum=0.0
    )
