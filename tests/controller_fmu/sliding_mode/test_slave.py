"""The controller FMU from inside: the calls that a master makes, and what interface and errors promise."""

import json
import math
import re
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonfmu.enums import Fmi2Status

from controller_fmu.gain_scaling import GainScaling
from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.sliding_mode.slave import UnifiedController
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import ZERO, Inertia, Quaternion, Vec3
from fmu_kit.failure import Failure
from fmu_kit.trajectory import Reference, Trajectory
from tests.slaves import BODY_OUT_OF_RANGE, assert_fails, assert_initialisation_fails, get, named, put

UNIFIED = UnifiedController.variables

COMMAND = ("thrust", "torque.x", "torque.y", "torque.z")
PAPER_ATTITUDE = Quaternion.from_xyzw(0.1699, 0.3058, 0.1699, 0.9212).normalised()


def count(slave: UnifiedController) -> int:
    return slave.get_integer([slave._index["sample_count"]])[0]


def command(slave: UnifiedController) -> list[float]:
    return get(slave, *COMMAND)


def vector(name: str, v: Vec3) -> dict[str, float]:
    return {f"{name}.{axis}": value for axis, value in zip("xyz", v)}


def quaternion(name: str, Q: Quaternion) -> dict[str, float]:
    return {f"{name}.{axis}": value for axis, value in zip("xyzw", Q)}


def measured(k: int) -> dict[str, float]:
    """Some motion, another for each `k`."""
    Q = Quaternion.from_xyzw(0.1 * math.sin(k), 0.1 * math.cos(k), 0.05, 1.0).normalised()
    return {
        **vector("position", Vec3(0.1 * k, 0.3, 2.0 - 0.1 * k)),
        **vector("velocity", Vec3(0.5, 0.4 - 0.1 * k, 0.1)),
        **quaternion("quaternion", Q),
        **vector("angular_velocity", Vec3(0.1, -0.02 * k, 0.05)),
    }


def instance(values: Mapping[str, float] | None = None, *, follow_inputs: bool = False) -> UnifiedController:
    slave = UnifiedController(instance_name="c")
    put(slave, values or {})
    if follow_inputs:
        slave.set_boolean([slave._index["use_reference_inputs"]], [True])
    return slave


def started(
    values: Mapping[str, float] | None = None, *, start: float = 0.0, follow_inputs: bool = False
) -> UnifiedController:
    """A controller after initialisation."""
    slave = instance(values, follow_inputs=follow_inputs)
    slave.setup_experiment(start)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def law(values: Mapping[str, float], t: float, gains: Gains | None = None, model: Model | None = None) -> list[float]:
    """The command of the law for these inputs at `t`, on the built-in trajectory."""
    P, V, omega = (
        Vec3(*(values[f"{name}.{a}"] for a in "xyz")) for name in ("position", "velocity", "angular_velocity")
    )
    Q = Quaternion.from_xyzw(*(values[f"quaternion.{a}"] for a in "xyzw")).normalised()
    now = evaluate(Measurement(P, V, Q, omega), Trajectory().at(t), gains or Gains(), model or Model())
    return [now.thrust, *now.torque]


def close(values: list[float]) -> Any:
    """Equal to rounding: normalising a unit quaternion again may change its last digit."""
    return pytest.approx(values, rel=1e-12, abs=1e-12)


def warnings(slave: UnifiedController) -> list[str]:
    assert {message.status for message in slave.log_queue} <= {Fmi2Status.warning}
    return [message.msg for message in slave.log_queue]


# -- samples ------------------------------------------------------------------------------------------------


def test_outputs_after_initialisation_are_the_command_for_the_initial_inputs_at_the_start_time() -> None:
    slave = started(measured(3), start=4.0)
    assert command(slave) == close(law(measured(3), 4.0))
    assert count(slave) == 0


