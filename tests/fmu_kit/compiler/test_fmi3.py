"""Native FMUs of FMI 3.0 describe, answer and compute the same as those of FMI 2.0."""

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu
from lxml import etree

import quadcosim
from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.standards import STANDARDS, TERMINALS
from fmu_kit.packaging import slave_class
from orchestration.components.building import fmus
from orchestration.components.building.models import MODELS
from orchestration.quadrotor.scenarios.scenario import Scenario
from tests.commands import Main
from tests.extent import in_test_all, sample
from tests.fmu_kit.compiler.compiled import compiled
from tests.fmus.archive import files_of
from tests.fmus.expected import COMMAND, MEASUREMENT
from tests.fmus.making import PAIR
from tests.fmus.process import run, run_script
from tests.native import NATIVE, assert_near, assert_the_same

START = 0.5
"""[s]"""
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}


def read(name: str) -> ModelDescription:
    return fmpy.read_model_description(str(fmus.locate(name)))


class Instance:
    """Of the controller, its messages kept."""

    def __init__(self, folder: Path, path: Path | None = None, **how: bool) -> None:
        path = path or fmus.locate("native/fmi3/UnifiedController")
        fmpy.extract(str(path), str(folder))
        description = fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.messages: list[str] = []
        self.fmu = FMU3Slave(
            guid=description.instantiationToken,
            unzipDirectory=str(folder),
            modelIdentifier=description.modelName,
            instanceName="controller",
        )
        self.fmu.instantiate(loggingOn=True, logMessage=self._log, **how)

    def _log(self, environment: object, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(f"{category.decode()}: {message.decode()}")

    def initialise(self) -> None:
        self.fmu.enterInitializationMode(startTime=START)
        for name, value in MEASUREMENT.items():
            self.fmu.setFloat64([self.references[name]], [value])
        self.fmu.exitInitializationMode()

    def get(self, *names: str) -> list[float]:
        return list(self.fmu.getFloat64([self.references[name] for name in names]))


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Instance]:
    instance = Instance(tmp_path)
    yield instance
    instance.fmu.freeInstance()


@pytest.mark.parametrize("name", sample([*PAIR], 1))
def test_an_fmu_of_fmi_3_has_the_variables_of_that_of_fmi_2(name: str) -> None:
    two, three = read(f"native/{name}"), read(f"native/fmi3/{name}")
    common = (
        "name",
        "description",
        "causality",
        "variability",
        "initial",
        "start",
        "quantity",
        "unit",
        "displayUnit",
        "nominal",
        "min",
        "max",
        "valueReference",
    )
    *variables, time = three.modelVariables
    for one, other in zip(two.modelVariables, variables, strict=True):
        assert {key: getattr(one, key) for key in common} == {key: getattr(other, key) for key in common}
        assert TYPES[one.type] == other.type
    displayed = [
        {unit.name: [(shown.name, shown.factor) for shown in unit.displayUnits] for unit in of.unitDefinitions}
        for of in (two, three)
    ]
    assert displayed[0] == displayed[1]
    assert (time.name, time.causality, time.valueReference) == ("time", "independent", len(variables))
    for structure in ("outputs", "initialUnknowns", "derivatives"):
        found = [
            [(each.variable.name, [v.name for v in each.dependencies or ()]) for each in getattr(of, structure)]
            for of in (two, three)
        ]
        assert found[0] == found[1]
        assert found[0] or structure == "derivatives"


@pytest.mark.parametrize("name", PAIR)
def test_its_icon_is_where_fmi_3_has_icons(name: str) -> None:
    two, three = (files_of(fmus.locate(f"native/{folder}{name}")) for folder in ("", "fmi3/"))
    assert three["terminalsAndIcons/icon.png"] == two["model.png"]
    assert "model.png" not in three


def terminals_file(name: str) -> bytes:
    """The terminals file of a slave's FMU."""
    return STANDARDS[3].beside(slave_class(Target.parse(MODELS[name])), STANDARDS[3].main)[TERMINALS]


@pytest.mark.parametrize("name", PAIR)
def test_its_terminals_are_where_fmi_3_has_them(name: str) -> None:
    assert files_of(fmus.locate(f"native/fmi3/{name}"))[TERMINALS] == terminals_file(name)


def terminals(name: str) -> dict[str, list[str]]:
    """Members of each terminal of a slave's FMU, whose file is valid."""
    document = etree.fromstring(terminals_file(name))
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(str(schema))).assertValid(document)
    found = {}
    for terminal in document.iter("Terminal"):
        members = terminal.findall("TerminalMemberVariable")
        assert [each.get("memberName") for each in members] == [each.get("variableName") for each in members]
        found[terminal.get("name")] = [each.get("variableName") for each in members]
    return found


