"""The view of an FMU that rules check, for either version of FMI: its archive and description."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from xml.etree.ElementTree import Element

from fmu_kit.archive import SOURCE_HASH_FILE
from orchestration.components.checks.validation.declared import Unknown, Variable
from orchestration.components.checks.validation.standards import Standard
from orchestration.components.fmi.archive import Archive

OUR_TOOL = "quadcosim"
LIBRARIES = (".so", ".dll", ".dylib")
"""suffixes of libraries"""


@dataclass(frozen=True, kw_only=True)
class Fmu:
    """An FMU for co-simulation by FMI 2.0 or 3.0."""

    standard: Standard
    archive: Archive
    root: Element
    variables: tuple[Variable, ...]
    """as declared: an array is one"""
    outputs: tuple[Unknown, ...]
    derivatives: tuple[Unknown, ...]
    initial_unknowns: tuple[Unknown, ...]
    further_lists: Mapping[str, tuple[Unknown, ...]]
    build: Element | None = None
    """how it is compiled, which FMI 3.0 has in a separate file"""

    @property
    def version(self) -> int:
        """Of FMI: 2 or 3."""
        return self.standard.version

    @property
    def is_ours(self) -> bool:
        """Whether quadcosim built it, so that the rules of this project apply, too."""
        tool, _, _ = self.root.get("generationTool", "").partition(" ")
        return tool == OUR_TOOL or SOURCE_HASH_FILE in self.archive.files

    @property
    def guid(self) -> str:
        """The GUID; in FMI 3.0 the instantiation token."""
        return self.root.get(self.standard.token, "")

    @property
    def model_identifier(self) -> str:
        """The model identifier for co-simulation."""
        return self._co_simulation.get("modelIdentifier", "")

    @property
    def experiment(self) -> dict[str, float]:
        """The attributes of the default experiment."""
        element = self.root.find("DefaultExperiment")
        return {} if element is None else {name: float(value) for name, value in element.items()}

    @property
    def fixed_step(self) -> float | None:
        """Its fixed internal step size [s], if declared (FMI 3.0)."""
        text = self._co_simulation.get("fixedInternalStepSize")
        return None if text is None else float(text)

    def can(self, capability: str) -> bool:
        """A capability flag for co-simulation."""
        return self._co_simulation.get(capability) in ("true", "1")

    @property
    def saves(self) -> bool:
        """Whether its state can be saved and restored."""
        return self.can(self.standard.saves)

    @property
    def serialises(self) -> bool:
        """Whether its state can be serialised."""
        return self.can(self.standard.serialises)

    @property
    def source_files(self) -> list[str]:
        """The files to be compiled, relative to `sources/`."""
        if self.version == 2:
            return [e.get("name", "") for e in self._co_simulation.iterfind("SourceFiles/File")]
        return [
            e.get("name", "")
            for built in ([] if self.build is None else self.build.iterfind("BuildConfiguration"))
            if built.get("modelIdentifier") == self.model_identifier
            for e in built.iterfind("SourceFileSet/SourceFile")
        ]

    @property
    def platforms(self) -> list[str]:
        """Folders with a library, and `c-code` for sources to compile."""
        parts = [name.split("/") for name in self.archive.files if name.endswith((*LIBRARIES, ".c"))]
        found = {part[1] for part in parts if part[0] == "binaries" and len(part) > 2 and part[-1][-2:] != ".c"}
        return [*(["c-code"] if any(part[0] == "sources" for part in parts) else []), *sorted(found)]

    @property
    def lists(self) -> Iterator[tuple[str, tuple[Unknown, ...]]]:
        """The lists of the model structure, by their names."""
        called = self.standard.lists
        yield called.outputs[0], self.outputs
        yield called.derivatives[0], self.derivatives
        yield called.initial_unknowns[0], self.initial_unknowns
        yield from self.further_lists.items()

    def of_causality(self, *causalities: str) -> tuple[Variable, ...]:
        """The variables of these causalities."""
        return tuple(v for v in self.variables if v.causality in causalities)

    def variable(self, handle: int) -> Variable | None:
        """The variable of a handle; None if there is none."""
        return self._by_handle.get(handle)

    @cached_property
    def elements(self) -> tuple[Variable, ...]:
        """All that has a value at any time: scalars and the elements of arrays, without clocked ones."""
        return tuple(element for v in self.variables if not v.is_clocked for element in v.elements)

    @cached_property
    def elements_by_name(self) -> dict[str, Variable]:
        """`elements` by their names."""
        return {v.name: v for v in self.elements}

    @cached_property
    def lengths(self) -> dict[str, int]:
        """The number of values of each variable, by its name."""
        return {v.name: len(v.elements) for v in self.variables}

    @cached_property
    def _by_handle(self) -> dict[int, Variable]:
        return {v.handle: v for v in self.variables}

    @property
    def _co_simulation(self) -> Element:
        element = self.root.find("CoSimulation")
        assert element is not None  # of an Fmu that was read
        return element
