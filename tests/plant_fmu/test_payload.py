"""A payload that is let go: the velocity goes on, the acceleration jumps, and the time is kept whatever the step."""

import numpy as np
import pytest

from plant_fmu.payload import Payload
from tests.plant_fmu.test_slave import LEVEL, MOTION, MOVING, NO_WIND, VELOCITY, close, run_steps, started
from tests.slaves import get, put

ACCELERATION = ("acceleration.x", "acceleration.y", "acceleration.z")
LOAD = {"payload.mass": 0.5, "payload.drop_time": 0.1037}
PUSHED = {"thrust": 12.0, "torque.x": 0.4, "torque.z": -0.2, "external_force.y": 0.7}


def test_a_payload_is_carried_until_its_time_and_for_ever_without_one() -> None:
    payload = Payload(mass=0.5, drop_time=2.0)
    assert [payload.carried(t) for t in (0.0, 1.999999, 2.0 - 1e-10, 2.0, 3.0)] == [0.5, 0.5, 0.0, 0.0, 0.0]
    assert Payload(mass=0.5).carried(1e6) == 0.5


def test_a_step_is_split_where_the_drop_is_inside_of_it_only() -> None:
    payload = Payload(mass=0.5, drop_time=2.0)
    assert payload.until_drop(1.99, 0.02) == pytest.approx(0.01)
    for t in (0.0, 1.98, 2.0 - 1e-10, 2.0, 1.98 + 1e-10):
        assert payload.until_drop(t, 0.02) == 0.0
    assert Payload(mass=0.0, drop_time=2.0).until_drop(1.99, 0.02) == 0.0
    assert Payload(mass=0.5).until_drop(0.0, 1.0) == 0.0


def test_without_a_payload_its_time_changes_no_bit() -> None:
    simulated = []
    for load in ({}, {"payload.drop_time": 0.1037}):
        slave = started({**MOVING, **PUSHED, **load})
        run_steps(slave, 0.01, 20)
        simulated.append(get(slave, *MOTION, *ACCELERATION))
    assert simulated[0] == simulated[1]


@pytest.mark.parametrize("h", [0.001, 0.01, 0.03, 0.3])
def test_along_a_line_the_velocity_is_the_sum_of_both_parts(h: float) -> None:
    slave = started({**LEVEL, **NO_WIND, **LOAD, "thrust": 12.0})
    run_steps(slave, h, round(0.3 / h))
    (speed,) = get(slave, "velocity.z")
    expected = (9.81 - 12.0 / 1.5) * 0.1037 + (9.81 - 12.0) * (0.3 - 0.1037)
    assert speed == pytest.approx(expected, rel=0.0, abs=1e-13)


def test_a_step_over_the_drop_is_a_step_to_it_and_one_from_it() -> None:
    whole, parts = (started({**MOVING, **PUSHED, **LOAD}) for _ in range(2))
    run_steps(whole, 0.11, 1)
    assert parts.do_step(0.0, 0.1037)
    assert parts.do_step(0.1037, 0.11 - 0.1037)
    assert get(whole, *MOTION, *ACCELERATION) == close(get(parts, *MOTION, *ACCELERATION), 1e-14)


def test_at_the_drop_the_velocity_goes_on_and_the_acceleration_jumps_by_the_formula() -> None:
    slave = started({**MOVING, **PUSHED, **LOAD, **NO_WIND})
    assert slave.do_step(0.0, 0.1037 - 1e-6)
    velocity, acceleration = np.array(get(slave, *VELOCITY)), np.array(get(slave, *ACCELERATION))
    assert slave.do_step(0.1037 - 1e-6, 1e-6)
    after = np.array(get(slave, *ACCELERATION))
    assert np.array(get(slave, *VELOCITY)) == pytest.approx(velocity + 1e-6 * acceleration, abs=1e-9)
    forces = 1.5 * (acceleration - [0.0, 0.0, 9.81])  # of thrust and external force: they go on
    assert after - acceleration == pytest.approx(forces * (1.0 / 1.0 - 1.0 / 1.5), abs=1e-4)


def test_a_payload_adds_to_the_mass_and_not_to_the_inertia() -> None:
    heavy, loaded = (started({**MOVING, **PUSHED, **load}) for load in ({"mass": 1.5}, {"payload.mass": 0.5}))
    for slave in (heavy, loaded):
        run_steps(slave, 0.01, 20)
    assert get(heavy, *MOTION) == get(loaded, *MOTION)


def test_a_payload_can_be_let_go_between_two_steps() -> None:
    slave = started({**LEVEL, **NO_WIND, "payload.mass": 0.5, "thrust": 15.0 * 0.981})
    run_steps(slave, 0.1, 1)
    assert get(slave, "velocity.z") == close([0.0])
    put(slave, {"payload.mass": 0.0})
    run_steps(slave, 0.1, 1, start=0.1)
    assert get(slave, "velocity.z") == close([-0.1 * 0.5 * 9.81])
