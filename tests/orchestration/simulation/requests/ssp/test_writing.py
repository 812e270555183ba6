"""The SSP that `quadcosim ssp` writes: its content, and the scenarios that it rejects."""

import dataclasses
import re
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd, read_ssv

from fmu_kit.archive import write_archive
from orchestration.simulation.requests.ssp import writing
from orchestration.simulation.requests.ssp.names import PARAMETER_SET
from orchestration.systems.system.paths import changed
from quadcosim import FmuChoice, Scenario, Timing, UsageError
from tests.fmus.interface_table import TABLES
from tests.orchestration.simulation.interop.common import with_other_parameters

NAMES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
}
MODELS = {"controller": "UnifiedController", "plant": "QuadrotorPlant"}
SETS = ("resources/controller.ssv", "resources/plant.ssv", "resources/scenario.ssv")


@pytest.fixture(params=["the paper's", "other"])
def scenario(request: pytest.FixtureRequest, short: Scenario) -> Scenario:
    return short if request.param == "the paper's" else with_other_parameters(short)


@pytest.fixture
def written(scenario: Scenario, tmp_path: Path) -> Path:
    return writing.write(scenario, tmp_path / "loop.ssp")


def document(path: Path, name: str = "SystemStructure.ssd") -> Element:
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read(name))


def values_in(path: Path, name: str) -> dict[str, tuple[str, str, str | None]]:
    """Type, text and unit of the parameters of a set, by name."""
    found = {}
    for parameter in document(path, name).iterfind("ssv:Parameters/ssv:Parameter", NAMES):
        (value,) = parameter
        assert parameter.get("name") not in found
        found[parameter.attrib["name"]] = (value.tag.partition("}")[2], value.attrib["value"], value.get("unit"))
    return found


def expected_values(scenario: Scenario, component: str) -> Iterator[tuple[str, tuple[str, str, str | None]]]:
    """The expected parameters: all numeric ones of the interface, and others that are set."""
    given = dict(getattr(scenario, component).parameters)
    if component == "controller":
        given |= {"sample_period": scenario.timing.period, "sample_offset": scenario.timing.offset}
    for row in TABLES[MODELS[component]]:
        if row.name in given or (row.causality == "parameter" and row.type not in ("Boolean", "Enumeration")):
            yield row.name, (row.type, repr(given.get(row.name, row.start)), row.unit)


# -- the content ------------------------------------------------------------------------------------------


def test_the_structure_and_each_parameter_set_are_valid_ssp_1_0(written: Path) -> None:
    structure = read_ssd(str(written), validate=True)
    assert structure.version == "1.0"
    for name in SETS:
        assert read_ssv(str(written), name, validate=True).parameters


def test_the_same_scenario_gives_the_same_bytes(scenario: Scenario, written: Path, tmp_path: Path) -> None:
    again = writing.write(dataclasses.replace(scenario), tmp_path / "new" / "folder" / "again.ssp")
    assert again.read_bytes() == written.read_bytes()
    other = writing.write(scenario.with_changes(parameters={"plant.mass": 1.3}), tmp_path / "other.ssp")
    assert other.read_bytes() != written.read_bytes()


def test_each_component_has_its_parameters_with_value_and_unit_in_shortest_exact_form(
    scenario: Scenario, written: Path
) -> None:
    for component in MODELS:
        found = values_in(written, f"resources/{component}.ssv")
        assert found == dict(expected_values(scenario, component))
        assert len(found) > 20


def test_the_set_of_the_system_has_the_same_values_behind_the_names_of_the_components(written: Path) -> None:
    both = {f"{c}.{name}": value for c in MODELS for name, value in values_in(written, f"resources/{c}.ssv").items()}
    assert values_in(written, "resources/scenario.ssv") == both


def test_every_set_is_bound_where_it_belongs(written: Path) -> None:
    system = document(written).find("ssd:System", NAMES)
    assert system is not None
    bound = {"system": system, **{c.attrib["name"]: c for c in system.iterfind("ssd:Elements/ssd:Component", NAMES)}}
    sources = {
        name: [b.attrib for b in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMES)]
        for name, element in bound.items()
    }
    assert sources == {
        "system": [{"source": "resources/scenario.ssv"}],
        "controller": [{"source": "resources/controller.ssv"}],
        "plant": [{"source": "resources/plant.ssv"}],
    }
    names = {document(written, name).attrib["name"] for name in SETS}
    assert names == {PARAMETER_SET}, "ecos takes its sets by this name"


def test_a_boolean_is_written_if_it_differs_from_its_start_value(short: Scenario, tmp_path: Path) -> None:
    for given, expected in ((True, ("Boolean", "true", None)), (False, None)):
        chosen = changed(short.as_system(), {"components.controller.parameters.use_reference_inputs": given})
        path = writing.write(chosen, tmp_path / "loop.ssp")
        assert values_in(path, "resources/controller.ssv").get("use_reference_inputs") == expected
        assert read_ssv(str(path), "resources/controller.ssv", validate=True)


