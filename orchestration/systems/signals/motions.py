"""Motions by name: positions over time, with their derivatives up to snap.

Inertial frame north-east-down (z points down), SI units. Each begins at (x, y, z); periodic ones begin towards north,
and accelerate from rest over `ramp` seconds, with four continuous derivatives. The functions of time
of which they consist use `ScalarOps`, so that times are floats, arrays of them or symbols.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from fmu_kit.algebra import Vec3
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps
from fmu_kit.trajectory import Reference, Trajectory
from orchestration.foundation.basics.errors import UsageError


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


_PAPER = Trajectory()
PERIOD = 10.0
"""Default period of periodic motions [s]"""


class Motion(Protocol):
    """A position over time, with derivatives."""

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """P_d and its first four derivatives at `t` [s], each a `Vec3` of scalars shaped as `t`."""


@dataclass(frozen=True, kw_only=True)
class Hover:
    """At rest at one point."""

    x: float = 0.0
    """Position x [m], as y and z"""
    y: float = 0.0
    z: float = 0.0

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """The same at all times."""
        return reference(constant(self.x, t), constant(self.y, t), constant(self.z, t))


@dataclass(frozen=True, kw_only=True)
class Step:
    """From one point to another, P + d S(τ) with the smooth step S of degree nine, and at rest before and after."""

    x: float = 0.0
    """Position x [m], as y and z"""
    y: float = 0.0
    z: float = 0.0
    dx: float = 1.0
    """the distance [m], as dy and dz"""
    dy: float = 0.0
    dz: float = 0.0
    start: float = 1.0
    """Time at which it begins [s]"""
    duration: float = 2.0
    """the time that it takes [s]"""

    def __post_init__(self) -> None:
        require(self.start >= 0.0, "start", self.start, "zero or a positive number")
        require(self.duration > 0.0, "duration", self.duration, "a positive number")

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """The motion between the two points."""
        share = rise(t, self.start, self.duration, ops)
        ways = ((self.x, self.dx), (self.y, self.dy), (self.z, self.dz))
        return reference(*(shifted(begin, scaled(by, share)) for begin, by in ways))


@dataclass(frozen=True, kw_only=True)
class _Periodic:
    """A periodic motion at an angular rate ω."""

    x: float = 0.0
    """Position x at which it begins [m], as y and z"""
    y: float = 0.0
    z: float = 0.0
    radius: float = 2.0
    """Radius [m]"""
    period: float | None = None
    """Period of one turn [s]; default: 10, if no speed is given"""
    speed: float | None = None
    """Speed in place of a period [m/s]"""
    ramp: float = 3.0
    """the time from rest to full speed [s]; 0: at full speed from the beginning"""

    def __post_init__(self) -> None:
        require(self.radius > 0.0, "radius", self.radius, "a positive number")
        require(self.ramp >= 0.0, "ramp", self.ramp, "zero or a positive number")
        for name in ("period", "speed"):
            value = getattr(self, name)
            require(value is None or value > 0.0, name, value, "a positive number")
        require(self.period is None or self.speed is None, "speed", self.speed, "none beside period, or no period")

    def rate(self, longest: float) -> float:
        """ω [rad/s]; at an angular rate of one the largest speed is `longest` [m/s]."""
        if self.speed is not None:
            return self.speed / longest
        return 2.0 * math.pi / (PERIOD if self.period is None else self.period)


@dataclass(frozen=True, kw_only=True)
class Circle(_Periodic):
    """P + r [sin θ, 1 - cos θ, 0]: level, to the right; θ = ωσ(t), and `speed` is that along the circle."""

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """The motion on the circle."""
        return reference(*_circle(self, eased(t, self.ramp, ops), ops), constant(self.z, t))


@dataclass(frozen=True, kw_only=True)
class Helix(_Periodic):
    """As the circle, and z + rate_z σ(t): it climbs or descends at the same time; `speed` is the level part."""

    rate_z: float = -0.2
    """Rate of z [m/s]; z points down, so that a negative one climbs"""

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """The motion on the helix."""
        time = eased(t, self.ramp, ops)
        return reference(*_circle(self, time, ops), after(line(self.z, self.rate_z, time.value), time))


@dataclass(frozen=True, kw_only=True)
class Lemniscate(_Periodic):
    """P + r [sin θ, sin θ cos θ, 0], θ = ωσ(t): Gerono's figure of eight, from its crossing; 2 r long and r wide.

    `speed` is the largest, at the crossing: √2 r ω.
    """

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """The motion on the figure of eight."""
        time, rate = eased(t, self.ramp, ops), self.rate(math.sqrt(2.0) * self.radius)
        along = shifted(self.x, after(wave(self.radius, rate, time.value, ops), time))
        across = shifted(self.y, after(wave(0.5 * self.radius, 2.0 * rate, time.value, ops), time))
        return reference(along, across, constant(self.z, t))


@dataclass(frozen=True, kw_only=True)
class Paper:
    """The paper's motion (section V), built into controllers: [a_x sin ωσ cos ωσ, a_y sin ωσ, start_z + rate_z σ].

    The paper has no ramp: its reference is at full speed from the beginning, and so is this one by default.
    """

    amplitude_x: float = _PAPER.amplitude_x
    """a_x [m]"""
    amplitude_y: float = _PAPER.amplitude_y
    """a_y [m]"""
    frequency: float = _PAPER.frequency
    """ω [rad/s]"""
    start_z: float = _PAPER.start_z
    """Start of z [m]"""
    rate_z: float = _PAPER.rate_z
    """Rate of z [m/s]"""
    ramp: float = 0.0
    """the time from rest to full speed [s]"""

    def __post_init__(self) -> None:
        require(self.ramp >= 0.0, "ramp", self.ramp, "zero or a positive number")

    def at(self, t: Scalar, ops: ScalarOps = FLOAT) -> Reference:
        """The motion on the paper's path."""
        path = Trajectory(
            amplitude_x=self.amplitude_x,
            amplitude_y=self.amplitude_y,
            frequency=self.frequency,
            start_z=self.start_z,
            rate_z=self.rate_z,
        )
        time = eased(t, self.ramp, ops)
        return reference(*(after(one, time) for one in _coordinates(path.at(time.value, ops))))


MOTIONS: dict[str, type[Motion]] = {
    "hover": Hover,
    "step": Step,
    "circle": Circle,
    "lemniscate": Lemniscate,
    "helix": Helix,
    "paper": Paper,
}


def _circle(motion: _Periodic, time: Derivatives, ops: ScalarOps) -> tuple[Derivatives, Derivatives]:
    rate, radius = motion.rate(motion.radius), motion.radius
    sine = wave(radius, rate, time.value, ops)
    cosine = Derivatives(radius * ops.cos(rate * time.value), *(-rate * each for each in sine[:4]))  # cos' = -ω sin
    return shifted(motion.x, after(sine, time)), shifted(motion.y + radius, scaled(-1.0, after(cosine, time)))


def _coordinates(reference: Reference) -> list[Derivatives]:
    orders: tuple[Vec3, ...] = (
        reference.position,
        reference.velocity,
        reference.acceleration,
        reference.jerk,
        reference.snap,
    )
    return [Derivatives(*each) for each in zip(*orders)]


def require(condition: bool, name: str, value: object, expected: str) -> None:
    """Raise `UsageError` naming the parameter, its value and what was expected, unless `condition` holds."""
    if not condition:
        raise UsageError(f"{name} = {value}: expected {expected}")
