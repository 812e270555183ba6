"""Axes conventions: converting twice gives the same value, and relations hold in both conventions."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit import frames
from fmu_kit.algebra import Inertia, Quaternion, Vec3

number = st.floats(-10.0, 10.0)
vectors = st.builds(Vec3, number, number, number)
quaternions = (
    st.builds(Quaternion.from_xyzw, number, number, number, number)
    .filter(lambda Q: Q.norm() > 0.1)
    .map(Quaternion.unit)
)
matrices = st.builds(
    lambda xx, yy, zz, xy, xz, yz: Inertia(xx=5.0 + xx, yy=5.0 + yy, zz=5.0 + zz, xy=xy, xz=xz, yz=yz),
    *[st.floats(0.0, 1.0)] * 6,
)
KINDS: dict[str, tuple[Callable[[Any, Any], Any], st.SearchStrategy[Any]]] = {
    "inertial": (frames.inertial, vectors),
    "inertial_sizes": (frames.inertial_sizes, vectors),
    "body": (frames.body, vectors),
    "body_matrix": (frames.body_matrix, matrices),
    "attitude": (frames.attitude, quaternions),
    "rotation": (frames.rotation, quaternions),
    "yaw": (frames.yaw, number.map(lambda angle: (angle,))),
    "about_z": (frames.about_z, number.map(lambda angle: (angle,))),
}


def near(one: Any, other: Any) -> None:
    assert np.allclose(list(one), list(other), rtol=0.0, atol=1e-12)


def turned(kind: str, value: Any, yes: bool = True) -> Any:
    function, _ = KINDS[kind]
    return (function(yes, *value),) if isinstance(value, tuple) else function(yes, value)


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data())
def test_told_twice_it_is_what_it_was_and_not_turned_it_stays_to_the_bit(kind: str, data: st.DataObject) -> None:
    value = data.draw(KINDS[kind][1])
    near(turned(kind, turned(kind, value)), value)
    assert [x.hex() for x in turned(kind, value, False)] == [x.hex() for x in value]


def test_forward_to_the_north_is_forward_to_the_second_axis_of_east_north_up() -> None:
    level = Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
    near(frames.attitude(True, level).to_inertial(Vec3(1.0, 0.0, 0.0)), (0.0, 1.0, 0.0))
    near(frames.attitude(True, level).to_inertial(Vec3(0.0, 0.0, 1.0)), (0.0, 0.0, 1.0))
    near(frames.inertial(True, Vec3(1.0, 2.0, 3.0)), (2.0, 1.0, -3.0))
    near(frames.body(True, Vec3(1.0, 2.0, 3.0)), (1.0, -2.0, -3.0))


@given(quaternions, vectors)
def test_an_attitude_takes_vectors_to_the_body_in_either_convention(Q: Quaternion, v: Vec3) -> None:
    near(frames.attitude(True, Q).to_body(frames.inertial(True, v)), frames.body(True, Q.to_body(v)))


@given(quaternions, quaternions)
def test_the_rotation_between_two_attitudes_is_so_in_either_convention(one: Quaternion, other: Quaternion) -> None:
    there = frames.attitude(True, one).inverse() * frames.attitude(True, other)
    near(there, frames.rotation(True, one.inverse() * other))


@given(matrices, vectors)
def test_an_angular_momentum_is_so_in_either_convention(J: Inertia, v: Vec3) -> None:
    near(frames.body_matrix(True, J) @ frames.body(True, v), frames.body(True, J @ v))


@given(vectors, vectors)
def test_gains_along_inertial_axes_are_so_in_either_convention(k: Vec3, v: Vec3) -> None:
    near(frames.inertial_sizes(True, k) * frames.inertial(True, v), frames.inertial(True, k * v))


@given(st.floats(-4.0, 4.0))
def test_a_yaw_is_the_direction_of_the_same_vector(angle: float) -> None:
    there = frames.yaw(True, angle)
    direction = frames.inertial(True, Vec3(math.cos(angle), math.sin(angle), 0.0))
    near(direction, (math.cos(there), math.sin(there), 0.0))
