"""From the velocity to fly to the force to exert, with what is kept from run to run (PX4: PositionControl.cpp)."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from controller_fmu.cascaded.filters import clamped, filtered_derivative
from controller_fmu.vehicle import Model
from fmu_kit.algebra import Vec3
from fmu_kit.scalar import FLOAT

SMALLEST_LENGTH = 1e-12
"""A vector shorter than it has no direction: [m/s²] of an acceleration, [N] of a force."""


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
    """[rad/s] (MPC_VELD_LP: 5 Hz)"""
    tilt_limit: float = math.radians(45.0)
    """[rad] (MPC_TILTMAX_AIR)"""
    least_thrust: float = 0.12
    """[1], of full thrust (MPC_THR_MIN)"""
    most_thrust: float = 1.0
    """[1], of full thrust (MPC_THR_MAX)"""
    horizontal_margin: float = 0.3
    """[1], of full thrust: what the vertical leaves to the horizontal if need be (MPC_THR_XY_MARG)"""


class VelocityState(NamedTuple):
    """What the velocity loop keeps from run to run."""

    integral: Vec3
    """[m/s²], inertial"""
    velocity: Vec3
    """as measured at the last run [m/s], inertial"""
    acceleration: Vec3
    """filtered derivative of the measured velocity [m/s²], inertial"""


def velocity_state_at(velocity: Vec3) -> VelocityState:
    """What there is to keep before the first run, at a measured `velocity` [m/s]."""
    return VelocityState(Vec3(0.0, 0.0, 0.0), velocity, Vec3(0.0, 0.0, 0.0))


class Force(NamedTuple):
    """Two forces [N], inertial: what was wanted, tilted no further than allowed, and what of it there is thrust for."""

    wanted: Vec3
    given: Vec3


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
    """The force of the propellers [N], inertial, and what to keep; `elapsed` [s] after the last run.

    `velocity` and `desired` [m/s], `feedforward` A_d [m/s²], all inertial. The output has the integral as it was
    before this run.
    """
    acceleration = filtered_derivative(state.acceleration, velocity - state.velocity, elapsed, loop.derivative_cutoff)
    g = model.gravity
    integral = Vec3(state.integral.x, state.integral.y, clamped(state.integral.z, -g, g))
    error = desired - velocity
    wanted = feedforward + loop.proportional * error + integral - loop.derivative * acceleration
    force = limited_force(loop, wanted, model, full_thrust)
    to_integrate = without_windup(loop, error, wanted, force, model, full_thrust)
    integral = integral + elapsed * (loop.integral * to_integrate)
    return force.given, VelocityState(integral, velocity, acceleration)


def limited_force(loop: VelocityLoop, acceleration: Vec3, model: Model, full_thrust: float) -> Force:
    """The force of the propellers for an `acceleration` [m/s²], inertial, within tilt and thrust; `full_thrust` [N].

    The direction is that of the horizontal acceleration against g, whatever the vertical one (MPC_ACC_DECOUPLE = 1);
    the length is what the vertical one needs in that direction. If that is too much thrust, the vertical comes first
    but for a margin of the horizontal.
    """
    least, most = loop.least_thrust * full_thrust, loop.most_thrust * full_thrust
    horizontal = math.sqrt(acceleration.x * acceleration.x + acceleration.y * acceleration.y)
    angle = min(math.atan2(horizontal, model.gravity), loop.tilt_limit)
    sine, cosine = math.sin(angle), math.cos(angle)
    thrust = max(model.mass * (model.gravity - acceleration.z) / cosine, least)
    sideways = thrust * sine / max(horizontal, SMALLEST_LENGTH)
    wanted = Vec3(sideways * acceleration.x, sideways * acceleration.y, -thrust * cosine)

    length = math.sqrt(wanted.x * wanted.x + wanted.y * wanted.y)
    kept = min(length, loop.horizontal_margin * full_thrust)
    z = max(wanted.z, -math.sqrt(max(0.0, most * most - kept * kept)))
    left = math.sqrt(max(0.0, most * most - z * z))
    share = min(1.0, left / max(length, SMALLEST_LENGTH))
    return Force(wanted, Vec3(share * wanted.x, share * wanted.y, z))


def without_windup(
    loop: VelocityLoop, error: Vec3, wanted: Vec3, force: Force, model: Model, full_thrust: float
) -> Vec3:
    """The velocity error [m/s] as it is to be integrated.

    Vertical: none that would drive a thrust at its limit further. Horizontal: where less acceleration is given than
    `wanted` [m/s²], as much less as brings the integral back (tracking anti-windup, with the gain 2/P).
    """
    least, most = loop.least_thrust * full_thrust, loop.most_thrust * full_thrust
    at_least = (force.wanted.z >= -least) & (error.z >= 0.0)
    at_most = (force.wanted.z <= -most) & (error.z <= 0.0)
    z = FLOAT.where(at_least | at_most, 0.0, error.z)
    x, y = force.given.x / model.mass, force.given.y / model.mass
    saturated = wanted.x * wanted.x + wanted.y * wanted.y > x * x + y * y
    gain = FLOAT.where(saturated, 2.0 / loop.proportional.x, 0.0)
    return Vec3(error.x - gain * (wanted.x - x), error.y - gain * (wanted.y - y), z)
