"""The law against reference data, its own derivatives, and its proved properties."""

import csv
import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, note
from hypothesis import strategies as st

from controller_fmu.sliding_mode.law import (
    DesiredRate,
    Evaluation,
    Gains,
    desired_attitude,
    evaluate,
    surface,
)
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import ZERO, Inertia, Quaternion, Vec3
from fmu_kit.errors import DivergenceError
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, derivative
from fmu_kit.scalar import FLOAT, ScalarOps
from fmu_kit.trajectory import Reference, Trajectory
from orchestration.simulation.engines.sources import NUMPY
from tests.controller_fmu.closed_loop import (
    assert_is_the_rate,
    assert_rates,
    between,
    inertias,
    quaternions,
    trajectories,
    triple,
)
from tests.reference.tables import LAWS, law_at
from tests.scalars import PRECISE

Z = Vec3(0.0, 0.0, 1.0)
IDENTITY = Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)

# -- (a) reference data ---------------------------------------------------------------------------------------

GENERAL_GAINS = Gains(
    k_t=Vec3(2.0, 1.5, 3.0), beta=0.4, k_s=3.0, beta_t=0.8, epsilon=2e-3, k_eta=10.0, k_theta=12.0, k_q=8.0, kappa=1.0
)
GENERAL_MODEL = Model(mass=1.3, inertia=Inertia(xx=0.8, yy=0.9, zz=1.4, xy=0.05, xz=-0.02, yz=0.03))
CASES = {"law_paper.csv": (Gains(), Model()), "law_general.csv": (GENERAL_GAINS, GENERAL_MODEL)}
FIELDS = {
    "sliding_rate": "sliding_dot",
    "virtual_control_rate": "virtual_control_dot",
    "virtual_control_acceleration": "virtual_control_ddot",
    "psi_rate": "psi_dot",
}
"""Where a column is called other than the field of `Evaluation`."""
FIRST_RESULT = 28
"""State and reference take the columns before this one."""
COLUMNS = [
    f"{name}.{axis}"
    for name, axes in (
        ("torque", "xyz"),
        ("sliding", "xyz"),
        ("sliding_rate", "xyz"),
        ("virtual_control", "xyz"),
        ("virtual_control_rate", "xyz"),
        ("virtual_control_acceleration", "xyz"),
        ("desired_quaternion", "xyzw"),
        ("desired_angular_velocity", "xyz"),
        ("desired_angular_acceleration", "xyz"),
        ("psi", "xyz"),
        ("psi_rate", "xyz"),
        ("theta", "xyz"),
    )
    for axis in axes
]


def read(path: Path) -> tuple[list[str], Any]:
    """Header and rows of a table."""
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array([[float(cell) for cell in row] for row in rows])


def arguments(values: Any) -> tuple[Measurement, Reference]:
    """State and reference from the leading columns, each a float or an array."""
    P, V, omega = Vec3(*values[0:3]), Vec3(*values[3:6]), Vec3(*values[10:13])
    P_d, V_d, A_d, J_d, S_d = (Vec3(*values[i : i + 3]) for i in range(13, FIRST_RESULT, 3))
    return (
        Measurement(P, V, Quaternion.from_xyzw(*values[6:10]), omega),
        Reference(position=P_d, velocity=V_d, acceleration=A_d, jerk=J_d, snap=S_d),
    )


def value_of(evaluation: Evaluation, column: str) -> Any:
    """What `evaluation` has for a column of the table."""
    name, _, axis = column.partition(".")
    value = getattr(evaluation, FIELDS.get(name, name))
    return dict(zip("xyzw", value))[axis] if axis else value


@pytest.mark.parametrize("table", CASES)
def test_reference_data_have_every_result_of_the_law(data: Path, table: str) -> None:
    header, rows = read(data / table)
    assert header[FIRST_RESULT:] == ["thrust", *COLUMNS]
    assert len(rows) == 100


@pytest.mark.parametrize("column", ["thrust", *COLUMNS])
@pytest.mark.parametrize("table", CASES)
def test_law_on_floats_equals_the_reference_data(data: Path, table: str, column: str) -> None:
    header, rows = read(data / table)
    for row in rows.tolist():
        actual, expected = value_of(evaluate(*arguments(row), *CASES[table]), column), row[header.index(column)]
        assert abs(actual - expected) <= 1e-9 * max(1.0, abs(expected))


