"""Communication steps of any length: samples keep their times, and the plant is where it should be."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from hypothesis.stateful import run_state_machine_as_test as run_machine

from tests.extent import tries
from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.instance import Instance

# -- as tools take them ---------------------------------------------------------------------------------


def test_time_that_is_off_by_1e_12_hardly_moves_the_plant(plant: Instance) -> None:
    arrived = []
    for error in (0.0, 1e-12):
        plant.fmu.reset()
        plant.initialise({"wind.amplitude.x": 2.0, "wind.frequency": 3.0, "torque.y": 0.3})
        for k in range(100):
            plant.step(k * 0.01 + error, 0.01)
        arrived.append(plant.get(*plant.names("output", "local")))
    assert arrived[0] == pytest.approx(arrived[1], abs=1e-11)


def test_last_step_of_1e_13_s_adds_no_sample_and_hardly_moves_the_plant(controller: Instance, plant: Instance) -> None:
    controller.initialise(MEASUREMENT)
    plant.initialise({"torque.x": 0.3})
    for k in range(10):  # the last one stops short of 0.1 s
        h = 0.01 if k < 9 else 0.01 - 1e-13
        controller.step(k * 0.01, h)
        plant.step(k * 0.01, h)
    before = plant.get(*plant.names("output"))
    plant.step(0.1 - 1e-13, 1e-13)
    assert plant.get(*plant.names("output")) == pytest.approx(before, abs=1e-11)
    assert plant.get(*plant.names("output")) != before
    for t in (0.1 - 1e-13, 0.1, 0.1 + 1e-13):  # the same due time, three times
        controller.step(t, 1e-13)
        assert controller.value("sample_count") == 11
        assert controller.get(*COMMAND) == pytest.approx(law_command(0.1), rel=1e-9)


@pytest.mark.parametrize("start", [5.0, -2.0, 1e4])
def test_the_plant_starts_at_any_time(start: float, plant: Instance) -> None:
    plant.initialise({"wind.amplitude.x": 2.0, "wind.frequency": 3.0}, start=start)
    assert plant.get("wind.force.x") == pytest.approx([2.0 * math.cos(3.0 * start)], rel=1e-12)
    plant.step(start, 0.01)
    assert plant.get("wind.force.x") == pytest.approx([2.0 * math.cos(3.0 * (start + 0.01))], rel=1e-12)


# -- any sequence of them -------------------------------------------------------------------------------

MS, TINY = 0.001, 1e-13
MILLISECONDS = st.integers(1, 25)


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Where a controller must be, by whole milliseconds, while its master adds up floats."""

    period: int
    offset: int
    now: int
    t: float
    due: int
    measurement: Mapping[str, float]
    command: list[float]
    count: int = 0

    @classmethod
    def started(cls, period: int, offset: int, start: int) -> "Expected":
        """After initialisation at `start` with `MEASUREMENT`."""
        periods = max(0, math.ceil((start - offset) / period))
        return cls(
            period=period,
            offset=offset,
            now=start,
            t=start * MS,
            due=offset + periods * period,
            measurement=MEASUREMENT,
            command=law_command(start * MS),
        )

    def stepped(self, ms: int, h: float) -> "Expected":
        """After a step of `h` [s], which is `ms` but for what no clock should notice."""
        after = replace(self, now=self.now + ms, t=self.t + h)
        if self.now < self.due:
            return after
        return replace(
            after,
            due=self.offset + ((self.now - self.offset) // self.period + 1) * self.period,
            command=law_command(self.t, self.measurement),
            count=self.count + 1,
        )


class AnyMaster(RuleBasedStateMachine):
    """Steps as it likes, goes back to where it has been, starts again: samples stay at the due times."""

    def __init__(self, controller: Instance) -> None:
        super().__init__()
        self.controller = controller
        self.saved: tuple[bytes, Expected] | None = None

    @initialize(period=MILLISECONDS, offset=st.integers(0, 25), start=st.integers(0, 60))
    def begin(self, period: int, offset: int, start: int) -> None:
        self.expected = Expected.started(period, offset, start)
        clock = {"sample_period": period * MS, "sample_offset": offset * MS}
        self.controller.fmu.reset()
        self.controller.initialise({**MEASUREMENT, **clock}, start=start * MS)

    @rule(down=st.floats(-5.0, 5.0))
    def measure(self, down: float) -> None:
        measurement = {**MEASUREMENT, "position.z": down}
        self.controller.set({**measurement, "velocity.x": down})
        self.controller.set(measurement)
        self.expected = replace(self.expected, measurement=measurement)

    @rule(ms=MILLISECONDS)
    def step(self, ms: int) -> None:
        self._step(ms, ms * MS)

    @rule(ms=MILLISECONDS)
    def stop_short_and_make_up_for_it(self, ms: int) -> None:
        self._step(ms, ms * MS - TINY)
        self._step(0, TINY)

    @rule()
    def hardly_step(self) -> None:
        self._step(0, TINY)

    @rule()
    def save(self) -> None:
        self.saved = (self.controller.save(), self.expected)

    @precondition(lambda self: self.saved is not None)
    @rule()
    def go_back(self) -> None:
        assert self.saved is not None
        content, self.expected = self.saved
        self.controller.restore(content)

    @invariant()
    def the_command_is_that_of_the_last_due_time(self) -> None:
        assert self.controller.get(*COMMAND) == pytest.approx(self.expected.command, rel=1e-12)
        assert self.controller.value("sample_count") == self.expected.count

    def _step(self, ms: int, h: float) -> None:
        self.controller.step(self.expected.t, h)
        self.expected = self.expected.stepped(ms, h)


def test_any_sequence_of_steps_samples_at_the_due_times(controller: Instance) -> None:
    machine: Any = partial(AnyMaster, controller)
    run_machine(machine, settings=hypothesis.settings(max_examples=tries(60, sampled=6), stateful_step_count=40))


T = 0.1
TRANSIENT: Mapping[str, float] = {
    "actuator_time_constant": 0.03,
    "initial.angular_velocity.y": 2.0,
    "inertia.xx": 0.8,
    "inertia.xy": 0.1,
    "wind.amplitude.x": 2.0,
    "wind.frequency": 3.0,
}
HELD: Mapping[str, float] = {"thrust": 14.0, "torque.x": 0.5, "torque.z": -0.2, "external_force.y": 0.3}


def fly(plant: Instance, points: list[float], *, disturbed: bool = False) -> list[float]:
    """Every Real at T, of a flight from point to point; disturbed by what should disturb nothing."""
    plant.fmu.reset()
    plant.initialise(TRANSIENT)
    plant.set(HELD)
    for begin, end in itertools.pairwise(points):
        if disturbed:
            content = plant.save()
            plant.set({"thrust": 0.0, "torque.y": 1.0})
            plant.step(begin, 0.001)
            plant.restore(content)
            plant.set(HELD)
            plant.everything()
        plant.step(begin, end - begin)
    return plant.get(*plant.names("input", "output", "local"))


@st.composite
def splits(draw: st.DrawFn) -> list[float]:
    """Communication points from 0 to T, some 1e-13 s after another."""
    inner = draw(st.lists(st.floats(0.0, T), max_size=10))
    followed = draw(st.lists(st.sampled_from([0.0, *inner]), max_size=3))
    points = {0.0, T, *inner, *(point + TINY for point in followed)}
    return sorted(point for point in points if point <= T)


def test_the_plant_arrives_at_the_same_state_by_any_split_of_an_interval(plant: Instance) -> None:
    """To the accuracy of its integrator, 7e-10 for this flight; and the same split gives the same bits."""
    whole = fly(plant, [0.0, T])

    @given(splits())
    def arrives(points: list[float]) -> None:
        arrived = fly(plant, points)
        assert arrived == pytest.approx(whole, rel=0.0, abs=2e-9)
        assert fly(plant, points, disturbed=True) == arrived

    arrives()
