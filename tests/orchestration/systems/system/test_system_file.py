"""System files: an error is one line that names the place and what is valid; writing and reading give the same."""

from pathlib import Path

import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios import translation
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.simulation.requests.request import load_request
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.file import load_system, schema, system_from_tables
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, value_at

SHIPPED = Path(translation.__file__).with_name("system.toml")

TANK = Path(__file__).with_name("test_system_file.toml").read_text(encoding="utf-8")


def loaded(folder: Path, text: str):
    file = folder / "system.toml"
    file.write_text(text, encoding="utf-8")
    return load_system(file)


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(UsageError) as refused:
        loaded(folder, text)
    line = str(refused.value)
    assert line.startswith(f"{folder / 'system.toml'}: ")
    assert line.isprintable()
    return line.partition(": ")[2]


@pytest.mark.parametrize(
    ("right", "wrong", "line"),
    [
        (
            "align =",
            "aling =",
            "components.tank.aling: no such key; expected one of fmu, parameters, step, points, sampling, ",
        ),
        ("jitter =", "jiter =", "components.controller.sampling.jiter: no such key; expected one of period, offset, "),
        ("delay =", "delai =", "connections.1.delai: no such key; expected one of name, from, to, order, delay, "),
        ("noise = 0.1", "nois = 0.1", "sources.rain.nois: no such key; expected one of to, constant, file, interp"),
        ("good =", "god =", "criterion.god: no such key; expected one of good, diverged, outcomes"),
        ("seed = 3", "sead = 3", "sead: no such key; expected one of stop_time, seed, components, "),
        ("step = 0.01", 'step = "fast"', "components.tank.step = 'fast': expected a valid number"),
        (
            "step = 0.01",
            'step = "10 ms"',
            "components.tank.step = '10 ms': expected a valid number without its unit; times are in seconds",
        ),
        ("step = 0.01", "step = -1.0", "components.tank.step = -1.0: expected a positive number"),
        (
            "step = 0.01",
            "",
            "components.tank.step = none: expected step (continuous time) or sampling (a digital task)",
        ),
        ("period = 0.1,", "period = 0.01,", "components.controller.sampling.jitter = 0.02: expected less than the "),
        (
            '"normal"',
            '"gauss"',
            "components.controller.sampling.jitter_distribution = 'gauss': expected 'uniform'",
        ),
        ("area = 2.0", "area = [1]", "components.tank.parameters.area = [1]: expected a number, true, false or a text"),
        ('"tank.level"]', '"tnk.level"]', "connections.0.from: tnk.level: no such component; expected one of tank, "),
        ('["tank.valve"]', '["tank.valve", "tank.x"]', "connections.valve.to = 2: expected 1 inputs, one for each"),
        ('["tank.inflow"]', '["tank.valve"]', "sources.rain.to: tank.valve is fed by connections.valve already; "),
        ('["tank.inflow"]', '["pond.inflow"]', "sources.rain.to: pond.inflow: no such component; expected one of tank"),
        ("loss = 0.1", "loss = 1.1", "connections.valve.loss = 1.1: expected a probability in [0, 1]"),
        ("loss = 0.1", "loss = 0.9", "connections.valve.loss = 0.9: expected at most 0.666667 in bursts of 2"),
        ("noise = 0.001", "noise = -1.0", "connections.0.noise of level = -1.0: expected zero or positive"),
        (
            "noise = 0.001",
            "noise = { lvl = 1.0 }",
            "connections.0.noise: lvl is no signal of it; expected one of level",
        ),
        (
            "noise = 0.001",
            "quantisation = { lvl = 1.0 }",
            "connections.0.quantisation: lvl is no signal of it; expecte",
        ),
        ('hold = "first"', 'hold = "last"', "connections.1.hold = 'last': expected 'zero' or 'first'"),
        ("period = 0.5", "", "sources.rain.period = none: expected how long each value is held, in seconds"),
        (
            "noise = 0.1\n",
            "",
            "sources.rain.constant = none: expected it, or one of file, noise, signal, trajectory",
        ),
        (
            "noise = 0.1\n",
            "noise = 0.1\nconstant = 1.0\n",
            "sources.rain.noise = 0.1: expected none beside constant: a source has one of constant, file, noise, "
            "signal, trajectory; noise on top is a source of its own, to an input that the FMU adds",
        ),
        ('"max(tank.level)"', '"max(tank.level"', "objectives.peak: "),
        ('"peak < 2.5"', '"open(1)"', "criterion.good: "),
        ('"abs(tank.level) > 100"', '"__import__(1)"', "criterion.diverged: "),
        ("stop_time = 60.0", "stop_time = 0.0", "stop_time = 0.0: expected a positive number"),
        ("stop_time = 60.0", "", "stop_time: expected a value"),
        ("seed = 3", "seed = 0.5", "seed = 0.5: "),
        ('name = "valve"', 'name = "0"', "connections = 0: expected a different name for each"),
        ("[sources.rain]", '[sources."a.b"]', "sources = a.b: expected a name in printable characters without a dot"),
        ('name = "valve"', 'name = "a\\nb"', "connections = a\\nb: expected a name in printable characters"),
        ("stop_time = 60.0", "stop_time = nan", "stop_time = nan: expected a positive number"),
        ("stop_time = 60.0", "stop_time = 1e-10", "stop_time = 1e-10: expected at least a nanosecond"),
        ("step = 0.01", "step = true", "components.tank.step = True: expected a valid number"),
        ("period = 0.1,", "period = -0.1,", "components.controller.sampling.period = -0.1: expected a positive number"),
        ("delay = 0.25", "delay = nan", "connections.valve.delay = nan: expected zero or a positive number"),
        ("period = 0.5", "period = 1e-12", "sources.rain.period = 1e-12: expected at least a nanosecond"),
        ("noise = 0.1\nperiod = 0.5", "constant = nan", "sources.rain.constant = nan: expected a finite number"),
        ("noise = 0.1\nperiod = 0.5", 'trajectory = "tank"', "sources.rain.to = tank.inflow: expected none: a traj"),
        ("[sources.rain]", "[sources.tank]", "sources.tank = tank: expected another name than a component's"),
        ("good =", 'outcomes = ["a", "diverged"]\ngood =', "criterion.outcomes = 'a, diverged': expected two names"),
        ("[criterion]", '[streams]\n"connections.valve.los" = 1\n[criterion]', "streams = connections.valve.los: expe"),
        ('"peak < 2.5"', '"peak"', "criterion.good = peak: expected a condition, as in peak < 2.5"),
        ('"peak < 2.5"', '"2 * peak"', "criterion.good = 2 * peak: expected a condition"),
        ('"abs(tank.level) > 100"', '"abs(tank.level)"', "criterion.diverged = abs(tank.level): expected a condition"),
        ("seed = 3", 'seed = 3\noptional = ["peek"]', "optional = peek: expected one of peak, late"),
        ("[criterion]", '[operating_point]\n"components.tnk.step" = 1\n[criterion]', "operating_point: components.tnk"),
        ("late =", '"a\\nb" =', "objectives = a\\nb: expected a name in printable characters"),
    ],
)
def test_one_error_is_one_line_that_names_its_place(right: str, wrong: str, line: str, tmp_path: Path) -> None:
    assert right in TANK
    assert refusal(tmp_path, TANK.replace(right, wrong, 1)).startswith(line)


