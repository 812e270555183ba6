"""Two people compute the same bits: the project's loop against another that does what `docs/timing.md` says."""

import ast
import math
import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.master.streams import Streams
from orchestration.quadrotor.timing import Timing
from orchestration.quadrotor.translation import quadrotor
from orchestration.quadrotor.wiring import COMMAND, MEASUREMENT
from tests.orchestration import second_clock
from tests.orchestration.strategies import Case, cases
from tests.orchestration.stubs import Counting, Flown, Plant

PAGE = Path(__file__).parent.parent.parent / "docs" / "timing.md"


def moved(t: float, h: float, command: Sequence[float]) -> list[float]:
    """A state that is bounded, and has in each component when and with what the plant was stepped."""
    return [math.sin((i + 1) * (t + 2 * h) + command[i % 4]) for i in range(len(MEASUREMENT))]


def answered(t: float, h: float, measurement: Sequence[float]) -> list[float]:
    """A command that is bounded, and has all that the controller was told."""
    told = sum((i + 1) * value for i, value in enumerate(measurement))
    return [math.cos((j + 1) * (told + t + 3 * h)) for j in range(len(COMMAND))]


class Moved(Plant):
    """`moved` as a simulator."""

    def advance(self, t: float, h: float) -> None:
        state = moved(t, h, [self.values[name] for name in COMMAND])
        self.values.update(zip(MEASUREMENT, state, strict=True))


class Answered(Counting):
    """`answered` as a simulator."""

    def begin(self) -> None:
        self.advance(0.0, 0.0)

    def advance(self, t: float, h: float) -> None:
        command = answered(t, h, [self.values[name] for name in MEASUREMENT])
        self.values.update(zip(COMMAND, command, strict=True))


def both(case: Case) -> tuple[second_clock.Seen, second_clock.Seen]:
    """The same flight by the project and by the second clock."""
    plant, controller = Moved(), Answered()
    start = [plant.values[name] for name in MEASUREMENT]
    flown = Flown(case.timing, case.stop_time, plant, controller, seed=case.seed)
    assert flown.master.divergence is None
    count = len(COMMAND)
    rows = [
        second_clock.Row(t, values[:count], values[count:-count], values[-count:])
        for t, *values in flown.rows().tolist()
    ]
    ours = second_clock.Seen(rows, plant.steps(), controller.steps(), sorted(flown.all_events()))
    theirs = second_clock.fly(
        asdict(case.timing), case.stop_time, case.seed, moved, start, answered, answered(0.0, 0.0, start)
    )
    return ours, theirs._replace(events=sorted(theirs.events))


def same(case: Case) -> None:
    ours, theirs = both(case)
    for name in second_clock.Seen._fields:
        assert getattr(ours, name) == getattr(theirs, name), name


NAMES = [*MEASUREMENT, "position", "velocity", "quaternion", "angular_velocity"]
SENSORS = st.dictionaries(st.sampled_from(NAMES), st.just(0.0) | st.floats(1e-3, 1.0), max_size=3)


@settings(derandomize=True, max_examples=150)
@given(st.data())
def test_rows_steps_and_events_are_the_same_over_random_timings(data: st.DataObject) -> None:
    sensors: dict[str, Any] = {"noise": data.draw(SENSORS), "quantisation": data.draw(SENSORS)}
    same(data.draw(cases(**sensors, hold=data.draw(st.sampled_from(["zero", "first"])))))


@settings(derandomize=True, max_examples=30)
@given(st.data())
def test_and_with_the_controllers_own_clock(data: st.DataObject) -> None:
    period = data.draw(st.sampled_from([0.01, 0.025, 0.1]))
    same(data.draw(cases(clock="fmu", jitter=0.0, clock_ratio=1.0, period=period, offset=0.0)))


ALL = {"jitter": 0.009, "delay": 0.012, "delay_jitter": 0.02, "measurement_loss": 0.3, "command_loss": 0.3}


@pytest.mark.parametrize("burst_length", [None, 1.0, 4.0])
@pytest.mark.parametrize("distribution", ["uniform", "normal"])
@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
def test_and_over_many_samples_with_every_cause_on(order: Any, distribution: Any, burst_length: float | None) -> None:
    timing = Timing(
        **ALL, order=order, jitter_distribution=distribution, burst_length=burst_length, hold="first",
        plant_interval=0.05, noise={"position": 0.01, "quaternion.w": 0.1}, quantisation={"velocity": 0.25},
    )  # fmt: skip
    same(Case(timing, 4.0, 11))


# -- that it is a second one, and that the page has what it needs ------------------------------------------


def test_the_second_clock_imports_nothing_of_the_project() -> None:
    tree = ast.parse(Path(second_clock.__file__).read_text(encoding="utf-8"))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names])
    }
    assert imported == {"collections", "fractions", "itertools", "math", "numpy", "statistics", "typing"}


def test_the_numbers_of_seed_1_are_those_of_the_page() -> None:
    rows = re.findall(r"^\| ([a-z ]+) \| (-?[\d.]+), (-?[\d.]+) \|$", PAGE.read_text(encoding="utf-8"), re.M)
    page = {name.replace(" ", "_"): [float(a), float(b)] for name, a, b in rows}
    numbered = quadrotor().streams
    owners = {"jitter": "components.controller", "delay_jitter": "connections.command"}
    drawn = {}
    for place in sorted(numbered, key=numbered.__getitem__):
        owner, _, cause = place.rpartition(".")
        name = f"{owner.rpartition('.')[2]}_loss" if cause == "loss" else cause
        stream = Streams(1, numbered).of(owner, cause)
        assert owners.get(cause, owner) == owner
        drawn[name] = stream.standard_normal(2).tolist() if cause == "noise" else [stream.random(), stream.random()]
    assert page == drawn


@pytest.mark.parametrize("constant", [second_clock.C0, second_clock.C1])
def test_the_ends_of_the_cut_normal_are_those_of_the_page(constant: float) -> None:
    assert repr(constant) in PAGE.read_text(encoding="utf-8")
