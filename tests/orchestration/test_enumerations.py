"""A parameter that is one of several items: by name wherever values are given, in FMUs of every making."""

import dataclasses
import enum
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmu_kit.errors import FmuError
from fmu_kit.interface import Declaration, FixedParameter, Input
from fmu_kit.slave import Slave
from orchestration.components.building import fmus
from orchestration.components.checks.validation.validator import validate
from orchestration.components.fmi import opening
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.study_file import load_study
from orchestration.simulation.requests.request import load_request
from orchestration.simulation.requests.ssp import document, writing
from orchestration.systems.system.model import System
from quadcosim import SimulatorError, UsageError, changed, load_run, load_system, run
from tests.commands import Main
from tests.fmu_kit.compiler.probes import Mode
from tests.orchestration.experiments.studies.common import sweep

SLAVE = """
import dataclasses
import enum
from fmu_kit.interface import FixedParameter, Output
from fmu_kit.slave import Slave

class Shape(enum.IntEnum):
    FLAT = 1
    LINE = 2
    TWO_LINES = 3

class Maker(Slave):
    '''Makes shapes.'''

    y = Output("what is made", "m", variability="continuous")
    shape = FixedParameter("of what is made", start=Shape.LINE)
    times = FixedParameter("how often", None, 1, minimum=1, maximum=5)

    def step(self, t: float, h: float) -> None:
        if self.shape != Shape.FLAT:
            slope = 2.0 if self.shape == Shape.TWO_LINES else 1.0
            self.y = slope * self.times * (t + h)
"""
SYSTEM = """
stop_time = 1.0
[components.maker]
fmu = "{fmu}"
step = 0.5
parameters = {{ shape = "two_lines" }}
[objectives]
made = "last(maker.y)"
"""
of_one_making = pytest.mark.parametrize("maker", ["native/Maker.fmu"], indirect=True)
ITEMS = "flat, line, two_lines"


@pytest.fixture(scope="module", params=["Maker.fmu", "native/Maker.fmu", "native/fmi3/Maker.fmu"])
def maker(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A system file beside the slave, its FMU of each making in turn."""
    folder = tmp_path_factory.mktemp("maker")
    (folder / "maker.py").write_text(SLAVE, "utf-8")
    fmus.locate(str(folder / request.param))
    (folder / "system.toml").write_text(SYSTEM.format(fmu=request.param), "utf-8")
    return folder / "system.toml"


@pytest.fixture
def system(maker: Path) -> System:
    return load_system(maker)


def made(system: System, **parameters: object) -> object:
    return run(changed(system, {f"components.maker.parameters.{k}": v for k, v in parameters.items()})).metrics["made"]


def test_the_description_names_the_items_and_no_rule_is_broken(maker: Path, system: System) -> None:
    (path,) = fmus.of_components(system.fmus).values()
    description = fmpy.read_model_description(str(path), validate=True)
    (shape,) = (v for v in description.modelVariables if v.name == "shape")
    assert (shape.type, shape.start) == ("Enumeration", "2")
    assert [(item.name, item.value) for item in shape.declaredType.items] == [
        ("flat", "1"),
        ("line", "2"),
        ("two_lines", "3"),
    ]
    assert validate_fmu(str(path)) == []
    if description.fmiVersion == "2.0":
        assert validate(path) == []


def test_an_item_is_given_by_name_or_by_number_and_starts_as_declared(system: System) -> None:
    assert made(system) == 2.0
    assert [made(system, shape=value) for value in ("flat", "line", 3)] == [0.0, 1.0, 2.0]
    assert made(system, shape_index=3) == made(system, shape="flat", shape_index=3) == 2.0
    assert made(system, shape="flat", shape_index=0) == 0.0
    without = dataclasses.replace(system.components["maker"], parameters={})
    assert made(dataclasses.replace(system, components={"maker": without})) == 1.0


@of_one_making
def test_another_name_is_refused_before_anything_runs_with_those_that_there_are(system: System) -> None:
    with pytest.raises(
        UsageError, match=rf"maker.parameters.shape = lines: did you mean line\? expected one of {ITEMS}"
    ):
        made(system, shape="lines")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("shape", 7, r"1 \(flat\), 2 \(line\) or 3 \(two_lines\)"),
        ("times", 9, "a whole number >= 1 and <= 5"),
    ],
)
def test_the_fmu_itself_refuses_what_other_masters_let_through(
    name: str, value: int, expected: str, system: System
) -> None:
    (path,) = fmus.of_components(system.fmus).values()
    with opening.open_here(path, "maker") as it:
        it.writer((name,), np.array([float(value)]))()
        it.enter_initialization(0.0, 1.0)
        with pytest.raises(SimulatorError, match=f"{name} = {value}: expected {expected}"):
            it.exit_initialization()


@of_one_making
def test_names_are_taken_on_the_command_line_and_kept_in_the_directory_of_a_run(
    maker: Path, tmp_path: Path, main: Main
) -> None:
    chosen = "components.maker.parameters.shape=line"
    main("run", maker, "--set", chosen, "--out", tmp_path / "run")
    kept = load_run(tmp_path / "run")
    assert kept.metrics["made"] == 1.0
    assert kept.system.components["maker"].parameters["shape"] == "line"
    assert main("run", maker, "--set", f"{chosen}s", code=2).stderr.count("\n") == 1


@of_one_making
def test_the_axis_of_a_study_has_names_for_values_and_so_has_its_table(maker: Path, tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(
        f'scenario = "{maker}"\n[[axes]]\nname = "shape"\nsets = ["components.maker.parameters.shape"]\n'
        'values = ["flat", "line", "two_lines"]\n',
        "utf-8",
    )
    sweep(load_study(file), out=tmp_path)
    with open_for_reading(store_path("study", tmp_path)) as store:
        found = [(row["settings"]["shape"], row["made"]) for row in store.rows()]
    assert found == [("flat", 0.0), ("line", 1.0), ("two_lines", 2.0)]


@of_one_making
def test_an_item_goes_through_an_ssp_and_back(system: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "_cache", lambda: tmp_path / "cache")
    read = load_request(*writing.write_with_timing(system, tmp_path / "loop.ssp"))
    assert isinstance(read, System)
    assert read.components["maker"].parameters["shape"] == "two_lines"
    assert run(read).metrics["made"] == 2.0


# -- its declaration --------------------------------------------------------------------------------------------------


class Gapped(enum.IntEnum):
    ONE = 1
    THREE = 3


def test_its_type_and_its_range_follow_from_the_items() -> None:
    class Chooses(Slave):
        mode = FixedParameter("how", start=Mode.TURNED)

    mode, index = Chooses.variables
    assert (index.name, index.type, index.start, index.bounds) == (
        "mode_index",
        "Integer",
        0,
        "a whole number >= 0 and <= 3",
    )
    assert (mode.type, mode.declared_type) == ("Enumeration", "Mode")
    assert mode.items == {"as_it_is": 1, "turned": 2, "doubled": 3}
    for value in (0, 4):
        with pytest.raises(FmuError, match=rf"mode = {value}: expected 1 \(as_it_is\), 2 \(turned\) or 3 \(doubled\)"):
            mode.check(value)


@pytest.mark.parametrize("declared", [FixedParameter(start=Gapped.ONE), Input(start=Mode.TURNED)])
def test_items_with_gaps_and_enumerations_that_are_no_parameters_are_refused(declared: Declaration) -> None:
    with pytest.raises(TypeError, match="m: expected an Enumeration to be a parameter, its items 1, 2"):
        type("Chooses", (Slave,), {"m": declared})