@pytest.mark.parametrize("table", CASES)
def test_law_on_a_batch_equals_the_reference_data(data: Path, table: str) -> None:
    header, rows = read(data / table)
    evaluation = evaluate(*arguments(rows.T), *CASES[table], NUMPY)
    for column in header[FIRST_RESULT:]:
        actual, expected = value_of(evaluation, column), rows[:, header.index(column)]
        assert np.shape(actual) == (len(rows),)
        assert np.all(np.abs(actual - expected) <= 1e-9 * np.maximum(1.0, np.abs(expected))), column


@pytest.mark.parametrize("kappa", [0.0, 1.0, 3.0, 15.0])
@pytest.mark.parametrize("table", CASES)
def test_law_with_any_weight_is_the_independent_one(data: Path, table: str, kappa: float) -> None:
    """Errors and energy too, which the tables do not hold."""
    gains, model = CASES[table]
    _, rows = read(data / table)
    for row in rows:
        now = evaluate(*arguments(row.tolist()), replace(gains, kappa=kappa), model)
        for name, expected in law_at(row, replace(LAWS[table], kappa=kappa)).items():
            value = getattr(now, FIELDS.get(name, name))
            actual = np.array(list(value) if isinstance(value, (Vec3, Quaternion)) else value)
            assert np.all(np.abs(actual - expected) <= 1e-11 * np.maximum(1.0, np.abs(expected))), name


# -- (b) rates ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Situation:
    """A closed loop without wind, its plant equal to the model of the law, at one state."""

    gains: Gains
    model: Model
    trajectory: Trajectory
    t: float
    state: RigidState

    def evaluation(self, t: float, x: RigidState) -> Evaluation:
        measurement = Measurement(x.position, x.velocity, x.quaternion, x.angular_velocity)
        return evaluate(measurement, self.trajectory.at(t), self.gains, self.model)

    def motion(self, t: float, x: RigidState) -> RigidState:
        """d(state)/dt with the controller evaluated continuously."""
        now = self.evaluation(t, x)
        body = Body(mass=self.model.mass, inertia=self.model.inertia, gravity=self.model.gravity)
        return derivative(x, Wrench(now.thrust, now.torque), ZERO, body)

    def now(self) -> Evaluation:
        return self.evaluation(self.t, self.state)

    def flow(self, h: float) -> Evaluation:
        """The evaluation `h` [s] later, or earlier."""
        return self.evaluation(self.t + h, rk4_step(self.motion, self.t, self.state, h))


gains_anywhere = st.builds(
    Gains,
    k_t=triple(between(0.5, 3.0)),
    beta=between(0.0, 1.0),
    k_s=between(0.5, 5.0),
    beta_t=st.one_of(st.just(1.0), between(0.3, 1.0)),
    epsilon=st.sampled_from([1e-3, 2e-2]),
    k_eta=between(1.0, 15.0),
    k_theta=between(1.0, 15.0),
    k_q=between(1.0, 15.0),
    kappa=st.one_of(st.sampled_from([0.0, 1.0]), between(0.0, 15.0)),
)


@functools.cache
def inside_or_outside(epsilon: float) -> st.SearchStrategy[float]:
    """Of the boundary layer, along one axis."""
    outside = st.builds(math.copysign, between(0.05, 2.0), st.sampled_from([-1.0, 1.0]))
    return between(-0.5 * epsilon, 0.5 * epsilon) | outside


@st.composite
def situations(draw: st.DrawFn) -> Situation:
    """Each axis inside or outside the boundary layer, and so far from |e| = ε that no flow crosses it."""
    gains, trajectory, t = draw(gains_anywhere), draw(trajectories), draw(between(0.0, 30.0))
    reference = trajectory.at(t)
    return Situation(
        gains=gains,
        model=Model(mass=draw(between(0.3, 3.0)), inertia=draw(inertias()), gravity=draw(between(9.0, 10.0))),
        trajectory=trajectory,
        t=t,
        state=RigidState(
            reference.position + draw(triple(inside_or_outside(gains.epsilon))),
            reference.velocity + draw(triple(between(-1.5, 1.5))),
            draw(quaternions()),
            draw(triple(between(-2.0, 2.0))),
        ),
    )