def test_the_connections_are_the_13_measurements_and_the_4_commands(written: Path) -> None:
    found = {
        tuple(connection.attrib[key] for key in ("startElement", "startConnector", "endElement", "endConnector"))
        for connection in document(written).iterfind("ssd:System/ssd:Connections/ssd:Connection", NAMES)
    }
    motion = [f"{name}.{axis}" for name in ("position", "velocity", "angular_velocity") for axis in "xyz"]
    motion += [f"quaternion.{axis}" for axis in "xyzw"]
    command = ["thrust", "torque.x", "torque.y", "torque.z"]
    expected = {("plant", name, "controller", name) for name in motion}
    expected |= {("controller", name, "plant", name) for name in command}
    assert found == expected
    assert len(document(written).findall("ssd:System/ssd:Connections/ssd:Connection", NAMES)) == 17


def test_connectors_are_typed_and_their_units_are_those_of_the_fmu_and_agree_on_both_ends(written: Path) -> None:
    units: dict[tuple[str, str], str] = {}
    for component in document(written).iterfind("ssd:System/ssd:Elements/ssd:Component", NAMES):
        name = component.attrib["name"]
        declared = {row.name: (row.causality, row.unit) for row in TABLES[MODELS[name]]}
        for connector in component.iterfind("ssd:Connectors/ssd:Connector", NAMES):
            (real,) = connector
            assert real.tag == f"{{{NAMES['ssc']}}}Real"
            assert (connector.attrib["kind"], real.attrib["unit"]) == declared[connector.attrib["name"]]
            units[name, connector.attrib["name"]] = real.attrib["unit"]
    assert len(units) == 34
    for connection in document(written).iterfind("ssd:System/ssd:Connections/ssd:Connection", NAMES):
        end = connection.attrib
        assert units[end["startElement"], end["startConnector"]] == units[end["endElement"], end["endConnector"]]


def test_every_unit_is_defined_with_the_base_units_of_the_fmus(written: Path, built: dict[str, Path]) -> None:
    of_the_fmus: dict[str, dict[str, str]] = {}
    for path in built.values():
        with zipfile.ZipFile(path) as archive:
            description = ElementTree.fromstring(archive.read("modelDescription.xml"))
        for unit in description.iterfind("UnitDefinitions/Unit"):
            of_the_fmus[unit.attrib["name"]] = unit[0].attrib
    assert of_the_fmus["N.m"] == {"kg": "1", "m": "2", "s": "-2"}
    for name, tag in (("SystemStructure.ssd", "ssd"), *((name, "ssv") for name in SETS)):
        root = document(written, name)
        defined = {unit.attrib["name"]: unit[0].attrib for unit in root.iterfind(f"{tag}:Units/ssc:Unit", NAMES)}
        used = {element.attrib["unit"] for element in root.iter() if "unit" in element.attrib}
        assert used
        assert used <= defined.keys()
        assert defined == {name: of_the_fmus[name] for name in defined}


def test_the_step_and_the_stop_time_of_the_scenario_are_in_it(scenario: Scenario, written: Path) -> None:
    experiment = document(written).find("ssd:DefaultExperiment", NAMES)
    assert experiment is not None
    assert (experiment.attrib["startTime"], experiment.attrib["stopTime"]) == ("0.0", "0.2")
    (annotation,) = experiment.iterfind("ssd:Annotations/ssc:Annotation", NAMES)
    assert annotation.attrib["type"] == "com.opensimulationplatform"
    (algorithm,) = annotation.iterfind("osp:Algorithm/osp:FixedStepAlgorithm", NAMES)
    assert algorithm.attrib == {"baseStepSize": "0.01"}


def test_the_fmus_inside_are_byte_for_byte_those_of_the_scenario(written: Path, built: dict[str, Path]) -> None:
    with zipfile.ZipFile(written) as archive:
        inside = {name: archive.read(name) for name in archive.namelist()}
    assert inside.keys() == {"SystemStructure.ssd", *SETS, *(f"resources/{model}.fmu" for model in MODELS.values())}
    for component in document(written).iterfind("ssd:System/ssd:Elements/ssd:Component", NAMES):
        model = MODELS[component.attrib["name"]]
        assert component.attrib["source"] == f"resources/{model}.fmu"
        assert component.attrib["implementation"] == "CoSimulation"
        assert inside[component.attrib["source"]] == built[model].read_bytes()


