"""The rigid body against an independent model, against conservation laws and exact solutions."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import ZERO, Inertia, Quaternion, Vec3
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, acceleration, derivative, tilt
from orchestration.simulation.engines.sources import NUMPY

IDENTITY = Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
J = np.array([[0.8, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.4]])
BODY = Body(mass=1.3, inertia=Inertia(xx=0.8, yy=0.9, zz=1.4, xy=0.05, xz=-0.02, yz=0.03), gravity=9.7)
NO_WRENCH = Wrench(0.0, ZERO)

component = st.floats(-5.0, 5.0)
vectors = st.builds(Vec3, component, component, component)
quaternions = (
    st.builds(Quaternion.from_xyzw, component, component, component, component)
    .filter(lambda Q: Q.norm() > 0.1)
    .map(lambda Q: Q.normalised())
)
states = st.builds(RigidState, vectors, vectors, quaternions, vectors)
wrenches = st.builds(Wrench, st.floats(0.0, 30.0), vectors)


def numbers(state: RigidState) -> list[Any]:
    return [*state.position, *state.velocity, *state.quaternion, *state.angular_velocity]


def inertial_from_body(Q: Quaternion) -> Any:
    """The textbook's rotation matrix of a body whose attitude is the quaternion w + xi + yj + zk."""
    x, y, z, w = Q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def skew(v: Any) -> Any:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def independent_rates(R: Any, omega: Any, wrench: Wrench, force: Vec3) -> tuple[Any, Any, Any]:
    """dV, dR and dΩ of Newton and Euler, with R from body to inertial components."""
    dV = np.array([0.0, 0.0, 9.7]) + (R @ [0.0, 0.0, -wrench.thrust] + list(force)) / 1.3
    return dV, R @ skew(omega), np.linalg.solve(J, list(wrench.torque) - np.cross(omega, J @ omega))


@given(states, wrenches, vectors)
def test_derivative_is_that_of_newton_and_euler(state: RigidState, wrench: Wrench, force: Vec3) -> None:
    rate = derivative(state, wrench, force, BODY)
    R, omega = inertial_from_body(state.quaternion), np.array(list(state.angular_velocity))
    dV, dR, d_omega = independent_rates(R, omega, wrench, force)
    assert rate.position == state.velocity
    np.testing.assert_allclose(list(rate.velocity), dV, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(list(rate.angular_velocity), d_omega, rtol=0.0, atol=1e-12)
    # R is quadratic in Q, so that its central difference along dQ is exact.
    ahead, behind = (inertial_from_body(state.quaternion.plus(sign, rate.quaternion)) for sign in (1.0, -1.0))
    np.testing.assert_allclose(0.5 * (ahead - behind), dR, rtol=0.0, atol=1e-11)


def test_batch_of_states_gives_what_its_states_give() -> None:
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (13, 10))

    def state(p: Any) -> RigidState:
        return RigidState(Vec3(*p[:3]), Vec3(*p[3:6]), Quaternion.from_xyzw(*p[6:10]), Vec3(*p[10:]))

    wrench, force = Wrench(9.0, Vec3(0.1, 0.2, 0.3)), Vec3(0.4, 0.5, 0.6)
    batch = numbers(derivative(state(points).normalised(NUMPY), wrench, force, BODY))
    for i, point in enumerate(points.T.tolist()):
        single = numbers(derivative(state(point).normalised(), wrench, force, BODY))
        assert [component[i] for component in batch] == single


@given(quaternions, vectors)
def test_torque_free_spin_conserves_energy_and_inertial_angular_momentum(Q: Quaternion, omega: Vec3) -> None:
    def invariants(x: RigidState) -> list[float]:
        momentum = BODY.inertia @ x.angular_velocity
        return [0.5 * (x.angular_velocity @ momentum), *x.quaternion.to_inertial(momentum)]

    start = state = RigidState(ZERO, ZERO, Q, omega)
    for _ in range(100):
        state = rk4_step(lambda t, x: derivative(x, NO_WRENCH, ZERO, BODY), 0.0, state, 0.002).normalised()
    assert invariants(state) == pytest.approx(invariants(start), rel=0.0, abs=1e-8)


def test_torque_free_spin_is_not_constant() -> None:
    """Else the conservation laws would be proven of a body that does not tumble."""
    rate = derivative(RigidState(ZERO, ZERO, IDENTITY, Vec3(1.0, 2.0, 3.0)), NO_WRENCH, ZERO, BODY)
    assert rate.angular_velocity.norm() > 1.0


def test_thrust_of_a_body_pitched_up_pushes_backwards() -> None:
    """Nose up by 0.1 rad: forward-right-down axes, thrust along -z of the body."""
    Q = Quaternion.from_xyzw(0.0, math.sin(0.05), 0.0, math.cos(0.05))
    expected = [-math.sin(0.1) * 10.0 / 1.3, 0.0, 9.7 - math.cos(0.1) * 10.0 / 1.3]
    assert list(acceleration(Q, 10.0, ZERO, BODY)) == pytest.approx(expected, abs=1e-14)


@given(st.floats(0.0, math.pi), st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_tilt_is_the_angle_of_the_lean_whatever_the_heading(angle: float, direction: float, heading: float) -> None:
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    lean = Quaternion.from_xyzw(s * math.cos(direction), s * math.sin(direction), 0.0, c)
    turn = Quaternion.from_xyzw(0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))
    # Upside down, the arc sine has a vertical tangent: half of the digits are lost there.
    tolerance = 1e-14 if angle < 3.0 else 1e-7
    assert tilt(lean * turn) == pytest.approx(angle, abs=tolerance)
    assert tilt(turn * lean) == pytest.approx(angle, abs=tolerance)


@pytest.mark.parametrize("angle", [1e-12, 1e-9, 1e-5])
def test_small_tilts_keep_their_digits(angle: float) -> None:
    """An arc cosine would see none below 1e-8."""
    assert tilt(Quaternion.from_xyzw(0.5 * angle, 0.0, 0.0, 1.0)) == pytest.approx(angle, rel=1e-9)


def test_tilt_of_a_body_upside_down_is_a_half_turn_in_spite_of_rounding() -> None:
    assert tilt(Quaternion.from_xyzw(1.0 + 1e-15, 0.0, 0.0, 0.0)) == math.pi


@given(states)
def test_normalised_changes_nothing_but_the_length_of_the_quaternion(state: RigidState) -> None:
    longer = RigidState(state.position, state.velocity, state.quaternion / 0.5, state.angular_velocity)
    assert numbers(longer.normalised()) == pytest.approx(numbers(state), rel=1e-15, abs=1e-15)