RATES = {
    "position_error": "velocity_error",
    "sliding": "sliding_dot",
    "virtual_control": "virtual_control_dot",
    "virtual_control_dot": "virtual_control_ddot",
    "desired_angular_velocity": "desired_angular_acceleration",
    "psi": "psi_dot",
}


@given(situation=situations())
def test_every_rate_is_the_derivative_along_the_closed_loop(situation: Situation) -> None:
    """Those that are named so, and by (13) and (10) those of the desired attitude and of the error of attitude."""
    now, flow = situation.now(), functools.cache(situation.flow)
    assert_rates(now, flow, RATES)
    note("(10)")
    assert_is_the_rate(
        list(now.attitude_error.rate(now.angular_velocity_error)), lambda h: list(flow(h).attitude_error)
    )


def energy_rate(situation: Situation) -> float:
    """dL_κ/dt as the proof has it, for any κ."""
    now, gains = situation.now(), situation.gains
    s, e, ev, theta, q = now.sliding, now.position_error, now.velocity_error, now.theta, now.attitude_error.vector
    k = gains.k_t + Vec3(gains.beta, gains.beta, gains.beta)

    def slope(e: float) -> float:
        outside = abs(e) >= gains.epsilon
        return gains.k_s * gains.beta_t * abs(e) ** (gains.beta_t - 1.0) if outside else gains.k_s

    translation = s @ (e.map(slope) * ev) - k @ (s * s.map(math.tanh))
    return float(-gains.k_theta * (theta @ theta) - gains.k_q * gains.k_eta * (q @ q) + gains.kappa * translation)


def coupled(situation: Situation, kappa: float | None) -> Situation:
    """`situation` with a weight κ, k_q if None."""
    gains = situation.gains
    return replace(situation, gains=replace(gains, kappa=gains.k_q if kappa is None else kappa))


WEIGHTS = (0.0, 1.0, 3.0, None)
"""κ: none, as the energy is printed, one of no meaning, and k_q as Ψ is printed."""


def assert_energy_has_the_rate_of_the_proof(situation: Situation) -> None:
    note(repr(situation.gains))
    assert_is_the_rate(energy_rate(situation), lambda h: situation.flow(h).energy)


@given(situation=situations())
def test_energy_has_the_rate_of_the_proof_for_every_weight_and_per_unit_inertia(situation: Situation) -> None:
    for kappa in WEIGHTS:
        assert_energy_has_the_rate_of_the_proof(coupled(situation, kappa))
    per_inertia = replace(situation, gains=replace(situation.gains, per_inertia=True))
    assert_energy_has_the_rate_of_the_proof(per_inertia)


@given(situations(), between(0.01, 3.0))
def test_gains_per_unit_inertia_are_torques_for_an_inertia_that_is_a_number(situation: Situation, j: float) -> None:
    gains, x = situation.gains, situation.state
    measurement = Measurement(x.position, x.velocity, x.quaternion, x.angular_velocity)
    model = replace(situation.model, inertia=Inertia(xx=j, yy=j, zz=j))
    torques = replace(gains, k_theta=j * gains.k_theta, k_q=j * gains.k_q, kappa=j * gains.kappa)
    reference = situation.trajectory.at(situation.t)
    a = evaluate(measurement, reference, replace(gains, per_inertia=True), model)
    b = evaluate(measurement, reference, torques, model)
    assert a.thrust == b.thrust
    assert (a.torque - b.torque).norm() <= 1e-12 * (1.0 + a.torque.norm() + b.torque.norm())
    assert j * a.energy == pytest.approx(b.energy, rel=1e-12)


@given(gains_anywhere)
def test_energy_is_none_at_the_goal_and_some_elsewhere(gains: Gains) -> None:
    goal = Measurement(ZERO, ZERO, IDENTITY, ZERO)
    assert evaluate(goal, Reference(position=ZERO), gains, Model()).energy == 0.0
    turned = goal._replace(quaternion=Quaternion.from_xyzw(0.0, 0.0, 0.6, 0.8))
    assert evaluate(turned, Reference(position=ZERO), gains, Model()).energy > 0.0


