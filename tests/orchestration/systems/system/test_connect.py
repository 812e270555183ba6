"""`quadcosim connect`: the proposal for some FMUs, and messages on what is undecided."""

import json
import re
import shutil
from pathlib import Path

import pytest

from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.check import check
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.proposal import PERIOD, STEP, STOP, propose
from tests.commands import Main
from tests.orchestration.components.fmi.small import CLOCK, small
from tests.orchestration.systems.system.described import described


def proposed(folder: Path, *paths: Path) -> tuple[System, tuple[str, ...], str]:
    """The system of the proposal, which fits its FMUs; what is undecided; the text."""
    proposal = propose([(str(path), read_model(path)) for path in paths], folder)
    (folder / "system.toml").write_text(proposal.text, encoding="utf-8")
    system = load_system(folder / "system.toml")
    check(system, {name: read_model(Path(component.fmu)) for name, component in system.components.items()})
    assert all(f"# - {line}\n" in proposal.text for line in proposal.undecided)
    return system, proposal.undecided, proposal.text


def wires(system: System) -> set[str]:
    return {f"{start} -> {end}" for x in system.connections for start, end in zip(x.start, x.end)}


def only(system: System) -> Connection:
    (connection,) = system.connections
    return connection


def test_nothing_is_proposed_for_an_fmu_that_no_run_takes(tmp_path: Path) -> None:
    path = small(tmp_path, fmi=3, more=CLOCK)
    with pytest.raises(UsageError, match=r"has clocks, but no event mode, in which they tick: tick"):
        propose([(str(path), read_model(path))], tmp_path)


# -- matches ----------------------------------------------------------------------------------------------


def test_the_same_names_are_connected_and_travel_together(tmp_path: Path) -> None:
    plant = described(tmp_path, "Plant", inputs={"force": "Real N"}, outputs={"x": "Real m", "v": "Real"})
    controller = described(tmp_path, "Law", inputs={"x": "Real m", "v": "Real"}, outputs={"force": "Real N discrete"})
    system, undecided, _ = proposed(tmp_path, plant, controller)
    assert [(x.name, x.start, x.end) for x in system.connections] == [
        ("Plant_to_Law", ("Plant.x", "Plant.v"), ("Law.x", "Law.v")),
        ("Law_to_Plant", ("Law.force",), ("Plant.force",)),
    ]
    assert undecided == ()


@pytest.mark.parametrize(
    ("output", "entry", "why"),
    [
        ("valve", "valve_control", "its name has the same words"),
        ("tankLevel", "u_tank_level", "its name has the same words"),
        ("tank.level", "level", "its name is alike"),
        ("y", "u", "nothing else has its unit"),
    ],
)
def test_names_that_differ_are_matched_by_words_then_by_units_with_comments(
    output: str, entry: str, why: str, tmp_path: Path
) -> None:
    paths = described(tmp_path, "A", outputs={output: "Real m"}), described(tmp_path, "B", inputs={entry: "Real m"})
    system, undecided, text = proposed(tmp_path, *paths)
    assert wires(system) == {f"A.{output} -> B.{entry}"}
    assert undecided == ()
    assert f"# B.{entry} has A.{output} because {why}\n" in text
    message = propose([(str(path), read_model(path)) for path in paths], tmp_path).guessed
    assert message == (f"B.{entry} has A.{output} because {why}",)


def test_an_output_matched_by_name_is_no_candidate_for_similar_names(tmp_path: Path) -> None:
    plant = described(tmp_path, "Plant", outputs={"position": "Real m"})
    law = described(tmp_path, "Law", inputs={"position": "Real m", "reference.position": "Real m"})
    system, undecided, _ = proposed(tmp_path, plant, law)
    assert wires(system) == {"Plant.position -> Law.position"}
    assert undecided == ("no output fits, so a start value is kept by Law.reference.position (Real [m]) = 0",)


def test_a_boolean_becomes_a_real_and_a_real_becomes_no_boolean(tmp_path: Path) -> None:
    boolean = described(tmp_path, "A", outputs={"open": "Boolean"}, inputs={"full": "Boolean"})
    real = described(tmp_path, "B", inputs={"open": "Real"}, outputs={"full": "Real"})
    system, undecided, _ = proposed(tmp_path, boolean, real)
    assert wires(system) == {"A.open -> B.open"}
    assert undecided == ("A.full (Boolean) is not connected: B.full (Real) is of a type that does not become one",)


