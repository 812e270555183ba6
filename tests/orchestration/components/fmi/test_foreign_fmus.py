"""What third-party FMUs force: each habit of theirs does in a run of a system what the documents say."""

import dataclasses
import json
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from orchestration.components.building.fmus import locate
from orchestration.components.fmi import opening, slaves
from orchestration.components.fmi.isolated_instance import IsolatedInstance
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.foundation.processes import subprocesses
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.result import Result
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.model import Criterion, System
from tests.fmus.archive import files_of
from tests.fmus.damage import write_fmu
from tests.orchestration.components.fmi.small import BINARY, CLOCK, SIZE, needs_compiler, nothing_known, small
from tests.orchestration.foundation.processes.test_child import gone

pytestmark = needs_compiler


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is known of any FMU."""
    nothing_known(tmp_path_factory.mktemp("cache"), monkeypatch)


def alone(path: Path, stop: float = 0.1, **component: Any) -> System:
    """The FMU with the input 1."""
    names = ("u[1]", "u[2]") if component.pop("array", False) else ("u",)
    return System(
        stop_time=stop,
        components={"it": Component(fmu=str(path), **{"step": 0.01, **component})},
        sources={"one": Source(constant=1.0, to=tuple(f"it.{name}" for name in names))},
    )


def twice(path: Path, stop: float = 0.1) -> System:
    """The FMU with the input 1, and once more behind itself."""
    return System(
        stop_time=stop,
        components={name: Component(fmu=str(path), step=0.01) for name in ("first", "second")},
        connections=(Connection(name="0", start=("first.y",), end=("second.u",)),),
        sources={"one": Source(constant=1.0, to=("first.u",))},
    )


def ran(system: System, **keys: Any) -> Result:
    with prepared(system, **keys) as simulation:
        simulation.master.initialise()
        simulation.master.run()
        return simulation.result()


def last(result: Result, name: str) -> float:
    return float(result.signals[name][-1])


TWICE = sum(0.01 * 0.01 * k for k in range(1, 11))
"""`second.y` at 0.1 s: the first is stepped first, and its new value is what the second one sees"""


def test_types_and_enumerations_by_name(tmp_path: Path) -> None:
    result = ran(alone(small(tmp_path), parameters={"mode": "backward", "gain": 2.0}))
    assert last(result, "it.y") == pytest.approx(-0.2)
    assert last(result, "it.count") == 10.0
    assert last(ran(alone(small(tmp_path), parameters={"mode": 2.0})), "it.y") == last(result, "it.y") / 2.0
    with pytest.raises(UsageError, match=r"components.it.parameters.mode = bakward: did you mean backward\? expected"):
        ran(alone(small(tmp_path), parameters={"mode": "bakward"}))
    with pytest.raises(UsageError, match=r"components.it.parameters.mode = 3: expected one of forward, backward"):
        ran(alone(small(tmp_path), parameters={"mode": 3}))
    with pytest.raises(UsageError, match=r"^components.it.record: label is a String: only numbers can be recorded"):
        ran(alone(small(tmp_path), record=("label",)))
    way = '<Enumeration name="way" valueReference="6" causality="output" declaredType="Mode" description="of it"/>'
    result = ran(alone(small(tmp_path / "3", fmi=3, more=way), parameters={"mode": "backward"}, array=True))
    assert (last(result, "it.way"), result.described["it.way"].text) == (2.0, "of it: 1 = forward, 2 = backward")


def test_a_number_that_a_type_does_not_hold_is_refused(tmp_path: Path) -> None:
    with opening.open_here(small(tmp_path), "it") as it:
        it.writer(("mode",), np.array([1.6]))()
        assert it.get("mode") == 2.0
        with pytest.raises(SimulatorError, match=r"^it.mode = 3e\+09: expected a number that int32 holds$"):
            it.writer(("mode",), np.array([3e9]))()
    big = '<Int64 name="big" valueReference="9" causality="parameter" variability="fixed" start="0"/>'
    path = small(tmp_path / "3", fmi=3, more=big)
    with opening.open_here(path, "it") as it:
        with pytest.raises(SimulatorError, match=r"^it.gain = 1e\+39: expected a number that float32 holds$"):
            it.writer(("gain",), np.array([1e39]))()
        with pytest.raises(UsageError, match=r"^it.big = 9007199254740993: expected a whole number that a float holds"):
            it.set("big", 2**53 + 1)
    wide = (
        f'<Int64 name="wide" valueReference="9" causality="input" start="{2**53 + 1} 1"><Dimension start="2"/></Int64>'
    )
    with opening.open_here(small(tmp_path / "array", fmi=3, more=wide), "it") as it:
        (call,) = it.calls_of(it.writer(("wide[2]",), np.ones(1)))
        assert call.part.buffer.tolist() == [2**53 + 1, 1], "what is set with an element keeps its digits"


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_a_source_that_a_type_does_not_hold_is_refused(engine: Any, tmp_path: Path) -> None:
    path = small(tmp_path, fmi=3, more='<Float32 name="w" valueReference="2" causality="input" start="0"/>')
    rises = tmp_path / "rises.csv"
    rises.write_text("time,w\n0,0\n0.1,1e39\n")
    system = dataclasses.replace(alone(path, array=True), sources={"s": Source(file=rises, to=("it.w",))})
    with pytest.raises(SimulatorError, match=r"^it.w = 4e\+38: expected a number that float32 holds, at t = 0.04 s$"):
        ran(system, engine=engine)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (' guid="small"', "", "its modelDescription.xml has no guid"),
        ('modelIdentifier="Small"', "", "its modelDescription.xml has no modelIdentifier"),
        ('name="high"', 'name="on"', "its modelDescription.xml has more than one variable on"),
        ("<CoSimulation", "<Other", "offers no interface; expected co-simulation, model exchange or sch"),
        ('fmiVersion="2.0"', 'fmiVersion="3.1"', "fmiVersion = 3.1: expected 1.0, 2.0 or 3.0"),
        ('valueReference="1"', 'valueReference="-1"', "y: valueReference = -1: expected a whole number of 32 bits"),
        (
            'causality="output"',
            'causality="outputt" initial="exact"',
            ": causality = outputt: expected one of parameter, calculatedPar",
        ),
        ('"Mode" start="1"', '"Mode" start="one"', "components.it.parameters.mode = one: expected a start value"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused_in_words(
    old: str, new: str, expected: str, tmp_path: Path
) -> None:
    files = files_of(small(tmp_path))
    text = files["modelDescription.xml"]
    assert old.encode() in text
    write_fmu(tmp_path / "odd.fmu", {**files, "modelDescription.xml": text.replace(old.encode(), new.encode())})
    with pytest.raises(UsageError, match=re.escape(expected)):
        ran(alone(tmp_path / "odd.fmu"))


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_a_boolean_is_wired_to_a_boolean_and_to_a_real(engine: Any, tmp_path: Path) -> None:
    path = small(tmp_path, "TRUTH=-1")  # as some tools have it: what is recorded and passed on is 1
    system = System(
        stop_time=0.1,
        components={
            "source": Component(fmu=str(path), step=0.01),
            "switch": Component(fmu=str(path), sampling=Sampling(period=0.01)),
            "meter": Component(fmu=str(path), step=0.01),
        },
        connections=(
            Connection(name="switched", start=("source.high",), end=("switch.on",)),
            Connection(name="measured", start=("source.high",), end=("meter.u",)),
        ),
        sources={"one": Source(constant=1.0, to=("source.u", "switch.u"))},
    )
    result = ran(system, engine=engine)
    high = result.signals["source.high"]
    assert high.tolist() == (result.signals["source.y"] > 0.045).astype(float).tolist()
    assert 0.0 < high.mean() < 1.0
    assert last(result, "switch.y") == pytest.approx(0.01 * high[:-1].sum())
    assert last(result, "meter.y") == pytest.approx(0.01 * high[1:].sum())


def test_a_fixed_step_is_kept_whatever_happens_between_its_points(tmp_path: Path) -> None:
    path = small(tmp_path, "FIXED_STEP", fixed_step=True)
    system = System(
        stop_time=0.1,
        components={
            "plant": Component(fmu=str(path), step=0.01, align="next"),
            "controller": Component(fmu=str(path), sampling=Sampling(period=0.01)),
        },
        connections=(Connection(name="late", start=("controller.y",), end=("plant.u",), delay=0.005),),
        sources={"one": Source(constant=1.0, to=("controller.u",))},
    )
    assert last(ran(system), "plant.count") == 10.0
    varying = alone(small(tmp_path / "other", "FIXED_STEP"), stop=0.105)  # it declares that it takes any step
    with pytest.raises(SimulatorError, match=r"it \(Small\): fmi2DoStep"):
        ran(varying)
    sampled = small(tmp_path / "sampled", fixed_step=True)
    assert not ran(alone(sampled, step=None, sampling=Sampling(period=0.01))).warnings
    (warning,) = ran(alone(sampled, step=None, sampling=Sampling(period=0.01, jitter=0.002))).warnings
    assert warning.startswith("it (Small): its steps differ in length")


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("sampling", [{"offset": 0.013}, {"jitter": 0.015}, {"offset": 0.02, "clock_ratio": 1.25}])
def test_the_first_step_of_a_task_begins_where_its_initialisation_was(
    fmi: int, sampling: dict[str, Any], tmp_path: Path
) -> None:
    """The FMU refuses a step that does not begin where the last one ended, or initialisation was."""
    path = small(tmp_path, "STRICT", "TELLS_START", fmi=fmi)
    output = "it.y[1]" if fmi == 3 else "it.y"
    result = ran(
        System(stop_time=0.1, components={"it": Component(fmu=str(path), sampling=Sampling(period=0.02, **sampling))})
    )
    first = result.signals["time"][result.signals["it.count"] == 1.0][0]
    assert first > 0.0
    assert result.signals[output][0] == sampling.get("clock_ratio", 1.0) * first


def test_a_task_without_a_sample_begins_at_the_start(tmp_path: Path) -> None:
    part = Component(fmu=str(small(tmp_path, "TELLS_START")), sampling=Sampling(period=0.02, offset=0.1))
    assert last(ran(System(stop_time=0.1, components={"it": part})), "it.y") == 0.0


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("load", [opening.open_here, IsolatedInstance])
def test_a_tolerance_is_that_of_the_file_else_of_the_declared_experiment(fmi: int, load: Any, tmp_path: Path) -> None:
    of_none, of_one = (
        small(tmp_path / f"{tolerance}", "TELLS_TOLERANCE", fmi=fmi, tolerance=tolerance) for tolerance in (None, 1e-3)
    )
    output, array = ("it.y[1]" if fmi == 3 else "it.y"), fmi == 3

    def tolerance_of(path: Path, **keys: Any) -> float:
        """The tolerance that initialisation receives: -1 for none."""
        return float(ran(alone(path, array=array, **keys), load=load).signals[output][0])

    assert (tolerance_of(of_none), tolerance_of(of_one)) == (-1.0, 1e-3)
    assert (tolerance_of(of_none, tolerance=1e-7), tolerance_of(of_one, tolerance=1e-7)) == (1e-7, 1e-7)


def test_a_tolerance_is_of_one_run(tmp_path: Path) -> None:
    path = small(tmp_path, "TELLS_TOLERANCE", tolerance=1e-3)
    with opening.open_here(path, "it") as it:
        it.set_tolerance(1e-7)
        it.reset()
        it.enter_initialization(0.0, 1.0)
        assert it.get("y") == 1e-3


def test_a_tolerance_is_positive() -> None:
    for tolerance in (0.0, -1e-3, float("nan"), float("inf")):
        with pytest.raises(UsageError, match=rf"^tolerance = {tolerance}: expected a positive number$"):
            Component(fmu="it.fmu", step=0.01, tolerance=tolerance)


def test_parameters_that_initialisation_loses_are_set_again(tmp_path: Path) -> None:
    with prepared(alone(small(tmp_path, "LOSES"), parameters={"gain": 3.0, "label": "x"})) as simulation:
        simulation.master.initialise()
        simulation.master.run()
        assert simulation.instances["it"].get("label") == "x"
        result = simulation.result()
    assert last(result, "it.y") == pytest.approx(0.3)
    assert not result.warnings


def test_a_parameter_that_an_fmu_does_not_take_is_a_warning(tmp_path: Path) -> None:
    result = ran(alone(small(tmp_path, "IGNORES"), parameters={"gain": 3.0}))
    assert result.warnings == ("it.gain: was set to 3.0, the FMU has 1.0",)


def test_a_value_of_an_objective_that_is_not_finite_is_a_warning_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "odd").mkdir()
    system = twice(small(tmp_path))
    second = Component(fmu=str(small(tmp_path / "odd", "ENDS=m->s.x[0] = NAN")), step=0.01)
    system = dataclasses.replace(system, components={**system.components, "second": second})
    result = ran(dataclasses.replace(system, objectives={"peak": "max(second.y)"}))
    judged = ran(dataclasses.replace(system, criterion=Criterion(good="max(second.y) < 2")))
    assert (result.metrics["peak"], judged.metrics["good"]) == (None, False)
    assert result.warnings == judged.warnings == ("second.y = nan at t = 0.06 s: what uses it may have no value",)
    assert ran(system).warnings == ()


@pytest.mark.parametrize("fmi", [2, 3])
def test_without_saved_states_asking_for_one_is_refused_by_name(fmi: int, tmp_path: Path) -> None:
    with prepared(alone(small(tmp_path, fmi=fmi, saves=False), array=fmi == 3)) as simulation:
        simulation.master.initialise()
        with pytest.raises(UsageError, match=r"^it: Small cannot save its state; expected canGetAndSetFMUstate"):
            simulation.master.saved()


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_saved_state_is_put_back(fmi: int, tmp_path: Path) -> None:
    output = "y[1]" if fmi == 3 else "y"
    with prepared(alone(small(tmp_path, fmi=fmi), array=fmi == 3)) as simulation:
        it = simulation.instances["it"]
        simulation.master.initialise()
        state = it.save()
        it.step(0.0, 0.5)
        assert it.get(output) == 0.5
        it.restore(state)
        assert it.get(output) == 0.0


def test_messages_have_their_arguments(tmp_path: Path) -> None:
    assert ran(alone(small(tmp_path / "a", "WARNS"))).warnings == ("it: it: level 7 is 50% of it",)
    with pytest.raises(SimulatorError, match=r"^it \(Small\): fmi2DoStep: it: level 7 is 50% of it, at t = 0.01 s$"):
        ran(alone(small(tmp_path / "b", "REFUSES")))
    with pytest.raises(SimulatorError, match=r"^it \(Small\): fmi3DoStep: level is too high, at t = 0.01 s$"):
        ran(alone(small(tmp_path / "c", "REFUSES", fmi=3), array=True))
    many = ran(alone(small(tmp_path / "d", "ENDS=say(m, WARNING, 7, t)"), stop=2.0)).warnings
    assert many[-2:] == ("it: it: level 7 is 1.04% of it", "it (Small): further warnings of this FMU are not kept")


def test_fmi_3_with_arrays_and_small_types(tmp_path: Path) -> None:
    path = small(tmp_path, fmi=3)
    system = System(
        stop_time=0.1,
        components={
            "a": Component(fmu=str(path), step=0.01, parameters={"gain": 0.1, "mode": "backward", "u[2]": 5.0}),
            "b": Component(fmu=str(path), sampling=Sampling(period=0.02)),
        },
        connections=(
            Connection(name="first", start=("a.y[1]",), end=("b.u[2]",)),
            Connection(name="second", start=("a.y[2]",), end=("b.u[1]",)),
            Connection(name="high", start=("a.high",), end=("b.on",)),
        ),
        sources={"one": Source(constant=1.0, to=("a.u[1]",))},
    )
    result = ran(system)
    gain = float(np.float32(0.1))
    assert last(result, "a.y[1]") == pytest.approx(-0.1 * gain)
    assert last(result, "a.y[2]") == pytest.approx(-0.5 * gain)
    assert not result.warnings
    on = System(stop_time=0.1, components=system.components, connections=system.connections[:2], sources=system.sources)
    t = np.arange(5) * 0.02
    result = ran(on)
    assert last(result, "b.y[2]") == pytest.approx(0.02 * -gain * t.sum())
    assert last(result, "b.y[1]") == pytest.approx(0.02 * -5.0 * gain * t.sum())


def test_an_element_that_is_set_leaves_the_others_as_they_were_saved(tmp_path: Path) -> None:
    with opening.open_here(small(tmp_path, fmi=3), "it") as it:
        one, two = np.array([1.0]), np.array([2.0])
        write_one, write_two = it.writer(("u[1]",), one), it.writer(("u[2]",), two)
        it.enter_initialization(0.0, 1.0)
        it.exit_initialization()
        write_one()
        write_two()
        state = it.save()
        two[0] = 7.0
        write_two()
        it.restore(state)
        write_one()
        assert (it.get("u[1]"), it.get("u[2]")) == (1.0, 2.0)


def test_clocks_and_event_mode_that_are_not_offered_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has clocks, but no event mode, in which they tick: tick"):
        ran(alone(small(tmp_path / "a", fmi=3, more=CLOCK), array=True))
    with pytest.raises(SimulatorError, match=r"it \(Small\): fmi3DoStep: the FMU asks for event mode"):
        ran(alone(small(tmp_path / "b", "NEEDS_EVENTS", fmi=3), array=True))


def test_fmi_3_what_cannot_be_connected_or_set_is_refused_by_name(tmp_path: Path) -> None:
    path = small(tmp_path, fmi=3, more=BINARY + SIZE)
    wired = System(
        stop_time=0.1,
        components={name: Component(fmu=str(path), step=0.01) for name in ("a", "b")},
        connections=(Connection(name="wire", start=("a.y[1]",), end=("b.blob",)),),
    )
    with pytest.raises(UsageError, match=r"^connections.wire.to: b.blob is a Binary; only .* can be connected$"):
        ran(wired)
    with pytest.raises(
        UsageError, match=r"size: is a structural parameter; expected none, as arrays keep the sizes .* value, 2: "
    ):
        ran(alone(path, array=True, parameters={"size": 2}))


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_that_is_once_per_process_has_one_of_its_own_when_needed_twice(fmi: int, tmp_path: Path) -> None:
    path = small(tmp_path, "ONCE", fmi=fmi, once=True)
    if fmi == 3:
        with prepared(alone(path, array=True)), prepared(alone(path, array=True)) as second:
            assert isinstance(second.instances["it"], IsolatedInstance)
        return
    with prepared(twice(path)) as simulation:
        kinds = [type(instance) for instance in simulation.instances.values()]
        assert issubclass(kinds[0], NativeInstance)
        assert kinds[1] is IsolatedInstance
        simulation.master.initialise()
        simulation.master.run()
        result = simulation.result()
    assert last(result, "second.y") == pytest.approx(TWICE)


def test_two_of_an_ordinary_fmu_share_the_process(tmp_path: Path) -> None:
    with prepared(twice(small(tmp_path))) as simulation:
        assert all(isinstance(instance, NativeInstance) for instance in simulation.instances.values())
        simulation.master.initialise()
        simulation.master.run()
        assert last(simulation.result(), "second.y") == pytest.approx(TWICE)


def test_an_fmu_that_keeps_statics_between_instances_is_as_if_each_were_the_first(tmp_path: Path) -> None:
    path = small(tmp_path, "STATICS")
    result = ran(twice(path))
    assert last(result, "first.y") == pytest.approx(0.1)
    assert last(result, "second.y") == pytest.approx(TWICE)
    assert last(ran(alone(path)), "it.y") == pytest.approx(0.1)


def test_a_crash_of_an_isolated_fmu_is_an_error_in_words(tmp_path: Path) -> None:
    path = small(tmp_path, "CRASHES")
    name = signal.Signals.SIGABRT.name
    with pytest.raises(SimulatorError, match=rf"^it \(Small\): its process ended by {name}, at t = 0.01 s$"):
        ran(alone(path), load=IsolatedInstance)


def test_what_an_isolated_fmu_refuses_reads_as_if_it_were_not(tmp_path: Path) -> None:
    path = small(tmp_path, "REFUSES")
    messages = []
    for load in (opening.open_here, IsolatedInstance):
        with pytest.raises(SimulatorError) as error:
            ran(alone(path), load=load)
        messages.append(str(error.value))
    assert messages[0] == messages[1]


def test_isolated_or_not_a_run_is_the_same_to_the_bit(tmp_path: Path) -> None:
    system = alone(small(tmp_path, "WARNS"), parameters={"gain": 0.3, "mode": "backward"})
    here, there = ran(system, load=opening.open_here), ran(system, load=IsolatedInstance)
    assert here.rows.tobytes() == there.rows.tobytes()
    assert here.warnings == there.warnings


@pytest.mark.skipif(sys.platform == "win32", reason="processes are looked for in the way of POSIX")
def test_the_process_of_an_isolated_fmu_ends_with_its_parent(tmp_path: Path) -> None:
    path = small(tmp_path)
    script = textwrap.dedent("""
        import os, sys
        from pathlib import Path
        from orchestration.components.fmi.isolated_instance import IsolatedInstance

        instance = IsolatedInstance(Path(sys.argv[1]), "it")
        print(instance._child.pid, flush=True)
        os.kill(os.getpid(), 9)
    """)
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)],
        capture_output=True,
        text=True,
        env=subprocesses.environment(),
        check=False,
    )
    assert gone(int(done.stdout))


@pytest.mark.parametrize("load", ["open_here", "IsolatedInstance"])
def test_what_an_fmu_prints_is_not_among_what_the_command_prints(load: str, tmp_path: Path) -> None:
    path = small(tmp_path, "PRINTS")
    script = textwrap.dedent(f"""
        import sys
        from orchestration.foundation.basics.terminal import banners_to_stderr
        from orchestration.components.fmi.opening import open_here
        from orchestration.components.fmi.isolated_instance import IsolatedInstance
        from orchestration.systems.system.component import Component
        from orchestration.systems.system.model import System
        from orchestration.simulation.runs.prepared import prepared

        system = System(stop_time=0.1, components={{"it": Component(fmu=sys.argv[1], step=0.01)}})
        print("before")
        with banners_to_stderr():
            with prepared(system, load={load}) as simulation:
                simulation.master.initialise()
                simulation.master.run()
            print("inside")
        print("after")
    """)
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)],
        capture_output=True, text=True, env=subprocesses.environment(PYTHONUNBUFFERED=""), check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["before", "inside", "after"]
    assert done.stderr.count("SMALL FMU, version 1") == 1
    assert done.stderr.count("stepping") == 10


def test_a_banner_does_not_spoil_the_json_of_a_command(tmp_path: Path) -> None:
    path = small(tmp_path, "PRINTS")
    (tmp_path / "system.toml").write_text(
        f'stop_time = 0.1\n[components.it]\nfmu = "{path.name}"\nstep = 0.01\n[objectives]\npeak = "max(it.y)"\n'
    )
    done = subprocess.run(
        subprocesses.command("orchestration.command.cli", "run", "system.toml", "--json"),
        cwd=tmp_path, capture_output=True, text=True, env=subprocesses.environment(), check=True,
    )  # fmt: skip
    assert json.loads(done.stdout)["peak"] == 0.0
    assert "SMALL FMU, version 1" in done.stderr


def test_an_fmu_finds_all_of_its_archive_but_for_one_of_this_kit_what_is_for_people(tmp_path: Path) -> None:
    path = small(tmp_path)
    write_fmu(path, {**files_of(path), "documentation/index.html": b"", "sources/small.c": b"", "extra/a": b""})
    plants = [locate("QuadrotorPlant"), locate("native/QuadrotorPlant")]
    found = []
    for fmu in (path, *plants):
        with opening.open_here(fmu, "it") as it:
            assert it._folder is not None
            found.append({each.name for each in it._folder.path.iterdir()})
    assert found[0] == {"modelDescription.xml", "binaries", "documentation", "sources", "extra"}
    for plant, of_kit in zip(plants, found[1:]):
        assert of_kit == {name.partition("/")[0] for name in files_of(plant)} - {"documentation", "sources"}
        assert of_kit >= {"modelDescription.xml", "binaries", "resources"}


def test_on_other_processors_an_fmu_of_fmi_2_is_found_by_the_name_of_fmi_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if this machine were one: the folder of the standard goes before that which tools have for all processors."""
    monkeypatch.setitem(slaves.FOLDERS, 2, ("aarch64-linux", fmpy.platform))
    path = small(tmp_path)
    with opening.open_here(path, "it") as it:
        assert it.get("gain") == 1.0
    content = {name.replace(fmpy.platform, "aarch64-linux"): each for name, each in files_of(path).items()}
    write_fmu(path, {**content, f"binaries/{fmpy.platform}/Small{fmpy.sharedLibraryExtension}": b"of x86"})
    with opening.open_here(path, "it") as it:
        assert it.get("gain") == 1.0
    write_fmu(path, {name.replace("aarch64-linux", "win64"): each for name, each in content.items()})
    with pytest.raises(QuadcosimError, match=f"no binary for aarch64-linux or {fmpy.platform}, only for win64$"):
        opening.open_here(path, "it")