def test_initial_outputs_of_the_defaults_are_those_of_a_hover_at_the_origin() -> None:
    values = {**vector("position", ZERO), **vector("velocity", ZERO), **vector("angular_velocity", ZERO)}
    hover = {**values, **quaternion("quaternion", Quaternion.from_xyzw(0.0, 0.0, 0.0, 1.0))}
    assert command(started()) == close(law(hover, 0.0))


def test_outputs_can_be_read_in_initialisation_mode_and_follow_the_inputs() -> None:
    slave = instance(measured(1))
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    assert command(slave) == close(law(measured(1), 0.0))
    put(slave, measured(2))
    assert command(slave) == close(law(measured(2), 0.0))
    put(slave, measured(3))
    slave.exit_initialization_mode()
    assert command(slave) == close(law(measured(3), 0.0))


def test_due_sample_evaluates_the_law_at_the_start_of_the_step() -> None:
    slave = started(measured(0))
    for k in range(5):
        put(slave, measured(k))
        assert slave.do_step(0.01 * k, 0.01) is True
        assert command(slave) == close(law(measured(k), 0.01 * k))
        assert count(slave) == k + 1


def test_gains_are_per_unit_inertia_where_that_is_chosen() -> None:
    slave = instance({**measured(3), "inertia.xx": 0.02, "inertia.yy": 0.03, "inertia.zz": 0.04})
    slave.set_integer([slave._index["gain_scaling"]], [GainScaling.INERTIA])
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    model = Model(inertia=Inertia(xx=0.02, yy=0.03, zz=0.04))
    assert command(slave) == close(law(measured(3), 0.0, Gains(per_inertia=True), model))


def test_command_is_held_between_samples() -> None:
    slave = started({**measured(0), "sample_period": 0.01})
    for k in range(30):
        put(slave, measured(k))
        slave.do_step(0.002 * k, 0.002)
        assert command(slave) == close(law(measured(k - k % 5), 0.002 * (k - k % 5)))
    assert count(slave) == 6


def test_no_output_moves_with_an_input_without_a_step() -> None:
    slave = started(measured(0))
    slave.do_step(0.0, 0.01)
    before = list(slave._reals)
    held = command(slave)
    put(slave, measured(7))
    assert command(slave) == held
    changed = {UNIFIED[i].causality for i, (a, b) in enumerate(zip(before, slave._reals)) if a != b}
    assert changed == {"input"}


def test_first_command_is_held_before_the_offset() -> None:
    slave = started({**measured(0), "sample_offset": 0.005})
    for k in range(5):
        put(slave, measured(k + 1))
        slave.do_step(0.001 * k, 0.001)
        assert command(slave) == close(law(measured(0), 0.0))
        assert count(slave) == 0
    put(slave, measured(9))
    slave.do_step(0.005, 0.001)
    assert command(slave) == close(law(measured(9), 0.005))
    assert count(slave) == 1


def test_period_of_zero_samples_at_every_communication_point() -> None:
    slave = started({"sample_period": 0.0})
    for k, (t, h) in enumerate([(0.0, 0.001), (0.001, 0.499), (0.5, 0.001)]):
        put(slave, measured(k))
        slave.do_step(t, h)
        assert command(slave) == close(law(measured(k), t))
    assert count(slave) == 3
    assert warnings(slave) == []


def test_step_longer_than_the_period_takes_one_sample_and_warns_once() -> None:
    slave = started({"sample_period": 0.01})
    for k in range(4):
        slave.do_step(0.025 * k, 0.025)
    assert count(slave) == 4
    assert warnings(slave) == ["communication step 0.025 s is longer than sample_period 0.01 s: one sample a step"]


@pytest.mark.parametrize("step", [0.01, 0.01 * (1.0 + 1e-9), 0.002])
def test_step_no_longer_than_the_period_does_not_warn(step: float) -> None:
    slave = started({"sample_period": 0.01})
    for k in range(4):
        slave.do_step(k * step, step)
    assert warnings(slave) == []


# -- measurement ----------------------------------------------------------------------------------------------

NOTHING = dict.fromkeys(measured(0), 0.0)


