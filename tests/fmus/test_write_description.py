"""`modelDescription.xml`: the contract that people wire to, apart from what validation finds wrong with any FMU."""

import ast
import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy
import pytest
from fmpy.model_description import ModelDescription, ScalarVariable

from fmu_kit.write_description import PYTHON_REQUIRED
from orchestration.components.building.models import MODELS
from orchestration.foundation.basics.documents import read_toml
from plant_fmu.interface import PlantInterface
from plant_fmu.observed import Observed
from tests.fmus.archive import files_of
from tests.fmus.expected import MEASUREMENT
from tests.fmus.instance import Instance
from tests.fmus.interface_table import TABLES, Row
from tests.places import ROOT

MAJOR, MINOR = map(int, PYTHON_REQUIRED.removeprefix(">=").split("."))


@pytest.fixture(scope="module")
def descriptions(built: dict[str, Path]) -> dict[str, ModelDescription]:
    """What the XML of each FMU says."""
    return {model: fmpy.read_model_description(str(path)) for model, path in built.items()}


@pytest.fixture(params=MODELS)
def description(request: pytest.FixtureRequest, descriptions: dict[str, ModelDescription]) -> ModelDescription:
    """Of each FMU in turn."""
    result: ModelDescription = descriptions[request.param]
    return result


# -- what is declared -----------------------------------------------------------------------------------


def row_of(variable: ScalarVariable) -> Row:
    start = variable.start
    if start is not None:
        start = start == "true" if variable.type == "Boolean" else float(start)
    return Row(variable.name, variable.causality, variable.variability, variable.type, variable.unit, start)


def test_every_variable_is_as_the_interface_says(description: ModelDescription) -> None:
    for row in TABLES[description.modelName]:
        assert [row_of(v) for v in description.modelVariables if v.name == row.name] == [row]


OBSERVED = {v.name for v in Observed.variables} - {v.name for v in PlantInterface.variables}
"""What a plant has beside its interface: tests/plant_fmu/test_observed.py has each, with its unit"""


def test_no_input_or_output_is_missing_from_the_interface(description: ModelDescription) -> None:
    def ports(variables: Iterator[tuple[str, str]]) -> set[str]:
        return {name for name, causality in variables if causality in ("input", "output") and name not in OBSERVED}

    declared = ports((v.name, v.causality) for v in description.modelVariables)
    table = ports((row.name, row.causality) for row in TABLES[description.modelName])
    assert declared == table, f"{declared ^ table}: expected the same in tests/fmus/interface_table.py"


def test_bounds_are_declared(description: ModelDescription) -> None:
    bounded = {v.name: float(v.min) for v in description.modelVariables if v.min is not None}
    assert (bounded["mass"], bounded["gravity"]) == (0.0, 0.0)


QUANTITIES = {
    "m": "Length", "m/s": "Velocity", "m/s2": "Acceleration", "m/s3": "Jerk", "rad": "Angle",
    "rad/s": "AngularVelocity", "rad/s2": "AngularAcceleration", "kg": "Mass", "kg.m2": "MomentOfInertia",
    "N": "Force", "N.m": "Torque", "s": "Time", "J": "Energy", "W": "Power", "Hz": "Frequency", "m2": "Area",
    "m3": "Volume", "kg/m3": "Density", "kg/s": "MassFlowRate", "Pa": "Pressure", "K": "ThermodynamicTemperature",
    "A": "ElectricCurrent", "V": "ElectricPotential", "C": "ElectricCharge",
}  # fmt: skip
"""As Modelica's library calls them"""


def test_each_unit_says_what_is_measured_and_angles_are_displayed_in_degrees(description: ModelDescription) -> None:
    for variable in description.modelVariables:
        is_of_a_period = "frequency" in variable.name or "cutoff" in variable.name
        quantity = "AngularFrequency" if is_of_a_period else QUANTITIES.get(variable.unit)
        assert (variable.name, variable.quantity) == (variable.name, quantity)
        in_degrees = variable.unit in ("rad", "rad/s", "rad/s2") and not is_of_a_period
        expected = variable.unit.replace("rad", "deg") if in_degrees else None
        assert (variable.name, variable.displayUnit) == (variable.name, expected)
    shown = {shown.name: float(shown.factor) for unit in description.unitDefinitions for shown in unit.displayUnits}
    assert shown["deg/s"] == math.degrees(1.0)
    assert shown.keys() >= {v.displayUnit for v in description.modelVariables if v.displayUnit is not None}


def test_what_is_far_from_one_says_its_usual_size_and_what_has_ends_says_them(
    descriptions: dict[str, ModelDescription],
) -> None:
    plant, controller = (
        {v.name: v for v in descriptions[model].modelVariables} for model in ("QuadrotorPlant", "UnifiedController")
    )
    assert float(plant["thrust"].nominal) == float(controller["thrust"].nominal) == 9.81
    assert float(plant["wind.force.z"].nominal) == 0.01
    assert (float(plant["tilt"].min), float(plant["tilt"].max)) == (0.0, math.pi)


def test_the_default_experiment_is_30_s_in_steps_of_10_ms(description: ModelDescription) -> None:
    experiment = description.defaultExperiment
    times = [float(text) for text in (experiment.startTime, experiment.stopTime, experiment.stepSize)]
    assert times == [0.0, 30.0, 0.01]


