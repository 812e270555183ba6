"""The variables that every controller FMU has; each law adds its own."""

from typing import Any

from controller_fmu.gain_scaling import GainScaling
from fmu_kit import frames
from fmu_kit.algebra import ZERO, Quaternion
from fmu_kit.framed import Framed
from fmu_kit.interface import FixedParameter, Input, Local, Output
from fmu_kit.mixer import Thrusts
from fmu_kit.rigid_body import Body
from fmu_kit.trajectory import Trajectory

_BODY, _TRAJECTORY = Body(), Trajectory()
_HOVER = _BODY.mass * _BODY.gravity
_UPRIGHT, _NONE = Quaternion(ZERO, 1.0), Quaternion(ZERO, 0.0)


def _reference(name: str, description: str, unit: str, start: Any = ZERO, frame: Any = frames.inertial) -> Input:
    what = f"{description}, used when use_reference_inputs is true"
    return Input(what, unit, start, name=f"reference.{name}", frame=frame, terminal="reference")


def _trajectory(name: str, description: str, unit: str, **others: Any) -> FixedParameter:
    return FixedParameter(description, unit, getattr(_TRAJECTORY, name), name=f"trajectory.{name}", **others)


class ControllerInterface(Framed):
    """Variables by which controller FMUs are interchangeable."""

    position = Input("measured position P, inertial frame", "m", ZERO, frame=frames.inertial, terminal="motion")
    velocity = Input("measured velocity V, inertial frame", "m/s", ZERO, frame=frames.inertial, terminal="motion")
    quaternion = Input(
        "measured attitude Q, body to inertial; all zero: no measurement",
        "1",
        _UPRIGHT,
        frame=frames.attitude,
        terminal="motion",
    )
    angular_velocity = Input(
        "measured angular velocity, body frame", "rad/s", ZERO, frame=frames.body, terminal="motion"
    )

    reference_position = _reference("position", "desired position", "m")
    reference_velocity = _reference("velocity", "desired velocity", "m/s")
    reference_acceleration = _reference("acceleration", "desired acceleration", "m/s2")
    reference_jerk = _reference("jerk", "desired jerk", "m/s3")
    reference_snap = _reference("snap", "desired snap", "m/s4")
    reference_yaw = _reference(
        "yaw", "desired direction of the nose, from x of the inertial frame towards y", "rad", 0.0, frames.yaw
    )
    reference_yaw_rate = _reference("yaw_rate", "its rate", "rad/s", 0.0, frames.about_z)

    thrust = Output("total thrust, upward in the body, held between samples", "N", nominal=_HOVER, terminal="command")
    torque = Output("body torque, body frame, held between samples", "N.m", ZERO, frame=frames.body, terminal="command")
    motor_thrust = Output(
        "thrust asked of each of four motors on an X frame, limited by nothing; 0 where motor.arm.* or "
        "motor.drag_to_thrust are not known",
        "N",
        Thrusts(0.0, 0.0, 0.0, 0.0),
        nominal=0.25 * _HOVER,
    )

    trajectory_amplitude_x = _trajectory("amplitude_x", "a_x of [a_x sin wt cos wt, a_y sin wt, z0 + vz t]", "m")
    trajectory_amplitude_y = _trajectory("amplitude_y", "a_y of the built-in trajectory", "m")
    trajectory_frequency = _trajectory(
        "frequency", "w of the built-in trajectory", "rad/s", nominal=_TRAJECTORY.frequency, quantity="AngularFrequency"
    )
    trajectory_start_z = _trajectory("start_z", "z0 of the built-in trajectory, along z of the inertial frame", "m")
    trajectory_rate_z = _trajectory("rate_z", "vz of the built-in trajectory, along z of the inertial frame", "m/s")
    trajectory_yaw = _trajectory("yaw", "yaw of the nose at time 0, along the built-in trajectory", "rad")
    trajectory_yaw_rate = _trajectory("yaw_rate", "rate of the yaw along the built-in trajectory", "rad/s")
    mass = FixedParameter("nominal mass m", "kg", _BODY.mass, above=0.0)
    gravity = FixedParameter("nominal gravity g", "m/s2", _BODY.gravity, minimum=0.0)
    inertia = FixedParameter(
        "entry of the nominal inertia matrix J, body frame", "kg.m2", _BODY.inertia, frame=frames.body_matrix
    )
    motor_arm_x = FixedParameter(
        "distance from the centre to each motor along x of the body; 0: not known",
        "m",
        0.0,
        name="motor.arm.x",
        minimum=0.0,
    )
    motor_arm_y = FixedParameter(
        "distance from the centre to each motor along y of the body; 0: not known",
        "m",
        0.0,
        name="motor.arm.y",
        minimum=0.0,
    )
    motor_drag_to_thrust = FixedParameter(
        "torque about z by thrust of a propeller; 0: not known", "m", 0.0, name="motor.drag_to_thrust", minimum=0.0
    )
    sample_period = FixedParameter(
        "period of the FMU's own clock; 0: sample at every communication point from sample_offset on",
        "s",
        0.01,
        minimum=0.0,
        nominal=0.01,
    )
    sample_offset = FixedParameter("time of the first sample of the FMU's own clock", "s", 0.0, minimum=0.0)

    desired_quaternion = Local("desired attitude Q_d as of the last sample (12)", "1", _NONE, frame=frames.attitude)
    position_error = Local("P - P_d as of the last sample, inertial frame", "m", ZERO, frame=frames.inertial)
    velocity_error = Local("V - V_d as of the last sample, inertial frame", "m/s", ZERO, frame=frames.inertial)
    attitude_error = Local("Q_d^-1 Q as of the last sample (8)", "1", _NONE, frame=frames.rotation)
    angular_velocity_error = Local(
        "angular velocity minus the desired one, body frame", "rad/s", ZERO, frame=frames.body
    )

    sample_count = Local("number of samples since the start, initialisation not counted", None, 0, minimum=0)
    use_reference_inputs = FixedParameter("true: follow reference.*; false: the built-in trajectory", start=False)


class ScaledGains(ControllerInterface):
    """A controller whose attitude gains are absolute or per unit inertia."""

    gain_scaling = FixedParameter(
        "scaling of the attitude's gains: as they are, or per unit inertia (in 1/s2 and 1/s), times the inertia "
        "matrix; energy is per unit inertia then, in 1/s2",
        start=GainScaling.ABSOLUTE,
    )

    @property
    def per_inertia(self) -> bool:
        """Whether the gains are per unit inertia."""
        return self.gain_scaling == GainScaling.INERTIA  # type: ignore[no-any-return]
