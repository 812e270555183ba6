"""Writes a system as an SSP 1.0 file for third-party tools: FMUs, their connections, their parameters.

The tools differ in what they read of an SSP. libcosim and ecos take parameter sets that are bound to a
component and want the prefixes ssd, ssc, ssv and osp; libcosim has its step from an annotation; fmpy takes
a set as an argument, with the component's name before each parameter's; OMSimulator wants its own annotation.
So every value is written twice, in a set of each component and in one of the system, and the step three times.
`docs/guides/ssp.md` has the call for each tool.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from fmu_kit.archive import write_archive
from fmu_kit.new_files import new_files
from fmu_kit.units import BASE
from fmu_kit.variables import INDEX
from fmu_kit.versions import generation_tool
from fmu_kit.write_description import generation_date
from orchestration.components.fmi.read_description import Kind, Variable
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.requests.ssp import timing
from orchestration.simulation.requests.ssp.document import add, document, element
from orchestration.simulation.requests.ssp.export import Export, Part, export_of
from orchestration.simulation.requests.ssp.names import PARAMETER_SET, SYSTEM_PARAMETERS
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.connection import variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request

TYPED: tuple[Kind, ...] = ("Real", "Integer", "Boolean", "String")
"""Types of connectors without a list of items"""


def write(
    request: Request,
    path: Path,
    announce: Callable[[str], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> Path:
    """Write a system as an SSP; the same system and FMUs give the same bytes.

    `announce` receives the FMUs that are built for it. `warn` receives a line for each feature that the SSP lacks,
    without which it is another system unless its file with timing is used, and for each that some masters reject.
    Raises `UsageError` for different FMUs of one file name.
    """
    export = export_of(request, announce)
    if warn is not None:
        for line in export.unsupported:
            warn(f"{line.partition('; expected')[0]}; only its file with timing does")
        for line in rejections(export):
            warn(request.in_own_terms(line))
    files = {source: fmu.read_bytes() for source, fmu in _sources(export.parts).items()}
    for place, table in timing.files_of(export.system).items():
        files[place] = table.read_bytes()
    for part in export.parts:
        files[_parameter_file(part)] = document(_parameter_set({"": part}))
    files[SYSTEM_PARAMETERS] = document(_parameter_set({f"{part.name}.": part for part in export.parts}))
    about = {"description": request.description} if request.description else {}
    files["SystemStructure.ssd"] = document(_structure(export, request.title or path.stem, about))
    write_archive(path, files, first="SystemStructure.ssd")
    return path


def write_with_timing(
    request: Request,
    path: Path,
    announce: Callable[[str], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> tuple[Path, Path]:
    """As `write`, with the file beside it with which it loads as the same system."""
    with new_files(path.parent) as new:
        written = timing.write(request.as_system(), write(request, new / path.name, announce, warn))
    return path, path.with_name(written.name)


def _sources(parts: Iterable[Part]) -> dict[str, Path]:
    """FMUs by their place in the archive."""
    found: dict[str, Path] = {}
    for part in parts:
        other = found.setdefault(_source(part), part.fmu)
        if other != part.fmu:
            raise UsageError(f"{other} and {part.fmu}: expected FMUs of different file names")
    return found


_ESCAPES = {ord(character): f"%{ord(character):02X}" for character in "%#?"}
"""Escapes in the name of a file in a URI that would otherwise end there; other tools do not decode more than they need
to"""


def _source(part: Part) -> str:
    return f"{timing.RESOURCES}{part.fmu.name}"


def _parameter_file(part: Part) -> str:
    return f"{timing.RESOURCES}{part.name}.ssv"


# -- the documents ----------------------------------------------------------------------------------------


def _structure(export: Export, name: str, about: Mapping[str, str]) -> Element:
    root = element(
        "ssd:SystemStructureDescription",
        name=name,
        version="1.0",
        generationTool=generation_tool(),
        generationDateAndTime=generation_date(),
    )
    system = add(root, "ssd:System", name=name, **about)
    _bind(system, SYSTEM_PARAMETERS)
    elements = add(system, "ssd:Elements")
    for part in export.parts:
        _add_component(elements, part)
    if export.system.connections:
        _add_connections(add(system, "ssd:Connections"), export.system)
    step = repr(float(export.step))
    _annotate_for_omsimulator(system, step)
    _add_units(root, "ssd:Units", export.parts)
    experiment = add(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(float(export.system.stop_time)))
    annotation = add(add(experiment, "ssd:Annotations"), "ssc:Annotation", type="com.opensimulationplatform")
    algorithm = add(annotation, "osp:Algorithm")
    add(algorithm, "osp:FixedStepAlgorithm", baseStepSize=step)
    own = add(add(root, "ssd:Annotations"), "ssc:Annotation", type=timing.ANNOTATION)
    add(own, "quadcosim:Timing").text = timing.as_text(export.system)
    return root


def _add_connections(connections: Element, system: System) -> None:
    """Add the connections with the conversions that the system states, and no other."""
    for x in system.connections:
        is_plain = not (x.stated or x.converts)
        for start, end in zip(x.start, x.end, strict=True):
            connection = add(
                connections,
                "ssd:Connection",
                startElement=x.sender,
                startConnector=variable_of(start),
                endElement=x.receiver,
                endConnector=variable_of(end),
                **({} if is_plain else {"suppressUnitConversion": "true"}),
            )
            if not is_plain:
                add(connection, "ssc:LinearTransformation", factor=repr(float(x.scale)), offset=repr(float(x.offset)))


def _annotate_for_omsimulator(system: Element, step: str) -> None:
    """Version 3 reads the attributes; version 2 does not start without the child."""
    annotation = add(add(system, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    master = add(
        add(annotation, "oms:Annotations"),
        "oms:SimulationInformation",
        name="oms_ma_default",
        method="oms_ma",
        fixedStepSize=step,
    )
    tolerances = {"absoluteTolerance": "1e-4", "relativeTolerance": "1e-4"}  # required, and unused at a fixed step
    add(master, "oms:FixedStepMaster", description="oms-ma", stepSize=step, **tolerances)


def _add_component(elements: Element, part: Part) -> None:
    component = add(
        elements,
        "ssd:Component",
        name=part.name,
        source=_source(part).translate(_ESCAPES),
        type="application/x-fmu-sharedlibrary",
        implementation="CoSimulation",
    )
    if part.inputs or part.outputs:
        _add_connectors(add(component, "ssd:Connectors"), part)
    _bind(component, _parameter_file(part))


def _add_connectors(connectors: Element, part: Part) -> None:
    for kind, names in (("input", part.inputs), ("output", part.outputs)):
        for name in names:
            variable = part.variable(name)
            connector = add(connectors, "ssd:Connector", name=name, kind=kind)
            if variable.kind in TYPED:
                add(connector, f"ssc:{variable.kind}", **_unit(variable))


def _bind(parent: Element, source: str) -> None:
    add(add(parent, "ssd:ParameterBindings"), "ssd:ParameterBinding", source=source)


def _parameter_set(parts: Mapping[str, Part]) -> Element:
    """A set with the parameters of components, each with its prefix."""
    root = element("ssv:ParameterSet", version="1.0", name=PARAMETER_SET)
    parameters = add(root, "ssv:Parameters")
    for prefix, part in parts.items():
        for name, value in part.parameters.items():
            variable = part.variable(name)
            kind = variable.kind if variable.kind in TYPED else "Enumeration" if isinstance(value, str) else "Integer"
            text = value if isinstance(value, str) else repr(value).lower()
            add(add(parameters, "ssv:Parameter", name=prefix + name), f"ssv:{kind}", value=text, **_unit(variable))
    _add_units(root, "ssv:Units", parts.values())
    return root


def _unit(variable: Variable) -> dict[str, str]:
    """The attribute `unit` of a variable, if it has one; only a Real can."""
    return {} if variable.unit is None or variable.kind != "Real" else {"unit": variable.unit}


def _add_units(root: Element, tag: str, parts: Iterable[Part]) -> None:
    """Add the unit definitions of the FMUs that have base units, each once."""
    definitions = (unit for part in parts for unit in part.model.description.unitDefinitions)
    bases = {unit.name: unit.baseUnit for unit in definitions if unit.baseUnit is not None}
    if not bases:
        return
    units = add(root, tag)
    for name in sorted(bases):
        base = {key: getattr(bases[name], key) for key in _BASE}
        unit = add(units, "ssc:Unit", name=name)
        add(unit, "ssc:BaseUnit", **{key: str(value) for key, value in base.items() if value != _BASE[key]})


_BASE = {**dict.fromkeys(BASE, 0), "factor": 1.0, "offset": 0.0}
"""The defaults of a base unit in the standard."""


def rejections(export: Export) -> Iterator[str]:
    """A line for each rejected value and connection, with its place in the system and the masters."""
    parts = {part.name: part for part in export.parts}
    for part in export.parts:
        for name, value in part.parameters.items():
            masters = _masters_without(part, name, value)
            if masters is not None:
                kind, instead = part.variable(name).kind, _integer_instead(part, name, value)
                yield f"components.{part.name}.parameters.{name} = {value}: of type {kind}; {masters}{instead}"
    for x in export.system.connections:
        for start, end in zip(x.start, x.end, strict=True):
            kinds = [
                parts[name].variable(variable_of(port)).kind for name, port in ((x.sender, start), (x.receiver, end))
            ]
            if kinds[0] != kinds[1] or "Enumeration" in kinds:
                yield f"{start} to {end}: from {kinds[0]} to {kinds[1]}; libcosim and ecos refuse the SSP"


def _integer_instead(part: Part, name: str, value: Parameter) -> str:
    """The alternative that all masters accept: the Integer that this project's FMUs have beside an Enumeration."""
    index, choices = f"{name}{INDEX}", part.variable(name).choices
    if index not in part.model.variables or not choices:
        return ""
    return f"; all take {index} = {choices.get(str(value), value)}"


def _masters_without(part: Part, name: str, value: Parameter) -> str | None:
    """The behaviour of masters that reject a value; None if all accept it."""
    kind = part.variable(name).kind
    if kind == "Enumeration" and isinstance(value, str):
        return "libcosim crashes, ecos and fmpy refuse the SSP"
    if kind == "Enumeration":
        return "libcosim and ecos leave it as it starts"
    return "fmpy refuses the SSP" if kind == "String" else None
