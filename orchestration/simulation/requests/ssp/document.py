"""The files of an SSP, whose archive is unpacked once, and their XML: written, and read with validation."""

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element, indent, register_namespace, tostring

from fmpy.ssp import ssd
from lxml import etree

from fmu_kit.new_files import new_files
from orchestration.components.fmi.archive import expect_honest_size
from orchestration.components.fmi.trust import content_hash
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


STRUCTURE = "SystemStructure.ssd"


@dataclass(frozen=True, kw_only=True)
class Package:
    """The files of an SSP."""

    structure: Path
    """its .ssd"""

    def file(self, source: str, base: Path | None = None) -> Path:
        """The file of a source in a document, relative to the .ssd or to `base`; raises `UsageError`."""
        parts = urlsplit(source)
        path = ((base or self.structure).parent / unquote(parts.path)).resolve()
        is_inside = path.is_relative_to(self.structure.parent.resolve())
        if parts.scheme not in ("", "file") or parts.netloc or not is_inside:
            raise UsageError(f"source {source}: expected a file of the SSP")
        if not path.is_file():
            raise UsageError(f"source {source}: there is no such file in the SSP")
        return path

    def resource(self, file: str) -> str | None:
        """The path of a file that the timing of the SSP has in its resources; None: it is another file."""
        path = self.structure.parent / file
        return str(path) if Path(file).parts[:1] == ("resources",) and path.is_file() else None


def open_package(path: Path) -> Package:
    """The SSP of an .ssp or .ssd file; raises `UsageError` for anything else."""
    if path.suffix.lower() == ".ssd":
        return Package(structure=path)
    with readable(path, "SSP archive"):
        folder = _cache() / content_hash(path)[:20]
    if not folder.is_dir():
        _unpack(path, folder)
    if not (folder / STRUCTURE).is_file():
        raise UsageError(f"{path}: expected an SSP archive: it has no {STRUCTURE}")
    return Package(structure=folder / STRUCTURE)


def _cache() -> Path:
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "ssp"


def _unpack(path: Path, folder: Path) -> None:
    """Unpack all files or none; zipfile cuts names that lead out of the folder."""
    if not zipfile.is_zipfile(path):
        raise UsageError(f"{path}: expected an SSP archive, which is a zip file")
    try:
        expect_honest_size(path)
        with new_files(folder.parent) as new, zipfile.ZipFile(path) as archive:
            archive.extractall(new / folder.name)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as error:
        raise UsageError(f"{path}: expected an SSP archive: {error}") from error
    except OSError:
        if not folder.is_dir():  # else another process was first
            raise
