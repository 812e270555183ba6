"""The one view of an FMU that the rules look at: what its description says, not yet judged."""

from dataclasses import dataclass
from typing import NoReturn
from xml.etree.ElementTree import Element

from fmu_kit.packaging import SOURCE_HASH_FILE
from orchestration.fmi.archive import DESCRIPTION, Archive, OtherVersionError, UnreadableFmuError, read_root, version_of

TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
NUMBERS = ("Real", "Integer", "Enumeration")
OUR_TOOL = "quadcosim"

_INITIAL = {"parameter": "exact", "calculatedParameter": "calculated", "independent": None, "input": None}
"""What `initial` is when it is not written; constants aside, outputs and locals are calculated."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Variable:
    """A scalar variable with its defaults filled in, numbers still as they are written."""

    index: int
    """Its place in the list, from 1"""
    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str | None
    start: str | None
    unit: str | None
    minimum: str | None
    maximum: str | None
    nominal: str | None
    items: tuple[int, ...]
    """Values that an Enumeration may take"""
    derivative_of: int | None
    """Index of the state that it is the derivative of"""

    @property
    def start_value(self) -> float | int | bool | str:
        """The start in its type; zero, false or an empty text if there is none."""
        if self.type == "Real":
            return float(self.start or 0.0)
        if self.type == "Boolean":
            return self.start in ("true", "1")
        return self.start or "" if self.type == "String" else int(self.start or 0)

    @property
    def keeps_start(self) -> bool:
        """Whether it is at its start after initialisation, unless it is set: no event of the model can change it."""
        given = self.causality in ("input", "parameter") or self.variability == "constant"
        return given and self.start is not None


@dataclass(frozen=True, kw_only=True, slots=True)
class Unknown:
    """An entry of the model structure."""

    index: int
    dependencies: tuple[int, ...] | None
    """Indices; None: it may depend on all there is"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Fmu:
    """An FMU for co-simulation by FMI 2.0."""

    archive: Archive
    root: Element
    variables: tuple[Variable, ...]
    outputs: tuple[Unknown, ...]
    derivatives: tuple[Unknown, ...]
    initial_unknowns: tuple[Unknown, ...]

    @property
    def is_ours(self) -> bool:
        """Whether quadcosim built it, so that the rules of this project are meant for it too."""
        tool, _, _ = self.root.get("generationTool", "").partition(" ")
        return tool == OUR_TOOL or SOURCE_HASH_FILE in self.archive.files

    @property
    def guid(self) -> str:
        """As it is written."""
        return self.root.get("guid", "")

    @property
    def model_identifier(self) -> str:
        """Of the co-simulation part."""
        return self._co_simulation.get("modelIdentifier", "")

    @property
    def experiment(self) -> dict[str, float]:
        """What the default experiment says."""
        element = self.root.find("DefaultExperiment")
        return {} if element is None else {name: float(value) for name, value in element.items()}

    def can(self, capability: str) -> bool:
        """A capability flag of the co-simulation part."""
        return self._co_simulation.get(capability) in ("true", "1")

    def of_causality(self, *causalities: str) -> tuple[Variable, ...]:
        """The variables of these causalities."""
        return tuple(v for v in self.variables if v.causality in causalities)

    def variable(self, index: int) -> Variable | None:
        """By its index; None if there is none."""
        return self.variables[index - 1] if 1 <= index <= len(self.variables) else None

    @property
    def _co_simulation(self) -> Element:
        element = self.root.find("CoSimulation")
        assert element is not None  # of an Fmu that was read
        return element


def read_co_simulation(archive: Archive) -> Element:
    """The description of an FMU; raises `UnreadableFmuError` if it is not of FMI 2.0 for co-simulation."""
    root = read_root(archive)
    if version_of(root) != 2:
        raise OtherVersionError(
            "fmiVersion = 3.0: expected 2.0; an FMU of FMI 3.0 is not checked here; "
            "fmpy validate checks its description"
        )
    if root.find("CoSimulation") is None:
        raise UnreadableFmuError(f"{DESCRIPTION}: expected a CoSimulation element, nothing else was checked")
    return root


def read_fmu(archive: Archive, root: Element) -> Fmu:
    """The view of an archive and its description; raises `UnreadableFmuError` for a number that is none."""
    types = {element.get("name"): element[0] for element in root.iterfind("TypeDefinitions/SimpleType") if len(element)}
    structure = {
        name: tuple(_unknown(e) for e in root.iterfind(f"ModelStructure/{name}/Unknown"))
        for name in ("Outputs", "Derivatives", "InitialUnknowns")
    }
    fmu = Fmu(
        archive=archive,
        root=root,
        variables=tuple(
            _variable(index, element, types)
            for index, element in enumerate(root.iterfind("ModelVariables/ScalarVariable"), start=1)
        ),
        outputs=structure["Outputs"],
        derivatives=structure["Derivatives"],
        initial_unknowns=structure["InitialUnknowns"],
    )
    _require_numbers(fmu)
    return fmu


def _variable(index: int, element: Element, types: dict[str | None, Element]) -> Variable:
    name = element.get("name", f"variable {index}")
    typed = next((child for child in element if child.tag in TYPES), None)
    if typed is None:
        _refuse(f"{name}: expected an element {', '.join(TYPES[:-1])} or {TYPES[-1]}")
    declared = types.get(typed.get("declaredType"))

    def attribute(key: str) -> str | None:
        return typed.get(key, None if declared is None else declared.get(key))

    causality, variability = element.get("causality", "local"), element.get("variability", "continuous")
    derivative = typed.get("derivative")
    return Variable(
        index=index,
        name=name,
        reference=_whole(element.get("valueReference"), f"{name}: valueReference"),
        type=typed.tag,
        causality=causality,
        variability=variability,
        initial=element.get("initial", _initial(causality, variability)),
        start=typed.get("start"),
        unit=attribute("unit"),
        minimum=attribute("min"),
        maximum=attribute("max"),
        nominal=attribute("nominal"),
        items=tuple(
            _whole(e.get("value"), f"{name}: Item") for e in (() if declared is None else declared.iter("Item"))
        ),
        derivative_of=None if derivative is None else _whole(derivative, f"{name}: derivative"),
    )


def _initial(causality: str, variability: str) -> str | None:
    return "exact" if variability == "constant" else _INITIAL.get(causality, "calculated")


def _unknown(element: Element) -> Unknown:
    listed = element.get("dependencies")
    index = _whole(element.get("index"), "ModelStructure: index")
    indices = None if listed is None else tuple(_whole(t, f"Unknown {index}: dependencies") for t in listed.split())
    return Unknown(index=index, dependencies=indices)


def _require_numbers(fmu: Fmu) -> None:
    """What the rules take for numbers are some."""
    numbers = [
        ("DefaultExperiment", key, text) for e in fmu.root.iterfind("DefaultExperiment") for key, text in e.items()
    ]
    numbers += [("BaseUnit", key, text) for e in fmu.root.iter("BaseUnit") for key, text in e.items()]
    for v in fmu.variables:
        if v.type in NUMBERS:
            found = {"start": v.start, "min": v.minimum, "max": v.maximum, "nominal": v.nominal}
            numbers += [(v.name, key, text) for key, text in found.items() if text is not None]
    for where, key, text in numbers:
        try:
            float(text)
        except ValueError:
            _refuse(f"{where}: {key} = {text}, expected a number")


def _whole(text: str | None, what: str) -> int:
    try:
        return int(text or "")
    except ValueError:
        _refuse(f"{what} = {text}, expected a whole number")


def _refuse(text: str) -> NoReturn:
    raise UnreadableFmuError(text)
