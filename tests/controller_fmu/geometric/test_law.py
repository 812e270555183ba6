"""The geometric law against a second form of it, its own derivatives, its authors' code and their example."""

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, note, settings
from hypothesis import strategies as st

from controller_fmu.geometric.law import NORTH, Evaluation, Gains, Heading, evaluate
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import ZERO, Inertia, Quaternion, Vec3
from fmu_kit.errors import DivergenceError
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import RigidState, Wrench, derivative
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
from tests.controller_fmu.geometric import second_form

IDENTITY = Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0)
X, Z = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Turning:
    """A heading whose angle is a quadratic function of time."""

    angle: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0

    def at(self, t: float) -> Heading:
        a, w = self.angle + self.rate * t + 0.5 * self.acceleration * t * t, self.rate + self.acceleration * t
        b1d, across = Vec3(math.cos(a), math.sin(a), 0.0), Vec3(-math.sin(a), math.cos(a), 0.0)
        return Heading(b1d, w * across, self.acceleration * across - w * w * b1d)


@dataclass(frozen=True, kw_only=True)
class Situation:
    """A closed loop without wind, its plant equal to the model of the law, at one state."""

    gains: Gains
    model: Model
    trajectory: Any
    heading: Turning
    t: float
    state: RigidState

    def evaluation(self, t: float, x: RigidState) -> Evaluation:
        measurement = Measurement(x.position, x.velocity, x.quaternion, x.angular_velocity)
        return evaluate(measurement, self.trajectory.at(t), self.gains, self.model, heading=self.heading.at(t))

    def motion(self, t: float, x: RigidState) -> RigidState:
        """d(state)/dt with the controller evaluated continuously."""
        now = self.evaluation(t, x)
        return derivative(x, Wrench(now.thrust, now.torque), ZERO, self.model)

    def now(self) -> Evaluation:
        return self.evaluation(self.t, self.state)

    def flow(self, h: float) -> Evaluation:
        """The evaluation `h` [s] later, or earlier."""
        return self.evaluation(self.t + h, rk4_step(self.motion, self.t, self.state, h))


@st.composite
def situations(draw: st.DrawFn) -> Situation:
    """Away from where b3c or b2c does not exist, and from where the sign of Q_d turns over."""
    trajectory, t = draw(trajectories), draw(between(0.0, 30.0))
    reference = trajectory.at(t)
    situation = Situation(
        gains=Gains(
            k_x=draw(between(0.0, 16.0)),
            k_v=draw(between(0.0, 6.0)),
            k_R=draw(between(0.0, 100.0)),
            k_Omega=draw(between(0.0, 30.0)),
            per_inertia=draw(st.booleans()),
        ),
        model=Model(mass=draw(between(0.3, 5.0)), inertia=draw(inertias()), gravity=draw(between(9.0, 10.0))),
        trajectory=trajectory,
        heading=Turning(
            angle=draw(between(-3.0, 3.0)), rate=draw(between(-2.0, 2.0)), acceleration=draw(between(-2.0, 2.0))
        ),
        t=t,
        state=RigidState(
            reference.position + draw(triple(between(-2.0, 2.0))),
            reference.velocity + draw(triple(between(-1.5, 1.5))),
            draw(quaternions()),
            draw(triple(between(-2.0, 2.0))),
        ),
    )
    now = situation.now()
    n = now.force.norm()
    assume(n > 3.0)
    assume((now.force / n).cross(situation.heading.at(t).direction).norm() > 0.3)
    assume(now.desired_quaternion.scalar > 0.05)
    return situation


def vector(v: Vec3) -> Any:
    return np.array([*v])


def matrix(J: Inertia) -> Any:
    return np.array([[J.xx, J.xy, J.xz], [J.xy, J.yy, J.yz], [J.xz, J.yz, J.zz]])


# -- a second form ------------------------------------------------------------------------------------------------


