"""Rules of this project, beyond the standard, for FMUs that quadcosim built."""

import datetime
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from fmpy.model_description import ModelVariable

from fmu_kit.archive import ICONS, NATIVE_TABLES, content_guid
from fmu_kit.loader import GUID_FILE
from orchestration.components.building.models import MODELS
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.checks.validation.roles import ROLES
from orchestration.components.checks.validation.variables import dimensions
from orchestration.components.fmi.archive import TOKENS
from orchestration.components.fmi.read_description import attribute, kind_of, starts_of
from orchestration.components.fmi.slaves import ENTRY

PAGE = "documentation/index.html"
_PNG = b"\x89PNG\r\n\x1a\n"
_DATE = "%Y-%m-%dT%H:%M:%SZ"
_DIFFERS = {"guid", "generationDateAndTime", "generationTool", "version"}
"""attributes that depend on packaging and date"""

Elements = dict[tuple[str, ...], dict[str, str]]

_PROGRAM = """
import importlib, sys
from xml.etree.ElementTree import tostring

resources, name = sys.argv[1:]
sys.path.insert(0, resources)
module = importlib.import_module(name)
(slave,) = (c for c in vars(module).values() if isinstance(c, type) and c.__module__ == name and hasattr(c, "to_xml"))
text = tostring(slave(instance_name="description", resources=resources).to_xml(), encoding="unicode")
sys.stdout.buffer.write(text.encode("utf-8"))
"""
"""runs with only the standard library and the resources of the FMU, so that no other package is imported"""


def guid_of_content(fmu: Fmu) -> Iterator[str]:
    """The GUID is a hash of the content of all files."""
    expected = content_guid(dict(fmu.archive.files))
    guid = fmu.description.guid
    if guid != expected:
        yield f"{TOKENS[fmu.version]} = {guid}: expected {expected}, that of the content"
    if NATIVE_TABLES in fmu.archive.files:
        return
    known = fmu.archive.files.get(GUID_FILE, b"").decode(errors="replace")
    if known != guid:
        yield f"{GUID_FILE} = {known}: expected {guid}, the guid"


def date(fmu: Fmu) -> Iterator[str]:
    """The date is in UTC, as the text of FMI requires; the schema allows any time."""
    text = fmu.description.generationDateAndTime or "none"
    try:
        sound = datetime.datetime.strptime(text, _DATE).strftime(_DATE) == text
    except ValueError:
        sound = False
    if not sound:
        yield f"generationDateAndTime = {text}: expected the form 2009-12-08T14:33:22Z"


def execution_tool(fmu: Fmu) -> Iterator[str]:
    """No tool is required: some masters refuse such an FMU."""
    if fmu.interface.needsExecutionTool:
        yield "needsExecutionTool = true: expected false"


def value_references(fmu: Fmu) -> Iterator[str]:
    """A value reference is the place in the list: unique, and the same for every build of the same sources."""
    for place, v in enumerate(fmu.variables):
        if v.valueReference != place:
            yield f"{v.name}: valueReference = {v.valueReference}, expected {place}, its place in the list"


def start_text(fmu: Fmu) -> Iterator[str]:
    """A start is the shortest text for its bits, so that two builds cannot differ in it."""
    for v in fmu.variables:
        for start in starts_of(v) if kind_of(v) == "Real" else ():
            if start != repr(float(start)):
                yield f"{v.name}: start = {start}, expected {float(start)!r}, the shortest text for the same bits"


def units(fmu: Fmu) -> Iterator[str]:
    """Every Real has a unit, and every unit a definition by SI base units and a corresponding name.

    That of a state beside the outputs may depend on parameters.
    """
    for_solvers = {v for one in fmu.description.derivatives for v in (one.variable, one.variable.derivative)}
    used = {attribute(v, "unit") for v in fmu.variables}
    for v in fmu.variables:
        has_unit = v.causality == "independent" or attribute(v, "unit") is not None  # that one is in seconds without
        if kind_of(v) == "Real" and not has_unit and v not in for_solvers:
            yield f"{v.name}: expected a unit, found none"
    for unit in fmu.description.unitDefinitions:
        if unit.baseUnit is None:
            yield f"unit {unit.name}: expected its base units, found none"
        if dimensions(unit.name) is None:
            yield f"unit {unit.name}: expected a name made of SI symbols, as N.m.s or m/s3"
        if unit.name not in used:
            yield f"unit {unit.name}: expected a variable that has it, found none"


