"""The view of an FMU that rules check, for either version of FMI: its archive and description."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from xml.etree.ElementTree import Element

from fmpy.model_description import ModelDescription, ModelVariable

from fmu_kit.archive import SOURCE_HASH_FILE
from orchestration.components.fmi.archive import Archive, UnreadableFmuError
from orchestration.components.fmi.read_description import attribute, declared_of, kind_of, read_description, starts_of
from orchestration.components.fmi.slaves import binary_folders
from orchestration.foundation.basics.errors import UsageError

NUMBERS = ("Real", "Integer", "Enumeration")
OUR_TOOL = "quadcosim"
LIBRARIES = (".so", ".dll", ".dylib")
"""suffixes of libraries"""


@dataclass(frozen=True, kw_only=True)
class Fmu:
    """An FMU of FMI 2.0 or 3.0 for co-simulation, or for model exchange or scheduled execution alone."""

    archive: Archive
    root: Element
    """Root element of its model description"""
    description: ModelDescription
    """Model description as fmpy reads it"""

    @property
    def version(self) -> int:
        """Of FMI: 2 or 3."""
        return int(self.description.fmiMajorVersion)

    @property
    def is_ours(self) -> bool:
        """Whether quadcosim built it, so that the rules of this project apply, too."""
        tool, _, _ = (self.description.generationTool or "").partition(" ")
        return tool == OUR_TOOL or SOURCE_HASH_FILE in self.archive.files

    @property
    def interface(self) -> Any:
        """The capabilities of the interface that is checked, by their names in FMI 2.0."""
        return next(iter(declared_of(self.description).values()))

    @property
    def model_identifier(self) -> str:
        """The model identifier of that interface."""
        return str(self.interface.modelIdentifier)

    @property
    def experiment(self) -> dict[str, float]:
        """The attributes of the default experiment."""
        element = self.root.find("DefaultExperiment")
        return {} if element is None else {name: float(value) for name, value in element.items()}

    @property
    def source_files(self) -> list[str]:
        """The files to be compiled, relative to `sources/`."""
        return [
            name
            for built in self.description.buildConfigurations
            if built.modelIdentifier == self.model_identifier
            for files in built.sourceFileSets
            for name in files.sourceFiles
        ]

    @property
    def platforms(self) -> list[str]:
        """Folders with a library, and `c-code` for sources to compile."""
        files = self.archive.files
        is_source = any(name.startswith("sources/") and name.endswith(".c") for name in files)
        return [*(["c-code"] if is_source else []), *binary_folders(name for name in files if name.endswith(LIBRARIES))]

    @cached_property
    def variables(self) -> tuple[ModelVariable, ...]:
        """The variables as declared, an array as one, without further names of them (FMI 3.0)."""
        return tuple(v for v in self.description.modelVariables if v.alias is None)

    @cached_property
    def places(self) -> dict[ModelVariable, int]:
        """The place of each variable in the list, from 0."""
        return {v: place for place, v in enumerate(self.variables)}

    @cached_property
    def states(self) -> frozenset[ModelVariable]:
        """The variables whose derivative is another variable."""
        return frozenset(v.derivative for v in self.variables if v.derivative is not None)


def is_clocked(v: ModelVariable) -> bool:
    """Whether a variable is a clock, or has a value only at ticks of one."""
    return v.type == "Clock" or bool(v.clocks)


def read_fmu(archive: Archive, root: Element) -> Fmu:
    """The view of an archive and its description; raises `UnreadableFmuError` for an invalid one."""
    try:
        fmu = Fmu(archive=archive, root=root, description=read_description(archive.path))
    except UsageError as error:
        raise UnreadableFmuError(str(error).removeprefix(f"{archive.path}: ")) from error
    _expect_numbers(fmu)
    return fmu


def _expect_numbers(fmu: Fmu) -> None:
    """Raise `UnreadableFmuError` for an attribute that rules take for a number or bytes and that is none."""
    for where, key, text in _numbers(fmu):
        try:
            float(text)
        except ValueError:
            raise UnreadableFmuError(f"{where}: {key} = {text}, expected a number") from None
    for v in fmu.variables:
        for start in starts_of(v) if v.type == "Binary" else ():
            try:
                bytes.fromhex(start)
            except ValueError:
                raise UnreadableFmuError(f"{v.name}: start = {start}, expected hexadecimal bytes") from None


def _numbers(fmu: Fmu) -> Iterator[tuple[str, str, str]]:
    for element in fmu.root.iterfind("DefaultExperiment"):
        yield from (("DefaultExperiment", key, text) for key, text in element.items())
    fixed_step = getattr(fmu.interface, "fixedInternalStepSize", None)
    if fixed_step is not None:
        yield "CoSimulation", "fixedInternalStepSize", fixed_step
    for v in fmu.variables:
        if kind_of(v) in NUMBERS:
            declared = ((key, attribute(v, key)) for key in ("min", "max", "nominal"))
            yield from ((v.name, key, text) for key, text in declared if text is not None)
            yield from ((v.name, "start", text) for text in starts_of(v))