@given(situations())
def test_law_equals_a_second_form_written_with_rotation_matrices_and_series(situation: Situation) -> None:
    now, x, m, gains = situation.now(), situation.state, situation.model, situation.gains
    r, heading = situation.trajectory.at(situation.t), situation.heading.at(situation.t)
    J = matrix(m.inertia)
    unit = J if gains.per_inertia else 1.0
    expected = second_form.evaluate(
        vector(x.position),
        vector(x.velocity),
        np.array([*x.quaternion]),
        vector(x.angular_velocity),
        np.array([[*v] for v in (r.position, r.velocity, r.acceleration, r.jerk, r.snap)]),
        [vector(v) for v in heading],
        second_form.Parameters(
            m=m.mass,
            J=J,
            g=m.gravity,
            k_x=m.mass * gains.k_x,
            k_v=m.mass * gains.k_v,
            k_R=gains.k_R * unit,
            k_Omega=gains.k_Omega * unit,
        ),
    )
    R_c = expected.pop("R_c")
    for name, value in expected.items():
        ours = getattr(now, name)
        actual = vector(ours) if isinstance(ours, Vec3) else ours
        assert np.max(np.abs(actual - value)) <= 1e-9 * max(1.0, np.max(np.abs(value))), name
    columns = [vector(now.desired_quaternion.to_inertial(Vec3(*axis))) for axis in np.eye(3)]
    assert np.allclose(np.column_stack(columns), R_c, rtol=0.0, atol=1e-12)
    relative = now.desired_quaternion.inverse() * x.quaternion
    assert np.allclose([*now.attitude_error], [*relative], rtol=0.0, atol=1e-15)


@settings(max_examples=30)
@given(situations())
def test_energy_is_that_of_the_errors(situation: Situation) -> None:
    now, gains, m = situation.now(), situation.gains, situation.model
    e_x, e_v, e_Omega = (vector(v) for v in (now.position_error, now.velocity_error, now.angular_velocity_error))
    mass, J = (1.0, np.eye(3)) if gains.per_inertia else (m.mass, matrix(m.inertia))
    turning = gains.k_R * now.error_function + 0.5 * e_Omega @ J @ e_Omega
    moving = 0.5 * mass * (gains.k_x * e_x @ e_x + e_v @ e_v)
    assert now.energy == pytest.approx(turning + moving, rel=1e-12)


def test_law_on_a_batch_is_the_law_on_floats() -> None:
    random = np.random.default_rng(1)
    rows = random.uniform(-1.5, 1.5, (50, 28))
    rows[:, 6:10] /= np.linalg.norm(rows[:, 6:10], axis=1)[:, None]

    def arguments(values: Any) -> tuple[Measurement, Reference]:
        P_d, V_d, A_d, J_d, S_d = (Vec3(*values[i : i + 3]) for i in range(13, 28, 3))
        return (
            Measurement(
                Vec3(*values[0:3]), Vec3(*values[3:6]), Quaternion.from_xyzw(*values[6:10]), Vec3(*values[10:13])
            ),
            Reference(position=P_d, velocity=V_d, acceleration=A_d, jerk=J_d, snap=S_d),
        )

    batch = evaluate(*arguments(rows.T), Gains(), Model(), NUMPY)
    for i, row in enumerate(rows.tolist()):
        one = evaluate(*arguments(row), Gains(), Model())
        for name in Evaluation._fields:
            many, single = getattr(batch, name), getattr(one, name)
            pairs = zip(many, single) if isinstance(single, (Vec3, Quaternion)) else [(many, single)]
            assert all(abs(a[i] - b) <= 1e-12 * (1.0 + abs(b)) for a, b in pairs), name


@settings(max_examples=30)
@given(situations())
def test_a_quaternion_and_its_negative_give_the_same_command(situation: Situation) -> None:
    x = situation.state
    a = situation.now()
    b = situation.evaluation(situation.t, RigidState(x.position, x.velocity, -x.quaternion, x.angular_velocity))
    assert (a.thrust, a.torque) == (b.thrust, b.torque)
    assert (a.error_function, a.energy) == (b.error_function, b.energy)


# -- rates ----------------------------------------------------------------------------------------------------


RATES = {
    "velocity_error": "acceleration_error",
    "acceleration_error": "jerk_error",
    "force": "force_dot",
    "force_dot": "force_ddot",
    "desired_angular_velocity": "desired_angular_acceleration",
}


