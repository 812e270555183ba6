"""The compiled loop gives what the master in Python gives: rows, events, ends and words, to the byte."""

import json
import math
import os
import re
import shutil
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.transfers import range_of
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError
from orchestration.foundation.basics.times import Grid, exact_nanoseconds
from orchestration.foundation.recording.recording import InMemory
from orchestration.simulation.engines import compiled
from orchestration.simulation.engines.memory import SharedTables
from orchestration.simulation.runs import simulation
from orchestration.simulation.runs.outcome import RunInterrupted
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.result import Result
from orchestration.systems.schedule import instant_arrays
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import Criterion, System
from tests.extent import tries
from tests.native import assert_the_same
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.quadrotor.scenarios.signals_table import flights, scenario_of
from tests.orchestration.simulation.engines.moving import moving
from tests.orchestration.simulation.engines.random_systems import systems, systems_of_fixed_steps
from tests.places import ROOT

pytestmark = needs_compiler
ENGINES = st.sampled_from(("python", "compiled"))
FLIGHTS = dict(flights())
EXAMPLES = sorted(ROOT.glob("examples/*/system.toml"))


@pytest.fixture(scope="module")
def fixed_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, but that it takes steps of one length only."""
    return moving(tmp_path_factory.mktemp("fixed"), fixed_step=True)


class Kept:
    """Instances of the FMUs by path and name, reset between runs: its reset is whole."""

    def __init__(self) -> None:
        self._instances: dict[tuple[Path, str], NativeInstance] = {}

    @contextmanager
    def load(self, path: Path, instance_name: str, access: Access = USUAL) -> Iterator[Instance]:
        key = path, instance_name
        if key not in self._instances or self._instances[key].failed:
            self._instances[key] = open_here(*key)
        self._instances[key].reset()
        yield self._instances[key]

    def close(self) -> None:
        for instance in self._instances.values():
            instance.close()


def ran(system: System, engine: Any, **keys: Any) -> Result:
    with prepared(system, engine=engine, **keys) as run:
        assert run.master.engine == engine
        run.master.initialise()
        run.master.run()
        return run.result()


def both(system: System, **keys: Any) -> Result:
    """The result of both engines, which is the same."""
    one, other = ran(system, "python", **keys), ran(system, "compiled", **keys)
    assert_the_same(other, one)
    return one


def expect_that_a_pause_changes_nothing(
    system: System, share: float, engines: tuple[Any, Any], size: int, load: Any
) -> None:
    """Pause after a share of the run in one engine, in windows of some size, and go on with another."""
    first, then = engines
    whole = ran(system, "python", load=load)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(instant_arrays, "INSTANTS", size)
        with prepared(system, engine=first, load=load) as run:
            run.master.initialise()
            if run.master.run(pause_at=int(share * 1e9 * system.stop_time)):
                return
            state, saved = json.loads(json.dumps(run.master.state())), run.master.saved()
    with prepared(system, engine=then, load=load) as run:
        run.master.restore(state, saved)
        run.master.run()
        assert_the_same(run.result(), whole)


def of(system: System, fmu: Path, **parameters: Mapping[str, float]) -> System:
    """A system of stubs with the FMU in their place; `parameters` by component."""
    parts = {
        name: replace(part, fmu=str(fmu), parameters={"place": float(i), **parameters.get(name, {})})
        for i, (name, part) in enumerate(system.components.items())
    }
    return replace(system, components=parts)


@settings(max_examples=tries(60, sampled=6), derandomize=True, deadline=None)
@given(systems(), st.sampled_from((1, 7, 2**13)))
def test_random_systems_run_the_same_in_schedules_of_any_length(
    fmu: Path, kept: Kept, what: System, instants: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(instant_arrays, "INSTANTS", instants)
        both(of(what, fmu), load=kept.load)


@settings(max_examples=tries(20, sampled=6), derandomize=True, deadline=None)
@given(systems_of_fixed_steps().filter(lambda drawn: len(drawn[1]) > 0))
def test_components_of_one_step_run_the_same(
    fmu: Path, fixed_fmu: Path, kept: Kept, drawn: tuple[System, Sequence[str]]
) -> None:
    """Those that the systems have move what happens to them to their grid, or both engines refuse in the same words."""
    what, names = of(drawn[0], fmu), drawn[1]
    parts = {
        name: replace(part, fmu=str(fixed_fmu)) if name in names else part for name, part in what.components.items()
    }
    what = replace(what, components=parts)
    assert all(not read_model(Path(parts[name].fmu)).varies_step for name in names)
    messages: list[str | bytes] = []
    for engine in ("python", "compiled"):
        try:
            result = ran(what, engine, load=kept.load)
        except QuadcosimError as error:
            messages.append(str(error))
            continue
        messages.append(result.rows.tobytes())
        for name in names:
            grid = Grid(Fraction(0), exact_nanoseconds(parts[name].step or 0.0))
            arrived = [e.time for e in result.events if e.kind == "arrived" and receiver_of(what, e.what) == name]
            assert all(grid.from_(time) == time for time in arrived)
    assert messages[0] == messages[1]


def receiver_of(system: System, connection: str) -> str:
    """Where a message over it goes."""
    return next(x.receiver for x in system.connections if x.name == connection)


LOOP = System(
    stop_time=1.0,
    components={
        "plant": Component(fmu="stub", step=0.01),
        "controller": Component(fmu="stub", sampling=Sampling(period=0.02, jitter=0.01)),
    },
    connections=(
        Connection(name="measured", start=("plant.y",), end=("controller.u0y",), noise={"y": 0.1}, delay=0.003),
        Connection(name="commanded", start=("controller.y",), end=("plant.u1y",), hold="first", delay=0.03),
    ),
)


def every_source(folder: Path) -> dict[str, Source]:
    """A source of each kind; the table lies in the folder."""
    table = folder / "table.csv"
    table.write_text("time,u4y,u4z\n0,0.1,0.3\n0.37,1,7\n1,-2,0.7\n", encoding="utf-8")
    return {
        "table": Source(file=table, to=("plant.u4y", "controller.u4z")),
        "noise": Source(noise=0.01, period=0.007, to=("plant.u5y", "plant.u5z")),
        "one": Source(constant=0.3, to=("controller.u6y",)),
    }


def test_what_sources_feed_is_the_same(fmu: Path, tmp_path: Path) -> None:
    both(replace(of(LOOP, fmu), sources=every_source(tmp_path)))


CONDITIONS = {
    "plant.y > 0.9": True,
    "abs(plant.y) > 2 or not controller.y < 5": False,
    "hypot(plant.y, controller.y) / (plant.y - plant.y) > 3": False,
    "norm(plant.y, controller.y) >= 1.2 and time > 0.1": True,
    "3 * plant.y**2 + 1 > 3.9": True,
    "-plant.y * controller.y + 0.5 == 0 or time >= 0.4": True,
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_condition_ends_both_at_the_same_instant_with_the_same_words(condition: str, fmu: Path, kept: Kept) -> None:
    found = both(replace(of(LOOP, fmu), criterion=Criterion(diverged=condition)), load=kept.load)
    assert (found.divergence is not None) == CONDITIONS[condition]


@pytest.mark.parametrize(("sign", "diverges"), [(">", False), (">=", True)])
def test_a_value_on_the_edge_is_decided_as_rows_have_it(sign: str, diverges: bool, fmu: Path, kept: Kept) -> None:
    """By the root of the sum of squares: it is less than `math.hypot` in its last digit here."""
    free = ran(of(LOOP, fmu), "python", load=kept.load)
    y, z = free.signals["plant.y"], free.signals["plant.z"]
    less = [i for i in range(1, len(y)) if math.sqrt(y[i] * y[i] + z[i] * z[i]) < math.hypot(y[i], z[i])]
    assert less
    edge = float(np.sqrt(y[less[0]] ** 2 + z[less[0]] ** 2))
    condition = (
        f"abs(time - {float(free.signals['time'][less[0]])!r}) < 1e-5 and norm(plant.y, plant.z) {sign} {edge!r}"
    )
    found = both(replace(of(LOOP, fmu), criterion=Criterion(diverged=condition)), load=kept.load)
    assert (found.divergence is not None) == diverges


def test_messages_that_arrive_together_are_noted_as_they_were_sent(fmu: Path, kept: Kept) -> None:
    tasks = {
        name: Component(fmu="stub", sampling=Sampling(period=period)) for name, period in (("a", 0.02), ("b", 0.01))
    }
    wires = (
        Connection(name="soon", start=("a.y",), end=("plant.u0y",), delay=0.01),
        Connection(name="late", start=("b.y",), end=("plant.u1y",), delay=0.02),
    )
    what = replace(LOOP, components={"plant": LOOP.components["plant"], **tasks}, connections=wires)
    found = both(of(what, fmu), load=kept.load)
    assert [event.what for event in found.events if event.kind == "arrived"][:4] == ["soon", "late", "late", "soon"]


def test_warnings_and_values_that_are_not_finite_are_the_same(fmu: Path, kept: Kept) -> None:
    found = both(of(LOOP, fmu, plant={"nan_at": 0.5}, controller={"warns_at": 0.4}), load=kept.load)
    assert (found.divergence or "").startswith("plant.y = nan at t = 0.5")
    assert found.warnings
    assert set(found.warnings) == {"controller: this is late"}


def test_a_call_that_fails_is_told_in_the_same_words_with_the_same_rows(fmu: Path) -> None:
    errors = []
    engines: tuple[Any, Any] = ("python", "compiled")
    for engine in engines:
        with pytest.raises(SimulatorError) as caught:
            simulation.run(of(LOOP, fmu, controller={"fails_at": 0.3}), engine=engine, in_process=True)
        errors.append(caught.value)
        assert str(errors[-1]) == "controller (Moving): fmi2DoStep: there is no more, at t = 0.308932 s"
    assert_the_same(errors[1].result, errors[0].result)


def test_a_number_that_an_input_does_not_hold_is_refused_in_the_same_words(tmp_path: Path) -> None:
    path = small(tmp_path, mode_is_input=True)
    parts = {name: Component(fmu=str(path), step=0.01) for name in ("first", "second")}
    # a count that is multiplied until no 32 bits hold it
    wire = Connection(name="0", start=("first.count",), end=("second.mode",), scale=1e9)
    messages = []
    for engine in ("python", "compiled"):
        with pytest.raises(QuadcosimError) as caught:
            ran(System(stop_time=0.1, components=parts, connections=(wire,)), engine)
        messages.append(str(caught.value))
    assert messages == ["second.mode = 3e+09: expected a number that int32 holds, at t = 0.03 s"] * 2


@pytest.mark.parametrize(
    ("value", "is_held"),
    [(2147483647.0, True), (2147483648.0, False), (-2147483648.0, True), (-2147483649.0, False), (1e300, False)],
)
def test_the_largest_number_that_an_input_holds_is_the_last_that_is_written(
    value: float, is_held: bool, tmp_path: Path
) -> None:
    path = small(tmp_path, mode_is_input=True)
    parts = {name: Component(fmu=str(path), step=0.01) for name in ("first", "second")}
    wire = Connection(name="0", start=("first.count",), end=("second.mode",), scale=1e-9, offset=value)
    system = System(stop_time=0.03, components=parts, connections=(wire,))
    for engine in ("python", "compiled"):
        if is_held:
            assert ran(system, engine).signals["second.mode"][-1] == value
        else:
            with pytest.raises(QuadcosimError, match=rf"{re.escape(f'{value:g}')}: expected a number that int32 holds"):
                ran(system, engine)


@pytest.mark.parametrize("dtype", ["int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"])
def test_the_bounds_of_a_type_are_the_last_floats_that_it_holds(dtype: str) -> None:
    low, high = range_of(np.dtype(dtype))
    of = np.iinfo(dtype)
    assert int(low) == of.min
    assert int(high) <= of.max
    assert high >= of.max or int(math.nextafter(high, math.inf)) > of.max


@pytest.mark.parametrize("name", FLIGHTS)
def test_flights_of_the_quadrotor_are_the_same(name: str) -> None:
    scenario = scenario_of(FLIGHTS[name]["scenario"])
    native = scenario.with_fmus(plant="native/QuadrotorPlant", controller="native/UnifiedController")
    assert_the_same(simulation.run(native, engine="compiled"), simulation.run(native, engine="python"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.parent.name)
def test_examples_run_the_same(path: Path) -> None:
    system = load_system(path)
    both(replace(system, stop_time=min(system.stop_time, 2.0)))


@pytest.mark.parametrize(("first", "then"), [("python", "compiled"), ("compiled", "python"), ("compiled", "compiled")])
def test_a_run_that_one_engine_pauses_another_ends(first: Any, then: Any, fmu: Path, tmp_path: Path) -> None:
    system = of(LOOP, fmu)
    assert fly_until(system, 0.4, tmp_path / "paused", engine=first, figures=False) is None
    assert_the_same(resume(tmp_path / "paused", engine=then), ran(system, "python"))


@settings(max_examples=tries(30, sampled=5), derandomize=True, deadline=None)
@given(systems(most=4), st.floats(0.0, 1.0), st.tuples(ENGINES, ENGINES), st.sampled_from((5, instant_arrays.INSTANTS)))
def test_random_systems_go_on_from_a_pause_as_if_there_was_none(
    fmu: Path, kept: Kept, what: System, share: float, engines: tuple[Any, Any], size: int
) -> None:
    expect_that_a_pause_changes_nothing(of(what, fmu), share, engines, size, kept.load)


def test_a_run_may_be_stopped_and_go_on_in_the_same_process(fmu: Path) -> None:
    system = of(LOOP, fmu)
    with prepared(system, engine="compiled") as run:
        run.master.initialise()
        for time in (100_000_000, 250_000_000, 251_000_000):
            assert not run.master.run(pause_at=time)
        assert run.master.run()
        assert_the_same(run.result(), ran(system, "python"))


def test_chunks_are_whole_at_the_same_rows_and_events(fmu: Path, kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, most in (("ROWS", 16), ("EVENTS", 30)):
        with monkeypatch.context() as patch:
            patch.setattr(f"orchestration.simulation.engines.backlog.{name}", most)
            sizes = []
            for engine in ("python", "compiled"):
                recorder = InMemory()
                ran(of(LOOP, fmu), engine, load=kept.load, recorder=recorder)
                sizes.append([(len(chunk.rows), len(chunk.events)) for chunk in recorder.chunks()])
            assert sizes[0] == sizes[1]
            assert len(sizes[0]) > 3


def test_rows_that_are_wide_are_handed_over_before_they_fill_the_memory(
    fmu: Path, kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Room is made for a chunk of them at once."""
    monkeypatch.setattr("orchestration.simulation.engines.backlog.BYTES", 1000)
    for engine in ("python", "compiled"):
        recorder = InMemory()
        with prepared(of(LOOP, fmu), engine=engine, load=kept.load, recorder=recorder) as run:
            if isinstance(run.master.backlog.tables, SharedTables):
                assert run.master.backlog.tables.content.nbytes <= 1000
            run.master.initialise()
            run.master.run()
        sizes = {chunk.rows.nbytes for chunk in recorder.chunks()}
        assert 500 < max(sizes) <= 1000


