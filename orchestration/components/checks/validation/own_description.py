"""Rule of this project: the description is the one that the bundled slave itself generates.

The slave is what runs, so its own `to_xml()` describes the FMU: a description that differs, if only by two swapped
value references, describes another one.
"""

import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestration.components.checks.validation.probe import Probe
from orchestration.components.fmi.slaves import ENTRY

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
