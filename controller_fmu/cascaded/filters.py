"""Filters of a sampled loop: a first-order low-pass, a filtered derivative, and clamping.

After an elapsed time of 0 they are unchanged, so that the first run of a loop is no special case.
"""

from fmu_kit.algebra import Vec3


def low_pass(filtered: float, sample: float, elapsed: float, cutoff: float) -> float:
    """x + dt (sample - x)/(τ + dt): the backward difference, dt = `elapsed` [s] after x was `filtered`.

    τ = 1/`cutoff`, in rad/s and larger than 0.
    """
    return filtered + elapsed * (sample - filtered) / (1.0 / cutoff + elapsed)


def filtered_derivative(derivative: Vec3, change: Vec3, elapsed: float, cutoff: float) -> Vec3:
    """The low-pass of change/elapsed, per axis, `elapsed` [s] after it was `derivative`, without division by 0."""
    return derivative + (change - elapsed * derivative) / (1.0 / cutoff + elapsed)


def clamped(value: float, lowest: float, highest: float) -> float:
    """`value` within [lowest, highest]."""
    return max(lowest, min(value, highest))


def clamped_axes(v: Vec3, bounds: Vec3) -> Vec3:
    """`v` within ±`bounds`, per axis."""
    return Vec3(clamped(v.x, -bounds.x, bounds.x), clamped(v.y, -bounds.y, bounds.y), clamped(v.z, -bounds.z, bounds.z))
