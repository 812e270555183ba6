"""The master obeys the timetable: what each component sees, in which order, without any FMU."""

import math

import pytest

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.recording.recording import InMemory
from orchestration.simulation.engines.algebraic_loops import secants
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from tests.orchestration.simulation.engines.stubs import (
    Direct,
    Stub,
    clock,
    column,
    continuous,
    events,
    near,
    sampled,
    system,
    wire,
)


def run(what, stubs, **keys):
    streams = Streams(what.seed, what.streams)
    recorded = {name: ["y"] if "y" in stub.values else [] for name, stub in stubs.items()}
    running = RunningSystem(what, stubs, timetable=Timetable(what, streams), streams=streams, recorded=recorded)
    master = Master(running, InMemory(), **keys)
    master.initialise()
    master.run()
    return master


def test_a_sample_sees_the_plant_as_it_is_and_acts_on_the_step_that_follows():
    what = system(
        {"plant": continuous(0.1), "controller": sampled(0.2)},
        [wire("plant.y", "controller.x"), wire("controller.y", "plant.u")],
        stop_time=0.4,
    )
    plant = Stub(clock, y=0.0, u=0.0)
    controller = Stub(lambda v, t, h: v.update(y=10.0 * v["x"]), x=0.0, y=0.0)
    master = run(what, {"plant": plant, "controller": controller})
    assert near([seen["x"] for _, _, seen in controller.steps]) == [0.0, 0.2]
    assert near([seen["u"] for _, _, seen in plant.steps]) == [0.0, 0.0, 2.0, 2.0]
    assert near(column(master, "plant.u")) == [0.0, 0.0, 2.0, 2.0, 2.0]
    assert near([(t, h) for t, h, _ in controller.steps]) == [[0.0, 0.2], [0.2, 0.2]]


@pytest.mark.parametrize(("order", "seen"), [("gauss-seidel", [0.1, 0.2, 0.3]), ("jacobi", [0.0, 0.1, 0.2])])
def test_over_a_wire_the_second_sees_the_first_one_step_further_unless_jacobi(order, seen):
    what = system({"a": continuous(0.1), "b": continuous(0.1)}, [wire("a.y", "b.u", order=order)], stop_time=0.3)
    b = Stub(y=0.0, u=0.0)
    run(what, {"a": Stub(clock, y=0.0), "b": b})
    assert near([values["u"] for _, _, values in b.steps]) == seen


def test_what_was_measured_late_is_what_the_plant_was_then():
    what = system(
        {"plant": continuous(0.1), "controller": sampled(0.2)},
        [wire("plant.y", "controller.x", delay=0.03)],
        stop_time=0.5,
    )
    controller = Stub(x=0.0, y=0.0)
    run(what, {"plant": Stub(clock, y=0.0), "controller": controller})
    assert near([values["x"] for _, _, values in controller.steps]) == [0.0, 0.17, 0.37]


def test_samples_due_together_pass_their_values_on_at_once():
    what = system({"controller": sampled(), "sensor": sampled()}, [wire("sensor.y", "controller.x")], stop_time=0.25)
    controller = Stub(x=0.0, y=0.0)
    sensor = Stub(lambda v, t, h: v.update(y=t), y=-1.0)
    run(what, {"controller": controller, "sensor": sensor})
    assert near([values["x"] for _, _, values in controller.steps]) == [0.0, 0.1, 0.2]


def test_scale_and_offset_convert_what_arrives():
    what = system(
        {"a": continuous(0.1), "b": continuous(0.1)}, [wire("a.y", "b.u", scale=2.0, offset=1.0)], stop_time=0.2
    )
    b = Stub(y=0.0, u=0.0)
    run(what, {"a": Stub(clock, y=0.0), "b": b})
    assert near([values["u"] for _, _, values in b.steps]) == [1.2, 1.4]


