"""Motions by name: positions over time, with their derivatives up to snap.

Inertial frame north-east-down (z points down), SI units. Each begins at (x, y, z); periodic ones begin towards north,
and accelerate from rest over `ramp` seconds, with four continuous derivatives.
"""

import math
from dataclasses import dataclass
from typing import Protocol

from fmu_kit.algebra import Vec3
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps
from fmu_kit.trajectory import Reference, Trajectory
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.signals.derivatives import (
    Derivatives,
    after,
    constant,
    eased,
    line,
    reference,
    rise,
    scaled,
    shifted,
    wave,
)

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
        _require(self.start >= 0.0, "start", self.start, "zero or a positive number")
        _require(self.duration > 0.0, "duration", self.duration, "a positive number")

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
        _require(self.radius > 0.0, "radius", self.radius, "a positive number")
        _require(self.ramp >= 0.0, "ramp", self.ramp, "zero or a positive number")
        for name in ("period", "speed"):
            value = getattr(self, name)
            _require(value is None or value > 0.0, name, value, "a positive number")
        _require(self.period is None or self.speed is None, "speed", self.speed, "none beside period, or no period")

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
        _require(self.ramp >= 0.0, "ramp", self.ramp, "zero or a positive number")

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


def _require(condition: bool, name: str, value: object, expected: str) -> None:
    if not condition:
        raise UsageError(f"{name} = {value}: expected {expected}")