def test_zero_quaternion_commands_hover_with_one_warning() -> None:
    slave = started({**NOTHING, "mass": 1.3, "gravity": 9.7})
    assert command(slave) == close([1.3 * 9.7, 0.0, 0.0, 0.0])
    for k in range(3):
        slave.do_step(0.01 * k, 0.01)
        assert command(slave) == close([1.3 * 9.7, 0.0, 0.0, 0.0])
    assert len(warnings(slave)) == 1
    assert "quaternion = (0, 0, 0, 0): no measurement" in warnings(slave)[0]


def test_measurement_that_arrives_later_ends_the_hover() -> None:
    slave = started(NOTHING)
    put(slave, measured(1))
    slave.do_step(0.0, 0.01)
    assert command(slave) == close(law(measured(1), 0.0))


def test_measurement_that_is_lost_returns_to_hover() -> None:
    slave = started(measured(1))
    put(slave, NOTHING)
    slave.do_step(0.0, 0.01)
    assert command(slave) == close([9.81, 0.0, 0.0, 0.0])
    assert len(warnings(slave)) == 1


@given(st.floats(-100.0, 100.0).map(lambda exponent: 10.0**exponent))
def test_quaternion_is_normalised_before_use(length: float) -> None:
    Q = PAPER_ATTITUDE
    values = {**measured(0), **quaternion("quaternion", Quaternion(length * Q.vector, length * Q.scalar))}
    slave = started(values)
    assert command(slave) == close(law(values, 0.0))
    slave.do_step(0.0, 0.01)
    assert command(slave) == close(law(values, 0.0))
    assert warnings(slave) == []


@pytest.mark.parametrize("size", [5e-324, 1e-200, 1e-161, 1e200])
def test_quaternion_whose_square_no_float_holds_is_normalised_like_any_other(size: float) -> None:
    tiny = started({**measured(0), **quaternion("quaternion", Quaternion(ZERO, size))})
    unit = started({**measured(0), **quaternion("quaternion", Quaternion(ZERO, 1.0))})
    assert command(tiny) == command(unit)


def test_reference_inputs_are_followed_when_asked_for() -> None:
    target = {
        **vector("reference.position", Vec3(0.3, -0.2, 1.5)),
        **vector("reference.velocity", Vec3(0.1, 0.2, -0.3)),
        **vector("reference.acceleration", Vec3(0.4, -0.5, 0.6)),
        **vector("reference.jerk", Vec3(-0.7, 0.8, 0.9)),
        **vector("reference.snap", Vec3(1.0, -1.1, 1.2)),
    }
    slave = started({**measured(2), **target}, follow_inputs=True)
    slave.do_step(0.0, 0.01)
    position, velocity = (Vec3(*(measured(2)[f"{name}.{a}"] for a in "xyz")) for name in ("position", "velocity"))
    state = Measurement(
        position,
        velocity,
        Quaternion.from_xyzw(*(measured(2)[f"quaternion.{a}"] for a in "xyzw")),
        Vec3(*(measured(2)[f"angular_velocity.{a}"] for a in "xyz")),
    )
    reference = Reference(
        position=Vec3(0.3, -0.2, 1.5),
        velocity=Vec3(0.1, 0.2, -0.3),
        acceleration=Vec3(0.4, -0.5, 0.6),
        jerk=Vec3(-0.7, 0.8, 0.9),
        snap=Vec3(1.0, -1.1, 1.2),
    )
    now = evaluate(state, reference, Gains(), Model())
    assert command(slave) == close([now.thrust, *now.torque])


def test_reference_inputs_are_ignored_by_default() -> None:
    slave = started({**measured(2), **vector("reference.position", Vec3(7.0, 8.0, 9.0))})
    slave.do_step(0.0, 0.01)
    assert command(slave) == close(law(measured(2), 0.0))


