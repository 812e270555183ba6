"""What the tests of every law share: states and models to try it at, and rates by differences along its flow.

Strategies are created once: that takes longer than drawing from them.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from hypothesis import note
from hypothesis import strategies as st

from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.trajectory import Trajectory


@functools.cache
def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high)


@functools.cache
def triple(component: st.SearchStrategy[float]) -> st.SearchStrategy[Vec3]:
    return st.builds(Vec3, component, component, component)


@functools.cache
@st.composite
def inertias(draw: st.DrawFn) -> Inertia:
    """A full, positive definite J = A Aᵀ + ½."""
    A = np.array([list(draw(triple(between(-0.5, 0.5)))) for _ in range(3)])
    J = A @ A.T + 0.5 * np.eye(3)
    xx, xy, xz, _, yy, yz, _, _, zz = J.ravel().tolist()
    return Inertia(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz)


@functools.cache
def quaternions() -> st.SearchStrategy[Quaternion]:
    component = between(-1.0, 1.0)
    return (
        st.builds(Quaternion.from_xyzw, component, component, component, component)
        .filter(lambda Q: Q.norm() > 0.1)
        .map(lambda Q: Q.normalised())
    )


trajectories = st.builds(
    Trajectory,
    amplitude_x=between(-4.0, 4.0),
    amplitude_y=between(-4.0, 4.0),
    frequency=between(0.0, 0.6),
    start_z=between(-5.0, 5.0),
    rate_z=between(-1.0, 1.0),
    yaw=between(-4.0, 4.0),
    yaw_rate=between(-1.0, 1.0),
)

STEP = 5e-5
"""[s], short against every time constant of these loops, and too short to cross |e| = ε."""


def rate_of(f: Callable[[float], Any]) -> Any:
    """df/dh at h = 0 of an array, by the central difference of sixth order."""
    h = STEP
    near, middle, far = (np.asarray(f(k * h)) - np.asarray(f(-k * h)) for k in (1, 2, 3))
    return (45.0 * near - 9.0 * middle + far) / (60.0 * h)


def assert_is_the_rate(exact: Any, f: Callable[[float], Any]) -> None:
    """The difference quotient loses about 1e-16/STEP of the value, its truncation less."""
    value, exact = np.asarray(f(0.0)), np.asarray(exact)
    error = np.max(np.abs(rate_of(f) - exact))
    assert error <= 1e-7 * (1.0 + np.max(np.abs(exact)) + np.max(np.abs(value))), error


def assert_rates(now: Any, flow: Callable[[float], Any], rates: Mapping[str, str]) -> None:
    """The rate of each quantity of a law is what is named beside it; the desired attitude's is its angular velocity's.

    `flow` is the law along the closed loop, by the time from `now` on [s].
    """

    def along(quantity: str) -> Callable[[float], list[float]]:
        return lambda h: list(getattr(flow(h), quantity))

    for quantity, rate in rates.items():
        note(quantity)
        assert_is_the_rate(list(getattr(now, rate)), along(quantity))
    note("desired attitude")
    turning = now.desired_quaternion.rate(now.desired_angular_velocity)
    assert_is_the_rate(list(turning), along("desired_quaternion"))