@pytest.mark.parametrize("controller", [name for name in MODELS if name != "QuadrotorPlant"])
def test_terminals_of_one_name_fit_together_and_are_the_whole_loop(controller: str) -> None:
    plant, law = terminals("QuadrotorPlant"), terminals(controller)
    assert plant == {"command": [*COMMAND], "motion": [*MEASUREMENT]}
    assert law == {**plant, "reference": law["reference"]}
    causalities = [
        {v.name: v.causality for v in read(f"native/{name}").modelVariables} for name in ("QuadrotorPlant", controller)
    ]
    for name in (*MEASUREMENT, *COMMAND):
        assert {each[name] for each in causalities} == {"input", "output"}
    inputs = [name for name, causality in causalities[1].items() if causality == "input"]
    assert law["reference"] == [name for name in inputs if name not in MEASUREMENT]


@pytest.mark.parametrize(
    ("t", "h", "text"),
    [
        (START, 0.1, f"currentCommunicationPoint = {START}: expected {START + 0.1}, where the last step ended"),
        (START + 0.1, 0.5, f"communicationStepSize = 0.5 from {START + 0.1}: expected no step past stopTime = 1.0"),
    ],
)
def test_a_step_that_is_not_the_next_one_or_goes_past_the_stop_is_refused(
    t: float, h: float, text: str, controller: Instance
) -> None:
    controller.fmu.enterInitializationMode(startTime=START, stopTime=1.0)
    controller.fmu.exitInitializationMode()
    controller.fmu.doStep(START, 0.1)
    with pytest.raises(FMICallException):
        controller.fmu.doStep(t, h)
    assert text in controller.messages[-1]


def test_a_run_does_not_stop_before_it_starts_and_ends_once(controller: Instance) -> None:
    with pytest.raises(FMICallException):
        controller.fmu.enterInitializationMode(startTime=START, stopTime=0.25)
    assert f"stopTime = 0.25: expected a time not before startTime = {START}" in controller.messages[-1]
    controller.fmu.reset()
    controller.initialise()
    controller.fmu.terminate()
    with pytest.raises(FMICallException):
        controller.fmu.terminate()
    assert "fmi3Terminate in phase terminated: expected phase stepping" in controller.messages[-1]


@pytest.mark.parametrize("name", PAIR)
def test_fmpy_finds_nothing_and_flies_it_as_it_does_the_other(name: str) -> None:
    three = str(fmus.locate(f"native/fmi3/{name}"))
    assert validate_fmu(three) == []
    rows = [
        fmpy.simulate_fmu(str(path), stop_time=0.2, output_interval=0.01)
        for path in (three, fmus.locate(f"native/{name}"))
    ]
    assert len(rows[0]) == 21
    assert rows[0].tobytes() == rows[1].tobytes()


def test_a_flight_is_that_of_fmi_2_to_the_byte() -> None:
    simulated = [
        quadcosim.run(
            Scenario(stop_time=2.0).with_fmus(
                plant=f"{folder}/QuadrotorPlant", controller=f"{folder}/UnifiedController"
            )
        )
        for folder in ("native/fmi3", "native")
    ]
    assert_the_same(*simulated)


CLOCKED = "native/fmi3/clocked/UnifiedController"


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_controller_samples_at_the_ticks_of_its_clock_as_else_at_its_steps(engine: Any) -> None:
    plain = NATIVE.with_changes(stop_time=0.2).as_system()
    without_ticks = quadcosim.changed(plain, {"components.controller.fmu": CLOCKED})
    by_ticks = quadcosim.changed(without_ticks, {"components.controller.sampling.fmu_clock": "sample_clock"})
    expected, ticked, stepped = (quadcosim.run(each, engine=engine) for each in (plain, by_ticks, without_ticks))
    assert_the_same(stepped, expected)
    assert_near(ticked, expected, 1e-12)


def test_a_tick_computes_what_is_read_and_no_step_does(tmp_path: Path) -> None:
    path = fmus.locate(CLOCKED)
    assert validate_fmu(str(path)) == []
    plain, ticking = Instance(tmp_path / "plain"), Instance(tmp_path / "ticking", path, eventModeUsed=True)
    for instance in (plain, ticking):
        instance.initialise()
    assert ticking.get(*COMMAND) == plain.get(*COMMAND)
    fmu, turned, clock = ticking.fmu, [plain.references["angular_velocity.x"]], [ticking.references["sample_clock"]]
    fmu.setFloat64(turned, [0.7])
    fmu.setClock(clock, [True])
    plain.fmu.setFloat64(turned, [0.7])
    plain.fmu.doStep(START, 0.01)
    sampled = plain.get(*COMMAND)
    assert ticking.get(*COMMAND) == sampled
    with pytest.raises(FMICallException):
        fmu.doStep(START, 0.01)
    assert ticking.messages[-1] == "logStatusError: fmi3DoStep: expected step mode, of co-simulation"
    fmu.reset()
    ticking.initialise()
    fmu.setFloat64(turned, [0.7])
    fmu.setClock(clock, [True])
    fmu.updateDiscreteStates()
    fmu.enterStepMode()
    assert ticking.get(*COMMAND) == sampled
    fmu.setFloat64(turned, [0.1])
    fmu.doStep(START, 0.02)
    assert ticking.get("time", *COMMAND) == [START + 0.02, *sampled]
    for instance in (plain, ticking):
        instance.fmu.freeInstance()