def test_locals_show_the_last_sample() -> None:
    slave = started(measured(0), start=3.0)
    put(slave, measured(4))
    slave.do_step(3.0, 0.01)
    values = measured(4)
    position, velocity = (Vec3(*(values[f"{name}.{a}"] for a in "xyz")) for name in ("position", "velocity"))
    state = Measurement(
        position,
        velocity,
        Quaternion.from_xyzw(*(values[f"quaternion.{a}"] for a in "xyzw")),
        Vec3(*(values[f"angular_velocity.{a}"] for a in "xyz")),
    )
    now = evaluate(state, Trajectory().at(3.0), Gains(), Model())
    for name in ("position_error", "velocity_error", "angular_velocity_error", "sliding", "theta"):
        assert get(slave, *(f"{name}.{a}" for a in "xyz")) == close(list(getattr(now, name)))
    for name in ("desired_quaternion", "attitude_error"):
        assert get(slave, *(f"{name}.{a}" for a in "xyzw")) == close(list(getattr(now, name)))
    assert get(slave, *(f"desired_angular_velocity.{a}" for a in "xyz")) == close(list(now.desired_angular_velocity))
    assert get(slave, "energy") == close([now.energy])


# -- parameters -----------------------------------------------------------------------------------------------

PARAMETERS = {
    "mass": 1.3,
    "gravity": 9.7,
    "inertia.xx": 0.08,
    "inertia.yy": 0.09,
    "inertia.zz": 0.14,
    "inertia.xy": 0.05,
    "inertia.xz": -0.02,
    "inertia.yz": 0.03,
    "gain.translation.x": 2.1,
    "gain.translation.y": 1.5,
    "gain.translation.z": 3.0,
    "gain.disturbance": 0.4,
    "gain.surface": 3.0,
    "gain.eta": 10.0,
    "gain.theta": 12.0,
    "gain.attitude": 8.0,
    "surface_exponent": 0.8,
    "boundary_layer": 0.002,
    "coupling": 0.5,
}
GAINS = Gains(
    k_t=Vec3(2.1, 1.5, 3.0), beta=0.4, k_s=3.0, beta_t=0.8, epsilon=0.002, k_eta=10.0, k_theta=12.0, k_q=8.0, kappa=0.5
)
MODEL = Model(mass=1.3, inertia=Inertia(xx=0.08, yy=0.09, zz=0.14, xy=0.05, xz=-0.02, yz=0.03), gravity=9.7)


def test_every_parameter_reaches_its_place_in_the_law() -> None:
    slave = started({**measured(1), **PARAMETERS})
    slave.do_step(0.0, 0.01)
    assert command(slave) == close(law(measured(1), 0.0, GAINS, MODEL))


@given(st.permutations(list(PARAMETERS)))
def test_parameters_may_be_set_in_any_order(order: list[str]) -> None:
    """On the way, the inertia is not positive definite."""
    slave = instance(measured(1))
    slave.setup_experiment(0.0)
    put(slave, {name: PARAMETERS[name] for name in order[:7]})
    slave.enter_initialization_mode()
    put(slave, {name: PARAMETERS[name] for name in order[7:]})
    slave.exit_initialization_mode()
    assert command(slave) == close(law(measured(1), 0.0, GAINS, MODEL))


def test_parameters_of_the_trajectory_move_the_reference() -> None:
    names = ("amplitude_x", "amplitude_y", "frequency", "start_z", "rate_z")
    values = dict(zip(names, (3.0, -2.0, 0.4, 1.0, -0.2)))
    slave = started({**measured(1), **{f"trajectory.{name}": value for name, value in values.items()}}, start=2.0)
    expected = Vec3(0.1, 0.3, 1.9) - Trajectory(**values).position(2.0)
    assert get(slave, "position_error.x", "position_error.y", "position_error.z") == close(list(expected))


