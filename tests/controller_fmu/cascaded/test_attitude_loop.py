"""The attitude loop alone, and the attitude that a force asks for."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from controller_fmu.cascaded.attitude_loop import AttitudeLoop, attitude_of, with_weighted_yaw
from fmu_kit.algebra import Quaternion, Vec3

FREE = AttitudeLoop(rate_limit=Vec3(1e9, 1e9, 1e9))
COMPONENT = st.floats(-1.0, 1.0, allow_subnormal=False)


@st.composite
def attitudes(draw: st.DrawFn) -> Quaternion:
    Q = Quaternion.from_xyzw(*(draw(COMPONENT) for _ in range(4)))
    assume(Q.norm() > 0.1)
    return Q.normalised()


def about(axis: Vec3, angle: float) -> Quaternion:
    return Quaternion(math.sin(0.5 * angle) * axis, math.cos(0.5 * angle))


# -- from a force ---------------------------------------------------------------------------------------------


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-30.0, -0.5), st.floats(-7.0, 7.0))
def test_the_attitude_of_a_force_has_its_thrust_axis_and_the_nose_in_the_plane_of_the_yaw(
    x: float, y: float, z: float, yaw: float
) -> None:
    force = Vec3(x, y, z)
    Q = attitude_of(force, yaw)
    assert Q.norm() == pytest.approx(1.0)
    assert [*Q.to_inertial(Vec3(0.0, 0.0, -force.norm()))] == pytest.approx([*force], abs=1e-9)
    nose = Q.to_inertial(Vec3(1.0, 0.0, 0.0))
    assert nose.y * math.cos(yaw) - nose.x * math.sin(yaw) == pytest.approx(0.0, abs=1e-12)
    assert nose.x * math.cos(yaw) + nose.y * math.sin(yaw) > 0.0


# -- from an attitude error -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("axis", "gain"), [(0, 6.5), (1, 6.5), (2, 2.8)])
def test_a_step_is_answered_as_the_sampled_loop_does(axis: int, gain: float) -> None:
    """θ → θ - T 2 K sin(θ/2) about x and y; about z the weighted angle, its gain divided by the weight."""
    loop, T, angle, weight = FREE, 0.02, 1.2, 0.4 if axis == 2 else 1.0
    unit = Vec3(*np.eye(3)[axis])
    Q, desired = about(unit, -angle), Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
    for _ in range(50):
        rate = [*loop.angular_velocity(Q, desired, 0.0)]
        assert rate == pytest.approx([*(2.0 * gain / weight * math.sin(0.5 * weight * angle) * unit)], abs=1e-12)
        Q = Q * about(unit, T * rate[axis])
        angle -= T * rate[axis]


def second_form(attitude: Quaternion, desired: Quaternion, weight: float) -> np.ndarray:
    """The weighted error by rotation matrices: the axis of Rᵀ R_d' times 2 sin of half its angle."""
    from scipy.spatial.transform import Rotation

    R, R_d = (Rotation.from_quat([*Q]).as_matrix() for Q in (attitude, desired))
    across = np.cross(R[:, 2], R_d[:, 2])
    angle = math.atan2(float(np.linalg.norm(across)), float(R[:, 2] @ R_d[:, 2]))
    unit = across / np.linalg.norm(across) if angle > 0.0 else across
    K = np.cross(unit, np.eye(3)).T  # [unit]×
    tilted = (np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K) @ R
    turn = tilted.T @ R_d
    yaw = weight * math.atan2(turn[1, 0], turn[0, 0])
    turned = tilted @ [[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    vector = Rotation.from_matrix(R.T @ turned).as_rotvec()
    size = float(np.linalg.norm(vector))
    return vector * (2.0 * math.sin(0.5 * size) / size if size > 0.0 else 1.0)


@given(attitudes(), attitudes(), st.floats(0.05, 1.0))
def test_the_reduced_weight_of_yaw_is_that_of_rotation_matrices(Q: Quaternion, Q_d: Quaternion, weight: float) -> None:
    from scipy.spatial.transform import Rotation

    now, then = Q.z_axis(), Q_d.z_axis()
    assume(now @ then > -0.999 and now.cross(then).norm() > 1e-6)
    error = Q.inverse() * with_weighted_yaw(Q, Q_d, weight)
    assume(abs(error.scalar) > 1e-3)  # half a turn: either way round
    full = Rotation.from_quat([*Q]).inv() * Rotation.from_quat([*Q_d])
    assume(abs(full.magnitude()) < math.pi - 1e-3)
    yaw = with_weighted_yaw(Q, Q_d, 0.0).inverse() * Q_d
    assume(abs(yaw.scalar) > 1e-3)
    loop = AttitudeLoop(gain=Vec3(1.0, 1.0, weight), yaw_weight=weight, rate_limit=FREE.rate_limit)
    assert [*loop.angular_velocity(Q, Q_d, 0.0)] == pytest.approx(list(second_form(Q, Q_d, weight)), abs=1e-9)


@given(attitudes(), attitudes())
def test_the_weight_of_one_is_the_whole_error_and_of_none_has_no_yaw(Q: Quaternion, Q_d: Quaternion) -> None:
    assume(Q.z_axis() @ Q_d.z_axis() > -0.999)
    whole = with_weighted_yaw(Q, Q_d, 1.0)
    assert abs(whole.vector @ Q_d.vector + whole.scalar * Q_d.scalar) == pytest.approx(1.0, abs=1e-12)
    tilt = Q.inverse() * with_weighted_yaw(Q, Q_d, 0.0)
    assert tilt.vector.z == pytest.approx(0.0, abs=1e-9)


def test_both_quaternions_of_an_attitude_are_turned_to_alike() -> None:
    Q, Q_d = about(Vec3(0.6, 0.0, 0.8), 2.0), about(Vec3(0.0, 1.0, 0.0), 0.5)
    rates = [[*FREE.angular_velocity(a, b, 0.0)] for a in (Q, -Q) for b in (Q_d, -Q_d)]
    assert rates == [pytest.approx(rates[0])] * 4


def test_upside_down_the_whole_error_is_taken() -> None:
    Q, Q_d = about(Vec3(0.6, 0.8, 0.0), math.pi), Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
    assert [*FREE.angular_velocity(Q, Q_d, 0.0)][:2] == pytest.approx([-2.0 * 6.5 * 0.6, -2.0 * 6.5 * 0.8], abs=1e-9)


@given(attitudes(), attitudes(), st.floats(-1.0, 1.0))
def test_the_rate_of_the_yaw_is_added_as_a_turn_about_the_vertical(Q: Quaternion, Q_d: Quaternion, rate: float) -> None:
    added = FREE.angular_velocity(Q, Q_d, rate) - FREE.angular_velocity(Q, Q_d, 0.0)
    assert [*Q.to_inertial(added)] == pytest.approx([0.0, 0.0, rate], abs=1e-9)


def test_angular_velocities_have_limits_of_their_own() -> None:
    Q, Q_d = about(Vec3(0.6, 0.0, 0.8), 3.0), Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
    rate = AttitudeLoop().angular_velocity(Q, Q_d, 0.0)
    assert [abs(rate.x), abs(rate.z)] == pytest.approx([math.radians(220.0), math.radians(200.0)])
