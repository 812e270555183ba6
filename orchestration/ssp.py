"""Both FMUs, their connections and a scenario's parameters as one SSP 1.0 file, for other people's tools.

The tools differ in what they read of an SSP. libcosim and ecos take parameter sets that are bound to a
component and want the prefixes ssd, ssc, ssv and osp; libcosim has its step from an annotation; fmpy takes
a set as an argument, with the component's name before each parameter's; OMSimulator wants its own annotation.
So every value is written twice, in a set of each component and in one of the system, and the step three times.
`docs/guides/ssp.md` has the call for each tool.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from xml.etree.ElementTree import Element, indent, register_namespace, tostring

from fmpy.model_description import ModelDescription, ScalarVariable

from fmu_kit.model_description import generation_date
from fmu_kit.packaging import write_archive
from orchestration import fmus
from orchestration.errors import UsageError
from orchestration.fmi.model import read_description
from orchestration.scenario import FmuChoice, Parameter, Scenario
from orchestration.timing import Timing
from orchestration.wiring import COMMAND, MEASUREMENT, SAMPLE_OFFSET, SAMPLE_PERIOD

NAME = "QuadrotorLoop"
PARAMETER_SET = "scenario"
"""Name of each parameter set."""
SYSTEM_PARAMETERS = "resources/scenario.ssv"
"""The set with the names of the components before those of the parameters."""

CARRIED = ("period", "offset", "plant_interval", "clock")
"""What of the timing an SSP can say: the sample clock, always the controller's own there, and the step of the tool."""

_NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}

_BASE = {**dict.fromkeys(("kg", "m", "s", "A", "K", "mol", "cd", "rad"), 0), "factor": 1.0, "offset": 0.0}
"""What a base unit is by the standard where nothing is said."""


@dataclass(frozen=True, kw_only=True)
class Component:
    """One FMU of the system."""

    name: str
    fmu: Path
    description: ModelDescription
    parameters: dict[str, Parameter]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def source(self) -> str:
        """Its FMU in the archive."""
        return f"resources/{self.fmu.name}"

    @property
    def parameter_file(self) -> str:
        """Its parameter set in the archive."""
        return f"resources/{self.name}.ssv"

    def variable(self, name: str) -> ScalarVariable:
        """The declaration of a variable; raises `UsageError` if there is none."""
        for variable in self.description.modelVariables:
            if variable.name == name:
                return variable
        raise UsageError(f"{self.name}.{name}: {self.description.modelName} has no such variable")


def write(scenario: Scenario, path: Path, announce: Callable[[str], None] | None = None) -> Path:
    """Write `scenario` as an SSP; the same scenario and FMUs give the same bytes.

    Raises `UsageError` for a scenario that needs more than both FMUs and their parameters: an SSP
    cannot say that values come late, get lost or are noisy.
    """
    both = components(scenario, announce)
    files = {component.source: component.fmu.read_bytes() for component in both}
    for component in both:
        files[component.parameter_file] = _document(_parameter_set({"": component}))
    files[SYSTEM_PARAMETERS] = _document(_parameter_set({f"{c.name}.": c for c in both}))
    files["SystemStructure.ssd"] = _document(_structure(scenario, both))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_archive(path, files, first="SystemStructure.ssd")
    return path


def components(scenario: Scenario, announce: Callable[[str], None] | None = None) -> tuple[Component, Component]:
    """The controller and the plant of `scenario`, in this order, for tools that step one after the other.

    Raises `UsageError` as `write` does.
    """
    _expect_carried(scenario)
    timing = scenario.timing
    clock: dict[str, Parameter] = {SAMPLE_PERIOD: timing.period, SAMPLE_OFFSET: timing.offset}
    controller = _component("controller", scenario.controller, clock, MEASUREMENT, COMMAND, announce)
    plant = _component("plant", scenario.plant, {}, COMMAND, MEASUREMENT, announce)
    if controller.source == plant.source:
        raise UsageError(f"{controller.fmu} and {plant.fmu}: expected FMUs of different file names")
    return controller, plant


def _expect_carried(scenario: Scenario) -> None:
    default = Timing()
    for field in fields(Timing):
        value = getattr(scenario.timing, field.name)
        if field.name not in CARRIED and value != getattr(default, field.name):
            raise UsageError(
                f"timing.{field.name} = {value}: an SSP cannot say that; expected no other timing than "
                f"{', '.join(CARRIED)}"
            )
    if scenario.reference.file is not None:
        raise UsageError("reference.file: an SSP cannot feed one; expected the controller's built-in trajectory")


def _component(
    name: str,
    choice: FmuChoice,
    clock: Mapping[str, Parameter],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    announce: Callable[[str], None] | None,
) -> Component:
    path = fmus.locate(choice.fmu, announce)
    description = read_description(path)
    component = Component(name=name, fmu=path, description=description, parameters={}, inputs=inputs, outputs=outputs)
    given = {**choice.parameters, **clock}
    for key in given:
        if component.variable(key).causality not in ("parameter", "input") or key in inputs:
            raise UsageError(f"{name}.{key}: expected a parameter or an input that nothing is connected to")
    for variable in description.modelVariables:
        if variable.name in given:
            value = _of_type(f"{name}.{variable.name}", given[variable.name], variable.type)
            # A Boolean only if it is not what it is anyway: fmpy takes the text false for true.
            if variable.type != "Boolean" or str(value).lower() != variable.start:
                component.parameters[variable.name] = value
        elif variable.causality == "parameter" and variable.type in ("Real", "Integer"):
            start = int(variable.start) if variable.type == "Integer" else float(variable.start)
            component.parameters[variable.name] = start
    return component