def test_ecos_flies_both_as_it_does_those_of_fmi_2() -> None:
    ends = [
        run_script(
            "fly_in_ecos", *(fmus.locate(f"{folder}/{model}") for model in ("QuadrotorPlant", "UnifiedController"))
        )
        for folder in ("native/fmi3", "native")
    ]
    assert ends[0] == ends[1]
    assert len(ends[0]) == len(MEASUREMENT)


def test_a_saved_state_is_put_back_as_bytes(controller: Instance) -> None:
    outputs = [v.name for v in read("native/fmi3/UnifiedController").modelVariables if v.causality == "output"]
    controller.initialise()
    controller.fmu.doStep(START, 0.01)
    state = controller.fmu.getFMUState()
    saved = controller.fmu.serializeFMUState(state)
    controller.fmu.freeFMUState(state)

    def after_one_more() -> list[float]:
        controller.fmu.setFloat64([controller.references["angular_velocity.x"]], [0.7])
        controller.fmu.doStep(START + 0.01, 0.02)
        return controller.get("time", *outputs)

    expected = after_one_more()
    controller.fmu.reset()
    state = controller.fmu.deserializeFMUState(saved)
    controller.fmu.setFMUState(state)
    assert controller.get("time") == [START + 0.01]
    assert after_one_more() == expected
    assert expected[0] == START + 0.03


def test_directional_derivatives_are_the_differences_while_it_initialises(controller: Instance) -> None:
    known, unknown = (controller.references[name] for name in ("angular_velocity.x", "torque.x"))
    controller.initialise()
    assert controller.fmu.getDirectionalDerivative([unknown], [known], [1.0]) == [0.0]  # between steps outputs stay
    controller.fmu.reset()
    controller.fmu.enterInitializationMode(startTime=START)
    for name, value in MEASUREMENT.items():
        controller.fmu.setFloat64([controller.references[name]], [value])
    (found,) = controller.fmu.getDirectionalDerivative([unknown], [known], [1.0])
    around = []
    for change in (1e-6, -1e-6):
        controller.fmu.setFloat64([known], [MEASUREMENT["angular_velocity.x"] + change])
        around += controller.get("torque.x")
    assert found == pytest.approx((around[0] - around[1]) / 2e-6, rel=1e-6)
    assert found != 0.0


def test_what_is_refused_is_named_as_fmi_3_does(controller: Instance) -> None:
    with pytest.raises(FMICallException):
        controller.fmu.doStep(0.0, 0.01)
    with pytest.raises(FMICallException):
        controller.fmu.getFloat64([9999])
    two_values = (ctypes.c_double * 2)()
    with pytest.raises(FMICallException):
        controller.fmu.fmi3GetFloat64(controller.fmu.component, (ctypes.c_uint * 1)(0), 1, two_values, 2)
    with pytest.raises(FMICallException):
        controller.fmu.getInt64([0])
    assert [message.partition(" (")[0] for message in controller.messages] == [
        "logStatusError: fmi3DoStep in phase instantiated: expected phase stepping",
        "logStatusError: value reference [9999]: expected one of a Float64 variable",
        "logStatusError: nValues: expected as many values as value references, for all variables are scalars",
        "logStatusError: value reference [0]: expected one of a Enumeration variable",
    ]


def test_two_instances_know_nothing_of_each_other(controller: Instance, tmp_path: Path) -> None:
    other = Instance(tmp_path / "other")
    controller.initialise()
    before = controller.get("torque.x", "time")
    other.fmu.enterInitializationMode(startTime=7.0)
    with pytest.raises(FMICallException):
        other.fmu.setFloat64([other.references["position.x"]], [np.nan])
    other.fmu.freeInstance()
    assert controller.get("torque.x", "time") == before
    assert controller.messages == []


@in_test_all
def test_the_whole_life_of_an_instance_is_clean_for_the_sanitizers(tmp_path: Path) -> None:
    sources = Path(fmpy.extract(str(fmus.locate("native/fmi3/QuadrotorPlant")), str(tmp_path))) / "sources"
    options = ("-I", str(sources), "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    done = run(str(compiled("life_of_fmi3.c", tmp_path / "life", *options)))
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    refused, another, *lives = done.stdout.splitlines()
    assert refused.startswith("3 logStatusError: instantiationToken: expected ")
    assert another == "3 logStatusError: fmi3InstantiateScheduledExecution: this FMU is for co-simulation"
    assert len(lives) == 14
    assert lives[:7] == lives[7:]
    assert lives[3] == "3 logStatusError: fmi3EnterEventMode: not offered by this FMU"
    assert lives[5].startswith("2 logStatusError: time and states: expected finite")
    assert lives[6] == "3 logStatusError: fmi3DoStep: expected step mode, of co-simulation"


def test_the_command_has_none_with_python_inside(main: Main) -> None:
    assert "--fmi 3: expected --native with it" in main("build", "--fmi", "3", code=2).stderr