def test_the_fmu_needs_no_tool_and_saves_its_state(description: ModelDescription) -> None:
    capabilities = description.coSimulation
    assert not capabilities.needsExecutionTool
    assert capabilities.canHandleVariableCommunicationStepSize
    assert capabilities.canGetAndSetFMUstate
    assert capabilities.canSerializeFMUstate
    assert not capabilities.canBeInstantiatedOnlyOncePerProcess


def test_names_are_structured(description: ModelDescription) -> None:
    assert description.variableNamingConvention == "structured"


def test_divergence_is_a_log_category(description: ModelDescription) -> None:
    assert "divergence" in {category.name for category in description.logCategories}


# -- the Python that runs it ------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_the_description_says_which_python_it_requires_where_the_schema_wants_it(
    model: str, built: dict[str, Path]
) -> None:
    root = fromstring(files_of(built[model])["modelDescription.xml"])
    (python,) = root.findall("VendorAnnotations/Tool[@name='quadcosim']/Python")
    assert python.attrib == {"requires": PYTHON_REQUIRED}
    order = [element.tag for element in root]
    place = order.index("VendorAnnotations")
    assert order[place - 1 : place + 2] == ["DefaultExperiment", "VendorAnnotations", "ModelVariables"]


def test_versions_are_those_of_the_project(descriptions: dict[str, ModelDescription]) -> None:
    version = read_toml(ROOT / "pyproject.toml", "project")["project"]["version"]
    said = {(one.version, one.generationTool) for one in descriptions.values()}
    assert said == {(version, f"quadcosim {version}")}


def test_the_required_python_is_the_one_that_the_project_requires_and_is_checked_for() -> None:
    project = read_toml(ROOT / "pyproject.toml", "project")
    oldest = PYTHON_REQUIRED.removeprefix(">=")
    assert project["project"]["requires-python"] == PYTHON_REQUIRED
    assert project["tool"]["mypy"]["python_version"] == oldest
    assert project["tool"]["ruff"]["target-version"] == "py" + oldest.replace(".", "")


@pytest.mark.parametrize("model", MODELS)
def test_the_bundled_sources_are_in_the_syntax_of_the_required_python(model: str, built: dict[str, Path]) -> None:
    sources = {name: content for name, content in files_of(built[model]).items() if name.endswith(".py")}
    assert len(sources) > 10
    for name, content in sources.items():
        ast.parse(content, name, feature_version=(MAJOR, MINOR))


# -- dependencies: that they are true is for validation to say -------------------------------------------


def test_no_output_is_declared_to_follow_an_input_directly(description: ModelDescription) -> None:
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    declared = {unknown.variable.name: unknown.dependencies for unknown in description.outputs}
    assert declared == {name: [] for name in outputs}


IDLE = {"CascadedController": {f"reference.{derivative}.{axis}" for derivative in ("jerk", "snap") for axis in "xyz"}}
"""Inputs that a controller does not use, or not at once."""


def test_declared_initial_dependencies_are_the_inputs_that_a_controller_uses_and_none_of_the_plant(
    description: ModelDescription,
) -> None:
    idle = IDLE.get(description.modelName, set())
    inputs = [v.name for v in description.modelVariables if v.causality == "input" and v.name not in idle]
    expected = [] if description.modelName == "QuadrotorPlant" else inputs
    outputs = {v.name for v in description.modelVariables if v.causality == "output" and v.name not in OBSERVED}
    declared = {
        u.variable.name: [d.name for d in u.dependencies if d.causality == "input"]
        for u in description.initialUnknowns
        if u.variable.name not in OBSERVED
    }
    assert declared == dict.fromkeys(outputs, expected)


def test_declared_initial_dependencies_are_the_parameters_of_a_controller_and_where_the_plant_starts(
    description: ModelDescription,
) -> None:
    declared = {
        u.variable.name: [d.name for d in u.dependencies if d.causality == "parameter"]
        for u in description.initialUnknowns
        if u.variable.name not in OBSERVED
    }
    if description.modelName == "QuadrotorPlant":
        assert declared["position.y"] == ["initial.position.y"]
        rounded = ["frame", "frame_index"]
        assert declared["quaternion.x"] == [*(f"initial.quaternion.{axis}" for axis in "xyzw"), *rounded]
    else:
        parameters = [v.name for v in description.modelVariables if v.causality == "parameter"]
        assert {"mass", "gravity", "use_reference_inputs"} < {*parameters}
        assert declared["thrust"] == [name for name in parameters if name != "sample_offset"]


def test_in_initialisation_mode_reference_inputs_that_are_not_used_move_nothing(built: dict[str, Path]) -> None:
    with Instance(built["UnifiedController"]) as controller:
        controller.set(MEASUREMENT)
        controller.fmu.setupExperiment(startTime=0.0)
        controller.fmu.enterInitializationMode()
        moving = [name for name in controller.names("input") if moves_outputs(controller, name)]
    assert moving == [name for name in controller.names("input") if not name.startswith("reference.")]


def moves_outputs(instance: Instance, name: str) -> bool:
    """Whether an output moves with an input, which is put back."""
    outputs = instance.names("output")
    (value,), before = instance.get(name), instance.get(*outputs)
    instance.set({name: value + 0.0625})
    after = instance.get(*outputs)
    instance.set({name: value})
    return before != after
