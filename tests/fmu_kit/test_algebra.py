"""Theorems of the algebra, sampled on purpose near the hard places."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from fmu_kit.algebra import Inertia, Quaternion, Vec3, is_positive_definite
from orchestration.simulation.engines.sources import NUMPY

ROUNDING = 1e-14
"""A few dozen units in the last place."""

unit_interval = st.floats(-1.0, 1.0)
directions = st.builds(Vec3, unit_interval, unit_interval, unit_interval).filter(lambda v: v.norm() > 1e-3)
scales = st.one_of(st.just(1.0), st.floats(-100.0, 100.0).map(lambda exponent: 10.0**exponent))
vectors = st.one_of(
    st.just(Vec3(0.0, 0.0, 0.0)),
    st.sampled_from([Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)]),
    st.builds(lambda direction, scale: scale * direction, directions, scales),
)
near = st.builds(
    lambda centre, sign, exponent: centre + sign * 10.0**exponent,
    st.sampled_from([0.0, math.pi, -math.pi, 2.0 * math.pi]),
    st.sampled_from([-1.0, 0.0, 1.0]),
    st.floats(-17.0, -1.0),
)
angles = st.one_of(near, st.floats(-2.0 * math.pi, 2.0 * math.pi))


def rotation(axis: Vec3, angle: float) -> Quaternion:
    """The attitude of a body turned by `angle` about `axis` out of the inertial frame."""
    return Quaternion(math.sin(0.5 * angle) * (axis / axis.norm()), math.cos(0.5 * angle))


quaternions = st.builds(rotation, directions, angles)


def matrix(Q: Quaternion) -> Any:
    """R(Q), from what it does to the unit vectors."""
    return np.array([list(Q.to_body(Vec3(*row))) for row in np.eye(3).tolist()]).T


def assert_equal_vectors(actual: Vec3, expected: Vec3, scale: float, tolerance: float = ROUNDING) -> None:
    assert (actual - expected).norm() <= tolerance * scale, f"{actual} is not {expected}"


def assert_equal_quaternions(actual: Quaternion, expected: Quaternion, tolerance: float = ROUNDING) -> None:
    assert actual.plus(-1.0, expected).norm() <= tolerance, f"{actual} is not {expected}"


@given(quaternions, quaternions)
def test_product_of_unit_quaternions_is_a_unit_quaternion(Q1: Quaternion, Q2: Quaternion) -> None:
    assert abs((Q1 * Q2).norm() - 1.0) <= ROUNDING


@given(quaternions)
def test_inverse_undoes_a_quaternion_from_both_sides(Q: Quaternion) -> None:
    identity = Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
    assert_equal_quaternions(Q * Q.inverse(), identity)
    assert_equal_quaternions(Q.inverse() * Q, identity)


@given(quaternions, quaternions, quaternions)
def test_quaternion_product_is_associative(Q1: Quaternion, Q2: Quaternion, Q3: Quaternion) -> None:
    assert_equal_quaternions((Q1 * Q2) * Q3, Q1 * (Q2 * Q3))


@given(quaternions)
def test_identity_is_neutral(Q: Quaternion) -> None:
    identity = Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
    assert Q * identity == Q
    assert identity * Q == Q


@given(quaternions, quaternions, vectors)
def test_product_rotates_by_its_left_factor_first(Q1: Quaternion, Q2: Quaternion, v: Vec3) -> None:
    """R(Q1 ⊙ Q2) = R(Q2) R(Q1), so that R(Q_d⁻¹ ⊙ Q) = R(Q) R(Q_d)ᵀ takes desired to actual body components."""
    assert_equal_vectors((Q1 * Q2).to_body(v), Q2.to_body(Q1.to_body(v)), v.norm())


def test_rotations_about_different_axes_do_not_commute() -> None:
    """Without this, the order of the composition would be proven for nothing."""
    Q1, Q2 = rotation(Vec3(1.0, 0.0, 0.0), 1.0), rotation(Vec3(0.0, 1.0, 0.0), 1.0)
    v = Vec3(1.0, 2.0, 3.0)
    assert ((Q1 * Q2).to_body(v) - Q1.to_body(Q2.to_body(v))).norm() > 0.1


def test_body_yawed_by_a_quarter_turn_has_its_x_axis_along_the_inertial_y_axis() -> None:
    Q = rotation(Vec3(0.0, 0.0, 1.0), 0.5 * math.pi)
    assert_equal_vectors(Q.to_inertial(Vec3(1.0, 0.0, 0.0)), Vec3(0.0, 1.0, 0.0), 1.0)
    assert_equal_vectors(Q.to_body(Vec3(0.0, 1.0, 0.0)), Vec3(1.0, 0.0, 0.0), 1.0)


@given(directions, angles, vectors)
def test_rotation_is_that_of_rodrigues(axis: Vec3, angle: float, v: Vec3) -> None:
    k = axis / axis.norm()
    c, s = math.cos(angle), math.sin(angle)
    expected = c * v + s * k.cross(v) + ((1.0 - c) * (k @ v)) * k
    assert_equal_vectors(rotation(axis, angle).to_inertial(v), expected, v.norm())


@given(quaternions)
def test_rotation_matrix_is_orthogonal_and_proper(Q: Quaternion) -> None:
    R = matrix(Q)
    np.testing.assert_allclose(R.T @ R, np.eye(3), rtol=0.0, atol=ROUNDING)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=ROUNDING)


@given(quaternions, vectors)
def test_to_inertial_undoes_to_body(Q: Quaternion, v: Vec3) -> None:
    assert_equal_vectors(Q.to_inertial(Q.to_body(v)), v, v.norm())
    assert_equal_vectors(Q.inverse().to_body(v), Q.to_inertial(v), v.norm())


@given(quaternions, vectors)
def test_rotation_preserves_length(Q: Quaternion, v: Vec3) -> None:
    assert Q.to_body(v).norm() == pytest.approx(v.norm(), rel=ROUNDING, abs=0.0)


@given(quaternions, vectors, vectors)
def test_rotation_preserves_the_vector_product(Q: Quaternion, a: Vec3, b: Vec3) -> None:
    assume(1e-140 < a.norm() * b.norm() < 1e140)  # the squares of the length must not leave the range of floats
    assert_equal_vectors(Q.to_body(a.cross(b)), Q.to_body(a).cross(Q.to_body(b)), a.norm() * b.norm())


@given(quaternions)
def test_z_axis_is_the_inertial_image_of_the_body_z_axis(Q: Quaternion) -> None:
    assert_equal_vectors(Q.z_axis(), Q.to_inertial(Vec3(0.0, 0.0, 1.0)), 1.0)


AXES = (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))


@given(quaternions)
@example(rotation(AXES[0], math.pi))
@example(rotation(AXES[1], math.pi))
@example(rotation(AXES[2], math.pi))
def test_an_attitude_is_found_from_its_axes(Q: Quaternion) -> None:
    x, y, z = (Q.to_inertial(axis) for axis in AXES)
    found = Quaternion.from_axes(x, y, z)
    assert found.scalar >= 0.0
    same = Q if found.vector @ Q.vector + found.scalar * Q.scalar > 0.0 else -Q
    assert_equal_quaternions(found, same)


def test_attitudes_are_found_from_their_axes_in_a_batch() -> None:
    many = [rotation(axis, angle) for axis in AXES for angle in (0.1, 2.0, 3.0, 4.0)]
    batch = Quaternion.from_xyzw(*np.array([[*Q] for Q in many]).T)
    x, y, z = (batch.to_inertial(axis) for axis in AXES)
    found = Quaternion.from_axes(x, y, z, NUMPY)
    for i, Q in enumerate(many):
        x, y, z = (Q.to_inertial(axis) for axis in AXES)
        expected = Quaternion.from_axes(x, y, z)
        assert_equal_quaternions(Quaternion.from_xyzw(*(component[i] for component in found)), expected)


@given(quaternions, vectors)
def test_opposite_quaternions_are_the_same_rotation(Q: Quaternion, v: Vec3) -> None:
    assert (-Q).to_body(v) == Q.to_body(v)
    assert (-Q).to_inertial(v) == Q.to_inertial(v)
    assert (-Q).z_axis() == Q.z_axis()


def test_an_attitude_is_the_rotation_from_body_to_inertial_frame_that_scipy_has() -> None:
    from scipy.spatial.transform import Rotation

    turn, v = Rotation.from_rotvec([0.4, -1.1, 0.7]), Vec3(0.3, 2.0, -1.0)
    found = Quaternion.from_xyzw(*turn.as_quat().tolist()).to_inertial(v)
    np.testing.assert_allclose([*found], turn.apply([*v]), rtol=0.0, atol=ROUNDING)


@given(quaternions, vectors)
def test_rate_is_tangent_to_the_unit_sphere(Q: Quaternion, omega: Vec3) -> None:
    rate = Q.rate(omega)
    radial = Q.vector @ rate.vector + Q.scalar * rate.scalar
    assert abs(radial) <= ROUNDING * omega.norm()
    assert rate.norm() == pytest.approx(0.5 * omega.norm(), rel=ROUNDING, abs=0.0)


@given(quaternions, directions, st.floats(0.01, 10.0))
def test_rate_is_the_derivative_of_a_turn_at_constant_angular_velocity(Q: Quaternion, axis: Vec3, speed: float) -> None:
    """A constant Ω turns the body by |Ω| t about Ω: Q(t) = Q ⊙ rotation(Ω, |Ω| t)."""
    h = 1e-3 / speed
    ahead, behind = Q * rotation(axis, speed * h), Q * rotation(axis, -speed * h)
    numerical = ahead.plus(-1.0, behind) / (2.0 * h)
    assert_equal_quaternions(numerical, Q.rate((speed / axis.norm()) * axis), 1e-6 * speed)


@given(quaternions, directions, directions)
def test_rate_turns_a_fixed_vector_backwards_in_the_body_frame(Q: Quaternion, omega: Vec3, v: Vec3) -> None:
    """dR/dt = -[Ω]× R; R is quadratic in Q, so that its central difference is exact."""
    rate = Q.rate(omega)
    numerical = 0.5 * (Q.plus(1.0, rate).to_body(v) - Q.plus(-1.0, rate).to_body(v))
    assert_equal_vectors(numerical, -omega.cross(Q.to_body(v)), 10.0)


@given(quaternions, st.floats(-100.0, 100.0).map(lambda exponent: 10.0**exponent))
def test_normalised_has_unit_length_and_the_same_direction(Q: Quaternion, scale: float) -> None:
    stretched = Quaternion(scale * Q.vector, scale * Q.scalar)
    assert_equal_quaternions(stretched.normalised(), Q)
    assert_equal_quaternions(stretched / scale, Q)


def test_zero_quaternion_has_no_direction() -> None:
    with pytest.raises(ZeroDivisionError):
        Quaternion.from_xyzw(0.0, 0.0, 0.0, 0.0).normalised()


@given(vectors, vectors)
def test_cross_product_is_orthogonal_to_its_factors_and_anticommutes(a: Vec3, b: Vec3) -> None:
    c = a.cross(b)
    assert abs(c @ a) <= ROUNDING * a.norm() ** 2 * b.norm()
    assert abs(c @ b) <= ROUNDING * a.norm() * b.norm() ** 2
    assert c == -b.cross(a)


@given(directions, directions, directions)
def test_triple_product_is_that_of_lagrange(a: Vec3, b: Vec3, c: Vec3) -> None:
    assert_equal_vectors(a.cross(b.cross(c)), (a @ c) * b - (a @ b) * c, 10.0)


@given(vectors, vectors)
def test_dot_and_cross_products_share_the_lengths(a: Vec3, b: Vec3) -> None:
    """|a × b|² + (a·b)² = |a|² |b|², of unit vectors where the lengths would overflow."""
    assume(a.norm() > 0.0 and b.norm() > 0.0)
    a, b = a / a.norm(), b / b.norm()
    assert a.cross(b).norm() ** 2 + (a @ b) ** 2 == pytest.approx(1.0, abs=ROUNDING)


def test_cross_product_of_x_and_y_is_z() -> None:
    assert Vec3(1.0, 0.0, 0.0).cross(Vec3(0.0, 1.0, 0.0)) == Vec3(0.0, 0.0, 1.0)


@given(vectors, vectors, st.floats(-1e6, 1e6))
def test_plus_is_the_sum_with_a_multiple(a: Vec3, b: Vec3, factor: float) -> None:
    assert a.plus(factor, b) == a + factor * b


@given(quaternions, quaternions, st.floats(-1e6, 1e6))
def test_plus_of_quaternions_is_componentwise(Q1: Quaternion, Q2: Quaternion, factor: float) -> None:
    assert list(Q1.plus(factor, Q2)) == [a + factor * b for a, b in zip(Q1, Q2)]


@given(vectors, vectors)
def test_product_of_vectors_is_elementwise(a: Vec3, b: Vec3) -> None:
    assert list(a * b) == [x * y for x, y in zip(a, b)]


@given(vectors)
def test_vectors_are_values(v: Vec3) -> None:
    same = Vec3(*v)
    assert same == v
    assert hash(same) == hash(v)
    assert v != v + Vec3(1.0 + v.norm(), 0.0, 0.0)
    assert tuple(v) != v


@given(quaternions)
def test_quaternions_are_values(Q: Quaternion) -> None:
    same = Quaternion.from_xyzw(*Q)
    assert same == Q
    assert hash(same) == hash(Q)
    assert Q != -Q
    assert tuple(Q) != Q


@given(quaternions)
def test_representations_can_be_read_back(Q: Quaternion) -> None:
    names = {"Vec3": Vec3, "Quaternion": Quaternion, "Inertia": Inertia}
    J = Inertia(xx=0.8, yy=0.9, zz=1.4, xy=0.05, xz=-0.02, yz=0.03)
    assert eval(repr(Q), names) == Q
    assert eval(repr(Q.vector), names) == Q.vector
    assert repr(eval(repr(J), names)) == repr(J)


@st.composite
def symmetric_entries(draw: st.DrawFn) -> dict[str, float]:
    """Entries of a symmetric matrix with chosen eigenvalues, some of them small or negative."""
    eigenvalue = st.one_of(st.floats(0.1, 10.0), st.floats(-5.0, -0.1), st.floats(-4.0, -1.0).map(lambda e: 10.0**e))
    R = matrix(draw(quaternions))
    J = R @ np.diag([draw(eigenvalue) for _ in range(3)]) @ R.T
    J *= 10.0 ** draw(st.integers(-6, 6))
    return {name: float(J["xyz".index(name[0]), "xyz".index(name[1])]) for name in ("xx", "yy", "zz", "xy", "xz", "yz")}


def array(entries: dict[str, float]) -> Any:
    """The full matrix of its entries."""
    e = entries
    return np.array([[e["xx"], e["xy"], e["xz"]], [e["xy"], e["yy"], e["yz"]], [e["xz"], e["yz"], e["zz"]]])


@given(symmetric_entries())
def test_positive_definite_means_positive_eigenvalues(entries: dict[str, float]) -> None:
    eigenvalues = np.linalg.eigvalsh(array(entries))
    assume(np.min(np.abs(eigenvalues)) > 1e-6 * np.max(np.abs(eigenvalues)))  # else rounding decides
    assert is_positive_definite(**entries) == bool(np.min(eigenvalues) > 0.0)


@pytest.mark.parametrize(
    "entries",
    [
        {"xx": 0.0, "yy": 1.0, "zz": 1.0, "xy": 0.0, "xz": 0.0, "yz": 0.0},
        {"xx": 1.0, "yy": 1.0, "zz": 1.0, "xy": 1.0, "xz": 0.0, "yz": 0.0},
        {"xx": 1.0, "yy": 1.0, "zz": 1.0, "xy": 1.0, "xz": 1.0, "yz": 1.0},
        {"xx": -1.0, "yy": -1.0, "zz": 1.0, "xy": 0.0, "xz": 0.0, "yz": 0.0},
        {"xx": math.nan, "yy": 1.0, "zz": 1.0, "xy": 0.0, "xz": 0.0, "yz": 0.0},
    ],
)
def test_singular_and_indefinite_matrices_are_not_positive_definite(entries: dict[str, float]) -> None:
    assert not is_positive_definite(**entries)


@given(symmetric_entries(), directions)
def test_inertia_acts_as_the_full_matrix_and_as_its_inverse(entries: dict[str, float], v: Vec3) -> None:
    J, full = Inertia(**entries), array(entries)
    eigenvalues = np.abs(np.linalg.eigvalsh(full))
    smallest, largest = float(np.min(eigenvalues)), float(np.max(eigenvalues))
    assume(largest < 1e3 * smallest)
    condition = largest / smallest
    cancellation = largest**3 / float(np.prod(eigenvalues))  # of the products that the determinant is a sum of
    product, solution = Vec3(*(full @ list(v)).tolist()), Vec3(*np.linalg.solve(full, list(v)).tolist())
    assert_equal_vectors(J @ v, product, largest)
    assert_equal_vectors(J.solve(v), solution, cancellation / smallest)
    assert_equal_vectors(J.solve(J @ v), v, cancellation * condition)
    assert_equal_vectors(J @ J.solve(v), v, cancellation * condition)


OPERATIONS: dict[str, Callable[[Any, Any, Any, Any], Any]] = {
    "sum": lambda a, b, P, Q: a + b - (-a),
    "elementwise": lambda a, b, P, Q: a * b,
    "scaled": lambda a, b, P, Q: (a @ b) * a + a * (b @ b) + a / P.scalar,
    "plus": lambda a, b, P, Q: a.plus(Q.scalar, b),
    "cross": lambda a, b, P, Q: a.cross(b),
    "mapped": lambda a, b, P, Q: a.map(abs),
    "product": lambda a, b, P, Q: P * Q,
    "to_body": lambda a, b, P, Q: Q.to_body(a),
    "to_inertial": lambda a, b, P, Q: (-Q).inverse().to_inertial(a),
    "z_axis": lambda a, b, P, Q: Q.z_axis(),
    "rate": lambda a, b, P, Q: Q.rate(a),
    "plus of quaternions": lambda a, b, P, Q: Q.plus(a.x, P) / P.scalar,
    "inertia": lambda a, b, P, Q: Inertia(xx=2.0 + a.x * a.x, yy=3.0, zz=4.0, xy=0.1, yz=b.x) @ b,
    "solve": lambda a, b, P, Q: Inertia(xx=2.0 + a.x * a.x, yy=3.0, zz=4.0, xy=0.1, xz=b.x).solve(b),
}


@pytest.mark.parametrize("name", OPERATIONS)
def test_batches_give_what_their_points_give(name: str) -> None:
    operation = OPERATIONS[name]
    points = np.random.default_rng(1).uniform(0.1, 1.0, (14, 20))
    batch = operation(
        Vec3(*points[0:3]), Vec3(*points[3:6]), Quaternion.from_xyzw(*points[6:10]), Quaternion.from_xyzw(*points[10:])
    )
    for i, point in enumerate(points.T.tolist()):
        single = operation(
            Vec3(*point[0:3]), Vec3(*point[3:6]), Quaternion.from_xyzw(*point[6:10]), Quaternion.from_xyzw(*point[10:])
        )
        assert [component[i] for component in batch] == list(single)


def test_norms_of_a_batch_are_those_of_its_points() -> None:
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (4, 20))
    v, Q = Vec3(*points[:3]), Quaternion.from_xyzw(*points)
    for i, (x, y, z, w) in enumerate(points.T.tolist()):
        assert v.norm(NUMPY)[i] == Vec3(x, y, z).norm()
        assert Q.norm(NUMPY)[i] == Quaternion.from_xyzw(x, y, z, w).norm()
        assert Q.normalised(NUMPY).scalar[i] == Quaternion.from_xyzw(x, y, z, w).normalised().scalar


def test_numpy_scalar_on_the_left_scales_a_vector() -> None:
    scaled = np.float64(2.0) * Vec3(1.0, 2.0, 3.0)
    assert type(scaled) is Vec3
    assert scaled == Vec3(2.0, 4.0, 6.0)


def test_numpy_array_on_the_left_scales_each_point() -> None:
    """Left alone, numpy would make an object array of three vectors out of it."""
    scaled = np.array([1.0, 2.0, 3.0]) * Vec3(1.0, 2.0, np.array([3.0, 4.0, 5.0]))
    assert type(scaled) is Vec3
    np.testing.assert_array_equal(scaled.x, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(scaled.z, [3.0, 8.0, 15.0])


@pytest.mark.parametrize("left", [np.float64(2.0), np.array([1.0, 2.0, 3.0])])
def test_sum_of_an_array_and_a_vector_means_nothing(left: Any) -> None:
    with pytest.raises(TypeError):
        left + Vec3(1.0, 2.0, 3.0)


@pytest.fixture(scope="module")
def symbols() -> tuple[Vec3, Vec3, Vec3, Any, Any]:
    """Three vectors and two numbers."""
    import sympy

    *nine, p0, q0 = sympy.symbols("a1:4 b1:4 c1:4 p0 q0", real=True)
    return Vec3(*nine[:3]), Vec3(*nine[3:6]), Vec3(*nine[6:]), p0, q0


def expanded(values: Any) -> list[Any]:
    import sympy

    return [sympy.expand(sympy.nsimplify(value)) for value in values]


def test_cross_product_of_symbols_is_orthogonal_to_its_factors(symbols: Any) -> None:
    A, B, *_ = symbols
    assert expanded([A.cross(B) @ A, A.cross(B) @ B]) == [0, 0]


def test_product_of_symbols_rotates_by_its_left_factor_first(symbols: Any) -> None:
    A, B, C, p0, q0 = symbols
    P, Q = Quaternion(A, p0), Quaternion(B, q0)
    assert expanded((P * Q).to_body(C) - Q.to_body(P.to_body(C))) == [0, 0, 0]


def test_rotation_there_and_back_scales_symbols_by_the_fourth_power_of_the_norm(symbols: Any) -> None:
    A, B, _, _, q0 = symbols
    Q = Quaternion(A, q0)
    squared = A @ A + q0 * q0
    assert expanded(Q.to_inertial(Q.to_body(B)) - (squared * squared) * B) == [0, 0, 0]


def test_inertia_of_symbols_is_undone_by_solve(symbols: Any) -> None:
    import sympy

    A, B, C, *_ = symbols
    J = Inertia(xx=A.x, yy=A.y, zz=A.z, xy=B.x, xz=B.y, yz=B.z)
    assert [sympy.simplify(value) for value in J.solve(J @ C) - C] == [0, 0, 0]


@given(quaternions, vectors)
@example(rotation(Vec3(0.0, 0.0, 1.0), math.pi), Vec3(1.0, 0.0, 0.0))
def test_half_turns_and_no_turns_are_no_exceptions(Q: Quaternion, v: Vec3) -> None:
    """Turning twice by Q is turning by its square, also where the angle of the square wraps."""
    assert_equal_vectors((Q * Q).to_body(v), Q.to_body(Q.to_body(v)), v.norm())