@given(triple(between(-2.0, 2.0)), gains_anywhere)
def test_surface_has_the_slope_and_the_curvature_that_it_names(e: Vec3, gains: Gains) -> None:
    assume(all(abs(abs(axis) - gains.epsilon) > 1e-4 and abs(axis) > 1e-4 for axis in e))
    slopes = surface(e, gains)
    h = 1e-5 * Vec3(1.0, 1.0, 1.0)
    ahead, behind = surface(e + h, gains), surface(e - h, gains)
    slope = (ahead.gamma * (e + h) - behind.gamma * (e - h)) / (2.0 * h.x)
    curvature = (ahead.gamma_prime - behind.gamma_prime) / (2.0 * h.x)
    # The truncation is h²/6 of a third derivative, which falls off as |e|^(β_t - 3).
    for size, error in zip(e, slope - slopes.gamma_prime):
        assert abs(error) <= 1e-9 * (1.0 + abs(size) ** (gains.beta_t - 3.0))
    for size, error in zip(e, curvature - slopes.gamma_second):
        assert abs(error) <= 1e-9 * (1.0 + abs(size) ** (gains.beta_t - 4.0))


# -- (c) the desired attitude -------------------------------------------------------------------------------

virtual_controls = triple(between(-20.0, 20.0)).filter(lambda F: (9.81 * Z - F).norm() + 9.81 - F.z > 1e-2)


@given(virtual_controls)
def test_eq12_extracts_the_attitude_that_realises_F(F: Vec3) -> None:
    """(T/m) R(Q_d)ᵀ z = g z - F, and Q_d has unit length and no yaw."""
    u = 9.81 * Z - F
    n = u.norm()
    Q_d = desired_attitude(F, n, 9.81)
    # Close to the singularity, 1 + (g - F_z)/n loses digits to cancellation, and q_d divides by its root.
    tolerance = 1e-13 * n / (n + u.z)
    assert Q_d.norm() == pytest.approx(1.0, abs=tolerance)
    assert (n * Q_d.z_axis() - u).norm() <= tolerance * n
    assert Q_d.vector.z == 0.0
    assert Q_d.scalar > 0.0


@given(quaternions(), virtual_controls)
def test_eq3_is_the_difference_of_the_thrust_axes(Q: Quaternion, F: Vec3) -> None:
    """(R(Q)ᵀ - R(Q_d)ᵀ) z = 2 R(Q)ᵀ (q̄ × q̃)."""
    u = 9.81 * Z - F
    assume(u.norm() + u.z > 0.1)
    Q_d = desired_attitude(F, u.norm(), 9.81)
    q, q0 = (Q_d.inverse() * Q).vector, (Q_d.inverse() * Q).scalar
    tilt = Vec3(q.y, -q.x, -q0).cross(q)
    assert (Q.z_axis() - Q_d.z_axis() - 2.0 * Q.to_inertial(tilt)).norm() <= 1e-11


@given(quaternions(), virtual_controls)
def test_eq8_takes_desired_to_actual_body_components(Q: Quaternion, F: Vec3) -> None:
    u = 9.81 * Z - F
    Q_d = desired_attitude(F, u.norm(), 9.81).normalised()
    error = Q_d.inverse() * Q
    v = Vec3(1.0, -2.0, 3.0)
    assert (error.to_body(v) - Q.to_body(Q_d.to_inertial(v))).norm() <= 1e-13


@given(virtual_controls, triple(between(-10.0, 10.0)))
def test_eq14_gives_the_rate_of_the_desired_attitude(F: Vec3, F_dot: Vec3) -> None:
    u = 9.81 * Z - F
    n = u.norm()
    assume(n > 1.0 and n + u.z > 1.0)
    omega_d = DesiredRate(F, F_dot, n, -(u @ F_dot) / n, 9.81).angular_velocity()

    def attitude(h: float) -> list[float]:
        moved = F.plus(h, F_dot)
        return list(desired_attitude(moved, (9.81 * Z - moved).norm(), 9.81))

    assert_is_the_rate(list(desired_attitude(F, n, 9.81).rate(omega_d)), attitude)


# -- (d) the sign of the quaternion ---------------------------------------------------------------------------