OUT_OF_RANGE = [
    *BODY_OUT_OF_RANGE,
    ("sample_period", -0.01, ">= 0"),
    ("sample_offset", -0.001, ">= 0"),
    ("gain.translation.x", -2.0, ">= 0"),
    ("gain.translation.y", -0.1, ">= 0"),
    ("gain.translation.z", -1e-9, ">= 0"),
    ("gain.disturbance", -0.99, ">= 0"),
    ("gain.surface", -5.0, ">= 0"),
    ("gain.eta", -15.0, ">= 0"),
    ("gain.theta", -15.0, ">= 0"),
    ("gain.attitude", 0.0, "> 0"),
    ("gain.attitude", -15.0, "> 0"),
    ("surface_exponent", 0.0, "> 0 and <= 1"),
    ("surface_exponent", 1.01, "> 0 and <= 1"),
    ("surface_exponent", -0.5, "> 0 and <= 1"),
    ("boundary_layer", 0.0, "> 0"),
    ("boundary_layer", -0.001, "> 0"),
]


@pytest.mark.parametrize(("name", "value", "expected"), OUT_OF_RANGE)
def test_parameter_out_of_range_is_refused_when_initialisation_ends(name: str, value: float, expected: str) -> None:
    assert_initialisation_fails(instance({name: value}), *named(name, value), "expected", expected)


TUNABLE = [v.name for v in UNIFIED if v.variability == "tunable"]


@pytest.mark.parametrize(("name", "value", "expected"), [case for case in OUT_OF_RANGE if case[0] in TUNABLE])
def test_tunable_parameter_out_of_range_is_refused_at_the_next_step(name: str, value: float, expected: str) -> None:
    slave = started()
    slave.do_step(0.0, 0.01)
    put(slave, {name: value})
    assert_fails(lambda: slave.do_step(0.01, 0.01), *named(name, value), "expected", expected)


def test_tunable_parameters_take_effect_at_the_next_sample() -> None:
    tunable = {name: value for name, value in PARAMETERS.items() if name in TUNABLE}
    assert sorted(tunable) == sorted(TUNABLE)
    slave = started(measured(1))
    slave.do_step(0.0, 0.005)
    put(slave, tunable)
    assert command(slave) == close(law(measured(1), 0.0))
    slave.do_step(0.005, 0.005)
    assert command(slave) == close(law(measured(1), 0.0))
    slave.do_step(0.01, 0.005)
    assert command(slave) == close(law(measured(1), 0.01, GAINS))


# -- misuse ---------------------------------------------------------------------------------------------------

INPUTS = [v.name for v in UNIFIED if v.causality == "input"]


def test_value_that_is_not_finite_is_named_among_many() -> None:
    slave = started()
    indices, values = [slave._index[name] for name in INPUTS], [1.0] * len(INPUTS)
    values[5] = math.nan
    assert_fails(lambda: slave.set_real(indices, values), f"{INPUTS[5]} = nan")


def test_large_inputs_whose_sum_overflows_are_inputs_like_others() -> None:
    slave = started(follow_inputs=True)
    names = ("reference.snap.x", "reference.snap.y")
    slave.set_real([slave._index[name] for name in names], [1.7e308, 1.7e308])
    assert get(slave, *names) == [1.7e308, 1.7e308]


def test_value_reference_of_another_type_is_refused() -> None:
    slave = started()
    real, integer = slave._index["thrust"], slave._index["sample_count"]
    assert_fails(lambda: slave.get_real([integer]), f"[{integer}]", "Real variable")
    assert_fails(lambda: slave.get_integer([real]), f"[{real}]", "Integer variable")
    assert_fails(lambda: slave.get_boolean([real]), "Boolean variable")
    assert_fails(lambda: slave.set_boolean([real], [True]), "Boolean variable")
    assert_fails(lambda: slave.get_string([real]), "String variable", "none")
    assert_fails(lambda: slave.set_string([real], ["x"]), "String variable", "none")
    assert_fails(lambda: slave.set_real([len(UNIFIED)], [1.0]), f"[{len(UNIFIED)}]", "Real variable")


