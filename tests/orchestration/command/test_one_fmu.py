"""`quadcosim run MODEL.fmu`: what `fmpy simulate` does, to the bit where its times are those of a clock."""

from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.util import read_csv, write_csv

from orchestration.command.flags import FlightFlags, request_from
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import resolve
from orchestration.simulation.requests.one_fmu import remarks
from orchestration.simulation.requests.request import load_request, request_from_tables
from orchestration.systems.system.paths import changed
from quadcosim import UsageError, run
from tests.commands import Main
from tests.orchestration.components.fmi.exchange import clock, exchange, law, partitions
from tests.orchestration.components.fmi.small import known, needs_compiler, small

JUMPING = """"time","thrust","torque.x"
0,9.75,0
0.5,9.5,0.01
0.5,12,0.02
2,11,0.01
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def by_fmpy(fmu: Path, inputs: Path | None = None, **how: object) -> str:
    """The file that fmpy writes of its run."""
    signals = None if inputs is None else read_csv(inputs)
    write_csv("by_fmpy.csv", fmpy.simulate_fmu(str(fmu), validate=False, input=signals, **how))
    return Path("by_fmpy.csv").read_text()


def test_rows_and_file_are_those_of_fmpy_to_the_bit(main: Main, built: dict[str, Path], here: Path) -> None:
    inputs, fmu = here / "jumping.csv", built["QuadrotorPlant"]
    inputs.write_text(JUMPING)
    flags = ("--stop-time", "1.5", "--output-interval", "0.0625", "--set", "mass=1.2")
    chosen = ("--record", "tilt", "--record", "position.z")
    main("run", fmu, "--inputs", inputs, "--output", "out.csv", *chosen, *flags)
    how = {"stop_time": 1.5, "output_interval": 0.0625, "start_values": {"mass": 1.2}}
    assert Path("out.csv").read_text() == by_fmpy(fmu, inputs, output=["tilt", "position.z"], **how)


@needs_compiler
@pytest.mark.parametrize(
    ("fmi", "start", "by_element"), [(2, "8", ["u=8"]), (3, "8 0.3", ["u[1]=8", "u[2]=0.3"]), (3, "8 0.3", ["u=8 0.3"])]
)
def test_types_arrays_and_held_inputs_are_those_of_fmpy(
    main: Main, here: Path, fmi: int, start: str, by_element: list[str]
) -> None:
    inputs, fmu = here / "held.csv", known(small(here, fmi=fmi))
    inputs.write_text("time,on\n0,1\n0.25,0\n1,1\n")
    flags = ("--output", "out.csv", "--output-interval", "0.125", *(w for each in by_element for w in ("--set", each)))
    main("run", fmu, "--in-process", "--inputs", inputs, *flags)
    how = {"output_interval": 0.125, "stop_time": 1.0, "start_values": {"u": start}}
    assert Path("out.csv").read_text() == by_fmpy(fmu, inputs, **how)
    assert "True" in Path("out.csv").read_text()
    main("run", fmu, "--in-process", "--inputs", inputs, "--record", "on", *flags)
    assert Path("out.csv").read_text() == by_fmpy(fmu, inputs, output=["on"], **how), "inputs are recorded, too"


@needs_compiler
def test_an_integer_of_64_bits_is_in_the_file_what_it_is_by_fmpy_or_refused(main: Main, here: Path) -> None:
    most = '<Int64 name="most" valueReference="11" causality="output"/>'
    flags = ("--in-process", "--output", "out.csv", "--output-interval", "0.5")
    fmu = known(small(here, "MOST_IS=INT64_MIN", fmi=3, more=most))
    main("run", fmu, *flags, "--record", "most")
    assert Path("out.csv").read_text() == by_fmpy(fmu, output=["most"], output_interval=0.5, stop_time=1.0)
    for engine in ("compiled", "python"):
        fmu = small(here / engine, "MOST_IS=INT64_MAX-(s->count<1)*1023", fmi=3, more=most)
        refused = main("run", fmu, *flags, "--engine", engine, "--record", "most", code=1).stderr
        named = f"Small.most = {2**63 - 1}: expected a whole number that a float holds: all are up to 2**53"
        assert f"{named}; it runs where this is neither recorded nor connected, at t = 0.5 s" in refused
        main("run", fmu, *flags, "--engine", engine, "--record", "count")


def test_without_flags_the_default_experiment_runs_as_in_fmpy(built: dict[str, Path]) -> None:
    system = load_request(built["QuadrotorPlant"]).as_system()
    (component,) = system.components.values()
    assert (system.stop_time, component.step) == (30.0, 0.04)  # fmpy: 0.01 s, doubled up to 1000 rows


@needs_compiler
def test_without_an_experiment_it_is_one_second_in_the_steps_of_fmpy(here: Path) -> None:
    (component,) = load_request(small(here)).as_system().components.values()
    assert component.step == fmpy.util.auto_interval(1.0)


@needs_compiler
def test_a_default_end_that_is_long_is_said_with_its_steps(here: Path) -> None:
    system = load_request(small(here, fmi=3, tolerance='1e-6" stopTime="1e8')).as_system()  # type: ignore[arg-type]
    (remark,) = remarks(system, is_default_end=True)
    assert remark.startswith("runs for 1e+08 s, as ")
    assert "declares, in 500 steps of 200000 s; --stop-time T ends sooner" in remark
    assert not [*remarks(system, is_default_end=False)]


@needs_compiler
def test_all_commands_set_what_run_sets_and_a_value_that_cannot_be_read_is_named(main: Main, here: Path) -> None:
    fmu = known(small(here, fmi=3, more='<Int8 name="lost" valueReference="99" causality="output"/>'))
    (component,) = request_from(fmu, FlightFlags(set=["gain=2"])).as_system().components.values()
    assert component.parameters == {"gain": 2.0}
    refused = main("run", fmu, "--in-process", code=1).stderr
    assert "u = 1 2 3: expected 2 numbers" in main("run", fmu, "--set", "u=1 2 3", code=2).stderr
    assert "fmi3GetInt8: returned fmi3Error, without a message, for lost" in refused


@needs_compiler
@pytest.mark.parametrize("written", ["1 2.5", [1, 2.5]])
def test_an_array_of_a_component_is_a_list_or_a_text(here: Path, written: object) -> None:
    component, path = {"fmu": str(small(here, fmi=3)), "step": 0.1}, "components.a.parameters.u"
    tables = {"stop_time": 1.0, "components": {"a": {**component, "parameters": {"u": written}}}}
    system = request_from_tables(tables, here).as_system()
    assert system.components["a"].parameters == {"u[1]": 1, "u[2]": 2.5}
    plain = request_from_tables({**tables, "components": {"a": component}}, here).as_system()
    assert changed(plain, {path: written}) == system
    with pytest.raises(UsageError, match=r"^components\.a\.parameters\.u = \[1\]: expected 2 numbers"):
        changed(plain, {path: [1]})
    with pytest.raises(UsageError, match=r"^components\.a\.parameters\.u: is an array; expected a list of its 2"):
        resolve(changed(plain, {path: 1}))


@needs_compiler
def test_periodic_clocks_tick_and_what_may_change_between_ticks_needs_a_system(main: Main, here: Path) -> None:
    inputs, out, fmu = here / "in.csv", here / "out.csv", law(here, clock("fast"))
    inputs.write_text("time,u,w\n0,1,0\n1,3,0\n1,5,0\n2,7,0\n")
    main("run", fmu, "--in-process", "--inputs", inputs, "--record", "y", "--output", out, "--stop-time", "2")
    assert out.read_text().split() == ['"time","y"', "0.0,-1.0", "0.5,-1.0", "1.0,-5.0", "1.5,-5.0", "2.0,-5.0"]
    refused = main("run", fmu, code=2).stderr
    assert "law.fmu: period, misused, ticks, slow_ticks may change between the ticks of its clocks" in refused
    assert "expected --record of outputs that do not, y, or a system, of which quadcosim connect" in refused
    fmu = law(here, clock("fast", "fixed", ""))
    assert "its clock fast states no interval; expected --output-in" in main("run", fmu, "--record", "y", code=2).stderr
    main("run", fmu, "--in-process", "--record", "y", "--output-interval", "0.25", "--output", out)
    assert len(out.read_text().split()) == 6
    refused = main("run", partitions(here), code=2).stderr
    assert "a partition: inClock1, inClock2, inClock3; expected a system of them, of which quadcosim conn" in refused


@needs_compiler
def test_the_rows_until_a_crash_are_in_the_file(main: Main, here: Path) -> None:
    fmu = known(small(here, "ENDS=abort()"))
    said = main("run", fmu, "--output", "out.csv", "--output-interval", "0.01", code=1).stderr
    assert "ended by SIGABRT" in said
    assert "; the rows until then are in out.csv" in said
    assert [row.split(",")[0] for row in Path("out.csv").read_text().split()[1:]] == [
        "0.0", "0.01", "0.02", "0.03", "0.04", "0.05"
    ]  # fmt: skip


def numbers(rows: list[str]) -> list[float]:
    """All cells, one after the other; False and True as 0 and 1."""
    cells = " ".join(rows).replace(",", " ").split()
    return [float({"False": 0, "True": 1}.get(cell, cell)) for cell in cells]


OFF = "time,u,on\n0,1,0\n0.1,1,1\n0.2534,2,1\n0.2534,3,1\n0.30000000000000004,4,1\n2,4,0\n"


@needs_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_step_ends_where_an_input_jumps_as_in_fmpy(main: Main, here: Path, fmi: int) -> None:
    inputs, fmu = here / "off.csv", known(small(here, fmi=fmi))
    rows = [line.split(",") for line in OFF.splitlines()]
    array = {2: "{0}", 3: "{0} {0}"}[fmi]
    inputs.write_text("time,u,on\n" + "".join(f"{t},{array.format(u)},{on}\n" for t, u, on in rows[1:]))
    flags = ("--in-process", "--inputs", inputs, "--output", "out.csv", "--stop-time", "1")
    for interval in (0.1, 0.3):
        ran = main("run", fmu, *flags, "--output-interval", str(interval))
        assert "jumps" not in ran.stderr
        assert "nothing is sampled" not in ran.stdout
        by_fmpy(fmu, inputs, stop_time=1.0, output_interval=interval)
        one, other = (Path(name).read_text().splitlines() for name in ("out.csv", "by_fmpy.csv"))
        assert one[0] == other[0]
        assert numbers(one[1:]) == pytest.approx(numbers(other[1:]), abs=1e-9)
        assert any(line.startswith("0.2534,") for line in one)


@needs_compiler
def test_a_jump_inside_of_a_step_that_cannot_end_there_is_warned_of_with_the_step_that_has_it(
    main: Main, here: Path
) -> None:
    inputs, fmu = here / "off.csv", known(small(here, fixed_step=True))
    flags = ("--in-process", "--inputs", inputs, "--stop-time", "1")
    inputs.write_text(OFF)
    warned = main("run", fmu, *flags, "--output-interval", "0.1").stderr
    assert "off.csv: input u jumps at 0.2534 s, between steps of 0.1 s, which the FMU takes only: " in warned
    assert "it has it from 0.3 s on; --output-interval 0.0002 has every jump at its time" in warned
    assert warned.count("jumps") == 1
    assert "jumps" not in main("run", fmu, *flags, "--output-interval", "0.0002").stderr
    inputs.write_text("time,on\n0,0\n0.25,1\n0.3000000000000001,0\n2,1\n")
    assert "input on jumps at 0.25 s" in main("run", fmu, *flags, "--output-interval", "0.1").stderr


@needs_compiler
def test_points_are_refused_where_no_step_ends_at_them(here: Path) -> None:
    def refused(**component: Any) -> str:
        with pytest.raises(UsageError) as refusal:
            run({"stop_time": 1.0, "components": {"it": {"fmu": str(fmu), "step": 0.5, **component}}}, in_process=True)
        return str(refusal.value)

    fmu = known(small(here))
    assert "points = (0.3, 0.2): expected positive times that increase" in refused(points=[0.3, 0.2])
    fmu = known(small(here / "fixed", fixed_step=True))
    assert "components.it.points: it takes steps of one length only; expected none" in refused(points=[0.2])


@needs_compiler
def test_a_whole_number_that_a_float_does_not_hold_is_refused_from_a_flag_a_file_and_a_source(
    main: Main, here: Path
) -> None:
    inputs, big = here / "big.csv", '<Int64 name="big" valueReference="9" causality="input" start="0"/>'
    fmu = known(small(here, fmi=3, more=big))
    for number in (2**53 + 1, 2**63 - 1):
        refused = main("run", fmu, "--in-process", "--set", f"big={number}", code=2).stderr
        assert f"big = {number}: expected a whole number that a float holds" in refused
    refused = main("run", fmu, "--in-process", "--set", f"big={2**63}", code=2).stderr  # a float that UInt64 takes
    assert f"big = {2**63}: expected a whole number of 64 bits" in refused
    inputs.write_text(f"time,big\n0,1\n1,{2**53 + 1}\n")
    refused = main("run", fmu, "--in-process", "--inputs", inputs, code=2).stderr
    assert f"big.csv: line 3: big = {2**53 + 1}: expected a whole number that a float holds" in refused
    inputs.write_text(f"time,big\n0,1\n1,{2**63 - 1}\n")
    refused = main("run", fmu, "--in-process", "--inputs", inputs, code=2).stderr
    assert f"big.csv: line 3: big = {2**63 - 1}: expected a whole number that a float holds" in refused
    system: dict[str, Any] = {"stop_time": 1.0, "components": {"it": {"fmu": str(fmu), "step": 0.5}}}
    for source, place in (
        ({"file": "big.csv"}, "big.csv: line 3: big"),
        ({"constant": 2**63 - 1}, "sources.s.constant"),
    ):
        with pytest.raises(UsageError, match=rf"{place} = {2**63 - 1}: expected a whole number that a float holds"):
            run(system | {"sources": {"s": {"to": ["it.big"], **source}}}, in_process=True)
    inputs.write_text(f"time,big\n0,{-(2**63)}\n1,{2**62}\n")
    main("run", fmu, "--in-process", "--inputs", inputs, "--stop-time", "1")


@needs_compiler
@pytest.mark.parametrize(
    ("table", "refusal"),
    [
        ("time,on,small\n0,True,1\n1,0,2.7\n", "line 3: small = 2.7: expected a whole number: it is an Int8"),
        ("time,on\n0,true\n1,.5\n", "line 3: on = 0.5: expected 0 or 1, or false or true: it is a Boolean"),
        ("time\n0\n1\n", "feeds no input; expected time and columns of its inputs, u[1], u[2], on, small, way"),
        ("", "feeds no input; expected time and columns of its inputs, u[1], u[2], on, small, way"),
        ("time,label\n0,a\n1,b\n", "label is a String: a file feeds numbers only, to u[1], u[2], on, small, way"),
        ("time,on\n0,yes\n1,no\n", "line 2: on = yes: expected numbers only"),
        ("time,small\n0,1\n1,300\n", "line 3: small = 300: expected a whole number of 8 bits"),
        ("time,u\n0,1 2 3\n1,1 2 3\n", "line 2: u[3] = 3.0: expected 2 numbers of u"),
        ("time,u\n0,1\n1,2\n", "line 2: u = 1: expected 2 numbers"),
        ("time,way\n0,1\n1,backward\n", "line 3: way = backward: expected the number of the item, 2"),
        ("time;on\n0;1\n", "columns separated by semicolons; expected commas, and points in numbers"),
    ],
    ids=[
        "whole",
        "boolean",
        "only time",
        "empty",
        "text",
        "word",
        "range",
        "too many",
        "too few",
        "item",
        "semicolons",
    ],
)
def test_a_table_that_does_not_fit_the_inputs_is_refused(main: Main, here: Path, table: str, refusal: str) -> None:
    more = '<Int8 name="small" valueReference="9" causality="input" start="0"/>'
    more += '<Enumeration name="way" declaredType="Mode" valueReference="11" causality="input" start="1"/>'
    more += '<String name="label" valueReference="10" causality="input"><Start value=""/></String>'
    fmu, inputs = known(small(here, fmi=3, more=more)), here / "table.csv"
    inputs.write_text(table)
    assert f"table.csv: {refusal}" in main("run", fmu, "--inputs", inputs, code=2).stderr


@needs_compiler
def test_an_index_of_no_variable_is_named_as_the_fault_of_the_description(
    main: Main, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fmpy, "read_model_description", lambda *_, **__: [][7])
    refused = main("run", small(here), code=2).stderr
    assert (
        "small.fmu: expected an FMU with a valid modelDescription.xml: its ModelStructure has an index of no" in refused
    )


LINES = "time,u,w\n5,0,0\n5.7,1.4,0\n6,2,0\n6,-1,0\n6.3,0.5,0\n7,4,0\n"


@needs_compiler
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("more", [(), ("--in-process", "--engine", "python"), ("--solver", "cvode")])
def test_the_solver_has_inputs_along_their_lines_as_the_exact_integral(
    main: Main, here: Path, fmi: int, more: tuple[str, ...]
) -> None:
    inputs, out = here / "lines.csv", here / "out.csv"
    inputs.write_text(LINES)
    flags = ("--start-time", "5", "--stop-time", "7", "--output-interval", "0.5", "--tolerance", "1e-10")
    recorded = [word for name in ("x1", "x2", "updates") for word in ("--record", name)]
    fmu = exchange(here, "integrator", fmi=fmi)
    main("run", fmu, "--inputs", inputs, *flags, *more, "--output", out, *recorded)
    found = read_csv(str(out))
    assert found["time"].tolist() == [5.0, 5.5, 6.0, 6.5, 7.0]
    x1, x2, exact = 1.0, 0.0, [(1.0, 0.0)]
    for h, u, slope in ((0.5, 0, 2), (0.2, 1, 2), (0.3, 1.4, 2), (0.3, -1, 5), (0.2, 0.5, 5), (0.5, 1.5, 5)):
        x1, x2 = x1 + h * (x2 + h * (u / 2 + h * slope / 6)), x2 + h * (u + h * slope / 2)
        exact.append((x1, x2))
    for name, values in zip(("x1", "x2"), zip(*(exact[k] for k in (0, 1, 3, 5, 6)))):
        assert found[name] == pytest.approx(values, abs=1e-8)
    if not more and fmi == 3:  # fmpy holds them in a step, of an FMU without event indicators
        how = {"start_time": 5.0, "stop_time": 7.0, "output_interval": 2**-7, "relative_tolerance": 1e-8}
        by_fmpy(fmu, inputs, output=["x1"], record_events=False, **how)
        assert read_csv("by_fmpy.csv")["x1"][-1] == pytest.approx(x1, abs=0.05)
    assert found["updates"].tolist()[-1] == 2  # at the beginning, and at the jump


@needs_compiler
def test_a_source_of_a_system_is_followed_within_steps_where_it_says_so(here: Path) -> None:
    (here / "lines.csv").write_text(LINES)
    source = {"to": ["it.u"], "file": "lines.csv", "start_time": 5.0, "within_steps": True}
    component = {"fmu": str(exchange(here, "integrator")), "step": 2.0}
    system: dict[str, Any] = {"stop_time": 2.0, "components": {"it": component}, "sources": {"lines": source}}
    assert run(system, in_process=True).signals["it.x2"][-1] == pytest.approx(2.5, abs=1e-8)  # with its jump inside
    del source["within_steps"]
    assert run(system, in_process=True).signals["it.x2"][-1] == 0.0
    source["within_steps"], component["fmu"] = True, str(small(here))
    with pytest.raises(UsageError, match=r"within_steps = true: it.u is called by co-simulation; expected model-ex"):
        run(system, in_process=True)


@needs_compiler
def test_flags_of_one_fmu_are_refused_for_a_system_and_those_of_a_loop_for_one(main: Main, here: Path) -> None:
    assert "--output-interval: for one FMU only" in main("run", "--output-interval", "0.1", code=2).stderr
    assert "--delay: for the quadrotor only" in main("run", small(here), "--delay", "0.1", code=2).stderr
    Path("wrong.csv").write_text("time,v\n0,1\n1,1\n")
    refused = main("run", here / "small.fmu", "--inputs", "wrong.csv", code=2).stderr
    assert "Small has no input v; its inputs are u, on" in refused


@needs_compiler
def test_a_model_of_differential_equations_is_solved_as_near_to_fmpy_as_is_asked(main: Main, here: Path) -> None:
    fmu = exchange(here, "oscillator")
    flags = ("--stop-time", "2", "--output-interval", "0.125", "--tolerance", "1e-10", "--set", "p=1.5")
    chosen = ("--record", "x1", "--record", "x2")
    main("run", fmu, "--in-process", "--interface", "model-exchange", "--output", "out.csv", *flags, *chosen)
    how: dict[str, Any] = {
        "stop_time": 2.0,
        "output_interval": 0.125,
        "relative_tolerance": 1e-10,
        "start_values": {"p": 1.5},
    }
    by_fmpy(fmu, output=["x1", "x2"], record_events=False, **how)
    one, other = (read_csv(name) for name in ("out.csv", "by_fmpy.csv"))
    for name in ("time", "x1", "x2"):
        assert one[name] == pytest.approx(other[name], abs=1e-6)
    main("run", fmu, "--in-process", "--solver", "cvode", "--output", "cvode.csv", *flags, *chosen)
    by_cvode = read_csv("cvode.csv")
    assert by_cvode["x1"] == pytest.approx(one["x1"], abs=1e-6)
    assert by_cvode["x1"].tolist() != one["x1"].tolist()
    assert "--solver rk4: expected one of dormand-prince" in main("run", fmu, "--solver", "rk4", code=2).stderr
    refused = main("run", fmu, "--interface", "co-simulation", code=2).stderr
    assert "interface = co-simulation: Oscillator does not offer it; expected model-exchange" in refused


@needs_compiler
def test_an_experiment_may_begin_later_and_inputs_end_before_as_in_fmpy(main: Main, here: Path) -> None:
    inputs, fmu = here / "short.csv", known(small(here, fmi=3, tolerance='1e-6" startTime="5" stopTime="7'))  # type: ignore[arg-type]
    inputs.write_text("time,u\n5.25,1 2\n6,3 -1\n")
    flags = ("--inputs", inputs, "--output-interval", "0.125", "--in-process")
    ran = main("run", fmu, *flags, "--output", "out.csv")
    expected = by_fmpy(fmu, inputs, output_interval=0.125)
    assert Path("out.csv").read_text() == expected
    assert [expected.splitlines()[i].partition(",")[0] for i in (1, -1)] == ["5.0", "7.0"]
    assert "its time begins at 5 s, where that of the run is 0" in ran.stderr
    assert "short.csv covers 5.25 to 6 s: its first and last row hold before and after" in ran.stderr
    main("run", fmu, *flags, "--start-time", "5.5", "--stop-time", "6.5", "--engine", "python", "--output", "out.csv")
    assert Path("out.csv").read_text() == by_fmpy(fmu, inputs, output_interval=0.125, start_time=5.5, stop_time=6.5)
    assert "runs from 7 s to 7 s: expected an end after" in main("run", fmu, "--start-time", "7", code=2).stderr


@needs_compiler
def test_an_fmu_is_called_at_its_own_time_by_both_loops_and_its_events_are_at_those_of_the_run(here: Path) -> None:
    component = {"fmu": str(exchange(here, "stair")), "step": 0.7, "start_time": 0.5}
    for engine in ("python", "compiled"):
        result = run({"stop_time": 3.5, "components": {"it": component}}, engine=engine, in_process=True)
        assert result.signals["it.count"].tolist() == [1, 2, 2, 3, 4, 5]
        assert [event.time for event in result.events] == [k * 10**9 + 5 * 10**8 for k in range(4)]
    with pytest.raises(UsageError, match=r"components.it.start_time = 0.5: expected 0 for one of many at once"):
        Shape(system=result.system, models={}, lanes=1)


@needs_compiler
def test_objectives_of_a_component_with_events_within_steps_are_told_to_be_of_the_rows(main: Main, here: Path) -> None:
    file, fmu = here / "ball.toml", known(exchange(here, "ball"))
    text = f'stop_time = 2.0\n[components.b]\nfmu = "{fmu.name}"\nstep = 0.5\n[objectives]\nn = '
    note = "events within steps of b: objectives are of the rows; a shorter step brings them nearer"
    for objective, is_told in (("max(b.x1)", True), ("max(time)", False)):
        file.write_text(f'{text}"{objective}"\n', "utf-8")
        assert (note in main("run", file, "--in-process").stderr) is is_told