@given(situations())
def test_opposite_quaternion_turns_the_other_way_to_the_same_attitude(situation: Situation) -> None:
    """The law is not invariant under Q → -Q: it goes the long way round if q̃_0 < 0 (unwinding)."""
    now, x = situation.now(), situation.state
    assume(now.attitude_error.vector.norm() > 1e-3)
    there = situation.evaluation(situation.t, RigidState(x.position, x.velocity, -x.quaternion, x.angular_velocity))
    for same in (
        "thrust",
        "position_error",
        "velocity_error",
        "sliding",
        "sliding_dot",
        "virtual_control",
        "virtual_control_dot",
        "virtual_control_ddot",
        "desired_quaternion",
        "desired_angular_velocity",
        "desired_angular_acceleration",
        "angular_velocity_error",
    ):
        assert getattr(there, same) == getattr(now, same), same
    for opposite in ("attitude_error", "psi", "psi_dot"):
        assert getattr(there, opposite) == -getattr(now, opposite), opposite
    if situation.gains.kappa == 0.0:  # else the terms in q̃ and in q̄ could cancel
        assert (there.torque - now.torque).norm() > 1e-4


def test_torque_of_the_paper_depends_on_the_sign_of_the_quaternion(data: Path) -> None:
    _, rows = read(data / "law_paper.csv")
    for row in rows.tolist():
        state, reference = arguments(row)
        torque = evaluate(state, reference, Gains(), Model()).torque
        other = evaluate(state._replace(quaternion=-state.quaternion), reference, Gains(), Model()).torque
        assert (torque - other).norm() > 1e-2


# -- (e) where there is no desired attitude -------------------------------------------------------------------


def at_rest(acceleration: Vec3) -> tuple[Measurement, Reference]:
    """No error at all, so that F is the desired acceleration."""
    return Measurement(ZERO, ZERO, IDENTITY, ZERO), Reference(position=ZERO, acceleration=acceleration)


@pytest.mark.parametrize(
    "F",
    [
        Vec3(0.0, 0.0, 9.81),
        Vec3(0.0, 0.0, 9.81 - 1e-10),
        Vec3(0.0, 0.0, 9.81 - 8e-10),  # n is too small, n + g - F_z is not
        Vec3(0.0, 0.0, 12.5),
        Vec3(1e-6, 0.0, 12.5),
        Vec3(0.0, -1e-6, 12.5),
        Vec3(math.nan, 0.0, 0.0),
    ],
)
def test_virtual_control_without_a_desired_attitude_is_named(F: Vec3) -> None:
    with pytest.raises(DivergenceError) as caught:
        evaluate(*at_rest(F), Gains(), Model())
    assert str(caught.value).startswith(f"virtual control F = ({F.x}, {F.y}, {F.z}) m/s2: expected n = |g z - F|")


@pytest.mark.parametrize("F", [Vec3(0.0, 0.0, 9.80), Vec3(1e-3, 0.0, 12.5), Vec3(0.0, 0.0, -1e6)])
def test_virtual_control_next_to_the_singularity_is_realised(F: Vec3) -> None:
    """(T/m) R(Q_d)ᵀ z = g z - F, to the digits that 1 + (g - F_z)/n has left."""
    found, u = evaluate(*at_rest(F), Gains(), Model()), 9.81 * Z - F
    n = u.norm()
    assert found.thrust == pytest.approx(Model().mass * n)
    assert (n * found.desired_quaternion.z_axis() - u).norm() <= 1e-13 * n * n / (n + u.z)


def test_one_point_of_a_batch_without_a_desired_attitude_is_enough() -> None:
    F = Vec3(0.0, 0.0, np.array([0.0, 12.5, 1.0]))
    with pytest.raises(DivergenceError, match="virtual control"):
        evaluate(*at_rest(F), Gains(), Model(), NUMPY)


# -- (f) the edge of the boundary layer -------------------------------------------------------------------------


def sliding(e: float, gains: Gains) -> Vec3:
    state = Measurement(Vec3(e, e, e), ZERO, IDENTITY, ZERO)
    return evaluate(state, Reference(position=ZERO), gains, Model()).sliding


def test_sliding_variable_jumps_by_a_third_of_a_millimetre_per_second_at_the_boundary_layer() -> None:
    """Erratum 12, with the paper's gains."""
    gains = Gains()
    jump = sliding(gains.epsilon, gains) - sliding(math.nextafter(gains.epsilon, 0.0), gains)
    assert list(jump) == pytest.approx([3.6e-4] * 3, rel=0.01)
    assert sliding(-gains.epsilon, gains) == -sliding(gains.epsilon, gains)


