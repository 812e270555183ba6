"""A system as one SSP 1.0 file, for other people's tools: FMUs, their connections, their parameters.

The tools differ in what they read of an SSP. libcosim and ecos take parameter sets that are bound to a
component and want the prefixes ssd, ssc, ssv and osp; libcosim has its step from an annotation; fmpy takes
a set as an argument, with the component's name before each parameter's; OMSimulator wants its own annotation.
So every value is written twice, in a set of each component and in one of the system, and the step three times.
`docs/guides/ssp.md` has the call for each tool.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from fmu_kit.archive import write_archive
from fmu_kit.model_description import generation_date
from fmu_kit.versions import generation_tool
from orchestration.basics.errors import UsageError
from orchestration.basics.units import BASE
from orchestration.fmi.model import Kind, Variable
from orchestration.requests.ssp import timing
from orchestration.requests.ssp.document import add, document, element
from orchestration.requests.ssp.export import Export, Part, export_of
from orchestration.requests.ssp.names import PARAMETER_SET, SYSTEM_PARAMETERS
from orchestration.requests.ssp.rejections import rejections
from orchestration.system.model import System
from orchestration.system.request import Request
from orchestration.system.variable_names import variable_of

TYPED: tuple[Kind, ...] = ("Real", "Integer", "Boolean", "String")
"""Types of connectors that need no list of items"""


def write(
    asked: Request,
    path: Path,
    announce: Callable[[str], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> Path:
    """Write a system as an SSP; the same system and FMUs give the same bytes.

    `announce` hears of FMUs that are built for it. `warn` hears, a line each, of what the SSP has no words for: it is
    another system without its file with timing; and of what it says and some masters do not take. Raises `UsageError`
    for different FMUs of one file name.
    """
    given = export_of(asked, announce)
    if warn is not None:
        for line in given.unsupported:
            warn(f"{line.partition('; expected')[0]}; only its file with timing does")
        for line in rejections(given):
            warn(asked.in_own_terms(line))
    files = {source: fmu.read_bytes() for source, fmu in _sources(given.parts).items()}
    for part in given.parts:
        files[_parameter_file(part)] = document(_parameter_set({"": part}))
    files[SYSTEM_PARAMETERS] = document(_parameter_set({f"{part.name}.": part for part in given.parts}))
    about = {"description": asked.description} if asked.description else {}
    files["SystemStructure.ssd"] = document(_structure(given, asked.title or path.stem, about))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_archive(path, files, first="SystemStructure.ssd")
    return path


def write_with_timing(
    asked: Request,
    path: Path,
    announce: Callable[[str], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> tuple[Path, Path]:
    """As `write`, and beside it the file that makes the system of it again."""
    write(asked, path, announce, warn)
    return path, timing.write(asked.as_system(), path)


def _sources(parts: Iterable[Part]) -> dict[str, Path]:
    """FMUs by their place in the archive."""
    found: dict[str, Path] = {}
    for part in parts:
        other = found.setdefault(_source(part), part.fmu)
        if other != part.fmu:
            raise UsageError(f"{other} and {part.fmu}: expected FMUs of different file names")
    return found


def _source(part: Part) -> str:
    return f"resources/{part.fmu.name}"


def _parameter_file(part: Part) -> str:
    return f"resources/{part.name}.ssv"


# -- the documents ----------------------------------------------------------------------------------------


def _structure(given: Export, name: str, about: Mapping[str, str]) -> Element:
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
    for part in given.parts:
        _add_component(elements, part)
    if given.system.connections:
        _add_connections(add(system, "ssd:Connections"), given.system)
    step = repr(float(given.step))
    _annotate_for_omsimulator(system, step)
    _add_units(root, "ssd:Units", given.parts)
    experiment = add(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(float(given.system.stop_time)))
    annotation = add(add(experiment, "ssd:Annotations"), "ssc:Annotation", type="com.opensimulationplatform")
    algorithm = add(annotation, "osp:Algorithm")
    add(algorithm, "osp:FixedStepAlgorithm", baseStepSize=step)
    own = add(add(root, "ssd:Annotations"), "ssc:Annotation", type=timing.ANNOTATION)
    add(own, "quadcosim:Timing").text = timing.as_text(given.system)
    return root


def _add_connections(connections: Element, system: System) -> None:
    """With the conversion that the system states, and no other."""
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
    """The attributes are what its version 3 reads, the child is what version 2 does not start without."""
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
        source=_source(part),
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
    """The parameters of components, each with its prefix."""
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
    """The attribute `unit`, if the variable has one; a Real only can."""
    return {} if variable.unit is None or variable.kind != "Real" else {"unit": variable.unit}


def _add_units(root: Element, tag: str, parts: Iterable[Part]) -> None:
    """The unit definitions of the FMUs that say what the unit is, each once."""
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
"""What a base unit is by the standard where nothing is said."""
