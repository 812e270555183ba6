"""Two implementations compute the same bits: the master, and a clock written from the documentation."""

import ast
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import Grid, exact_nanoseconds
from orchestration.foundation.recording.recording import InMemory
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.quadrotor.scenarios.wiring import MEASUREMENT
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.systems.schedule import instant_arrays as position
from orchestration.systems.schedule.plan import FixedStep
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.choices import Spread
from orchestration.systems.system.connection import variable_of
from orchestration.systems.system.model import System
from tests.orchestration.quadrotor.scenarios.strategies import Case, cases
from tests.orchestration.simulation.engines.random_systems import systems, systems_of_fixed_steps
from tests.orchestration.simulation.engines.stubs import Stub, continuous, events, sampled, system, wire
from tests.orchestration.systems.schedule import second_clock
from tests.places import ROOT

PAGE = ROOT / "docs" / "timing.md"


def moved(outputs: Mapping[str, float], t: float, h: float, inputs: Mapping[str, float]) -> dict[str, float]:
    """Bounded outputs that depend on the time, the length and the inputs of a step."""
    weighted = sum((i + 1) * value for i, (_, value) in enumerate(sorted(inputs.items())))
    return {name: math.sin((i + 1) * (t + 2 * h) + weighted + start) for i, (name, start) in enumerate(outputs.items())}


class Moved(Stub):
    """`moved` as a simulator."""

    def __init__(self, outputs: Mapping[str, float], inputs: Iterable[str]) -> None:
        super().__init__(self.follow, **outputs, **dict.fromkeys(inputs, 0.0))
        self.outputs, self.inputs = outputs, tuple(inputs)

    def received(self, values: Mapping[str, float]) -> dict[str, float]:
        return {name: values[name] for name in self.inputs}

    def follow(self, values: dict[str, float], t: float, h: float) -> None:
        values.update(moved(self.outputs, t, h, self.received(values)))


def ends(what: System, name: str, kind: str) -> list[str]:
    """The inputs (`end`) or outputs (`start`) of a component that are connected."""
    found = (end for x in what.connections for end in getattr(x, kind) if end.startswith(f"{name}."))
    return list(dict.fromkeys(map(variable_of, found)))


def both(what: System, fixed: Iterable[str] = ()) -> tuple[second_clock.Seen, second_clock.Seen]:
    """The same run by the project and by the second clock."""
    first = {
        name: {output: 0.25 * place + 0.125 * i for i, output in enumerate(ends(what, name, "start"))}
        for place, name in enumerate(what.components)
    }
    stubs = {name: Moved(first[name], ends(what, name, "end")) for name in what.components}
    streams, zero = Streams(what.seed, what.streams), exact_nanoseconds(0.0)
    grids = {name: Grid(zero, exact_nanoseconds(what.components[name].step or 0.0)) for name in fixed}
    steps = {name: FixedStep(name=name, grid=grid, moves=True) for name, grid in grids.items()}
    clock, recorded = Timetable(what, streams, steps), dict.fromkeys(stubs, ())
    master = Master(RunningSystem(what, stubs, timetable=clock, streams=streams, recorded=recorded), InMemory())
    master.initialise()
    master.run()
    assert master.divergence is None
    rows = [row for chunk in master.recorder.finish().chunks() for row in chunk.rows.tolist()]
    ours = second_clock.Seen(
        [dict(zip(master.board.columns, row, strict=True)) for row in rows],
        {
            name: [second_clock.Step(t, h, stub.received(seen)) for t, h, seen in stub.steps]
            for name, stub in stubs.items()
        },
        sorted(tuple(event) for event in events(master)),
    )
    models = {name: second_clock.Model(values, partial(moved, values)) for name, values in first.items()}
    return ours, second_clock.run(asdict(what), models, fixed)