def test_surface_is_a_line_inside_the_boundary_layer_and_a_power_outside() -> None:
    gains = Gains(k_s=3.0, beta_t=0.5, epsilon=0.01)
    inside = surface(Vec3(0.0, 0.005, -0.00999), gains)
    assert list(inside.gamma) == list(inside.gamma_prime) == [3.0] * 3
    assert list(inside.gamma_second) == [0.0] * 3
    outside = surface(Vec3(0.01, -0.04, 4.0), gains)
    assert list(outside.gamma) == pytest.approx([30.0, 15.0, 1.5])
    assert list(outside.gamma_prime) == pytest.approx([15.0, 7.5, 0.75])
    assert list(outside.gamma_second) == pytest.approx([-750.0, 93.75, -0.09375])


def test_exponent_of_one_has_no_boundary_layer() -> None:
    gains = Gains(beta_t=1.0)
    for e in (0.0, 5e-4, 1e-3, 1.0):
        assert list(sliding(e, gains)) == pytest.approx([5.0 * e] * 3, rel=1e-15)


# -- (g) other scalars --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def symbolic() -> ScalarOps:
    """The functions of symbols."""
    import sympy

    return ScalarOps(
        sqrt=sympy.sqrt,
        tanh=sympy.tanh,
        sin=sympy.sin,
        cos=sympy.cos,
        atan2=sympy.atan2,
        sign=sympy.sign,
        maximum=sympy.Max,
        where=lambda condition, a, b: sympy.Piecewise((a, condition), (b, True)),
        all=lambda condition: True,
    )


def components(evaluation: Evaluation) -> list[Any]:
    """All numbers of an evaluation, in the order of its fields."""
    return [x for value in evaluation for x in (value if isinstance(value, (Vec3, Quaternion)) else [value])]


@pytest.mark.parametrize("table", CASES)
def test_law_in_fifty_digits_agrees_with_floats(data: Path, table: str) -> None:
    """An independent measure of what floats lose."""
    _, rows = read(data / table)
    with mpmath.workdps(50):
        for row in rows[:25].tolist():
            precise = components(evaluate(*arguments([mpmath.mpf(x) for x in row]), *CASES[table], PRECISE))
            floats = components(evaluate(*arguments(row), *CASES[table]))
            assert {type(x) for x in precise} == {mpmath.mpf}
            for x, y in zip(precise, floats, strict=True):
                assert abs(x - y) <= 1e-12 * max(1.0, abs(y))


def test_law_of_a_symbol_agrees_with_floats(data: Path, symbolic: ScalarOps) -> None:
    """The angular velocity about x as a symbol: the torque is a polynomial of second degree in it."""
    import sympy

    _, rows = read(data / "law_general.csv")
    x = sympy.Symbol("x", real=True)
    for row in rows[:3].tolist():
        state, reference = arguments(row)
        omega = Vec3(x, state.angular_velocity.y, state.angular_velocity.z)
        now = evaluate(state._replace(angular_velocity=omega), reference, *CASES["law_general.csv"], symbolic)
        expected = components(evaluate(state, reference, *CASES["law_general.csv"]))
        actual = [float(sympy.sympify(value).subs(x, state.angular_velocity.x)) for value in components(now)]
        np.testing.assert_allclose(actual, expected, rtol=1e-10, atol=1e-10)
        assert sympy.degree(sympy.expand(now.torque.y), x) == 2


def test_surface_of_symbols_is_its_own_antiderivative(symbolic: ScalarOps) -> None:
    import sympy

    e = sympy.Symbol("e", real=True)
    gains = Gains(k_s=3.0, beta_t=0.5, epsilon=0.01)
    slopes = surface(Vec3(e, e, e), gains, symbolic)
    slope, curvature = sympy.diff(slopes.gamma.x * e, e), sympy.diff(slopes.gamma_prime.x, e)
    for value in (-2.0, -0.5, -0.001, 0.001, 0.02, 1.0):
        assert slope.subs(e, value) == pytest.approx(slopes.gamma_prime.x.subs(e, value))
        assert curvature.subs(e, value) == pytest.approx(slopes.gamma_second.x.subs(e, value))


def test_sign_of_a_float_is_that_of_numpy() -> None:
    """sgn 0 = 0: no side is preferred on the axis."""
    values = [-2.0, -0.0, 0.0, 5e-324, 3.0]
    assert [FLOAT.sign(x) for x in values] == [NUMPY.sign(x) for x in values] == [-1.0, 0.0, 0.0, 1.0, 1.0]