def test_virtual_control_without_a_desired_attitude_fails_as_a_divergence() -> None:
    slave = started(follow_inputs=True)
    put(slave, {"reference.acceleration.z": 20.0})
    assert_fails(lambda: slave.do_step(0.0, 0.01), "virtual control", "20.0", "expected")
    assert [message.category for message in slave.log_queue] == ["divergence"]
    assert "virtual control" in slave.log_queue[0].msg


def test_command_that_leaves_the_range_of_floats_fails_as_a_divergence() -> None:
    slave = started()
    put(slave, {"angular_velocity.x": 1e200, "angular_velocity.y": 1e200})
    assert_fails(lambda: slave.do_step(0.0, 0.01), "expected a finite value")
    assert [message.category for message in slave.log_queue] == ["divergence"]


def test_an_error_of_python_is_reported_with_its_place_in_the_first_line(monkeypatch: pytest.MonkeyPatch) -> None:
    slave = started()
    monkeypatch.setattr(slave, "_clock", None)
    with pytest.raises(Failure) as caught:
        slave.do_step(0.0, 0.01)
    first = str(caught.value).partition("\n")[0]
    assert re.fullmatch(r"AttributeError\(.*\) in controller_fmu/sampled.py, line \d+", first)


# -- state ----------------------------------------------------------------------------------------------------


def as_bytes(slave: UnifiedController) -> bytes:
    return slave._fmu_state_to_bytes(slave._get_fmu_state())


def test_tunable_parameter_that_was_set_but_not_used_is_part_of_the_state() -> None:
    slave = started(measured(0))
    put(slave, {"gain.surface": 4.0, "gain.eta": 7.0})
    other = UnifiedController(instance_name="other")
    other._set_fmu_state(json.loads(as_bytes(slave)))
    other.do_step(0.0, 0.01)
    assert command(other) == close(law(measured(0), 0.0, Gains(k_s=4.0, k_eta=7.0)))


def test_tunable_parameter_out_of_range_is_still_checked_after_a_restore() -> None:
    slave = started()
    put(slave, {"gain.surface": -4.0})
    other = UnifiedController(instance_name="other")
    other._set_fmu_state(json.loads(as_bytes(slave)))
    assert_fails(lambda: other.do_step(0.0, 0.01), "gain.surface = -4.0")


def test_state_saved_in_initialisation_mode_goes_on_from_there() -> None:
    slave = instance(measured(1), follow_inputs=False)
    slave.setup_experiment(2.0)
    slave.enter_initialization_mode()
    other = started(measured(5))
    other._set_fmu_state(json.loads(as_bytes(slave)))
    other.exit_initialization_mode()
    assert command(other) == close(law(measured(1), 2.0))


def test_outputs_follow_the_inputs_in_an_initialisation_mode_that_was_restored() -> None:
    """An instance that was stepping must forget that its inputs act at samples only."""
    slave = instance(measured(1))
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    command(slave)
    other = started(measured(5))
    other._set_fmu_state(json.loads(as_bytes(slave)))
    put(other, measured(2))
    assert command(other) == close(law(measured(2), 0.0))


def test_restore_after_a_refused_step_recovers() -> None:
    """What a master that rolls back needs."""
    slave = started(measured(0))
    saved = as_bytes(slave)
    assert_fails(lambda: slave.do_step(0.0, -1.0), "communicationStepSize")
    slave._set_fmu_state(json.loads(saved))
    slave.do_step(0.0, 0.01)
    assert command(slave) == close(law(measured(0), 0.0))


def test_warning_is_not_repeated_after_a_restore() -> None:
    slave = started(NOTHING)
    saved = as_bytes(slave)
    other = UnifiedController(instance_name="other")
    for restored in (slave, other):
        restored._set_fmu_state(json.loads(saved))
        restored.do_step(0.0, 0.01)
    assert [len(warnings(restored)) for restored in (slave, other)] == [1, 0]


def test_instances_do_not_share_values() -> None:
    first, second = started(measured(0)), started(measured(0))
    put(first, measured(5))
    first.do_step(0.0, 0.01)
    assert command(second) == close(law(measured(0), 0.0))
    assert count(second) == 0
