"""Dryden gusts near the ground: velocities of the air about its mean, as coloured noise of given spectra.

MIL-F-8785C (1980), section 3.7: the Dryden form and its low-altitude model (10 to 1000 feet). With Ω = ω/V the
spectra are, one-sided and per rad/m,

    Φ_u = σ_u² 2L_u/π 1/(1 + (L_u Ω)²)
    Φ_i = σ_i² L_i/π (1 + 3(L_i Ω)²)/(1 + (L_i Ω)²)²        i = v, w

SI units; u is along the mean wind, v level to the right of it, w down.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from orchestration.systems.signals.motions import require

FOOT = 0.3048
"""Length of a foot [m]"""
LOWEST, HIGHEST = 10.0 * FOOT, 1000.0 * FOOT
"""Range of heights of the low-altitude model [m]"""
DRAWS = 5
"""Normal variates of each step: one for u, two for v, two for w"""


@dataclass(frozen=True, kw_only=True)
class Dryden:
    """Gusts at one height, for a vehicle that moves through the air at `airspeed`."""

    wind_speed: float = 5.0
    """W₂₀, the mean wind 20 feet (6 m) above the ground [m/s], to which gusts are proportional"""
    height: float = 10.0
    """h, above the ground [m]"""
    airspeed: float = 5.0
    """V, between the vehicle and the air [m/s]; at hover, that of the mean wind"""
    direction: float = 0.0
    """the direction to which the mean wind blows [rad], from north towards east"""
    steady: float = 0.0
    """the mean wind added to the gusts [m/s]"""
    step: float = 0.01
    """the step at which gusts are drawn [s]; they are linear in between"""

    def __post_init__(self) -> None:
        for name in ("airspeed", "step"):
            require(getattr(self, name) > 0.0, name, getattr(self, name), "a positive number")
        require(self.wind_speed >= 0.0, "wind_speed", self.wind_speed, "zero or a positive number")
        allowed = f"{LOWEST:g} to {HIGHEST:g} m, where the low-altitude model holds"
        require(LOWEST <= self.height <= HIGHEST, "height", self.height, allowed)

    def intensities(self) -> tuple[float, float, float]:
        """σ_u, σ_v, σ_w [m/s]."""
        down = 0.1 * self.wind_speed
        level = down / (0.177 + 0.000823 * self.height / FOOT) ** 0.4
        return level, level, down

    def lengths(self) -> tuple[float, float, float]:
        """L_u, L_v, L_w [m]."""
        level = self.height / (0.177 + 0.000823 * self.height / FOOT) ** 1.2
        return level, level, self.height

    def velocities(self, normal: Iterable[Sequence[float]]) -> list[tuple[float, float, float]]:
        """Wind [m/s], inertial, at the steps 0, 1, …, from standard normal variates, `DRAWS` per step.

        The first values are from the stationary distribution, and each step is exact: the values have the joint
        distribution of the continuous process at these times.
        """
        along, across, down = (
            _Filter(intensity, self.airspeed * self.step / length)
            for intensity, length in zip(self.intensities(), self.lengths())
        )
        north, east = math.cos(self.direction), math.sin(self.direction)
        found = []
        for a, b, c, d, e in normal:
            u, v, w = self.steady + along.first_order(a), across.second_order(b, c), down.second_order(d, e)
            found.append((north * u - east * v, east * u + north * v, w))
        return found


class _Filter:
    """A filter from white noise to one of the spectra, step by step, from the stationary distribution.

    In the time θ = tV/L the second order is d(x₁, x₂) = (x₂, -x₁ - 2x₂) dθ + (0, 2) dw, whose stationary covariance is
    the unit matrix, and y = σ/2 (x₁ + √3 x₂). Over a step e^{Aθ} = e^{-θ} [[1 + θ, θ], [-θ, 1 - θ]], and the noise has
    the covariance ∫ e^{As} B Bᵀ e^{Aᵀs} ds, whose triangular root is used.
    """

    def __init__(self, intensity: float, theta: float) -> None:
        self._intensity, left = intensity, math.exp(-theta)
        self._state: tuple[float, float] | None = None
        self._left, self._added = left, math.sqrt(-math.expm1(-2.0 * theta))
        self._move = (left * (1.0 + theta), left * theta, left * (1.0 - theta))
        power = left * left
        q11 = max(0.0, -math.expm1(-2.0 * theta) - power * (2.0 * theta + 2.0 * theta * theta))
        q12 = 2.0 * theta * theta * power
        q22 = -math.expm1(-2.0 * theta) + power * (2.0 * theta - 2.0 * theta * theta)
        self._a = math.sqrt(q11)
        self._b = q12 / self._a if self._a > 0.0 else 0.0
        self._c = math.sqrt(max(0.0, q22 - self._b * self._b))

    def first_order(self, a: float) -> float:
        """The next value of u."""
        x = a if self._state is None else self._left * self._state[0] + self._added * a
        self._state = x, 0.0
        return self._intensity * x

    def second_order(self, a: float, b: float) -> float:
        """The next value of v or w."""
        if self._state is None:
            x1, x2 = a, b
        else:
            (x1, x2), (m11, m12, m22) = self._state, self._move
            x1, x2 = m11 * x1 + m12 * x2 + self._a * a, m22 * x2 - m12 * x1 + self._b * a + self._c * b
        self._state = x1, x2
        return 0.5 * self._intensity * (x1 + math.sqrt(3.0) * x2)