@settings(max_examples=30)
@given(situation=situations())
def test_every_rate_is_the_derivative_along_the_closed_loop(situation: Situation) -> None:
    """Those that are named so, Omega_c of the desired attitude, and what the errors give of the error function."""
    now, flow = situation.now(), functools.cache(situation.flow)
    assert_rates(now, flow, RATES)
    note("error function")
    assert_is_the_rate(now.rotation_error @ now.angular_velocity_error, lambda h: flow(h).error_function)


@settings(max_examples=30)
@given(situations())
def test_attitude_energy_falls_by_what_the_damping_takes(situation: Situation) -> None:
    gains, J = situation.gains, situation.model.inertia

    def energy(now: Evaluation) -> float:
        e_Omega = now.angular_velocity_error
        momentum = e_Omega if gains.per_inertia else J @ e_Omega
        return float(gains.k_R * now.error_function + 0.5 * (e_Omega @ momentum))

    e_Omega = situation.now().angular_velocity_error
    assert_is_the_rate(-gains.k_Omega * (e_Omega @ e_Omega), lambda h: energy(situation.flow(h)))


# -- what was published -----------------------------------------------------------------------------------------


def test_law_gives_the_command_of_its_authors_own_test_case() -> None:
    """`NonZeroInitConditions` of cpp/tests/test_controller.cpp, github.com/fdcl-gwu/uav_geometric_control at f5fcb51.

    Their attitude gains are diagonal, (1.5, 1.5, 0.8) and (0.35, 0.35, 0.15): the law is evaluated with both. Their
    torque has w × Jw, w = RᵀR_cΩ_c, where that of 2010 has Ω × JΩ - J(Ω × w), which is none here for Ω = 0.
    """
    h = 0.707106781186548
    state = Measurement(Vec3(0.0, 1.0, 2.2), Vec3(0.0, 1.0, 2.2), Quaternion.from_xyzw(0.0, 0.0, 1.0, 0.0), ZERO)
    reference = Reference(
        position=Vec3(-1.0, 0.0, 0.0),
        velocity=Vec3(0.0, -2.0, 0.0),
        acceleration=Vec3(0.0, 0.0, -5.0),
        jerk=Vec3(0.0, 1.2, 0.0),
        snap=Vec3(2.1, 0.0, 0.0),
    )
    heading = Heading(Vec3(h, h, 0.0), Vec3(0.0, h, h), Vec3(h, 0.0, h))
    model = Model(mass=1.95, inertia=Inertia(xx=0.02, yy=0.02, zz=0.04), gravity=9.81)

    def command(k_R: float, k_Omega: float) -> list[float]:
        gains = Gains(k_x=10.0 / 1.95, k_v=8.0 / 1.95, k_R=k_R, k_Omega=k_Omega)
        now = evaluate(state, reference, gains, model, heading=heading)
        w = now.attitude_error.to_body(now.desired_angular_velocity)
        return [now.thrust, *(now.torque + w.cross(model.inertia @ w))]

    thrust, x, y, _ = command(1.5, 0.35)
    *_, z = command(0.8, 0.15)
    assert thrust == pytest.approx(68.4795, rel=1e-14)
    assert [x, y, z] == pytest.approx([0.569002526179056, 0.131284659695342, -0.597667987195412], abs=1e-14)


class Helix:
    """x_d = [0.4 t, 0.4 sin πt, 0.6 cos πt] of the paper's first example."""

    def at(self, t: float) -> Reference:
        s, c, w = math.sin(math.pi * t), math.cos(math.pi * t), math.pi
        return Reference(
            position=Vec3(0.4 * t, 0.4 * s, 0.6 * c),
            velocity=Vec3(0.4, 0.4 * w * c, -0.6 * w * s),
            acceleration=w**2 * Vec3(0.0, -0.4 * s, -0.6 * c),
            jerk=w**3 * Vec3(0.0, -0.4 * c, 0.6 * s),
            snap=w**4 * Vec3(0.0, 0.4 * s, 0.6 * c),
        )