def test_ctrl_c_is_heard_within_a_slice(fmu: Path) -> None:
    system = replace(of(LOOP, fmu), stop_time=36000.0)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(RunInterrupted) as caught:
        simulation.run(system, engine="compiled", recorder=_Nowhere(), in_process=True)
    assert 0.0 < (caught.value.result.interrupted_at or 0.0) < 36000.0


class _Nowhere(InMemory):
    def take(self, chunk: Any) -> None:
        if not self._chunks:
            self._chunks.append(chunk)


# -- where it is not available ---------------------------------------------------------------------------------------


def test_what_stands_in_the_way_is_said_in_a_line(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    once = small(tmp_path, once=True)
    parts = {name: Component(fmu=str(once), step=0.01) for name in ("first", "second")}
    system = System(stop_time=0.1, components=parts)
    with pytest.raises(QuadcosimError, match=r"^engine compiled is not available: components.second is not called in "):
        ran(system, "compiled")
    with prepared(system) as run:
        assert run.master.engine == "python"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(shutil, "which", lambda name: None)
    compiled.library.cache_clear()
    try:
        with pytest.raises(QuadcosimError, match=r"^engine compiled is not available: no C compiler that is called cc"):
            ran(of(LOOP, fmu), "compiled")
        with prepared(of(LOOP, fmu)) as run:
            assert run.master.engine == "python"
    finally:
        compiled.library.cache_clear()


def test_an_instance_that_does_more_than_call_its_fmu_is_stepped_in_python(fmu: Path) -> None:
    class Stepped(Fmi2Instance):
        steps = 0

        def step(self, t: float, h: float) -> None:
            Stepped.steps += 1
            super().step(t, h)

    with prepared(of(LOOP, fmu), load=Stepped) as run:
        run.master.initialise()
        run.master.run()
        assert run.master.engine == "python"
        assert Stepped.steps > 0


def test_the_compiled_loop_is_the_default_where_it_can_be_had(fmu: Path) -> None:
    with prepared(of(LOOP, fmu)) as run:
        assert run.master.engine == "compiled"
        run.master.initialise()
        run.master.run()
        assert run.result().provenance["engine"] == "compiled"
