"""One period of the quadrotor in its lateral plane, over boxes of the measurement at its beginning.

The state is [y, vy, φ, p, z, vz] [m, m/s, rad, rad/s, m, m/s]: a roll φ about the x axis at the rate p, and altitude,
which a tilted thrust does not hold. The reference is rest at 0. The state stays in the plane: the law's command about
the other axes is 0 to the bit. The law is the project's own, explicit, with its command held for the period.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.vehicle import Measurement, Model
from docs.lateral_basin.centred import OPS, Centred
from docs.lateral_basin.intervals import Intervals
from fmu_kit.algebra import ZERO, Quaternion, Vec3
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import RigidState, Wrench, derivative
from fmu_kit.scalar import Scalar, ScalarOps
from fmu_kit.trajectory import Reference
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.sources import NUMPY

STATES = ("y", "vy", "φ", "p", "z", "vz")
UNITS = ("m", "m/s", "rad", "rad/s", "m", "m/s")
REST = Reference(position=ZERO)


@dataclass(frozen=True, kw_only=True)
class Loop:
    """The law and the vehicle, which is also its nominal model."""

    period: float
    """h [s]"""
    gains: Gains = Gains()
    body: Model = Model()

    def command(self, state: Sequence[Scalar], ops: ScalarOps) -> tuple[Scalar, Scalar]:
        """The command of the law: thrust per mass n [m/s²] and roll acceleration α [rad/s²]."""
        y, vy, phi, p, z, vz = state
        half = 0.5 * phi
        attitude = Quaternion(Vec3(ops.sin(half), 0.0, 0.0), ops.cos(half))
        measurement = Measurement(Vec3(0.0, y, z), Vec3(0.0, vy, vz), attitude, Vec3(p, 0.0, 0.0))
        result = evaluate(measurement, REST, self.gains, self.body, ops)
        if isinstance(phi, Centred) and not result.torque.y == result.torque.z == 0.0:
            raise ArithmeticError("the law leaves the plane")
        return result.thrust / self.body.mass, result.torque.x / self.body.inertia.xx

    def after(self, states: Floats, longest: float = 0.01) -> Floats:
        """The states a period later, shape (6, points), by the plant's equations and Runge-Kutta steps of `longest`."""
        thrust, roll = self.command(tuple(states), NUMPY)
        body, steps, none = self.body, math.ceil(self.period / longest), np.zeros_like(roll)
        wrench = Wrench(thrust * body.mass, Vec3(roll * body.inertia.xx, 0.0, 0.0))
        y, vy, phi, p, z, vz = states
        attitude = Quaternion(Vec3(np.sin(phi / 2), none, none), np.cos(phi / 2))
        x = RigidState(Vec3(none, y, z), Vec3(none, vy, vz), attitude, Vec3(p, none, none))
        for _ in range(steps):
            x = rk4_step(lambda _, x: derivative(x, wrench, ZERO, body), 0.0, x, self.period / steps)
        roll_angle = 2.0 * np.arctan2(x.quaternion.vector.x, x.quaternion.scalar)
        return np.array([x.position.y, x.velocity.y, roll_angle, x.angular_velocity.x, x.position.z, x.velocity.z])

    def change(self, state: Sequence[Centred]) -> list[Centred]:
        """The change of each coordinate of the state in a period, (4) and (5) with the command held.

        The roll is a parabola in time; velocity and position are integrals of n sin φ and g - n cos φ.
        """
        h, (_, vy, phi, p, _, vz) = self.period, state
        n, alpha = self.command(state, OPS)
        sine, cosine = _integrals(phi, p, alpha, h)
        lift_y, lift_z = n * sine[0], n * cosine[0]
        return [
            vy * h + n * sine[1],
            lift_y,
            p * h + alpha * (h**2 / 2),
            alpha * h,
            vz * h + self.body.gravity * (h**2 / 2) - n * cosine[1],
            self.body.gravity * h - lift_z,
        ]


def _integrals(phi: Centred, p: Centred, alpha: Centred, h: float) -> list[tuple[Centred, Centred]]:
    """∫ f dt and ∫ (h - t) f dt over the period, for f = sin φ and f = cos φ.

    With τ from the middle of the period, φ = φ_m + ψ, ψ = ω τ + α τ²/2, and f(φ) = f + f' ψ - f ψ²/2 - f'(ξ) ψ³/6,
    with f and f' at φ_m. All terms but the last are integrated exactly; for the last, |f'(ξ) ψ²/6| ≤ Ψ²/6.
    """
    middle, omega = phi + p * (h / 2) + alpha * (h**2 / 8), p + alpha * (h / 2)
    sine, cosine = OPS.sin(middle), OPS.cos(middle)
    largest = omega.anywhere.size * (h / 2) + alpha.anywhere.size * (h**2 / 8)  # Ψ

    def any_up_to(factor: float) -> Centred:
        return Centred.any_of(Intervals.symmetric(factor / 6.0 * largest**2 * (1.0 + 1e-12)), phi.radius)

    squares = omega * omega * (h**3 / 12) + alpha * alpha * (h**5 / 320)  # ∫ ψ² dτ
    rest = omega * any_up_to(h**2 / 4) + alpha * any_up_to(h**3 / 24)
    rest_of_moment = omega * any_up_to(h**3 / 12) + alpha * any_up_to(h**4 / 64)

    def of(f: Centred, slope: Centred) -> tuple[Centred, Centred]:
        whole = f * h + slope * alpha * (h**3 / 24) - 0.5 * f * squares + rest
        moment = slope * omega * (h**3 / 12) - f * omega * alpha * (h**5 / 160) + rest_of_moment  # ∫ τ f dτ
        return whole, whole * (h / 2) - moment

    return [of(sine, cosine), of(cosine, -sine)]
