"""Each objective of the quadrotor against a signal of which it is known in closed form, or computed another way."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from orchestration.foundation.recording.recording import Chunk, Event, Events, InMemory
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.quadrotor.scenarios.wiring import COMMAND, POSITION
from orchestration.simulation.results import objectives
from orchestration.simulation.results.objectives import Metrics
from orchestration.systems.system.choices import Hold
from orchestration.systems.system.connection import variable_of
from orchestration.systems.system.paths import changed
from plant_fmu.actuators import Channels, Motors
from tests.orchestration.quadrotor.scenarios.named_signals import scalars_beyond_exchanged

Array = npt.NDArray[np.float64]

TIME = np.linspace(0.0, 3.0, 3001)
ATTITUDE_ERROR_SCALAR = "attitude_error.w"


def attitude(scalar: Array) -> dict[str, Any]:
    """The scalar part of the attitude error, for `measured`."""
    return {ATTITUDE_ERROR_SCALAR: scalar}


def measured(
    error: Array | float = 0.0,
    *,
    t: Array = TIME,
    planned: float | None = None,
    command: dict[str, Array] | None = None,
    sampled: Array | None = None,
    arrived: Array | None = None,
    hold: Hold = "zero",
    thrust_max: float = math.inf,
    torque_max: float = math.inf,
    motor_max: float = 0.0,
    divergence_time: float | None = None,
    **others: Array,
) -> Metrics:
    """The metrics of a flight whose position error has this norm, spread over the axes as 2:-3:6.

    `others`: what the plant measures, or objectives name, beside position, command and limits, without its component, a
    vector by its parts, as `**{"acceleration.x": …}`; default: 1.
    """
    zero = np.zeros(len(t))
    desired = np.column_stack([zero + 1.0, zero - 2.0, 0.1 * t])
    position = desired + np.outer(zero + error, np.array([2.0, -3.0, 6.0]) / 7.0)
    motors = {"thrust_max": motor_max, "thrust_min": 0.1, "arm.x": 0.2, "arm.y": 0.1, "drag_to_thrust": 0.02}
    limits = {"plant.thrust_max": thrust_max, "plant.thrust_min": 0.0, "plant.torque_max": torque_max}
    limits |= {f"plant.motor.{name}": value for name, value in motors.items()}
    exchanged = [f"plant.{name}" for name in wiring.MEASUREMENT if name not in POSITION]
    named = [*exchanged, *(name for name in scalars_beyond_exchanged() if name not in limits)]
    unknown = others.keys() - set(map(variable_of, named))
    assert unknown == set(), f"{unknown}: expected some of {named}, without components"
    signals = {
        "time": t,
        **{f"plant.{name}": position[:, i] for i, name in enumerate(POSITION)},
        **{f"plant.{name}": (command or {}).get(name, zero) for name in COMMAND},
        **{name: others.get(variable_of(name), zero + 1.0) for name in named},
        **{name: desired[:, i] for i, name in enumerate(wiring.POSITION_REFERENCE)},
    }
    marks = {"sampled": (sampled, "measurement"), "arrived": (arrived, "command")}
    events = [
        Event(round(time * 1e9), kind, what, 0)
        for kind, (rows, what) in marks.items()
        for time in t[np.ones(len(t), dtype=bool) if rows is None else rows.astype(bool)]
    ]
    end = float(t[-1])
    system = changed(quadrotor(), {"stop_time": planned or end or 1.0, "connections.command.hold": hold})
    recording, columns = InMemory(), tuple(signals)
    recording.begin(columns)
    recording.take(Chunk(columns=columns, rows=np.column_stack([*signals.values()]), events=Events.of(sorted(events))))
    return objectives.compute(
        system,
        lambda: objectives.spans(system, recording, limits, end, None),
        end=end,
        divergence_time=divergence_time,
        steps=0,
    )


# -- position ---------------------------------------------------------------------------------------------


def test_a_decaying_error_has_the_integrals_of_an_exponential() -> None:
    m = measured(np.exp(-TIME))
    end = math.exp(-3.0)
    assert m["position_iae"] == pytest.approx(1.0 - end, rel=1e-6)
    assert m["position_itae"] == pytest.approx(1.0 - end * 4.0, rel=1e-6)
    assert m["position_rmse"] == pytest.approx(math.sqrt((1.0 - end**2) / 2.0 / 3.0), rel=1e-6)
    assert m["position_max"] == pytest.approx(1.0)
    assert m["ultimate_bound"] == pytest.approx(math.exp(-2.0), rel=1e-3)
    assert m["settling_time"] == pytest.approx(math.log(1.0 / 0.05), abs=1e-3)


uneven = arrays(np.float64, st.integers(2, 30), elements=st.floats(1e-3, 1.0)).map(np.cumsum)


@given(uneven, st.data())
def test_integrals_are_the_trapezoid_rule_on_any_rows(t: Array, data: st.DataObject) -> None:
    e = data.draw(arrays(np.float64, len(t), elements=st.floats(0.0, 10.0)))
    m, span = measured(e, t=t), t[-1] - t[0]
    slices = list(zip(t, t[1:], e, e[1:], strict=False))
    assert m["position_iae"] == pytest.approx(sum((b - a) * (x + y) / 2 for a, b, x, y in slices), abs=1e-12)
    assert m["position_itae"] == pytest.approx(sum((b - a) * (a * x + b * y) / 2 for a, b, x, y in slices), abs=1e-12)
    squares = sum((b - a) * (x * x + y * y) / 2 for a, b, x, y in slices)
    assert m["position_rmse"] == pytest.approx(math.sqrt(squares / span), abs=1e-7)


@pytest.mark.parametrize("fault", [0.06, 1.0])
def test_the_ultimate_bound_is_the_largest_error_of_the_last_third(fault: float) -> None:
    bump = np.where(np.abs(TIME - 2.0005) < 1e-3, fault, 0.01)
    assert measured(bump)["ultimate_bound"] == pytest.approx(fault)
    early = np.where(np.abs(TIME - 1.99) < 1e-3, fault, 0.01)
    assert measured(early)["ultimate_bound"] == pytest.approx(0.01)


# -- what became of it ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("error", "outcome"), [(0.0499, "settled"), (0.0501, "bounded"), (80.0, "bounded")])
def test_the_outcome_is_settled_below_5_cm_in_the_last_third_and_else_bounded(error: float, outcome: str) -> None:
    found = measured(np.where(TIME < 1.9, 1.0, error))
    assert (found["outcome"], found["horizon"], found["ultimate_bound"]) == (outcome, 3.0, pytest.approx(error))
    assert found["good"] is (outcome == "settled")


def test_a_diverged_run_has_no_metric_that_depends_on_its_duration() -> None:
    found = measured(0.01, divergence_time=2.5)
    assert {name: value for name, value in found.items() if value is not None} == {
        "outcome": "diverged", "good": False, "horizon": 3.0, "diverged": True, "divergence_time": 2.5, "steps": 0,
    }  # fmt: skip


def test_the_last_third_of_an_interrupted_run_is_that_of_its_rows() -> None:
    found = measured(np.where(TIME < 1.9, 1.0, 0.2), planned=30.0)
    assert (found["outcome"], found["horizon"], found["ultimate_bound"]) == ("bounded", 3.0, pytest.approx(0.2))


# -- settling ---------------------------------------------------------------------------------------------


def test_an_error_that_stays_small_settles_at_the_start() -> None:
    assert measured(0.049)["settling_time"] == 0.0


def test_an_error_that_is_large_at_the_end_never_settles() -> None:
    assert measured(0.051)["settling_time"] is None
    assert measured(np.where(TIME > 2.9995, 0.06, 0.0))["settling_time"] is None


# -- attitude and energy, at samples ----------------------------------------------------------------------


def test_the_attitude_error_is_the_angle_of_the_rotation_at_samples() -> None:
    angle = np.array([0.3, 3.0, 0.4, 3.0, 0.0])
    scalar = np.cos(angle / 2) * np.array([1, 1, -1, 1, 1])  # q and -q are one attitude
    m = measured(t=np.arange(5.0), sampled=np.array([1, 0, 1, 0, 1]), **attitude(scalar))
    assert m["attitude_error_max"] == pytest.approx(0.4)
    assert m["attitude_error_rmse"] == pytest.approx(math.sqrt((0.09 + 0.16) / 3))


def test_a_scalar_part_that_rounding_made_too_large_is_no_error() -> None:
    m = measured(t=np.arange(2.0), **attitude(np.array([1.0 + 1e-15, -1.0 - 1e-15])))
    assert (m["attitude_error_rmse"], m["attitude_error_max"]) == (0.0, 0.0)


def test_energy_growth_is_the_share_of_the_steps_from_sample_to_sample_that_grow() -> None:
    energy = np.array([5.0, 9.0, 4.0, 0.0, 4.5, 9.0, 4.5, 0.0, 3.0, 0.0])  # at samples: 5 4 4.5 4.5 3
    m = measured(t=np.arange(10.0), sampled=np.arange(10) % 2 == 0, energy=energy)
    assert m["energy_growth_share"] == pytest.approx(1 / 4)
    assert measured(t=np.arange(10.0), energy=np.arange(10.0))["energy_growth_share"] == 1.0


def test_what_goes_up_and_down_once_settled_is_no_growth_of_energy() -> None:
    settled = np.where(TIME < 0.5, 7.0 * (1.0 - TIME), 1e-3 * (2.0 + np.sin(900.0 * TIME)))
    assert measured(energy=settled)["energy_growth_share"] == 0.0
    assert measured(energy=settled + np.where(TIME > 2.0, TIME - 2.0, 0.0))["energy_growth_share"] > 0.3


@pytest.mark.parametrize("every", [1, 10, 50])
def test_energy_growth_does_not_depend_on_how_often_it_is_looked_at(every: int) -> None:
    rising_for_a_third = np.exp(-np.abs(TIME - 1.0))
    share = measured(sampled=np.arange(len(TIME)) % every == 0, energy=rising_for_a_third)["energy_growth_share"]
    assert share == pytest.approx(1 / 3, abs=0.01)


def test_what_is_taken_at_samples_is_none_without_any() -> None:
    values = np.ones(3)
    m = measured(t=np.arange(3.0), sampled=np.zeros(3), energy=values, **attitude(values))
    assert m["attitude_error_rmse"] is m["attitude_error_max"] is m["energy_growth_share"] is None


# -- commands ---------------------------------------------------------------------------------------------


def test_control_effort_is_the_integral_of_the_squares() -> None:
    sine = {
        "thrust": 2.0 + 0.0 * TIME,
        "torque.x": np.sin(TIME),
        "torque.y": np.cos(TIME),
        "torque.z": 2.0 + 0.0 * TIME,
    }
    m = measured(command=sine)
    assert m["control_effort.thrust"] == pytest.approx(12.0)
    assert m["control_effort.torque"] == pytest.approx(5.0 * 3.0)
    assert m["torque_max"] == pytest.approx(math.sqrt(5.0))


def test_a_command_that_is_held_counts_until_the_next_row() -> None:
    steps = {"thrust": np.array([2.0, 3.0, 1.0, 9.0]), "torque.y": np.array([0.0, 4.0, 0.0, 9.0])}
    m = measured(t=np.array([0.0, 1.0, 1.5, 4.0]), command=steps)
    assert m["control_effort.thrust"] == pytest.approx(4.0 * 1.0 + 9.0 * 0.5 + 1.0 * 2.5)
    assert m["control_effort.torque"] == pytest.approx(16.0 * 0.5)


def extrapolated(points: int) -> Metrics:
    """Commands 0, 1, 0 that arrive at 0, 1 and 2 s of 3 s, on the lines through the last two: up, then down."""
    t = np.linspace(0.0, 3.0, 3 * points + 1)
    line = np.select([t < 1.0, t < 2.0], [0.0 * t, t], 2.0 - t)
    return measured(t=t, command={"thrust": line}, arrived=np.arange(len(t)) % points == 0, hold="first")


@pytest.mark.parametrize("points", [1, 2, 7, 50])
def test_with_first_order_hold_commands_count_along_their_line_whatever_the_plant_interval(points: int) -> None:
    m = extrapolated(points)  # from 1 up to 2, down at once to 0, and on to -1
    assert m["total_variation.thrust"] == pytest.approx(1.0 + 1.0 + 2.0 + 1.0)
    assert m["control_effort.thrust"] == pytest.approx(7.0 / 3.0 + 1.0 / 3.0)


def test_until_the_second_command_there_is_no_line_to_follow() -> None:
    t, arrived = np.arange(6.0), np.array([0, 0, 1, 0, 0, 0])
    command = {"thrust": np.array([1.0, 1.0, 2.0, 2.5, 3.0, 3.5])}  # the first one is that of the initialisation
    m = measured(t=t, command=command, arrived=arrived, hold="first")
    assert m["total_variation.thrust"] == pytest.approx(2.5)
    assert m["control_effort.thrust"] == pytest.approx(2.0 + (3.5**3 - 2.0**3) / 3.0 / 0.5)


def test_total_variation_is_the_sum_of_all_changes() -> None:
    t = np.arange(5.0)
    command = {
        "thrust": np.array([1.0, 3.0, 3.0, 2.0, 2.5]),
        "torque.x": np.array([0.0, -1.0, 0.0, 0.0, 0.0]),
        "torque.z": np.array([0.0, 0.0, 0.0, 4.0, 4.0]),
    }
    m = measured(t=t, command=command)
    assert m["total_variation.thrust"] == pytest.approx(2.0 + 1.0 + 0.5)
    assert m["total_variation.torque"] == pytest.approx(2.0 + 4.0)


Limited = Callable[[Array], dict[str, Array]]


@pytest.mark.parametrize(
    "command",
    [
        lambda active: {"thrust": np.where(active, 21.0, 20.0)},
        lambda active: {"thrust": np.where(active, -0.1, 0.0)},
        lambda active: {"torque.x": np.where(active, 3.1, 3.0)},
        lambda active: {"torque.y": np.where(active, -3.1, -3.0)},
        lambda active: {"torque.z": np.where(active, 9.0, 0.0), "thrust": np.where(active, 30.0, 1.0)},
    ],
    ids=["thrust above", "thrust below", "torque above", "torque below", "both"],
)
def test_saturation_is_the_share_of_time_beyond_a_limit(command: Limited) -> None:
    t = np.array([0.0, 1.0, 1.5, 4.0, 5.0])
    active = np.array([False, True, False, True, True])  # each until the next row: 0.5 s and 1 s of 5 s
    m = measured(t=t, command=command(active), thrust_max=20.0, torque_max=3.0)
    assert m["saturation_share"] == pytest.approx(1.5 / 5.0)


@pytest.mark.parametrize("beyond", ["above", "below"])
@pytest.mark.parametrize("motor", range(4))
def test_saturation_is_seen_of_every_motor(motor: int, beyond: str) -> None:
    """One of the four asked for a little more than it can give, or a little less than it must."""
    motors = Motors(thrust_max=4.0, thrust_min=0.1, arm_x=0.2, arm_y=0.1, drag_to_thrust=0.02)
    t, thrusts = np.array([0.0, 1.0, 2.0, 3.0]), [1.0, 1.5, 2.0, 0.9]
    thrusts[motor] = 4.0 if beyond == "above" else 0.1
    edge = np.array([thrusts[motor] + (-1e-9 if beyond == "above" else 1e-9)] * 4)
    edge[1] += 2e-9 if beyond == "above" else -2e-9  # for 1 s of 3 s
    asked = motors.wrench(Channels(*(edge if i == motor else thrust for i, thrust in enumerate(thrusts))))
    command = dict(zip(COMMAND, (asked.thrust + 0.0 * t, *(torque + 0.0 * t for torque in asked.torque)), strict=True))
    assert measured(t=t, command=command, motor_max=4.0)["saturation_share"] == pytest.approx(1.0 / 3.0)
    assert measured(t=t, command=command)["saturation_share"] == 0.0


def test_a_command_at_its_limit_is_not_beyond_it() -> None:
    command: dict[str, Any] = {"thrust": np.where(TIME < 1.0, 0.0, 20.0), "torque.x": np.where(TIME < 2.0, -3.0, 3.0)}
    assert measured(command=command, thrust_max=20.0, torque_max=3.0)["saturation_share"] == 0.0


def test_a_run_of_one_row_has_finite_metrics() -> None:
    m = measured(0.7, t=np.array([0.0]), energy=np.array([1.0]), **attitude(np.array([1.0])))
    assert (m["position_rmse"], m["position_max"], m["ultimate_bound"]) == (pytest.approx(0.7),) * 3
    assert (m["position_iae"], m["saturation_share"], m["settling_time"]) == (0.0, 0.0, None)
    assert all(math.isfinite(value) for value in m.values() if isinstance(value, float))


def test_metrics_are_plain_numbers_of_python() -> None:
    m = measured(0.1, energy=TIME, **attitude(np.ones(len(TIME))))
    assert {type(value) for value in m.values()} <= {float, int, bool, str, type(None)}
