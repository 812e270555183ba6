"""`modelDescription.xml`: the contract that people wire to, and the truth of what it says."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy
import pytest
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu

from fmu_kit.model_description import PYTHON_REQUIRED
from orchestration.scenario_file import tomllib
from orchestration.wiring import MODELS
from tests.fmus.archive import files_of
from tests.fmus.expected import MEASUREMENT
from tests.fmus.instance import Instance
from tests.fmus.interface_table import TABLES, Row
from tests.fmus.process import ROOT
from tests.fmus.python_library import OLDEST

ROWS = [pytest.param(model, row, id=f"{model}-{row.name}") for model, table in TABLES.items() for row in table]


@pytest.fixture(scope="module")
def descriptions(built: dict[str, Path]) -> dict[str, ModelDescription]:
    """What the XML of each FMU says."""
    return {model: fmpy.read_model_description(str(path)) for model, path in built.items()}


@pytest.fixture(params=MODELS)
def description(request: pytest.FixtureRequest, descriptions: dict[str, ModelDescription]) -> ModelDescription:
    """Of each FMU in turn."""
    result: ModelDescription = descriptions[request.param]
    return result


@pytest.fixture
def instance(description: ModelDescription, built: dict[str, Path]) -> Iterator[Instance]:
    """Freshly instantiated, of each FMU in turn."""
    with Instance(built[description.modelName]) as instance:
        yield instance


# -- what is declared -----------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_fmpy_finds_no_problem(model: str, built: dict[str, Path]) -> None:
    assert validate_fmu(str(built[model])) == []


@pytest.mark.parametrize(("model", "row"), ROWS)
def test_the_variable_is_as_the_interface_says(model: str, row: Row, descriptions: dict[str, ModelDescription]) -> None:
    (variable,) = (v for v in descriptions[model].modelVariables if v.name == row.name)
    start = variable.start
    if start is not None:
        start = start == "true" if row.type == "Boolean" else float(start)
    found = Row(variable.name, variable.causality, variable.variability, variable.type, variable.unit, start)
    assert found == row


def test_no_input_or_output_is_missing_from_the_interface(description: ModelDescription) -> None:
    def ports(variables: Iterator[tuple[str, str]]) -> set[str]:
        return {name for name, causality in variables if causality in ("input", "output")}

    declared = ports((v.name, v.causality) for v in description.modelVariables)
    assert declared == ports((row.name, row.causality) for row in TABLES[description.modelName])


def test_bounds_contain_the_start(description: ModelDescription) -> None:
    bounded = [v for v in description.modelVariables if v.start is not None and (v.min, v.max) != (None, None)]
    assert {"mass", "gravity"} <= {v.name for v in bounded}
    for v in bounded:
        lower, upper = float(v.min or "-inf"), float(v.max or "inf")
        assert lower <= float(v.start) <= upper, v.name


def test_the_default_experiment_is_30_s_in_steps_of_10_ms(description: ModelDescription) -> None:
    experiment = description.defaultExperiment
    times = [float(text) for text in (experiment.startTime, experiment.stopTime, experiment.stepSize)]
    assert times == [0.0, 30.0, 0.01]
    assert times[1] > times[0]


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
    assert root.find("VendorAnnotations/Tool[@name='quadcosim']/Python").attrib == {"requires": PYTHON_REQUIRED}
    order = [element.tag for element in root]
    place = order.index("VendorAnnotations")
    assert order[place - 1 : place + 2] == ["DefaultExperiment", "VendorAnnotations", "ModelVariables"]


def test_the_required_python_is_the_one_that_the_project_requires_and_is_checked_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    oldest = PYTHON_REQUIRED.removeprefix(">=")
    assert project["project"]["requires-python"] == PYTHON_REQUIRED
    assert project["tool"]["mypy"]["python_version"] == oldest
    assert project["tool"]["ruff"]["target-version"] == "py" + oldest.replace(".", "")
    assert f"{OLDEST[0]}.{OLDEST[1]}" == oldest


@pytest.mark.parametrize("model", MODELS)
def test_the_bundled_sources_are_in_the_syntax_of_the_required_python(model: str, built: dict[str, Path]) -> None:
    sources = {name: content for name, content in files_of(built[model]).items() if name.endswith(".py")}
    assert len(sources) > 10
    for name, content in sources.items():
        ast.parse(content, name, feature_version=OLDEST)


# -- units ----------------------------------------------------------------------------------------------

DERIVED = {"N": {"kg": 1, "m": 1, "s": -2}, "J": {"kg": 1, "m": 2, "s": -2}, "1": {}}


def dimensions(unit: str) -> Counter[str]:
    """Exponents of the base units, read from the name of the unit: `N.m.s`, `m/s3`, `1/s`."""
    above, _, below = unit.partition("/")
    total: Counter[str] = Counter()
    for sign, symbols in ((1, above.split(".")), (-1, below.split(".") if below else [])):
        for symbol in symbols:
            match = re.fullmatch(r"([A-Za-z]+|1)(\d*)", symbol)
            assert match, unit
            for base, exponent in DERIVED.get(match[1], {match[1]: 1}).items():
                total[base] += sign * exponent * int(match[2] or 1)
    return total


def test_every_unit_is_defined_by_the_base_units_that_its_name_means(description: ModelDescription) -> None:
    defined = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    used = {v.unit for v in description.modelVariables if v.unit is not None}
    assert used == set(defined)
    for name, base in defined.items():
        assert base is not None, name
        expected = dimensions(name)
        found = {symbol: int(getattr(base, symbol)) for symbol in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        assert found == {symbol: expected[symbol] for symbol in found}, name
        assert (float(base.factor), float(base.offset)) == (1.0, 0.0), name


def test_every_real_has_a_unit(description: ModelDescription) -> None:
    assert [v.name for v in description.modelVariables if v.type == "Real" and v.unit is None] == []


# -- what is declared is true ---------------------------------------------------------------------------


def test_declared_starts_are_what_a_fresh_instance_has_to_the_last_digit(instance: Instance) -> None:
    declared = {name: v for name, v in instance.variables.items() if v.start is not None}
    assert len(declared) > 30
    for name, variable in declared.items():
        value = instance.value(name)
        if variable.type == "Real":
            assert variable.start == repr(value), name  # the shortest text that gives the same bits
        else:
            assert bool(value) == (variable.start == "true"), name


def test_declared_starts_are_what_reset_restores(instance: Instance) -> None:
    before = [instance.value(name) for name, v in instance.variables.items() if v.start is not None]
    instance.initialise({"mass": 1.5, "gravity": 9.7})
    instance.fmu.reset()
    assert [instance.value(name) for name, v in instance.variables.items() if v.start is not None] == before


def test_no_output_is_declared_to_follow_an_input_directly(description: ModelDescription) -> None:
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    declared = {unknown.variable.name: unknown.dependencies for unknown in description.outputs}
    assert declared == {name: [] for name in outputs}


def test_declared_initial_dependencies_are_all_inputs_of_the_controller_and_none_of_the_plant(
    description: ModelDescription,
) -> None:
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    expected = inputs if description.modelName == "UnifiedController" else []
    outputs = {v.name for v in description.modelVariables if v.causality == "output"}
    declared = {u.variable.name: [d.name for d in u.dependencies] for u in description.initialUnknowns}
    assert declared == dict.fromkeys(outputs, expected)


def perturbed(instance: Instance) -> Iterator[tuple[str, list[str]]]:
    """Each input in turn, moved a little, with the outputs that moved with it."""
    outputs = instance.names("output")
    for name in instance.names("input"):
        (before,), outputs_before = instance.get(name), instance.get(*outputs)
        instance.set({name: before + 0.0625})
        moved = zip(outputs, outputs_before, instance.get(*outputs), strict=True)
        yield name, [output for output, old, new in moved if old != new]
        instance.set({name: before})


@pytest.mark.parametrize("steps", [0, 3])
def test_at_a_communication_point_no_output_moves_with_an_input(steps: int, instance: Instance) -> None:
    instance.initialise({})
    for k in range(steps):
        instance.step(k * 0.01, 0.01)
    moved = dict(perturbed(instance))
    assert moved == {name: [] for name in instance.names("input")}


def test_in_initialisation_mode_the_outputs_of_the_plant_move_with_no_input(built: dict[str, Path]) -> None:
    with Instance(built["QuadrotorPlant"]) as plant:
        plant.fmu.setupExperiment(startTime=0.0)
        plant.fmu.enterInitializationMode()
        assert dict(perturbed(plant)) == {name: [] for name in plant.names("input")}


def test_in_initialisation_mode_the_command_moves_with_every_input(built: dict[str, Path]) -> None:
    with Instance(built["UnifiedController"]) as controller:
        # Away from every symmetry, where some derivative would vanish.
        general = {name: 0.05 * (i % 7 + 1) for i, name in enumerate(controller.names("input"))}
        controller.set({**general, "quaternion.w": 0.9, "use_reference_inputs": True})
        controller.fmu.setupExperiment(startTime=0.0)
        controller.fmu.enterInitializationMode()
        moved = dict(perturbed(controller))
    assert [name for name, outputs in moved.items() if not outputs] == []
    assert set().union(*moved.values()) == {"thrust", "torque.x", "torque.y", "torque.z"}


def test_in_initialisation_mode_reference_inputs_that_are_not_used_move_nothing(built: dict[str, Path]) -> None:
    with Instance(built["UnifiedController"]) as controller:
        controller.set(MEASUREMENT)
        controller.fmu.setupExperiment(startTime=0.0)
        controller.fmu.enterInitializationMode()
        moved = dict(perturbed(controller))
    assert {name for name, outputs in moved.items() if not outputs} == {n for n in moved if n.startswith("reference.")}
