"""The XML documents of SSP: written, and read with validation by their schemas."""

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, indent, register_namespace, tostring

from fmpy.ssp import ssd
from lxml import etree

from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes.resource_limits import DOCUMENT

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "quadcosim": "urn:quadcosim:timing",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
SCHEMAS = {
    "ssd": "SystemStructureDescription.xsd",
    "ssv": "SystemStructureParameterValues.xsd",
    "ssm": "SystemStructureParameterMapping.xsd",
}
"""The schemas in fmpy, by the prefix of the root"""

Read = Any
"""An element of lxml, which has no types"""


def element(tag: str, **attributes: str) -> Element:
    """A new element; `tag` with its prefix."""
    prefix, _, name = tag.partition(":")
    return Element(f"{{{NAMESPACES[prefix]}}}{name}", attributes)


def add(parent: Element, tag: str, **attributes: str) -> Element:
    """A new child."""
    child = element(tag, **attributes)
    parent.append(child)
    return child


def document(root: Element) -> bytes:
    """The text of a document, with the prefixes that libcosim and ecos require."""
    for prefix, uri in NAMESPACES.items():
        register_namespace(prefix, uri)
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def read(path: Path, kind: str) -> Read:
    """The root of a document that is valid by the schema of its `kind`, ssd, ssv or ssm; raises `UsageError`."""
    what = f"{kind.upper()} document of SSP 1.0"
    with readable(path, what), path.open("rb") as file:
        text = file.read(DOCUMENT.bytes + 1)
    if len(text) > DOCUMENT.bytes:
        raise UsageError(f"{path}: expected a readable {what}: it has more than {DOCUMENT}")
    try:
        root = etree.fromstring(text, etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False))
    except etree.XMLSyntaxError as error:
        raise UsageError(f"{path}: expected a readable {what}: {error.msg}") from error
    try:
        ssd.validate_tree(root, SCHEMAS[kind])
    except Exception as error:  # which lists all errors, one per line
        first = str(error).splitlines()[1:2] or [str(error)]
        for uri in NAMESPACES.values():
            first[0] = first[0].replace(f"{{{uri}}}", "")
        raise UsageError(f"{path}: expected a valid {what}: {first[0]}") from error
    return root


def all_of(parent: Read, path: str) -> list[Read]:
    """Descendants by a path of prefixed tags."""
    return list(parent.findall(path, namespaces=NAMESPACES))