def test_an_fmu_is_not_connected_to_itself(tmp_path: Path) -> None:
    system, _, _ = proposed(tmp_path, described(tmp_path, "A", inputs={"u_x": "Real m"}, outputs={"x": "Real m"}))
    assert system.connections == ()


# -- undecided --------------------------------------------------------------------------------------------


def test_an_input_that_two_outputs_fit_is_undecided_with_both_named(tmp_path: Path) -> None:
    plant = described(tmp_path, "Plant", outputs={"level": "Real m"})
    sensor = described(tmp_path, "Sensor", inputs={"level": "Real m"}, outputs={"level_out": "Real m"})
    twin = described(tmp_path, "Twin", outputs={"level": "Real m"})
    system, undecided, _ = proposed(tmp_path, plant, sensor, twin)
    assert wires(system) == set()
    message = "Sensor.level (Real [m]) is not connected: it may be any of Plant.level, Twin.level"
    assert undecided == (message,)


@pytest.mark.parametrize(
    ("units", "scale", "offset"),
    [(("mm", "m"), 0.001, 0.0), (("degC", "K"), 1.0, 273.15), (("m/s2", "m/s^2"), 1.0, 0.0)],
)
def test_units_that_differ_are_converted_and_two_spellings_of_one_are_not(
    units: tuple[str, str], scale: float, offset: float, tmp_path: Path
) -> None:
    giver = described(tmp_path, "A", outputs={"x": f"Real {units[0]}"})
    system, _, text = proposed(tmp_path, giver, described(tmp_path, "B", inputs={"x": f"Real {units[1]}"}))
    assert (only(system).scale, only(system).offset) == pytest.approx((scale, offset))
    assert ("its units differ" in text) == ((scale, offset) != (1.0, 0.0))


def test_signals_that_are_converted_differently_are_separate_messages(tmp_path: Path) -> None:
    giver = described(tmp_path, "A", outputs={"x": "Real mm", "t": "Real s"})
    system, _, _ = proposed(tmp_path, giver, described(tmp_path, "B", inputs={"x": "Real m", "t": "Real s"}))
    assert [(x.name, x.end, x.scale) for x in system.connections] == [
        ("A_to_B", ("B.x",), 0.001),
        ("A_to_B_2", ("B.t",), 1.0),
    ]


def test_the_same_name_for_another_quantity_is_undecided(tmp_path: Path) -> None:
    paths = described(tmp_path, "A", outputs={"x": "Real m"}), described(tmp_path, "B", inputs={"x": "Real s"})
    system, undecided, _ = proposed(tmp_path, *paths)
    assert wires(system) == set()
    assert undecided == ("B.x (Real [s]) is not connected: A.x (Real [m]) is of another quantity",)


# -- components -------------------------------------------------------------------------------------------


def test_only_a_component_with_discrete_outputs_is_sampled(tmp_path: Path) -> None:
    given = {
        "Digital": {"a": "Real discrete", "b": "Boolean"},
        "Mixed": {"c": "Real discrete", "d": "Real"},
        "Silent": {},
    }
    system, _, _ = proposed(tmp_path, *(described(tmp_path, name, outputs=outputs) for name, outputs in given.items()))
    steps = {name: component.sampling or component.step for name, component in system.components.items()}
    assert steps == {"Digital": Sampling(period=PERIOD), "Mixed": STEP, "Silent": STEP}
    assert system.stop_time == STOP


@pytest.mark.parametrize(("name", "sampled"), [("PidLaw", True), ("Law", False)])
def test_the_controller_of_a_loop_is_sampled_with_a_comment(tmp_path: Path, name: str, sampled: bool) -> None:
    plant = described(tmp_path, "Plant", inputs={"force": "Real N"}, outputs={"x": "Real m"})
    law = described(tmp_path, name, inputs={"x": "Real m"}, outputs={"force": "Real N"})
    system, _, text = proposed(tmp_path, plant, law)
    assert (system.components[name].sampling, system.components["Plant"].step) == (
        Sampling(period=PERIOD) if sampled else None,
        STEP,
    )
    assert ("# sampled, as its name is that of a controller; its FMU does not say how often\n" in text) == sampled