def test_the_date_is_that_of_the_sources(short: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    path = writing.write(short, tmp_path / "loop.ssp")
    assert document(path).attrib["generationDateAndTime"] == "1980-01-01T00:00:00Z"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    path = writing.write(short, tmp_path / "loop.ssp")
    assert document(path).attrib["generationDateAndTime"] == "2001-09-09T01:46:40Z"


# -- what scenarios may hold ------------------------------------------------------------------------------


def test_numbers_of_numpy_and_whole_numbers_are_written_as_any_other(short: Scenario, tmp_path: Path) -> None:
    plain = short.with_changes(stop_time=2.0, parameters={"plant.mass": 2.0}, timing={"period": 0.02})
    same = dataclasses.replace(
        short.with_changes(parameters={"plant.mass": 2}),
        stop_time=np.float64(2.0),
        timing=Timing(period=np.float64(0.02), plant_interval=np.float64(0.01)),
    )
    expected = writing.write(plain, tmp_path / "plain.ssp")
    assert writing.write(same, tmp_path / "same.ssp").read_bytes() == expected.read_bytes()


def test_the_clock_of_the_scenario_changes_nothing_for_other_tools(short: Scenario, tmp_path: Path) -> None:
    """It is in the annotation with the timing, and nowhere else."""
    paths = [
        writing.write(short.with_changes(timing={"clock": clock}), tmp_path / clock) for clock in ("master", "fmu")
    ]
    assert paths[0].read_bytes() != paths[1].read_bytes()
    assert for_others(paths[0]) == for_others(paths[1])


def for_others(path: Path) -> dict[str, bytes]:
    """What an SSP has for other tools, by name: all but the annotation of this project."""
    with zipfile.ZipFile(path) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    root = document(path)
    root.remove(*root.iterfind("ssd:Annotations", NAMES))
    return {**found, "SystemStructure.ssd": ElementTree.tostring(root)}


def test_whole_numbers_stay_whole_and_others_are_rejected(odd_plant: Path, short: Scenario, tmp_path: Path) -> None:
    chosen = dataclasses.replace(short, plant=FmuChoice(fmu=str(odd_plant), parameters={"cargo": 3}))
    path = writing.write(chosen, tmp_path / "loop.ssp")
    assert values_in(path, "resources/plant.ssv")["cargo"] == ("Integer", "3", None)
    assert read_ssv(str(path), "resources/plant.ssv", validate=True)
    without = writing.write(dataclasses.replace(short, plant=FmuChoice(fmu=str(odd_plant))), path)
    assert values_in(without, "resources/plant.ssv")["cargo"] == ("Integer", "0", None)
    of_a_range = writing.write(chosen.with_changes(parameters={"plant.cargo": 4.0}), path)
    assert values_in(of_a_range, "resources/plant.ssv")["cargo"] == ("Integer", "4", None)
    with pytest.raises(UsageError, match=r"^plant.cargo = 3.5: expected a whole number of 32 bits$"):
        writing.write(chosen.with_changes(parameters={"plant.cargo": 3.5}), path)


DEGREES = '<Unit name="deg"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit><Unit name="box"/>'


def test_third_party_fmus_may_have_units_of_any_kind(short: Scenario, built: dict[str, Path], tmp_path: Path) -> None:
    def changed(description: str) -> str:
        return description.replace("<UnitDefinitions>", f"<UnitDefinitions>{DEGREES}", 1)

    path = writing.write(with_descriptions(short, built, tmp_path, changed), tmp_path / "loop.ssp")
    assert read_ssd(str(path), validate=True)
    units = document(path).iterfind("ssd:Units/ssc:Unit", NAMES)
    defined = {unit.attrib["name"]: unit[0].attrib for unit in units}
    assert defined["deg"] == {"rad": "1", "factor": "0.017453292519943295"}
    assert defined["N"] == {"kg": "1", "m": "1", "s": "-2"}
    assert "box" not in defined, "an FMU may leave out what its unit is; SSP may not"


def test_third_party_fmus_need_no_units(short: Scenario, built: dict[str, Path], tmp_path: Path) -> None:
    def changed(description: str) -> str:
        description = re.sub("<UnitDefinitions>.*</UnitDefinitions>", "", description, flags=re.DOTALL)
        return re.sub(r' unit="[^"]*"', "", description)

    path = writing.write(with_descriptions(short, built, tmp_path, changed), tmp_path / "loop.ssp")
    assert read_ssd(str(path), validate=True)
    for name in ("SystemStructure.ssd", *SETS):
        assert not any(
            "unit" in element.tag.lower() or "unit" in element.attrib for element in document(path, name).iter()
        )


def with_descriptions(
    scenario: Scenario, built: dict[str, Path], folder: Path, changed: Callable[[str], str]
) -> Scenario:
    """`scenario` with copies of its FMUs whose descriptions are changed."""
    copies = {}
    for model, path in built.items():
        with zipfile.ZipFile(path) as archive:
            description = archive.read("modelDescription.xml").decode()
        assert changed(description) != description
        copies[model] = folder / path.name
        write_archive(copies[model], {"modelDescription.xml": changed(description).encode()}, first="")
    return scenario.with_fmus(plant=copies["QuadrotorPlant"], controller=copies["UnifiedController"])