def same(what: System, fixed: Iterable[str] = (), size: int = position.INSTANTS) -> second_clock.Seen:
    """The results of both, with schedules of about so many instants."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(position, "INSTANTS", size)
        ours, theirs = both(what, fixed)
    for name in reversed(second_clock.Seen._fields):
        assert getattr(ours, name) == getattr(theirs, name), name
    return theirs


def flight(case: Case) -> System:
    """A timing of the quadrotor as its system."""
    return Scenario(timing=case.timing, stop_time=case.stop_time, seed=case.seed).as_system()


SIZES = st.sampled_from((1, 7, position.INSTANTS))


@given(systems(), SIZES)
def test_steps_rows_and_events_are_the_same_over_random_systems(what: System, size: int) -> None:
    same(what, size=size)


@given(systems_of_fixed_steps(), SIZES)
def test_both_clocks_agree_where_instants_move_to_the_points_of_fixed_steps(
    drawn: tuple[System, list[str]], size: int
) -> None:
    try:
        same(*drawn, size=size)
    except UsageError as error:
        if "both move" not in str(error):
            raise
        reject()


NAMES = [*MEASUREMENT, "position", "velocity", "quaternion", "angular_velocity"]
SENSORS = st.dictionaries(st.sampled_from(NAMES), st.just(0.0) | st.floats(1e-3, 1.0), max_size=3)


@given(st.data())
def test_both_clocks_agree_over_random_timings_of_the_quadrotor(data: st.DataObject) -> None:
    sensors: dict[str, Any] = {"noise": data.draw(SENSORS), "quantisation": data.draw(SENSORS)}
    same(flight(data.draw(cases(**sensors, hold=data.draw(st.sampled_from(["zero", "first"]))))))


@given(st.data())
def test_both_clocks_agree_with_the_controllers_own_clock(data: st.DataObject) -> None:
    period = data.draw(st.sampled_from([0.01, 0.025, 0.1]))
    same(flight(data.draw(cases(clock="fmu", jitter=0.0, clock_ratio=1.0, period=period, offset=0.0))))


ALL: dict[str, Any] = {
    "jitter": 0.009, "delay": 0.012, "delay_jitter": 0.02, "measurement_loss": 0.3, "command_loss": 0.3,
}  # fmt: skip


@pytest.mark.parametrize("burst_length", [None, 1.0, 4.0])
@pytest.mark.parametrize("distribution", get_args(Spread))
@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
def test_both_clocks_agree_over_many_samples_with_every_cause_on(
    order: Any, distribution: Any, burst_length: float | None
) -> None:
    timing = Timing(
        **ALL, order=order, jitter_distribution=distribution, burst_length=burst_length, hold="first",
        plant_interval=0.05, noise={"position": 0.01, "quaternion.w": 0.1}, quantisation={"velocity": 0.25},
    )  # fmt: skip
    same(flight(Case(timing, 4.0, 11)))


# -- what the random systems found, each by itself ---------------------------------------------------------


def test_without_a_component_in_continuous_time_there_are_events_to_the_end_and_a_row_at_the_start() -> None:
    link = wire("a.y", "b.u", "link", delay=0.005)
    seen = same(system({"a": sampled(0.01), "b": sampled(0.01, offset=0.005)}, [link], stop_time=0.045))
    assert (45_000_000, "arrived", "link", 4) in seen.events
    assert same(system({"a": sampled(0.01, offset=0.005)}, stop_time=0.01)).rows[0] == {"time": 0.0}


def test_a_connection_with_delay_does_not_determine_the_order() -> None:
    late, prompt = wire("a.y", "b.u", "late", delay=0.015), wire("b.y", "a.u", "prompt")
    seen = same(system({"a": sampled(0.01), "b": sampled(0.01)}, [late, prompt], stop_time=0.03))
    assert [step.inputs["u"] for step in seen.steps["a"]] == [
        row["b.y"] for row in seen.rows if row["time"] in ALL_OF_A
    ]


ALL_OF_A = (0.0, 0.01, 0.02)


def test_a_component_with_its_own_clock_is_ordered_among_those_that_are_due() -> None:
    link = wire("a.y", "b.u", "link")
    seen = same(system({"b": sampled(0.01), "a": sampled(0.01, clock="fmu")}, [link], stop_time=0.03))
    assert [step.inputs["u"] for step in seen.steps["b"]] == [row["a.y"] for row in seen.rows[:-1]]


def test_noise_of_readings_at_one_instant_is_in_the_order_of_their_samples() -> None:
    level = wire("a.y", "b.u", "level", delay=0.02, noise={"y": 1.0})
    same(system({"a": continuous(0.01), "b": sampled(0.01)}, [level], stop_time=0.1))


def test_a_component_that_is_read_with_a_delay_is_not_stepped_to_the_sample() -> None:
    level = wire("a.y", "b.u", "level", delay=0.005)
    seen = same(system({"a": continuous(0.1), "b": sampled(0.05)}, [level], stop_time=0.1))
    assert [round(1000 * (step.t + step.h)) for step in seen.steps["a"]] == [45, 95, 100]


def test_a_sample_that_reads_two_components_of_fixed_step_moves_to_a_common_point() -> None:
    parts = {"a": continuous(0.03), "b": continuous(0.02), "c": sampled(0.1)}
    seen = same(system(parts, [wire("a.y", "c.u"), wire("b.y", "c.v")], stop_time=0.3), ["a", "b"])
    assert [round(1000 * step.t) for step in seen.steps["c"]] == [0, 120, 240]


def test_of_messages_that_move_to_one_point_the_last_sent_remains() -> None:
    link = wire("a.y", "b.u", "link", hold="first")
    seen = same(system({"a": continuous(0.01), "b": continuous(0.02)}, [link], stop_time=0.06), ["b"])
    assert [row["b.u"] for row in seen.rows if row["time"] in (0.02, 0.04)] == [
        row["a.y"] for row in seen.rows if row["time"] in (0.02, 0.04)
    ]


def test_samples_that_would_move_to_one_point_are_an_error() -> None:
    what = system({"a": continuous(0.03), "b": sampled(0.01)}, [wire("a.y", "b.u")], stop_time=0.3)
    with pytest.raises(UsageError, match=r"samples 1 and 2 of components\.b both move to t = 0\.03 s"):
        both(what, ["a"])


def test_the_end_is_a_point_of_components_of_fixed_step() -> None:
    with pytest.raises(UsageError, match=r"stop_time = 0\.2: .* components\.a, .* expected 0\.18 or 0\.21"):
        both(system({"a": continuous(0.03)}, stop_time=0.2), ["a"])


# -- that it is a second one, and that the page has what it needs ------------------------------------------


def test_the_second_clock_imports_nothing_of_the_project() -> None:
    tree = ast.parse(Path(second_clock.__file__).read_text(encoding="utf-8"))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names])
    }
    assert imported == {"collections", "fractions", "hashlib", "itertools", "math", "numpy", "statistics", "typing"}


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