def test_the_criterion_to_fill_in_is_valid(tmp_path: Path) -> None:
    law = described(tmp_path, "Law", inputs={"x": "Real m"}, outputs={"force": "Real N discrete"})
    plant = described(tmp_path, "Plant", inputs={"force": "Real N"}, outputs={"x": "Real m"})
    _, _, text = proposed(tmp_path, law, plant)
    text = re.sub(r"^# (?=\[|\w+ = )", "", text, flags=re.MULTILINE)
    (tmp_path / "filled.toml").write_text(text, encoding="utf-8")
    system = load_system(tmp_path / "filled.toml")
    assert (system.criterion.good, system.criterion.diverged) == ("final < 0.05", "abs(Plant.x) > 1e3")


def test_the_default_experiment_of_an_fmu_is_used(tmp_path: Path) -> None:
    one = described(tmp_path, "A", outputs={"x": "Boolean"}, experiment='stopTime="7" stepSize="0.25"')
    two = described(tmp_path, "B", experiment='stopTime="3" stepSize="0.5"')
    system, _, _ = proposed(tmp_path, one, two)
    assert system.stop_time == 7.0
    assert system.components["A"].sampling == Sampling(period=0.25)
    assert system.components["B"].step == 0.5


def test_components_have_unique_names_after_their_models(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    models = ["Lib.Tank", "rows", "2 tanks", "Ventil für Öl"]
    paths = [described(tmp_path, model) for model in models]
    paths.append(Path(shutil.copyfile(paths[0], tmp_path / "other" / "copy.fmu")))
    system, _, _ = proposed(tmp_path, *paths)
    assert list(system.components) == ["Tank", "rows_2", "_2_tanks", "Ventil_f_r_l", "Tank_2"]
    assert [Path(component.fmu).resolve() for component in system.components.values()] == paths


# -- the command ------------------------------------------------------------------------------------------


def test_the_file_is_written_to_the_given_path_and_finds_its_fmus(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "fmus").mkdir()
    described(tmp_path / "fmus", "A", outputs={"x": "Real m"})
    described(tmp_path / "fmus", "B", inputs={"x": "Real m", "load": "Real N"})
    monkeypatch.chdir(tmp_path)
    done = main("connect", "fmus/A.fmu", "fmus/B.fmu", "--out", "new/system.toml")
    message = "no output fits, so a start value is kept by B.load (Real [N]) = 0"
    assert (done.stdout, done.stderr) == (f"{Path('new/system.toml')}\n", f"not decided: {message}\n")
    text = (tmp_path / "new" / "system.toml").read_text(encoding="utf-8")
    assert 'fmu = "../fmus/A.fmu"' in text
    assert f"# - {message}" in text
    assert Path(load_system("new/system.toml").components["A"].fmu).is_file()
    printed = main("connect", "fmus/A.fmu", "fmus/B.fmu").stdout
    assert 'fmu = "fmus/A.fmu"' in printed
    again = main("connect", "fmus/A.fmu", "--out", "new/system.toml", code=2)
    assert again.stderr.startswith("quadcosim: --out new/system.toml: exists already")
    killed = tmp_path / f".quadcosim-{12 * 'a'}.new"
    (killed / "whole").mkdir(parents=True)
    (killed / "whole" / "killed.toml").write_text(text)  # all but moved
    again = main("connect", "fmus/A.fmu", "--out", "killed.toml", code=2)
    assert again.stderr.startswith("quadcosim: --out killed.toml: exists already")
    assert not killed.exists()


def test_a_complete_proposal_runs(built: dict[str, Path], tmp_path: Path, main: Main) -> None:
    out = tmp_path / "system.toml"
    main("connect", built["QuadrotorPlant"], built["UnifiedController"], "--out", out)
    metrics = json.loads(main("run", out, "--json", "--stop-time", "0.1").stdout)
    assert metrics["steps"] == 10
    assert not metrics["diverged"]


def test_a_file_that_is_no_fmu_is_rejected_in_one_line(tmp_path: Path, main: Main) -> None:
    (tmp_path / "text.fmu").write_text("no archive")
    for path, text in (("text.fmu", "expected"), ("nowhere.fmu", "no such file")):
        stderr = main("connect", tmp_path / path, code=2).stderr
        assert re.fullmatch(rf"quadcosim: [^\n]*{path}: {text}[^\n]*\n", stderr)
