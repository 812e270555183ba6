"""The structure of an SSD without its nested systems: components by path, and the wires between them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.unit_algebra import BaseUnits
from orchestration.simulation.requests.ssp.document import Package, Read, all_of
from orchestration.simulation.requests.ssp.parameters import Value, definitions_in, transformation, values_of
from orchestration.simulation.requests.ssp.timing import ANNOTATION
from orchestration.systems.system.conversion import Conversion

Path_ = tuple[str, ...]
"""The names from the top system, which is (), to an element"""
Node = tuple[Path_, str]
"""A connector of the element at a path"""


@dataclass(frozen=True, kw_only=True)
class Wire:
    """A connection of the document, in the direction of its values."""

    start: Node
    end: Node
    transformation: Conversion
    converts_units: bool

    @property
    def label(self) -> str:
        """The wire as text, for messages."""
        return f"{dotted(self.start)} -> {dotted(self.end)}"


@dataclass(frozen=True, kw_only=True)
class Structure:
    """The content of a document."""

    components: dict[Path_, Path] = field(default_factory=dict)
    """their FMUs"""
    kinds: dict[Node, str] = field(default_factory=dict)
    units: dict[Node, str] = field(default_factory=dict)
    """Units of the connectors that name one"""
    wires: dict[Node, Wire] = field(default_factory=dict)
    """Wires by their end"""
    values: dict[Node, Value] = field(default_factory=dict)
    """Values of parameters and inputs"""
    definitions: dict[str, BaseUnits] = field(default_factory=dict)
    """Definitions of units"""
    stop: float | None = None
    step: float | None = None
    """Step [s], if the document has one"""
    timing: str | None = None
    """the text of this project's annotation"""

    def wires_to(self, node: Node) -> Iterator[Wire]:
        """The wires that lead to a connector, from the last, through the connectors of systems."""
        seen = set()
        while (wire := self.wires.get(node)) is not None and node not in seen:
            seen.add(node)
            yield wire
            node = wire.start


def dotted(node: Node) -> str:
    """The dotted path of a connector."""
    return ".".join((*node[0], node[1]))


def structure_of(root: Read, package: Package) -> Structure:
    """Read the structure of a document; raises `UsageError` for unsupported elements."""
    (system,) = all_of(root, "ssd:System")
    result = Structure(stop=_stop(root), step=_step(root), timing=_timing(root))
    result.definitions.update(definitions_in(root, "ssd:Units/ssc:Unit"))
    _walk(system, (), package, result)
    return result


def _walk(system: Read, path: Path_, package: Package, into: Structure) -> None:
    _connectors(system, path, into)
    elements = {child.get("name"): child for child in all_of(system, "ssd:Elements/*")}
    if len(elements) < len(all_of(system, "ssd:Elements/*")):
        raise UsageError(f"{'.'.join(path) or 'the system'}: has two elements of one name; expected a name for each")
    for name, child in elements.items():
        kind = child.tag.rpartition("}")[2]
        if kind == "System":
            _walk(child, (*path, name), package, into)
        elif kind == "Component":
            _component(child, (*path, name), package, into)
        else:
            raise UsageError(f"{dotted((path, name))}: is a {kind}; only components and systems are read")
    for connection in all_of(system, "ssd:Connections/ssd:Connection"):
        _wire(connection, path, into)
    # After those of its elements: outer bindings override.
    for name, value in values_of(system, package, package.structure):
        into.values[_node_named(name, path, elements)] = value


def _component(component: Read, path: Path_, package: Package, into: Structure) -> None:
    place = ".".join(path)
    kind = component.get("type") or "application/x-fmu-sharedlibrary"
    if kind != "application/x-fmu-sharedlibrary":
        raise UsageError(f"{place}: is of type {kind}; only FMUs are read")
    if component.get("implementation") == "ModelExchange":
        raise UsageError(f"{place}: is for model exchange; only co-simulation is read")
    into.components[path] = fmu = package.file(component.get("source"))
    _connectors(component, path, into)
    for name, value in values_of(component, package, fmu):
        into.values[path, name] = value


def _connectors(element: Read, path: Path_, into: Structure) -> None:
    for connector in all_of(element, "ssd:Connectors/ssd:Connector"):
        node = path, connector.get("name")
        into.kinds[node] = connector.get("kind")
        for unit in (real.get("unit") for real in all_of(connector, "ssc:Real")):
            if unit is not None:
                into.units[node] = unit


def _wire(connection: Read, path: Path_, into: Structure) -> None:
    """Add a wire; its direction follows from the kinds of the connectors, not from which is called the start."""
    ends: list[Node] = []
    for which in ("start", "end"):
        element = connection.get(f"{which}Element")
        node: Node = ((path if element is None else (*path, element)), connection.get(f"{which}Connector"))
        if node not in into.kinds:
            raise UsageError(f"connection to {dotted(node)}: there is no such connector")
        ends.append(node)
    is_output = [into.kinds[node] in (("input", "parameter") if node[0] == path else ("output",)) for node in ends]
    if is_output[0] == is_output[1]:
        kinds = " and ".join(f"{dotted(node)} ({into.kinds[node]})" for node in ends)
        raise UsageError(f"connection of {kinds}: expected an output and an input")
    start, end = (ends[0], ends[1]) if is_output[0] else (ends[1], ends[0])
    if end in into.wires:
        raise UsageError(f"connection to {dotted(end)}: is connected already; expected one connection")
    into.wires[end] = Wire(
        start=start,
        end=end,
        transformation=transformation(connection),
        converts_units=connection.get("suppressUnitConversion", "false") not in ("true", "1"),
    )


def _node_named(name: str, path: Path_, elements: dict[str, Read]) -> Node:
    """The connector of a name in a parameter set of a system: of an element, if it begins with the name of that one."""
    owners = [owner for owner in elements if name.startswith(f"{owner}.")]
    if not owners:
        return path, name
    owner = max(owners, key=len)
    inside = elements[owner]
    rest = name[len(owner) + 1 :]
    if not inside.tag.endswith("}System"):
        return (*path, owner), rest
    return _node_named(rest, (*path, owner), {child.get("name"): child for child in all_of(inside, "ssd:Elements/*")})


def _stop(root: Read) -> float | None:
    for experiment in all_of(root, "ssd:DefaultExperiment"):
        start = float(experiment.get("startTime", 0.0))
        if start != 0.0:
            raise UsageError(f"DefaultExperiment.startTime = {start:g}: expected 0; runs begin there")
        if experiment.get("stopTime") is not None:
            return float(experiment.get("stopTime"))
    return None


def _timing(root: Read) -> str | None:
    for annotation in all_of(root, "ssd:Annotations/ssc:Annotation"):
        if annotation.get("type") == ANNOTATION:
            return "".join(child.text or "" for child in annotation)
    return None


def _step(root: Read) -> float | None:
    """The step in the annotations of other tools; the standard has none."""
    names = {
        "FixedStepAlgorithm": "baseStepSize",
        "FixedStepMaster": "stepSize",
        "SimulationInformation": "fixedStepSize",
    }
    for tag, attribute in names.items():
        for found in root.iter(f"{{*}}{tag}"):
            if found.get(attribute) is not None:
                return float(found.get(attribute))
    return None
