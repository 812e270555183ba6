"""The plant FMU from inside: the calls that a master makes, and what interface and errors promise."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import plant_fmu.slave
from fmu_kit.algebra import ZERO
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import RigidState
from plant_fmu.slave import QuadrotorPlant
from tests.reference.flight import Q0, integrated, quaternion
from tests.reference.law import Parameters, rotation
from tests.slaves import BODY_OUT_OF_RANGE, assert_fails, assert_initialisation_fails, get, named, put

QUADROTOR = QuadrotorPlant.variables

POSITION = ("position.x", "position.y", "position.z")
VELOCITY = ("velocity.x", "velocity.y", "velocity.z")
QUATERNION = ("quaternion.x", "quaternion.y", "quaternion.z", "quaternion.w")
SPIN = ("angular_velocity.x", "angular_velocity.y", "angular_velocity.z")
MOTION = (*POSITION, *VELOCITY, *QUATERNION, *SPIN)

NO_WIND = {"wind.amplitude.x": 0.0, "wind.amplitude.y": 0.0, "wind.amplitude.z": 0.0}
LEVEL = {
    "initial.quaternion.x": 0.0,
    "initial.quaternion.y": 0.0,
    "initial.quaternion.z": 0.0,
    "initial.quaternion.w": 1.0,
}
BODY = {
    "mass": 1.3,
    "gravity": 9.7,
    "inertia.xx": 0.8,
    "inertia.yy": 0.9,
    "inertia.zz": 1.4,
    "inertia.xy": 0.05,
    "inertia.xz": -0.02,
    "inertia.yz": 0.03,
}
MOVING = {
    "initial.position.x": 1.0,
    "initial.position.y": -2.0,
    "initial.position.z": 3.0,
    "initial.velocity.x": 0.1,
    "initial.velocity.y": 0.2,
    "initial.velocity.z": -0.3,
    "initial.angular_velocity.x": 0.4,
    "initial.angular_velocity.y": -0.5,
    "initial.angular_velocity.z": 0.6,
}


def instance(values: Mapping[str, float] | None = None) -> QuadrotorPlant:
    slave = QuadrotorPlant(instance_name="p")
    put(slave, values or {})
    return slave


def started(values: Mapping[str, float] | None = None, *, start: float = 0.0) -> QuadrotorPlant:
    """A plant after initialisation."""
    slave = instance(values)
    slave.setup_experiment(start)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def run_steps(slave: QuadrotorPlant, h: float, count: int, start: float = 0.0) -> None:
    for k in range(count):
        assert slave.do_step(start + k * h, h) is True


def close(values: list[float], tolerance: float = 1e-12) -> Any:
    return pytest.approx(values, rel=0.0, abs=tolerance)


# -- motion -------------------------------------------------------------------------------------------------


def test_defaults_start_at_the_initial_state_of_the_paper() -> None:
    slave = started()
    length = math.sqrt(0.1699**2 + 0.3058**2 + 0.1699**2 + 0.9212**2)
    assert get(slave, *POSITION, *VELOCITY, *SPIN) == [0.0] * 9
    assert get(slave, *QUATERNION) == close([0.1699 / length, 0.3058 / length, 0.1699 / length, 0.9212 / length])
    assert get(slave, "thrust") == [9.81]


def test_initial_state_is_where_it_was_set() -> None:
    assert get(started(MOVING), *POSITION, *VELOCITY, *SPIN) == list(MOVING.values())


@given(st.floats(-100.0, 100.0).map(lambda exponent: 10.0**exponent))
def test_initial_quaternion_is_normalised(length: float) -> None:
    values = {"x": 0.1 * length, "y": -0.5 * length, "z": 0.5 * length, "w": 0.7 * length}
    slave = started({f"initial.quaternion.{axis}": value for axis, value in values.items()})
    assert get(slave, *QUATERNION) == close([0.1, -0.5, 0.5, 0.7])


def test_hover_stays_for_half_a_minute() -> None:
    slave = started({**BODY, **LEVEL, **NO_WIND, "initial.position.z": -2.0, "thrust": 1.3 * 9.7})
    run_steps(slave, 0.01, 3000)
    assert get(slave, *MOTION) == close([0.0, 0.0, -2.0, *[0.0] * 6, 1.0, 0.0, 0.0, 0.0])


def test_free_fall_is_exact() -> None:
    slave = started({**NO_WIND, "thrust": 0.0})
    run_steps(slave, 0.01, 200)
    assert get(slave, *POSITION, *VELOCITY) == close([0.0, 0.0, 0.5 * 9.81 * 4.0, 0.0, 0.0, 9.81 * 2.0], 1e-11)


def independent_motion(seconds: float, command: list[float]) -> Any:
    """The motion of BODY from MOVING in wind and an external force, by adaptive integration."""
    p = Parameters(m=1.3, g=9.7, J=np.array([[0.8, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.4]]))
    Q = Q0 / np.linalg.norm(Q0)
    start = np.concatenate([[1.0, -2.0, 3.0, 0.1, 0.2, -0.3], rotation(Q).ravel(), [0.4, -0.5, 0.6]])
    force = lambda t: np.array([0.5, -0.2, 0.1]) * math.cos(2.0 * t) + [0.0, 0.4, 0.0]  # noqa: E731
    x = integrated(start, 0.0, seconds, np.array(command), p, force=force)
    return np.concatenate([x[:6], quaternion(x[6:15].reshape(3, 3), Q), x[15:]])


def distance_from_it(internal_step: float) -> float:
    """Of the plant after 1 s under one command."""
    wind = {"wind.amplitude.x": 0.5, "wind.amplitude.y": -0.2, "wind.amplitude.z": 0.1, "wind.frequency": 2.0}
    slave = started({**BODY, **MOVING, **wind, "max_internal_step": internal_step})
    put(slave, {"thrust": 12.0, "torque.x": 1.0, "torque.y": -2.0, "torque.z": 3.0, "external_force.y": 0.4})
    run_steps(slave, 0.1, 10)
    expected = independent_motion(1.0, [12.0, 1.0, -2.0, 3.0])
    return float(np.max(np.abs(np.array(get(slave, *MOTION)) - expected)))


def test_flight_is_that_of_an_independent_model() -> None:
    assert distance_from_it(0.001) <= 1e-11


def test_halving_the_internal_step_divides_the_distance_from_an_independent_model_by_16() -> None:
    coarse, middle, fine = (distance_from_it(step) for step in (0.05, 0.025, 0.0125))
    assert math.log2(coarse / middle) == pytest.approx(4.0, abs=0.3)
    assert math.log2(middle / fine) == pytest.approx(4.0, abs=0.3)


def test_quaternion_keeps_its_length() -> None:
    slave = started({**MOVING, "torque.x": 1.0})
    run_steps(slave, 0.05, 200)
    assert sum(x * x for x in get(slave, *QUATERNION)) == pytest.approx(1.0, abs=1e-15)


def test_wind_pushes_as_its_integral_says() -> None:
    """v = a / (m w) sin wt, of a level body that hovers otherwise."""
    slave = started(
        {
            **BODY,
            **LEVEL,
            "thrust": 1.3 * 9.7,
            "wind.amplitude.x": 0.5,
            "wind.amplitude.y": -0.2,
            "wind.amplitude.z": 0.1,
            "wind.frequency": 2.0,
        }
    )
    run_steps(slave, 0.01, 300)
    factor = math.sin(6.0) / (1.3 * 2.0)
    assert get(slave, *VELOCITY) == close([0.5 * factor, -0.2 * factor, 0.1 * factor], 1e-11)
    assert get(slave, "wind.force.x", "wind.force.y") == close([0.5 * math.cos(6.0), -0.2 * math.cos(6.0)])


def test_wind_blows_at_the_masters_time() -> None:
    """A start later than zero finds another phase of the wind."""
    assert get(started(start=7.0), "wind.force.x", "wind.force.z") == close([0.01 * math.cos(0.7)] * 2)


def test_external_force_adds_to_the_wind() -> None:
    slave = started({**LEVEL, "external_force.x": 0.3, "external_force.z": -0.1, "wind.frequency": 0.0})
    assert get(slave, "acceleration.x", "acceleration.y", "acceleration.z") == close([0.31, 0.01, -0.09])
    assert get(slave, "wind.force.x", "wind.force.y", "wind.force.z") == [0.01] * 3
    run_steps(slave, 0.01, 100)
    assert get(slave, *VELOCITY) == close([0.31, 0.01, -0.09])


def test_tunable_wind_takes_effect_at_the_next_step() -> None:
    slave = started({**LEVEL, **NO_WIND})
    run_steps(slave, 0.01, 100)
    put(slave, {"wind.amplitude.x": 1.0, "wind.frequency": 0.0})
    assert get(slave, *VELOCITY, "wind.force.x") == close([0.0] * 4)
    run_steps(slave, 0.01, 100, start=1.0)
    assert get(slave, "velocity.x", "position.x", "wind.force.x") == close([1.0, 0.5, 1.0])


def test_no_output_moves_with_an_input_without_a_step() -> None:
    slave = started()
    run_steps(slave, 0.01, 3)
    before = list(slave._reals)
    put(slave, {"thrust": 20.0, "torque.x": 3.0, "external_force.z": -1.0})
    get(slave, *MOTION)
    changed = {QUADROTOR[i].causality for i, (a, b) in enumerate(zip(before, slave._reals)) if a != b}
    assert changed == {"input"}


# -- internal steps -----------------------------------------------------------------------------------------


def test_step_of_20_ms_is_ten_steps_of_2_ms() -> None:
    """Both go through the same internal grid; only the rounding of times differs."""
    values = {**BODY, **MOVING, "actuator_time_constant": 0.03, "thrust": 3.0}
    whole, parts = started(values), started(values)
    for slave in (whole, parts):
        put(slave, {"thrust": 15.0, "torque.x": 0.5, "torque.z": -0.1})
    run_steps(whole, 0.02, 50)
    run_steps(parts, 0.002, 500)
    assert get(whole, *MOTION) == close(get(parts, *MOTION), 1e-13)


@pytest.mark.parametrize(
    ("h", "largest", "count"),
    [(0.01, 0.002, 5), (0.001, 0.002, 1), (0.0101, 0.002, 6), (0.02, 0.02, 1), (0.03, 0.01, 3), (1e-13, 0.002, 1)],
)
def test_step_is_covered_by_equal_internal_steps(
    h: float, largest: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []

    def counting(f: Any, t: float, x: RigidState, internal: float) -> RigidState:
        taken.append((t, internal))
        return rk4_step(f, t, x, internal)

    monkeypatch.setattr(plant_fmu.slave, "rk4_step", counting)
    started({"max_internal_step": largest}).do_step(3.0, h)
    assert taken == [(pytest.approx(3.0 + i * h / count, rel=1e-15), h / count) for i in range(count)]


# -- actuators ------------------------------------------------------------------------------------------------


def thrust_of(slave: QuadrotorPlant) -> float:
    """What the propellers exert on a level body of 1 kg without wind, as its acceleration shows it."""
    return 9.81 - get(slave, "acceleration.z")[0]


def test_thrust_is_limited_from_both_sides() -> None:
    slave = started({**LEVEL, **NO_WIND, "thrust_max": 15.0, "thrust": 20.0})
    assert thrust_of(slave) == pytest.approx(15.0, abs=1e-13)
    put(slave, {"thrust": -3.0})
    slave.do_step(0.0, 0.01)
    assert thrust_of(slave) == pytest.approx(0.0, abs=1e-13)
    assert get(slave, "velocity.z") == close([0.0981])


def test_each_torque_is_limited_from_both_sides() -> None:
    slave = started({**LEVEL, "torque_max": 0.5})
    for k, (torque, expected) in enumerate(((3.0, 0.005), (-3.0, 0.0), (0.1, 0.001))):
        put(slave, {"torque.x": torque})
        slave.do_step(0.01 * k, 0.01)
        assert get(slave, "angular_velocity.x") == close([expected])


def test_lag_is_the_exact_exponential_and_starts_at_the_limited_initial_command() -> None:
    slave = started({**LEVEL, **NO_WIND, "actuator_time_constant": 0.05, "thrust_max": 15.0, "thrust": 40.0})
    assert thrust_of(slave) == pytest.approx(15.0, abs=1e-13)
    put(slave, {"thrust": 5.0})
    for k in range(10):
        slave.do_step(0.01 * k, 0.01)
        left = math.exp(-0.01 * (k + 1) / 0.05)
        assert thrust_of(slave) == pytest.approx(5.0 + 10.0 * left, abs=1e-12)
    fallen = 9.81 * 0.1 - 5.0 * 0.1 - 10.0 * 0.05 * (1.0 - math.exp(-2.0))
    assert get(slave, "velocity.z") == close([fallen], 1e-9)


def test_torques_lag_as_the_thrust_does() -> None:
    """With J = 1 and a spin about one axis only, angular velocity is the integral of the torque."""
    slave = started({**LEVEL, "actuator_time_constant": 0.05, "torque.x": 1.0})
    put(slave, {"torque.x": -1.0})
    run_steps(slave, 0.01, 20)
    expected = -0.2 + 2.0 * 0.05 * (1.0 - math.exp(-4.0))
    assert get(slave, "angular_velocity.x") == close([expected], 1e-8)


MOTORS = {"motor.thrust_max": 4.0, "motor.arm.x": 0.1, "motor.arm.y": 0.1, "motor.drag_to_thrust": 0.02}


def test_motors_start_at_the_limited_initial_command_and_each_goes_at_its_own_pace() -> None:
    """Roll cuts two of them at the top: half of the thrust rises with one time constant, half falls with the other."""
    lag = {"motor.time_constant.up": 0.02, "motor.time_constant.down": 0.05}
    slave = started({**LEVEL, **NO_WIND, **MOTORS, **lag, "thrust": 8.0})
    assert thrust_of(slave) == pytest.approx(8.0, abs=1e-13)
    put(slave, {"torque.x": 1.0})
    slave.do_step(0.0, 0.01)
    rising, falling = 1.0 - math.exp(-0.5), 1.0 - math.exp(-0.2)
    assert slave.internal_state()["actuators"] == close(
        [2.0 - 2.0 * falling, 2.0 + 2.0 * rising, 2.0 + 2.0 * rising, 2.0 - 2.0 * falling]
    )


def test_motors_lag_as_all_actuators_do_unless_they_have_a_lag_of_their_own() -> None:
    own = {"motor.time_constant.up": 0.02, "motor.time_constant.down": 0.05}
    thrusts = []
    for lag in (own, {**own, "motor.time_constant.up": 0.0, "actuator_time_constant": 0.02}):
        slave = started({**LEVEL, **NO_WIND, **MOTORS, **lag, "thrust": 8.0})
        put(slave, {"torque.y": 0.2})
        slave.do_step(0.0, 0.01)
        thrusts.append(slave.internal_state()["actuators"])
    assert thrusts[0] == thrusts[1]


def test_motors_that_nothing_limits_fly_the_same_path_as_without_them() -> None:
    simulated = []
    for motors in ({}, {**MOTORS, "motor.thrust_max": 1e3, "motor.thrust_min": -1e3}):
        slave = started({**BODY, **MOVING, **motors, "thrust": 14.0, "torque.x": 0.5, "torque.z": -0.2})
        run_steps(slave, 0.01, 100)
        simulated.append(get(slave, *MOTION))
    assert simulated[0] == close(simulated[1], 1e-11)


def test_limits_act_before_the_lag() -> None:
    """A lag of the unlimited command would reach the limit almost at once."""
    slave = started({**LEVEL, **NO_WIND, "actuator_time_constant": 0.1, "thrust_max": 20.0, "thrust": 0.0})
    put(slave, {"thrust": 1e6})
    slave.do_step(0.0, 0.01)
    assert thrust_of(slave) == pytest.approx(20.0 * (1.0 - math.exp(-0.1)), abs=1e-12)


@pytest.mark.parametrize("time_constant", [1e-4, 1e-9, 5e-324])
def test_time_constant_much_smaller_than_the_step_stays_stable(time_constant: float) -> None:
    slave = started({**LEVEL, **NO_WIND, "actuator_time_constant": time_constant, "thrust": 0.0})
    put(slave, {"thrust": 9.81})
    run_steps(slave, 0.02, 100)
    assert thrust_of(slave) == pytest.approx(9.81, abs=1e-13)
    assert 0.0 <= get(slave, "velocity.z")[0] < 0.01
    put(slave, {"thrust": 9.81, "torque.x": 1.0})
    run_steps(slave, 0.02, 50, start=2.0)
    assert get(slave, "angular_velocity.x")[0] == pytest.approx(1.0, abs=1e-3)


# -- parameters and misuse ------------------------------------------------------------------------------------

OUT_OF_RANGE = [
    *BODY_OUT_OF_RANGE,
    ("thrust_max", -1.0, ">= 0"),
    ("torque_max", -0.1, ">= 0"),
    ("actuator_time_constant", -0.01, ">= 0"),
    ("max_internal_step", 0.0, "> 0"),
    ("max_internal_step", -0.002, "> 0"),
    ("motor.thrust_max", -1.0, ">= 0"),
    ("motor.arm.y", 0.0, "> 0"),
    ("motor.drag_to_thrust", 0.0, "> 0"),
]


@pytest.mark.parametrize(("name", "value", "expected"), OUT_OF_RANGE)
def test_parameter_out_of_range_is_refused_when_initialisation_ends(name: str, value: float, expected: str) -> None:
    assert_initialisation_fails(instance({name: value}), *named(name, value), "expected", expected)


def test_zero_initial_quaternion_is_refused() -> None:
    slave = instance({**LEVEL, "initial.quaternion.w": 0.0})
    assert_initialisation_fails(slave, "initial.quaternion = (0.0, 0.0, 0.0, 0.0)", "expected", "not zero")


@given(st.permutations(list({**BODY, **MOVING})))
def test_parameters_may_be_set_in_any_order(order: list[str]) -> None:
    """On the way, the inertia need not be positive definite."""
    values = {**BODY, **MOVING, "inertia.xx": 8.0, "inertia.yy": 9.0, "inertia.xy": 5.0}
    slave, sorted_slave = started({name: values[name] for name in order}), started(values)
    for plant in (slave, sorted_slave):
        put(plant, {"thrust": 10.0, "torque.x": 1.0})
        run_steps(plant, 0.01, 2)
    assert slave._reals == sorted_slave._reals


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"initial.velocity.y": 1.7e308}, "position.y = inf"),
        ({"external_force.z": 1.7e308, "initial.velocity.z": 1.7e308}, "position.z = inf"),
        ({"initial.angular_velocity.x": 1e200, "initial.angular_velocity.y": 1e200}, "expected a finite value"),
        ({"torque_max": 1.7e308, "torque.x": 1.7e308}, "expected a finite value"),
    ],
)
def test_state_that_stops_being_finite_is_named_as_a_divergence(values: dict[str, float], name: str) -> None:
    slave = started({**values, "max_internal_step": 2.0, **NO_WIND})
    assert_fails(lambda: run_steps(slave, 2.0, 3), name, "expected")
    assert [message.category for message in slave.log_queue] == ["divergence"]


def test_float_that_leaves_its_range_on_the_way_is_a_divergence_at_a_time() -> None:
    """The phase of this wind overflows, and the standard library has no cosine of infinity."""
    slave = started({"wind.frequency": 1e308})
    assert_fails(lambda: slave.do_step(100.0, 0.01), "at t = 100.0", "expected finite values")
    assert [message.category for message in slave.log_queue] == ["divergence"]


# -- state ----------------------------------------------------------------------------------------------------


def test_wind_that_was_set_but_not_used_is_part_of_the_state() -> None:
    slave = started({**LEVEL, **NO_WIND})
    put(slave, {"wind.amplitude.x": 1.0, "wind.frequency": 0.0})
    other = QuadrotorPlant(instance_name="other")
    other._set_fmu_state(json.loads(json.dumps(slave._get_fmu_state())))
    run_steps(other, 0.01, 100)
    assert get(other, "velocity.x") == close([1.0])


def test_instances_do_not_share_values() -> None:
    first, second = started(LEVEL), started(LEVEL)
    run_steps(first, 0.01, 5)
    assert get(second, *POSITION, *VELOCITY, *SPIN) == [*ZERO, *ZERO, *ZERO]
