"""The cascade as an FMU: the turns of its loops, and what it remembers."""

import json
import math
from collections.abc import Iterable, Mapping

import pytest

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.attitude_loop import AttitudeLoop, attitude_of
from controller_fmu.cascaded.position_loop import PositionLoop
from controller_fmu.cascaded.rate_loop import RateLoop, control_rate, initial_rate_state
from controller_fmu.cascaded.slave import CascadedController
from controller_fmu.cascaded.velocity_loop import VelocityLoop, control_velocity, initial_velocity_state
from controller_fmu.vehicle import Model
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.trajectory import Trajectory
from tests.slaves import assert_initialisation_fails, get, put

COMMAND = ("thrust", "torque.x", "torque.y", "torque.z")
ONE_RATE = {"velocity_ratio": 1, "attitude_ratio": 1}


def motion(k: int) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
    """Position, velocity, attitude and angular velocity, others for each `k`."""
    return (
        Vec3(0.1 * k, 0.3, 2.0 - 0.1 * k),
        Vec3(0.5, 0.4 - 0.1 * k, 0.1),
        Quaternion.from_xyzw(0.1 * math.sin(k), 0.1 * math.cos(k), 0.05, 1.0).normalised(),
        Vec3(0.1, -0.02 * k, 0.05),
    )


def measured(k: int) -> dict[str, float]:
    names = ("position", "velocity", "quaternion", "angular_velocity")
    parts: tuple[Iterable[float], ...] = motion(k)
    return {f"{name}.{a}": x for name, v in zip(names, parts) for a, x in zip("xyzw", v)}


def instance(values: Mapping[str, float] | None = None, **ratios: int) -> CascadedController:
    slave = CascadedController(instance_name="c")
    put(slave, values or {})
    for name, ratio in ratios.items():
        slave.set_integer([slave._index[name]], [ratio])
    return slave


def started(k: int, **ratios: int) -> CascadedController:
    slave = instance(measured(k), **ratios)
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def run_steps(slave: CascadedController, steps: range, h: float = 0.01) -> list[list[float]]:
    rows = []
    for k in steps:
        put(slave, measured(k))
        slave.do_step(k * h, h)
        rows.append(
            get(slave, *COMMAND, *(f"desired_{name}.{a}" for name in ("velocity", "quaternion") for a in "xyz"))
        )
    return rows


def one_rate(count: int, h: float = 0.01) -> list[list[float]]:
    """The loops one after the other, at every sample, with no turns."""
    frame, model = Airframe(), Model()
    velocity_state, rate_state = initial_velocity_state(motion(0)[1]), initial_rate_state(motion(0)[3])
    rows = []
    for k in range(count):
        P, V, Q, omega = motion(k)
        Q, reference, elapsed = Q.unit(), Trajectory().at(k * h), k * h - max(0, k - 1) * h
        desired = PositionLoop().velocity(P, reference.position, reference.velocity)
        force, velocity_state = control_velocity(
            VelocityLoop(), velocity_state, V, desired, reference.acceleration, elapsed, model, frame.full_thrust
        )
        Q_d = attitude_of(force, 0.0)
        rate = AttitudeLoop().angular_velocity(Q, Q_d, 0.0)
        torque, rate_state = control_rate(RateLoop(), rate_state, omega, rate, elapsed, model.inertia, frame)
        rows.append([force.norm(), *torque, *desired, *Q_d.vector])
    return rows


def test_with_ratios_of_one_it_is_the_cascade_of_one_rate_to_the_bit() -> None:
    assert run_steps(started(0, **ONE_RATE), range(50)) == one_rate(50)