def _of_type(place: str, value: Parameter, kind: str) -> Parameter:
    """A value as a variable of type `kind` takes it; raises `UsageError` for one that it cannot take."""
    is_truth = isinstance(value, bool)
    fits, expected = {
        "Boolean": (is_truth, "true or false"),
        "Integer": (isinstance(value, int) and not is_truth, "a whole number"),
    }.get(kind, (not is_truth and math.isfinite(value), "a finite number"))
    if not fits:
        raise UsageError(f"{place} = {value}: expected {expected}")
    return value if kind in ("Boolean", "Integer") else float(value)


# -- the documents ----------------------------------------------------------------------------------------


def _structure(scenario: Scenario, components: tuple[Component, ...]) -> Element:
    root = _element(
        "ssd:SystemStructureDescription",
        name=NAME,
        version="1.0",
        generationTool="quadcosim",
        generationDateAndTime=generation_date(),
    )
    system = _add(root, "ssd:System", name=NAME, description="Quadrotor and its controller in closed loop")
    _bind(system, SYSTEM_PARAMETERS)
    elements = _add(system, "ssd:Elements")
    for component in components:
        _add_component(elements, component)
    connections = _add(system, "ssd:Connections")
    controller, plant = components
    for start, end in ((plant, controller), (controller, plant)):
        for name in start.outputs:
            _add(
                connections,
                "ssd:Connection",
                startElement=start.name,
                startConnector=name,
                endElement=end.name,
                endConnector=name,
            )
    step = repr(float(scenario.timing.plant_interval))
    _annotate_for_omsimulator(system, step)
    _add_units(root, "ssd:Units", components)
    experiment = _add(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(float(scenario.stop_time)))
    annotation = _add(_add(experiment, "ssd:Annotations"), "ssc:Annotation", type="com.opensimulationplatform")
    algorithm = _add(annotation, "osp:Algorithm")
    _add(algorithm, "osp:FixedStepAlgorithm", baseStepSize=step)
    return root


def _annotate_for_omsimulator(system: Element, step: str) -> None:
    """The attributes are what its version 3 reads, the child is what version 2 does not start without."""
    annotation = _add(_add(system, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    master = _add(
        _add(annotation, "oms:Annotations"),
        "oms:SimulationInformation",
        name="oms_ma_default",
        method="oms_ma",
        fixedStepSize=step,
    )
    tolerances = {"absoluteTolerance": "1e-4", "relativeTolerance": "1e-4"}  # required, and unused at a fixed step
    _add(master, "oms:FixedStepMaster", description="oms-ma", stepSize=step, **tolerances)


def _add_component(elements: Element, component: Component) -> None:
    element = _add(
        elements,
        "ssd:Component",
        name=component.name,
        source=component.source,
        type="application/x-fmu-sharedlibrary",
        implementation="CoSimulation",
    )
    connectors = _add(element, "ssd:Connectors")
    for kind, names in (("input", component.inputs), ("output", component.outputs)):
        for name in names:
            connector = _add(connectors, "ssd:Connector", name=name, kind=kind)
            _add(connector, "ssc:Real", **_unit(component.variable(name)))
    _bind(element, component.parameter_file)


def _bind(element: Element, source: str) -> None:
    _add(_add(element, "ssd:ParameterBindings"), "ssd:ParameterBinding", source=source)


def _parameter_set(components: Mapping[str, Component]) -> Element:
    """The parameters of components, each with its prefix."""
    root = _element("ssv:ParameterSet", version="1.0", name=PARAMETER_SET)
    parameters = _add(root, "ssv:Parameters")
    for prefix, component in components.items():
        for name, value in component.parameters.items():
            variable = component.variable(name)
            parameter = _add(parameters, "ssv:Parameter", name=prefix + name)
            _add(parameter, f"ssv:{variable.type}", value=repr(value).lower(), **_unit(variable))
    _add_units(root, "ssv:Units", components.values())
    return root


def _unit(variable: ScalarVariable) -> dict[str, str]:
    """The attribute `unit`, if the variable has one."""
    return {} if variable.unit is None else {"unit": variable.unit}


def _add_units(root: Element, tag: str, components: Iterable[Component]) -> None:
    """The unit definitions of the FMUs that say what the unit is, each once."""
    definitions = (unit for component in components for unit in component.description.unitDefinitions)
    bases = {unit.name: unit.baseUnit for unit in definitions if unit.baseUnit is not None}
    if not bases:
        return
    units = _add(root, tag)
    for name in sorted(bases):
        base = {key: getattr(bases[name], key) for key in _BASE}
        unit = _add(units, "ssc:Unit", name=name)
        _add(unit, "ssc:BaseUnit", **{key: str(value) for key, value in base.items() if value != _BASE[key]})


def _element(tag: str, **attributes: str) -> Element:
    prefix, _, name = tag.partition(":")
    return Element(f"{{{_NAMESPACES[prefix]}}}{name}", attributes)


def _add(parent: Element, tag: str, **attributes: str) -> Element:
    element = _element(tag, **attributes)
    parent.append(element)
    return element


def _document(root: Element) -> bytes:
    for prefix, uri in _NAMESPACES.items():
        register_namespace(prefix, uri)
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text