def test_events_name_the_connection():
    what = system(
        {"plant": continuous(0.1), "controller": sampled(0.2)},
        [wire("plant.y", "controller.x", "level"), wire("controller.y", "plant.u", "valve", delay=0.05)],
        stop_time=0.3,
    )
    master = run(what, {"plant": Stub(clock, y=0.0, u=0.0), "controller": Stub(x=0.0, y=0.0)})
    assert [(time // 1_000_000, kind, name, k) for time, kind, name, k in events(master)] == [
        (0, "sampled", "level", 0), (0, "sent", "valve", 0), (50, "arrived", "valve", 0),
        (200, "sampled", "level", 1), (200, "sent", "valve", 1), (250, "arrived", "valve", 1),
    ]  # fmt: skip


def test_a_value_that_is_not_finite_ends_a_run_in_which_nothing_is_connected():
    plant = Stub(lambda v, t, h: v.update(y=math.nan if t > 0.25 else 0.0), y=0.0)
    master = run(system({"plant": continuous(0.1)}, [], stop_time=1.0), {"plant": plant})
    assert master.divergence == "plant.y = nan at t = 0.4 s, expected a finite value"


def test_a_value_that_is_not_finite_is_passed_on_to_nobody():
    what = system(
        {"plant": continuous(0.1), "controller": sampled(0.1)}, [wire("plant.y", "controller.x")], stop_time=1.0
    )
    controller = Stub(x=0.0, y=0.0)
    plant = Stub(lambda v, t, h: v.update(y=math.nan if t > 0.25 else 0.0), y=0.0)
    master = run(what, {"plant": plant, "controller": controller})
    assert master.divergence == "plant.y = nan at t = 0.4 s, expected a finite value"
    assert master.divergence_time == 400_000_000
    assert all(not math.isnan(values["x"]) for _, _, values in controller.steps)


RING = system({"a": continuous(), "b": continuous()}, [wire("a.y", "b.u"), wire("b.y", "a.u")], stop_time=0.1)


@pytest.mark.parametrize(("d1", "d2"), [(0.5, 0.8), (-0.9, 1.0), (2.0, -3.0), (4.0, 2.0)])
def test_values_around_a_loop_are_found_before_the_run_begins(d1: float, d2: float):
    """a = 1 + d1 b and b = d2 a; exchanges converge for |d1 d2| < 1."""
    stubs = {"a": Direct(lambda u: 1.0 + d1 * u, u=0.0, y=0.0), "b": Direct(lambda u: d2 * u, u=0.0, y=0.0)}
    master = run(RING, stubs, first_exchange=((0, 1),))
    assert column(master, "b.y")[0] == pytest.approx(d2 / (1.0 - d1 * d2), rel=1e-11)


def test_the_secant_of_two_linear_equations_needs_three_exchanges():
    asked = []

    def around(values):
        asked.append(values)
        return [-3.0 * (2.0 * values[0] + 1.0)]

    _, (found,) = secants(around, [0.0])
    assert (found, len(asked)) == (pytest.approx(-3.0 / 7.0, abs=1e-12), 3)


def test_secants_find_the_values_of_a_nonlinear_loop_of_vectors():
    def around(values):
        x, y, z = values
        return [1.0 + 2.0 * y, math.sin(x) - z, 0.5 * x - 3.0 * math.tanh(y)]

    before, found = secants(around, [0.1, 0.2, 0.3])
    assert before is found
    assert around(found) == pytest.approx(found, rel=1e-11)


def test_a_loop_without_a_solution_is_an_error_that_names_it_and_what_was_found():
    stubs = {name: Direct(lambda u: 1.0 + u, u=0.0, y=0.0) for name in "ab"}
    with pytest.raises(
        SimulatorError, match=r"loop a.y -> b.u; b.y -> a.u: .* exchanges, .* b.u = \S+ becomes \S+; a.u"
    ):
        run(RING, stubs, first_exchange=((0, 1),))