def test_each_loop_runs_when_its_turn_is_and_its_results_are_held() -> None:
    slave = started(0, velocity_ratio=6, attitude_ratio=2)
    found: dict[str, list[object]] = {"desired_velocity": [], "desired_angular_velocity": [], "torque": []}
    for k in range(24):
        run_steps(slave, range(k, k + 1))
        for name, values in found.items():
            values.append(get(slave, *(f"{name}.{a}" for a in "xyz")))
    changes = {name: [k for k in range(1, 24) if values[k] != values[k - 1]] for name, values in found.items()}
    assert changes == {
        "desired_velocity": [6, 12, 18],
        "desired_angular_velocity": [*range(2, 24, 2)],
        "torque": [*range(1, 24)],
    }


def test_where_nothing_moves_between_their_turns_slower_loops_are_those_of_one_rate() -> None:
    """Outer loops at every third sample of h are those at every sample of 3 h."""
    slow, fast = started(0, **ONE_RATE), started(0, velocity_ratio=3, attitude_ratio=3)
    for k in range(10):
        put(slow, measured(k))
        slow.do_step(k * 0.03, 0.03)
        for i in range(3):
            put(fast, measured(k))
            fast.do_step(k * 0.03 + i * 0.01, 0.01)
        for name in ("desired_velocity", "velocity_integral", "desired_quaternion", "desired_angular_velocity"):
            names = [f"{name}.{a}" for a in "xyz"]
            assert get(fast, *names) == pytest.approx(get(slow, *names), rel=1e-12, abs=1e-15)


def test_the_outputs_after_initialisation_are_those_of_the_first_sample_and_nothing_is_remembered() -> None:
    slave = started(3)
    initial = get(slave, *COMMAND)
    assert get(slave, "velocity_integral.x", "rate_integral.x") == [0.0, 0.0]
    slave.do_step(0.0, 0.01)
    assert get(slave, *COMMAND) == initial
    other = started(5)
    assert run_steps(other, range(3, 6)) == run_steps(started(3), range(3, 6))


def test_a_sample_without_measurement_is_no_run() -> None:
    slave = started(0, **ONE_RATE)
    put(slave, dict.fromkeys((f"quaternion.{a}" for a in "xyzw"), 0.0))
    slave.do_step(0.0, 0.01)
    assert get(slave, *COMMAND) == [9.81, 0.0, 0.0, 0.0]
    assert run_steps(slave, range(1, 5)) == run_steps(started(1, **ONE_RATE), range(1, 5))


@pytest.mark.parametrize("k", [0, 1, 7])
def test_a_saved_state_goes_on_to_the_same_bits_in_another_instance(k: int) -> None:
    ratios = {"velocity_ratio": 5, "attitude_ratio": 2}
    slave = started(0, **ratios)
    run_steps(slave, range(k))
    state = json.loads(json.dumps(slave._get_fmu_state()))
    expected = run_steps(slave, range(k, k + 12))
    other = CascadedController(instance_name="other")
    other._set_fmu_state(state)
    assert run_steps(other, range(k, k + 12)) == expected
    slave._set_fmu_state(state)
    assert run_steps(slave, range(k, k + 12)) == expected


def test_a_run_that_is_initialised_anew_remembers_nothing_of_the_one_before() -> None:
    slave = started(0)
    expected = run_steps(started(0), range(30))
    begun = slave._get_fmu_state()
    run_steps(slave, range(25))
    slave._set_fmu_state(begun)
    slave.initialise(0.0)
    slave._clock.next_index = 0
    assert run_steps(slave, range(30)) == expected


def test_parameters_that_make_no_cascade_are_refused() -> None:
    assert_initialisation_fails(
        instance({"limit.thrust.least": 0.6, "limit.thrust.most": 0.5}), "limit.thrust.least = 0.6", "0.5"
    )
    assert_initialisation_fails(instance(velocity_ratio=0), "velocity_ratio = 0", "a whole number >= 1")
    assert_initialisation_fails(instance({"cutoff.rate_derivative": 0.0}), "cutoff.rate_derivative = 0.0", "> 0")
    assert_initialisation_fails(instance({"limit.tilt": 1.56}), "limit.tilt = 1.56", "<= 1.55334")