def test_a_system_equals_the_one_read_from_its_file(tmp_path: Path) -> None:
    first = loaded(tmp_path, TANK)
    (tmp_path / "elsewhere").mkdir()
    assert loaded(tmp_path / "elsewhere", first.to_toml()) == first
    assert loaded(tmp_path, quadrotor().to_toml()) == quadrotor()


def test_a_tolerance_is_of_one_component_and_has_a_path(tmp_path: Path) -> None:
    system = loaded(tmp_path, TANK)
    assert {name: part.tolerance for name, part in system.components.items()} == {"tank": 1e-6, "controller": None}
    path = "components.controller.tolerance"
    assert value_at(changed(system, {path: 1e-3}), path) == 1e-3


def test_the_order_at_the_top_is_the_default_of_connections(tmp_path: Path) -> None:
    assert [x.order for x in loaded(tmp_path, TANK).connections] == ["jacobi", "gauss-seidel"]


def test_one_number_for_noise_is_for_all_signals(tmp_path: Path) -> None:
    assert loaded(tmp_path, TANK).connections[0].noise == {"level": 0.001}


def test_a_file_without_components_is_a_scenario_of_the_quadrotor(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text("stop_time = 2.0\n")
    (tmp_path / "system.toml").write_text(TANK)
    kinds = [type(load_request(tmp_path / f"{name}.toml")).__name__ for name in ("scenario", "system")]
    assert kinds == ["Scenario", "System"]


def test_a_timetable_needs_no_fmu(tmp_path: Path) -> None:
    system = loaded(tmp_path, TANK.replace("60.0", "1.0"))
    assert sum(len(i.samples) for i in Cursor(Timetable(system, Streams(system.seed))).instants()) == 10


def test_the_schema_accepts_valid_files_and_no_unknown_key(tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    from orchestration.foundation.basics.documents import read_toml

    check = jsonschema.Draft202012Validator(schema())
    check.check_schema(schema())
    (tmp_path / "tank.toml").write_text(TANK)
    (tmp_path / "wrong.toml").write_text(TANK.replace("align =", "aling ="))
    assert [error.message for file in (SHIPPED, tmp_path / "tank.toml") for error in check.iter_errors(
        read_toml(file, "system file"))] == []  # fmt: skip
    (error,) = check.iter_errors(read_toml(tmp_path / "wrong.toml", "system file"))
    assert "aling" in error.message


def test_every_key_of_the_schema_has_a_description() -> None:
    tables = [schema(), *schema()["$defs"].values()]
    assert len(tables) == 12
    assert all("description" in key for table in tables for key in table["properties"].values())


def test_a_run_too_short_for_a_component_or_a_message_is_named() -> None:
    def law(period: float, offset: float = 0.0) -> Component:
        return Component(fmu="law.fmu", sampling=Sampling(period=period, offset=offset))

    components = {"late": law(0.1, offset=0.6), "slow": law(0.5), "fast": law(0.1)}
    sent = [Connection(name=f"m{i}", start=("fast.y",), end=(f"slow.u{i}",), delay=d) for i, d in enumerate((0.7, 0.4))]
    ends = "the run ends at 0.5 s, so"
    tasks = {name: {"period": period, "execution": 0.001} for name, period in (("fast", 0.1), ("slow", 10))}
    meant = system_from_tables({"stop_time": 0.5, "computers": {"cpu": {"tasks": tasks}}}, Path())
    assert [*meant.oversights()] == [
        f"computers.cpu.tasks.slow.period = 10.0: {ends} slow runs at most once (times are in seconds: 10 ms is 0.01)"
    ]
    assert [*System(stop_time=0.5, components=components, connections=tuple(sent)).oversights()] == [
        f"components.late.sampling.offset = 0.6: {ends} late never samples",
        f"components.slow.sampling.period = 0.5: {ends} slow samples only once",
        f"connections.m0.delay = 0.7: {ends} none of its messages arrives",
    ]


def test_a_quaternion_of_which_parts_are_set_is_named() -> None:
    def body(**parts: float) -> Component:
        parameters = {f"initial.quaternion.{part}": value for part, value in parts.items()}
        return Component(fmu="body.fmu", step=0.01, parameters={"initial.position.x": 1.0, **parameters})

    components = {"level": body(w=1.0, x=0.0), "whole": body(x=0.0, y=0.0, z=0.0, w=1.0), "as_it_is": body()}
    place = "components.level.parameters.initial.quaternion.w"
    assert [*System(stop_time=0.5, components=components).oversights()] == [
        f"{place}: is set without y, z, which keep their start values"
    ]
