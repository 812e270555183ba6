"""Functions of time with their first four derivatives, of which motions consist.

They use `ScalarOps`, so that times are floats, arrays of them or symbols.
"""

from typing import NamedTuple

from fmu_kit.algebra import Vec3
from fmu_kit.scalar import Scalar, ScalarOps
from fmu_kit.trajectory import Reference


class Derivatives(NamedTuple):
    """A value and its derivatives, each a scalar shaped as the time."""

    value: Scalar
    first: Scalar
    second: Scalar
    third: Scalar
    fourth: Scalar


def constant(value: float, t: Scalar) -> Derivatives:
    """A constant, at all times `t`."""
    zero = 0.0 * t
    return Derivatives(value + zero, zero, zero, zero, zero)


def line(start: float, rate: float, t: Scalar) -> Derivatives:
    """start + rate t."""
    zero = 0.0 * t
    return Derivatives(start + rate * t, rate + zero, zero, zero, zero)


def wave(amplitude: float, rate: float, t: Scalar, ops: ScalarOps) -> Derivatives:
    """amplitude sin(rate t)."""
    sin, cos = ops.sin(rate * t), ops.cos(rate * t)
    first, second = amplitude * rate, amplitude * rate * rate
    third, fourth = second * rate, second * rate * rate
    return Derivatives(amplitude * sin, first * cos, -second * sin, -third * cos, fourth * sin)


def rise(t: Scalar, start: float, duration: float, ops: ScalarOps) -> Derivatives:
    """From 0 at `start` to 1 `duration` later, all [s]: S(τ) = 126 τ⁵ - 420 τ⁶ + 540 τ⁷ - 315 τ⁸ + 70 τ⁹.

    The polynomial of lowest degree whose first four derivatives vanish at both ends; constant before and after.
    """
    share = _share(t, start, duration, ops)
    q, p = share * (1.0 - share), 1.0 - 2.0 * share  # S' = 630 q⁴, and q' = p
    value = share * share * share * share * share * _horner((126.0, -420.0, 540.0, -315.0, 70.0), share)
    rate = 1.0 / duration
    return Derivatives(
        value,
        630.0 * q * q * q * q * rate,
        2520.0 * q * q * q * p * (rate * rate),
        2520.0 * q * q * (3.0 * p * p - 2.0 * q) * (rate * rate * rate),
        15120.0 * q * p * (p * p - 3.0 * q) * (rate * rate * rate * rate),
    )


def eased(t: Scalar, ramp: float, ops: ScalarOps) -> Derivatives:
    """Time σ(t) that is at rest at 0 and runs as `t` does from `ramp` [s] on: dσ/dt = S(t/ramp).

    From then on it lags by ramp/2. With a ramp of 0 it is `t`.
    """
    if ramp == 0.0:
        return line(0.0, 1.0, t)
    share, speed = _share(t, 0.0, ramp, ops), rise(t, 0.0, ramp, ops)
    integral = share * share * share * share * share * share * _horner((21.0, -60.0, 67.5, -35.0, 7.0), share)
    return Derivatives(ramp * integral + ops.maximum(t - ramp, 0.0 * t), *speed[:4])


def after(path: Derivatives, time: Derivatives) -> Derivatives:
    """`path`, a function of σ, as a function of t, where `time` is σ(t): the chain rule up to the fourth derivative."""
    s1, s2, s3, s4 = time[1:]
    p0, p1, p2, p3, p4 = path
    return Derivatives(
        p0,
        p1 * s1,
        p2 * s1 * s1 + p1 * s2,
        p3 * s1 * s1 * s1 + 3.0 * p2 * s1 * s2 + p1 * s3,
        p4 * s1 * s1 * s1 * s1 + 6.0 * p3 * s1 * s1 * s2 + p2 * (3.0 * s2 * s2 + 4.0 * s1 * s3) + p1 * s4,
    )


def shifted(by: float, motion: Derivatives) -> Derivatives:
    """`one` plus a constant."""
    return Derivatives(by + motion.value, *motion[1:])


def scaled(factor: float, motion: Derivatives) -> Derivatives:
    """`one` times a factor."""
    return Derivatives(*(factor * each for each in motion))


def reference(x: Derivatives, y: Derivatives, z: Derivatives) -> Reference:
    """The motion with these coordinates."""
    position, velocity, acceleration, jerk, snap = (Vec3(*each) for each in zip(x, y, z))
    return Reference(position=position, velocity=velocity, acceleration=acceleration, jerk=jerk, snap=snap)


def _share(t: Scalar, start: float, duration: float, ops: ScalarOps) -> Scalar:
    """The share of `duration` that has passed since `start`, in [0, 1]."""
    share = (t - start) / duration
    share = ops.where(share > 0.0, share, 0.0 * t)
    return ops.where(share < 1.0, share, 1.0 + 0.0 * t)


def _horner(coefficients: tuple[float, ...], x: Scalar) -> Scalar:
    """The polynomial with these coefficients, from that of x⁰."""
    result = coefficients[-1] + 0.0 * x
    for each in reversed(coefficients[:-1]):
        result = result * x + each
    return result
