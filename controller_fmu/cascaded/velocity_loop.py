"""From the desired velocity to the desired force, with the state of the loop (PX4: PositionControl.cpp)."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from controller_fmu.cascaded.filters import clamped, filtered_derivative
from controller_fmu.vehicle import Model
from fmu_kit.algebra import Vec3
from fmu_kit.scalar import FLOAT

SMALLEST_LENGTH = 1e-12
"""A shorter vector has no direction: [m/s²] of an acceleration, [N] of a force."""


@dataclass(frozen=True, kw_only=True, slots=True)
class VelocityLoop:
    """PID with feed-forward, anti-windup and limits; the defaults are PX4's."""

    proportional: Vec3 = Vec3(1.8, 1.8, 4.0)
    """P [1/s] (MPC_XY_VEL_P_ACC, MPC_Z_VEL_P_ACC)"""
    integral: Vec3 = Vec3(0.4, 0.4, 2.0)
    """I [1/s²] (MPC_XY_VEL_I_ACC, MPC_Z_VEL_I_ACC)"""
    derivative: Vec3 = Vec3(0.2, 0.2, 0.0)
    """D [1] (MPC_XY_VEL_D_ACC, MPC_Z_VEL_D_ACC)"""
    derivative_cutoff: float = 2.0 * math.pi * 5.0
    """Cutoff of the low-pass of the velocity derivative [rad/s] (MPC_VELD_LP: 5 Hz)"""
    tilt_limit: float = math.radians(45.0)
    """Largest tilt [rad] (MPC_TILTMAX_AIR)"""
    least_thrust: float = 0.12
    """Least thrust as a share of full thrust [1] (MPC_THR_MIN)"""
    most_thrust: float = 1.0
    """Largest thrust as a share of full thrust [1] (MPC_THR_MAX)"""
    horizontal_margin: float = 0.3
    """Share of full thrust reserved for the horizontal force at the thrust limit [1] (MPC_THR_XY_MARG)"""


class VelocityState(NamedTuple):
    """The state of the velocity loop between runs."""

    integral: Vec3
    """Integral of the velocity error [m/s²], inertial"""
    velocity: Vec3
    """Velocity as measured at the last run [m/s], inertial"""
    acceleration: Vec3
    """filtered derivative of the measured velocity [m/s²], inertial"""


def initial_velocity_state(velocity: Vec3) -> VelocityState:
    """The state before the first run, at a measured `velocity` [m/s]."""
    return VelocityState(Vec3(0.0, 0.0, 0.0), velocity, Vec3(0.0, 0.0, 0.0))


class Force(NamedTuple):
    """Two forces [N], inertial: the desired one within the tilt limit, and that limited by the thrust."""

    desired: Vec3
    limited: Vec3


def control_velocity(
    loop: VelocityLoop,
    state: VelocityState,
    velocity: Vec3,
    desired: Vec3,
    feedforward: Vec3,
    elapsed: float,
    model: Model,
    full_thrust: float,
) -> tuple[Vec3, VelocityState]:
    """The force of the propellers [N], inertial, and the new state; `elapsed` [s] after the last run.

    `velocity` and `desired` [m/s], `feedforward` A_d [m/s²], all inertial. The output uses the integral before this
    run.
    """
    acceleration = filtered_derivative(state.acceleration, velocity - state.velocity, elapsed, loop.derivative_cutoff)
    g = model.gravity
    integral = Vec3(state.integral.x, state.integral.y, clamped(state.integral.z, -g, g))
    error = desired - velocity
    total = feedforward + loop.proportional * error + integral - loop.derivative * acceleration
    force = limited_force(loop, total, model, full_thrust)
    to_integrate = error_without_windup(loop, error, total, force, model, full_thrust)
    integral = integral + elapsed * (loop.integral * to_integrate)
    return force.limited, VelocityState(integral, velocity, acceleration)


def limited_force(loop: VelocityLoop, acceleration: Vec3, model: Model, full_thrust: float) -> Force:
    """The force of the propellers for an `acceleration` [m/s²], inertial, within tilt and thrust; `full_thrust` [N].

    The direction is that of the horizontal acceleration and g, independent of the vertical acceleration
    (MPC_ACC_DECOUPLE = 1); the length is what the vertical acceleration needs in that direction. At the thrust limit,
    the vertical force has priority except for a margin of the horizontal force.
    """
    least, most = loop.least_thrust * full_thrust, loop.most_thrust * full_thrust
    horizontal = math.sqrt(acceleration.x * acceleration.x + acceleration.y * acceleration.y)
    angle = min(math.atan2(horizontal, model.gravity), loop.tilt_limit)
    sine, cosine = math.sin(angle), math.cos(angle)
    thrust = max(model.mass * (model.gravity - acceleration.z) / cosine, least)
    sideways = thrust * sine / max(horizontal, SMALLEST_LENGTH)
    desired = Vec3(sideways * acceleration.x, sideways * acceleration.y, -thrust * cosine)

    length = math.sqrt(desired.x * desired.x + desired.y * desired.y)
    reserved = min(length, loop.horizontal_margin * full_thrust)
    z = max(desired.z, -math.sqrt(max(0.0, most * most - reserved * reserved)))
    left = math.sqrt(max(0.0, most * most - z * z))
    share = min(1.0, left / max(length, SMALLEST_LENGTH))
    return Force(desired, Vec3(share * desired.x, share * desired.y, z))


def error_without_windup(
    loop: VelocityLoop, error: Vec3, demand: Vec3, force: Force, model: Model, full_thrust: float
) -> Vec3:
    """The velocity error [m/s] to be integrated.

    Vertical: zero where it would drive a thrust at its limit further. Horizontal: where the acceleration is less than
    `demand` [m/s²], reduced so that the integral returns (tracking anti-windup, with the gain 2/P).
    """
    least, most = loop.least_thrust * full_thrust, loop.most_thrust * full_thrust
    at_least = (force.desired.z >= -least) & (error.z >= 0.0)
    at_most = (force.desired.z <= -most) & (error.z <= 0.0)
    z = FLOAT.where(at_least | at_most, 0.0, error.z)
    x, y = force.limited.x / model.mass, force.limited.y / model.mass
    saturated = demand.x * demand.x + demand.y * demand.y > x * x + y * y
    gain = FLOAT.where(saturated, 2.0 / loop.proportional.x, 0.0)
    return Vec3(error.x - gain * (demand.x - x), error.y - gain * (demand.y - y), z)
