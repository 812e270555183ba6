"""Redesigns and prediction in the FMU of a controller: reference inputs, hold period, and where they warn or fail."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from controller_fmu.geometric.slave import GeometricController
from controller_fmu.redesign.controller import RedesignedController
from controller_fmu.redesign.interface import Discretisation
from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.trajectory import Trajectory
from tests.slaves import assert_fails, get, put

COMMAND = ("thrust", "torque.x", "torque.y", "torque.z")
AT = {
    **{"position.x": 0.4, "position.y": -0.3, "position.z": 2.2, "velocity.x": 0.5, "velocity.y": 0.2},
    **{"quaternion.x": 0.1, "quaternion.y": 0.05, "quaternion.z": -0.1, "quaternion.w": 1.0},
    **{"angular_velocity.x": 0.3, "angular_velocity.y": -0.2, "angular_velocity.z": 0.1},
}
H = 0.01
DIRECT = [
    (UnifiedController, Discretisation.MIDPOINT, 0.0),
    (UnifiedController, Discretisation.MEAN, 0.0),
    (UnifiedController, Discretisation.EXPLICIT, 1.0),
    (UnifiedController, Discretisation.SEMI_IMPLICIT, 1.0),
    (UnifiedController, Discretisation.MEAN, 1.0),
    (GeometricController, Discretisation.MEAN, 0.0),
    (GeometricController, Discretisation.EXPLICIT, 1.0),
]
"""Law, redesign, and the delay that is predicted over, in hold periods: all of them look beyond the sample."""
MINIMISED = (UnifiedController, Discretisation.MATCH, 0.0)
"""Its thrust is as near as the iterations come to the minimum, which hides what is of third order."""


def begun(law: type[RedesignedController], values: Mapping[str, float], kind: Discretisation) -> RedesignedController:
    slave = law(instance_name="c")
    put(slave, values)
    slave.set_integer([slave._index["discretisation"]], [kind])
    slave.setup_experiment(1.0)
    slave.enter_initialization_mode()
    return slave


def stepped(slave: RedesignedController, times: list[float] | None = None) -> np.ndarray:
    """The command that is held after steps at these times, of length H but for what is left to the next."""
    slave.exit_initialization_mode()
    times = [1.0] if times is None else times
    for t, end in zip(times, [*times[1:], times[-1] + H]):
        slave.do_step(t, H if math.isclose(end - t, H) else end - t)
    return np.array(get(slave, *COMMAND))


def differences(
    law: type[RedesignedController], kind: Discretisation, periods: float, T: float, **trajectory: float
) -> tuple[float, float]:
    """In thrust and in torque, with the reference by inputs and by the built-in trajectory."""
    shape = {f"trajectory.{name}": value for name, value in trajectory.items()}
    values = {**AT, **shape, "sample_period": 0.0, "hold_period": T, "prediction": periods * T}
    by_inputs = begun(law, values, kind)
    now = Trajectory(**trajectory).at(1.0)
    for name in ("position", "velocity", "acceleration", "jerk", "snap"):
        put(by_inputs, {f"reference.{name}.{axis}": x for axis, x in zip("xyz", getattr(now, name))})
    by_inputs.set_boolean([by_inputs._index["use_reference_inputs"]], [True])
    difference = stepped(by_inputs) - stepped(begun(law, values, kind))
    return abs(difference[0]), float(np.linalg.norm(difference[1:]))


@pytest.mark.parametrize(("law", "kind", "periods"), DIRECT)
def test_a_reference_by_inputs_goes_on_as_its_series_to_snap(
    law: type[RedesignedController], kind: Discretisation, periods: float
) -> None:
    """Beyond it snap, and with it torque, is wrong in first order of the time; acceleration, and thrust, in third."""
    long, short = (differences(law, kind, periods, T, frequency=0.8) for T in (0.01, 0.005))
    orders = [math.log2(one / other) for one, other in zip(long, short)]
    assert orders == pytest.approx([3.0, 1.0], abs=0.3)


@pytest.mark.parametrize(("law", "kind", "periods"), [*DIRECT, MINIMISED])
def test_a_reference_by_inputs_that_is_its_series_gives_what_the_built_in_trajectory_gives(
    law: type[RedesignedController], kind: Discretisation, periods: float
) -> None:
    found = differences(law, kind, periods, 0.2, amplitude_x=0.0, amplitude_y=0.0, rate_z=0.7)
    assert found == pytest.approx((0.0, 0.0), abs=1e-7 if kind == Discretisation.MATCH else 1e-11)


@pytest.mark.parametrize("kind", Discretisation)
def test_the_hold_period_is_what_is_set_else_the_sample_period_else_the_step(kind: Discretisation) -> None:
    by_hand, by_clock, by_step, of_another = (
        stepped(begun(UnifiedController, {**AT, "hold_period": hold, "sample_period": clock}, kind)).tolist()
        for hold, clock in [(H, 0.05), (0.0, H), (0.0, 0.0), (0.05, H)]
    )
    assert by_hand == by_clock == by_step
    assert (by_hand == of_another) == (kind == Discretisation.EXPLICIT)


def test_a_hold_period_that_is_too_short_fails_by_name() -> None:
    slave = begun(UnifiedController, {**AT, "hold_period": 1e-10}, Discretisation.MEAN)
    assert_fails(slave.exit_initialization_mode, "hold_period = 1e-10", "0 or at least 1e-09 s")


def test_with_prediction_and_no_measurement_it_hovers_and_warns_once() -> None:
    values = {"quaternion.w": 0.0, "prediction": 0.03, "sample_period": 0.0}
    slave = begun(UnifiedController, values, Discretisation.MEAN)
    assert stepped(slave, [1.0, 1.01, 1.02]).tolist() == pytest.approx([9.81, 0.0, 0.0, 0.0])
    assert [message.msg for message in slave.log_queue] == [
        "quaternion = (0, 0, 0, 0): no measurement, commanding hover thrust and no torque"
    ]


def test_the_predictor_takes_samples_that_are_late_when_they_are() -> None:
    """The command of 1.013 acts from 1.043 on, independent of the period."""
    values = {**AT, "prediction": 0.03, "sample_period": 0.0}
    on_time, late = (begun(UnifiedController, values, Discretisation.EXPLICIT) for _ in range(2))
    commands = [stepped(slave, [1.0, t, 1.02]) for slave, t in ((on_time, 1.01), (late, 1.013))]
    assert [sent.time for sent in late._pending[-3:]] == [1.0, 1.013, 1.02]
    assert np.abs(commands[0] - commands[1]).max() > 1e-3


def test_more_commands_on_their_way_than_are_remembered_fail_with_the_largest_delay() -> None:
    slave = begun(UnifiedController, {**AT, "prediction": 0.335, "sample_period": 0.0}, Discretisation.EXPLICIT)
    stepped(slave, [1.0 + H * k for k in range(32)])
    assert_fails(lambda: slave.do_step(1.32, H), "prediction = 0.335", "at most 0.32 s", "32 commands")