def test_published_helix_begins_at_the_published_attitude_error_which_then_only_falls() -> None:
    """From rest at the origin with R = I; b1d = [cos πt, sin πt, 0]. The end of the test is where rounding begins."""
    helix = Situation(
        gains=Gains(k_x=16.0, k_v=5.6, k_R=8.81, k_Omega=2.54),
        model=Model(mass=4.34, inertia=Inertia(xx=0.0820, yy=0.0845, zz=0.1377)),
        trajectory=Helix(),
        heading=Turning(rate=math.pi),
        t=0.0,
        state=RigidState(ZERO, ZERO, IDENTITY, ZERO),
    )
    x, step, psi = helix.state, 0.01, []
    for k in range(350):
        psi.append(helix.evaluation(k * step, x).error_function)
        x = rk4_step(helix.motion, k * step, x, step).normalised()
    assert psi[0] == pytest.approx(0.3659, abs=5e-5)
    assert all(later < earlier for earlier, later in itertools.pairwise(psi))
    assert psi[-1] < 1e-10
    assert helix.evaluation(3.5, x).position_error.norm() < 1e-3


# -- where it does not exist --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("acceleration", "heading", "words"),
    [
        (9.81 * Z, NORTH, "expected a length of at least 1e-09 m/s2"),
        (9.81 * Z - 5.0 * X, NORTH, r"\|b3c x b1d\| of at least 1e-09"),
        (9.81 * Z + 5.0 * X, NORTH, r"-A/m = \(-5.0, -?0.0, 0.0\) m/s2: .* b1d = \(1.0, 0.0, 0.0\)"),
        (ZERO, Heading(Z), r"\|b3c x b1d\|"),
    ],
)
def test_no_desired_attitude_is_an_error_that_says_why(acceleration: Vec3, heading: Heading, words: str) -> None:
    state = Measurement(ZERO, ZERO, IDENTITY, ZERO)
    reference = Reference(position=ZERO, acceleration=acceleration)
    with pytest.raises(DivergenceError, match=words):
        evaluate(state, reference, Gains(), Model(), heading=heading)


def test_one_point_of_a_batch_without_a_desired_attitude_is_an_error() -> None:
    free = Vec3(np.zeros(2), np.zeros(2), np.array([0.0, 9.81]))
    with pytest.raises(DivergenceError):
        evaluate(
            Measurement(ZERO, ZERO, IDENTITY, ZERO),
            Reference(position=ZERO, acceleration=free),
            Gains(),
            Model(),
            NUMPY,
        )


def test_the_geometric_law_hovers_upright_and_upside_down_where_asked_to() -> None:
    """Upside down, which the unified law cannot ask for: the reference falls faster than g."""
    model, at = Model(mass=2.0), Measurement(ZERO, ZERO, IDENTITY, ZERO)
    upright = evaluate(at, Reference(position=ZERO), Gains(), model)
    assert (upright.thrust, upright.torque, upright.energy) == (2.0 * 9.81, ZERO, 0.0)
    falling = Reference(position=ZERO, acceleration=15.0 * Z)
    over = evaluate(at, falling, Gains(), model)
    assert over.thrust == pytest.approx(-2.0 * 5.19)
    assert over.error_function == pytest.approx(2.0)
    turned = evaluate(at._replace(quaternion=Quaternion.from_xyzw(1.0, 0.0, 0.0, 0.0)), falling, Gains(), model)
    assert turned.thrust == pytest.approx(2.0 * 5.19)
    assert turned.error_function == pytest.approx(0.0, abs=1e-15)


def test_heading_is_where_the_body_points_at_rest() -> None:
    angle = 0.7
    heading = Turning(angle=angle).at(0.0)
    yawed = Quaternion.from_xyzw(0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))
    now = evaluate(Measurement(ZERO, ZERO, yawed, ZERO), Reference(position=ZERO), Gains(), Model(), heading=heading)
    assert now.torque.norm() < 1e-12
    assert (now.desired_quaternion.to_inertial(X) - Vec3(math.cos(angle), math.sin(angle), 0.0)).norm() < 1e-15


def test_flight_from_the_papers_start_settles() -> None:
    """The project's scenario without wind, in continuous time."""
    flight = Situation(
        gains=Gains(),
        model=Model(),
        trajectory=Trajectory(),
        heading=Turning(),
        t=0.0,
        state=RigidState(ZERO, ZERO, Quaternion.from_xyzw(0.1699, 0.3058, 0.1699, 0.9212).normalised(), ZERO),
    )
    x, step = flight.state, 0.02
    for k in range(400):
        x = rk4_step(flight.motion, k * step, x, step).normalised()
    assert flight.evaluation(8.0, x).position_error.norm() < 1e-4
