"""What a file refuses the constructors refuse too, in the same words."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import quadcosim
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from quadcosim import (
    Component,
    Connection,
    Criterion,
    FmuChoice,
    Record,
    ReferenceChoice,
    Sampling,
    Scenario,
    Source,
    System,
    Timing,
    UsageError,
)

Construct = Callable[[], object]

SCENARIOS: list[tuple[str, Construct]] = [
    ("stop_time = -1.0", lambda: Scenario(stop_time=-1.0)),
    ("seed = -1", lambda: Scenario(seed=-1)),
    ('model_mismatch = "yes"', lambda: Scenario(model_mismatch="yes")),  # type: ignore[arg-type]
    ("[timing]\nperiod = -1.0", lambda: Scenario(timing=Timing(period=-1.0))),
    ("[timing]\nperiod = nan", lambda: Timing(period=float("nan"))),
    ("[timing]\njitter = 0.5", lambda: Timing(jitter=0.5)),
    ("[timing]\ncommand_loss = 1.5", lambda: Timing(command_loss=1.5)),
    ("[timing]\nnoise = { position = -1.0 }", lambda: Timing(noise={"position": -1.0})),
    ("[record]\nplant = 3", lambda: Record(plant=3)),  # type: ignore[arg-type]
    ("[record]\nplant = [3]", lambda: Record(plant=(3,))),  # type: ignore[arg-type]
    ("[controller]\ngain.eta = [1.0]", lambda: FmuChoice(fmu="x", parameters={"gain.eta": [1.0]})),  # type: ignore[dict-item]
    ("[controller]\nsample_period = 0.1", lambda: Scenario(controller=_controller({"sample_period": 0.1}))),
]
"""Texts of files, and the same in Python: both are refused, the latter by the end of the former"""

OTHER_WORDS: list[tuple[str, Construct]] = [
    ('stop_time = "long"', lambda: Scenario(stop_time="long")),  # type: ignore[arg-type]
    ("stop_time = true", lambda: Scenario(stop_time=True)),
    ("seed = 0.5", lambda: Scenario(seed=0.5)),  # type: ignore[arg-type]
    ('[timing]\nperiod = "10 ms"', lambda: Timing(period="10 ms")),  # type: ignore[arg-type]
    ('[timing]\nburst_length = "long"', lambda: Timing(burst_length="long")),  # type: ignore[arg-type]
    ('[timing]\nnoise = { position = "x" }', lambda: Timing(noise={"position": "x"})),  # type: ignore[dict-item]
    ("bogus = 1", lambda: Scenario(bogus=1)),  # type: ignore[call-arg]
    ("[timing]\nperio = 0.1", lambda: Timing(perio=0.1)),  # type: ignore[call-arg]
    ('[timing]\norder = "jakobi"', lambda: Timing(order="jakobi")),  # type: ignore[arg-type]
    ("[timing]\norder = 3", lambda: Timing(order=3)),  # type: ignore[arg-type]
    ("timing = 3", lambda: Scenario(timing=3)),  # type: ignore[arg-type]
    ("[timing]\nnoise = 0.1", lambda: Timing(noise=0.1)),  # type: ignore[arg-type]
    ("[reference]\nfile = 3", lambda: ReferenceChoice(file=3)),  # type: ignore[arg-type]
    ("[controller]\nfmu = 3", lambda: FmuChoice(fmu=3)),  # type: ignore[arg-type]
    ('vehicle = "biplane"', lambda: Scenario(vehicle="biplane")),  # type: ignore[arg-type]
    ("controller = 3", lambda: Scenario(controller=3)),  # type: ignore[arg-type]
]
"""Likewise, where a file may say more of what a value is for, or Python has another name for what is valid"""

TANK = '[components.tank]\nfmu = "tank.fmu"\n'
TWO = 'stop_time = 1.0\n[components]\na = { fmu = "a.fmu", step = 0.1 }\nb = { fmu = "b.fmu", step = 0.1 }\n'
WIRE = '[[connections]]\nname = "wire"\nfrom = ["a.y"]\nto = ["b.u"]\n'
SYSTEMS: list[tuple[str, Construct]] = [
    (f"stop_time = 1.0\n{TANK}step = -0.1", lambda: Component(fmu="tank.fmu", step=-0.1)),
    (f"stop_time = 1.0\n{TANK}", lambda: _system(component=Component(fmu="tank.fmu"))),
    (f"stop_time = 0.0\n{TANK}step = 0.1", lambda: _system(stop_time=0.0)),
    (f"stop_time = 1.0\n{TANK}sampling = {{ period = 0.0 }}", lambda: Sampling(period=0.0)),
    (f"stop_time = 1.0\n{TANK}step = 0.1\nrecord = [1]", lambda: Component(fmu="t", step=0.1, record=(1,))),  # type: ignore[arg-type]
    (f"{TWO}{WIRE}delay = -1.0", lambda: _wire(delay=-1.0)),
    (f"{TWO}{WIRE}loss = 2.0", lambda: _wire(loss=2.0)),
    (f"{TWO}{WIRE}noise = {{ y = -1.0 }}", lambda: _wire(noise={"y": -1.0})),
    (f"{TWO}{WIRE}noise = {{ z = 1.0 }}", lambda: _wire(noise={"z": 1.0})),
    (f"{TWO}[sources.s]\nto = ['a.u']", lambda: Source(to=("a.u",))),
    (f"{TWO}[sources.s]\nto = ['a.u']\nnoise = 1.0", lambda: Source(to=("a.u",), noise=1.0)),
    (f"{TWO}[sources.s]\nto = ['c.u']\nconstant = 1.0", lambda: _two(sources={"s": Source(to=("c.u",), constant=1.0)})),
    (f"{TWO}[objectives]\npeak = 'max('", lambda: _two(objectives={"peak": "max("})),
    (f"{TWO}[criterion]\ngood = '1 + 2'", lambda: _two(criterion=Criterion(good="1 + 2"))),
    (f"{TWO}[criterion]\noutcomes = ['diverged', 'bad']", lambda: Criterion(outcomes=("diverged", "bad"))),
    (f"{TWO}[streams]\nwind = 1", lambda: _two(streams={"wind": 1})),
]
SYSTEMS_IN_OTHER_WORDS: list[tuple[str, Construct]] = [
    (f'{TWO}{WIRE}delay = "long"', lambda: _wire(delay="long")),
    (f"{TWO}[objectives]\npeak = 3", lambda: _two(objectives={"peak": 3})),
    (f"{TWO}{WIRE}dealy = 0.1", lambda: _wire(dealy=0.1)),
    (f"{TWO}{WIRE}noise = true", lambda: _wire(noise=True)),
]


def _controller(parameters: dict[str, float | bool | str]) -> FmuChoice:
    return FmuChoice(fmu="UnifiedController", parameters=parameters)


def _wire(**keys: object) -> Connection:
    return Connection(name="wire", start=("a.y",), end=("b.u",), **keys)  # type: ignore[arg-type]


def _system(*, component: Component | None = None, stop_time: float = 1.0) -> System:
    return System(components={"tank": component or Component(fmu="tank.fmu", step=0.1)}, stop_time=stop_time)


def _two(**keys: object) -> System:
    components = {name: Component(fmu=f"{name}.fmu", step=0.1) for name in "ab"}
    return System(stop_time=1.0, components=components, **keys)  # type: ignore[arg-type]


def refusals(path: Path, text: str, construct: Construct, load: Callable[[Path], object]) -> tuple[str, str]:
    """The message for the file, without its name, and that for the value in Python; quotes apart, each in one line."""
    path.write_text(text)
    with pytest.raises(UsageError) as of_file:
        load(path)
    with pytest.raises(UsageError) as of_value:
        construct()
    of_file_, of_value_ = str(of_file.value).removeprefix(f"{path}: "), str(of_value.value)
    assert of_value_
    assert "\n" not in of_file_ + of_value_
    return of_file_.replace("'", ""), of_value_.replace("'", "")


def expect_same_place(of_file: str, of_value: str) -> None:
    """Both name it, and what is expected there."""
    assert of_value.partition(" ")[0].rstrip(":") in of_file
    assert "expected" in of_file
    assert "expected" in of_value


@pytest.mark.parametrize(("text", "construct"), SCENARIOS, ids=[text for text, _ in SCENARIOS])
def test_a_scenario_is_refused_in_the_words_of_its_file(tmp_path: Path, text: str, construct: Construct) -> None:
    of_file, of_value = refusals(tmp_path / "scenario.toml", text, construct, quadcosim.load_scenario)
    assert of_file.endswith(of_value.removeprefix("parameters."))


@pytest.mark.parametrize(("text", "construct"), OTHER_WORDS, ids=[text for text, _ in OTHER_WORDS])
def test_a_scenario_is_refused_at_the_place_where_its_file_is(tmp_path: Path, text: str, construct: Construct) -> None:
    expect_same_place(*refusals(tmp_path / "scenario.toml", text, construct, quadcosim.load_scenario))


@pytest.mark.parametrize(("text", "construct"), SYSTEMS, ids=range(len(SYSTEMS)))
def test_a_system_is_refused_in_the_words_of_its_file(tmp_path: Path, text: str, construct: Construct) -> None:
    of_file, of_value = refusals(tmp_path / "system.toml", text, construct, quadcosim.load_system)
    assert of_file.endswith(of_value)


@pytest.mark.parametrize(("text", "construct"), SYSTEMS_IN_OTHER_WORDS, ids=range(len(SYSTEMS_IN_OTHER_WORDS)))
def test_a_system_is_refused_at_the_place_where_its_file_is(tmp_path: Path, text: str, construct: Construct) -> None:
    expect_same_place(*refusals(tmp_path / "system.toml", text, construct, quadcosim.load_system))


def test_a_study_is_refused_as_its_file_is(tmp_path: Path) -> None:
    axis = '[[axes]]\nname = "timing.period"\n'
    cases: list[tuple[str, Construct]] = [
        (f"{axis}values = []", lambda: Axis(name="timing.period", targets=("timing.period",), values=())),
        ("name = 'x'", lambda: Study(name="x", base=Scenario(), axes=())),
    ]
    for text, construct in cases:
        of_file, of_value = refusals(tmp_path / "study.toml", text, construct, load_study)
        assert of_file.endswith(of_value)


def test_a_value_without_a_name_is_refused_with_the_names() -> None:
    with pytest.raises(UsageError, match=r"^Timing = 0.01: expected values by name, as in period=…$"):
        Timing(0.01)  # type: ignore[call-arg]


def test_a_missing_value_is_refused_by_its_name() -> None:
    with pytest.raises(UsageError, match=r"^period: expected a value$"):
        Sampling()  # type: ignore[call-arg]


def test_scenarios_and_systems_are_keys_whatever_the_order_of_their_parameters() -> None:
    one, other = (
        quadcosim.Scenario().with_changes(plant=dict(sorted({"mass": 1.2, "drag": 0.1}.items(), reverse=turned)))
        for turned in (False, True)
    )
    assert {one: 1, quadcosim.Scenario(): 2} == {other: 1, quadcosim.Scenario(seed=0): 2}
    assert len({one.as_system(), other.as_system(), quadcosim.Scenario().as_system()}) == 2


def test_lists_paths_and_numbers_of_numpy_are_taken_as_they_are_meant() -> None:
    source = Source(to=["a.u"], file="table.csv")  # type: ignore[arg-type]
    assert (source.to, source.file) == (("a.u",), Path("table.csv"))
    component = Component(fmu=Path("tank.fmu"), step=np.float32(0.5))  # type: ignore[arg-type]
    assert (component.fmu, type(component.step)) == ("tank.fmu", float)
    assert type(Scenario(seed=np.int64(3)).seed) is int
