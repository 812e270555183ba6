"""What nobody reads is refused in every file that people write, with the name that was probably meant."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.tuning.tuning_file import load_tuning
from orchestration.simulation.requests.request import load_request
from quadcosim import UsageError

SCENARIO = (Path(__file__).with_name("unread_keys") / "scenario.toml").read_text(encoding="utf-8")
SYSTEM = """
stop_time = 1.0
[components.plant]
fmu = "QuadrotorPlant"
step = 0.01
[sources.wind]
to = ["plant.external_force.x"]
constant = 0.1
[criterion]
diverged = "plant.tilt > 3"
[operating_point.components.plant.parameters]
mass = 1.0
"""
STUDY = """
[base]
stop_time = 1.0
[base.timing]
period = 0.01
[design]
samples = 4
[[axes]]
name = "timing.delay"
start = 0.0
stop = 0.01
"""
COMPARISON = (Path(__file__).with_name("unread_keys") / "comparison.toml").read_text(encoding="utf-8")
GAINS = """
[controller]
"gain.eta" = 14.0
"""
TUNING = (Path(__file__).with_name("unread_keys") / "tuning.toml").read_text(encoding="utf-8")
FILES: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "scenario": (SCENARIO, load_request),
    "system": (SYSTEM, load_request),
    "study": (STUDY, load_study),
    "comparison": (COMPARISON, load_comparison),
    "tuning": (TUNING, load_tuning),
    "gains": (GAINS, lambda path: load_comparison(path.with_name("comparison.toml"))),
}


def load(kind: str, folder: Path, given: str = "", written: str = "") -> None:
    """Load a file of a kind in which what is `given` has become what is `written`."""
    (folder / "comparison.toml").write_text(COMPARISON, encoding="utf-8")
    (folder / "gains.toml").write_text(GAINS, encoding="utf-8")
    text, read = FILES[kind]
    assert given in text
    path = folder / f"{kind}.toml"
    path.write_text(text.replace(given, written, 1), encoding="utf-8")
    read(path)


@pytest.mark.parametrize("kind", FILES)
def test_what_is_written_rightly_is_read(kind: str, tmp_path: Path) -> None:
    load(kind, tmp_path)


@pytest.mark.parametrize(
    ("kind", "given", "written", "meant"),
    [
        ("scenario", "stop_time", "stop_tim", "stop_time"),
        ("scenario", "[timing]", "[timming]", "timing"),
        ("scenario", "period", "perod", "period"),
        ("scenario", "radius", "radios", "radius"),
        ("scenario", "wind_speed", "windspeed", "wind_speed"),
        ("scenario", "plant =", "plan =", "plant"),
        ("system", "stop_time", "stop_tim", "stop_time"),
        ("system", "step", "stepp", "step"),
        ("system", "constant", "constnt", "constant"),
        ("system", "diverged", "divergd", "diverged"),
        ("system", "parameters", "paramters", "parameters.NAME"),
        ("system", "diverged", "div", "diverged"),
        ("study", "[base]", "[bas]", "base"),
        ("study", "period", "perod", "period"),
        ("study", "samples", "sampels", "samples"),
        ("study", "start", "stat", "start"),
        ("comparison", "stop_time", "stop_tim", "stop_time"),
        ("comparison", "count", "cont", "count"),
        ("comparison", "values", "vales", "values"),
        ("comparison", "error", "eror", "error"),
        ("comparison", "plant", "plnt", "plant"),
        ("comparison", "file", "fil", "file"),
        ("comparison", "sets", "set", "sets"),
        ("tuning", "bad", "badd", "bad"),
        ("tuning", "evaluations", "evaluation", "evaluations"),
        ("tuning", "judged", "juged", "judged"),
        ("tuning", "stop =", "stopp =", "stop"),
        ("gains", "controller", "controler", "controller"),
    ],
)
def test_a_misspelt_key_is_refused_with_the_one_that_was_meant(
    kind: str, given: str, written: str, meant: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError) as refused:
        load(kind, tmp_path, given, written)
    assert f"did you mean {meant}?" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "written", "said"),
    [
        ("start = 0.0\nstop = 0.01", "values = [0.0]", "design.samples: expected none; every axis has its values"),
        ("start = 0.0\nstop = 0.01", "values = [0.0]\nstart = 0.0", "axis timing.delay: expected values, or start"),
        ("start = 0.0\nstop = 0.01", "values = [0.0]\nscale = 'logarithmic'", "axis timing.delay: expected values"),
        ("[base]", "keep_signals = [0, 4]\n[base]", "keep_signals: 4: expected the indices of runs, from 0 to 3"),
    ],
)
def test_a_key_that_says_nothing_beside_another_is_refused(given: str, written: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=said):
        load("study", tmp_path, given, written)


@pytest.mark.parametrize(
    ("kind", "given", "written", "key"),
    [
        ("scenario", "gain.eta = 15.0", "gain.eta = {}", "controller.gain.eta"),
        ("scenario", "gain.eta = 15.0", "gain = {}", "controller.gain"),
        ("scenario", "stop_time = 1.0", 'stop_time = 1.0\nvehicle = "vehicle.toml"', "plant.mass"),
        ("system", "step = 0.01", "step = 0.01\nparameters = { mass = {} }", "plant.parameters.mass"),
        ("system", "mass = 1.0", "mass = {}", "components.plant.parameters.mass"),
        ("comparison", "mass = 2.0", "mass = {}", "vehicles.heavy.plant.mass"),
        ("comparison", '"timing.delay" = 0.001', '"timing.delay" = {}', "conditions.nominal.sets.timing.delay"),
        ("gains", "14.0", "{}", "controller.gain.eta"),
    ],
)  # fmt: skip
def test_an_empty_table_is_no_value(kind: str, given: str, written: str, key: str, tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text("[plant]\nmass = {}\n", encoding="utf-8")
    with pytest.raises(UsageError) as refused:
        load(kind, tmp_path, given, written)
    assert f"{key} = {{}}: expected a number, true, false or a text" in str(refused.value)
    assert "\n" not in str(refused.value)