def documentation(fmu: Fmu) -> Iterator[str]:
    """The FMU has a documentation page, and a model of this project its icon."""
    files = fmu.archive.files
    if not files.get(PAGE, b"").strip():
        yield f"{PAGE}: expected a page, found {'an empty file' if PAGE in files else 'none'}"
    icon = ICONS[fmu.version]
    if fmu.description.modelName in MODELS and not files.get(icon, b"").startswith(_PNG):
        yield f"{icon}: expected an icon in PNG, found {'another file' if icon in files else 'none'}"


def ports(fmu: Fmu) -> Iterator[str]:
    """A controller or plant has all variables to be connected, with the names and units of the wiring."""
    outputs, by_name = {v.name for v in fmu.variables if v.causality == "output"}, {v.name: v for v in fmu.variables}
    role = next((role for role in ROLES if outputs.intersection(role.identified_by)), None)
    if role is None:
        return
    is_complete = not by_name.keys().isdisjoint(role.complete_by)
    for port in (*role.ports, *role.optional):
        expected = _described(port.kind, port.causality, port.unit)
        if port.name not in by_name:
            if port in role.optional and not is_complete:
                continue
            yield f"{port.name}: expected {expected}, found none"
        elif (found := _as_port(by_name[port.name])) != expected:
            yield f"{port.name}: expected {expected}, found {found}"


def _as_port(v: ModelVariable) -> str:
    return _described(kind_of(v), v.causality, attribute(v, "unit"))


def _described(kind: str, causality: str, unit: str | None) -> str:
    return f"{kind} {causality}" + (f" in {unit}" if unit is not None else "")


def own_description(probe: Probe) -> Iterator[str]:
    """The description is the one that the bundled slave generates."""
    fmu = probe.fmu
    if ENTRY not in fmu.archive.files:
        return  # checked by another rule
    name = fmu.archive.files[ENTRY].decode("utf-8", "replace").strip()
    command = [sys.executable, "-I", "-c", _PROGRAM, str(probe.folder / "resources"), name]
    done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines() or [f"exit code {done.returncode}"]
        yield f"the bundled slave does not describe itself: {lines[-1]}"
        return
    try:
        expected = ElementTree.fromstring(done.stdout)
    except ElementTree.ParseError as error:
        yield f"the description by the bundled slave is no XML: {error}"
        return
    yield from differences(elements(fmu.root), elements(expected))


def differences(found: Elements, expected: Elements) -> Iterator[str]:
    """Elements of only one description, and differences of attributes and of the order."""
    for label in {**expected, **found}:
        where = ", ".join(label) or "fmiModelDescription"
        if label not in found:
            if label[:-1] in found:  # else its parent element has been reported
                yield f"{where}: expected it as in the bundled slave, found none"
        elif label not in expected:
            if label[:-1] in expected:
                yield f"{where}: found it, expected none as in the bundled slave"
        else:
            mine, theirs = found[label], expected[label]
            for key in {**theirs, **mine}:
                if mine.get(key) != theirs.get(key):
                    yield f"{where}: {key} = {mine.get(key)}, expected {theirs.get(key)} as in the bundled slave"
    order = [(a, b) for a, b in zip(_of(found, expected), _of(expected, found)) if a != b]
    if order:
        yield f"{', '.join(order[0][0])}: expected {', '.join(order[0][1])} in its place, as in the bundled slave"


def elements(root: Element) -> Elements:
    """The attributes of every element by its path of names, in order; those of a variable with those of its type."""
    found: Elements = {(): {key: value for key, value in root.items() if key not in _DIFFERS}}
    _add_children(root, (), found)
    return found


def _add_children(parent: Element, path: tuple[str, ...], found: Elements) -> None:
    seen: Counter[str] = Counter()
    for child in parent:
        if child.tag == "ScalarVariable":
            path, label = (), child.get("name", "")
            attributes = {**child.attrib, "type": child[0].tag, **child[0].attrib}
        else:
            label = " ".join(filter(None, (child.tag, child.get("name"), child.get("index"))))
            attributes = dict(child.attrib)
        seen[label] += 1
        here = (*path, label if seen[label] == 1 else f"{label} again")
        found[here] = attributes
        if child.tag != "ScalarVariable":
            _add_children(child, here, found)


def _of(elements: Elements, others: Elements) -> list[tuple[str, ...]]:
    return [label for label in elements if label in others]


RULES = (guid_of_content, date, execution_tool, value_references, start_text, units, documentation, ports)
