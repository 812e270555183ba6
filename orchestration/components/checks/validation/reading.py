"""Reads the archive and the XML of an FMU into the view that rules check."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NoReturn
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestration.components.checks.validation.declared import NUMBERS, Unknown, Variable
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.checks.validation.standards import STANDARDS, Standard
from orchestration.components.fmi.archive import DESCRIPTION, Archive, UnreadableFmuError, read_root, version_of

BUILD_DESCRIPTION = "sources/buildDescription.xml"
_INITIAL = {
    "parameter": "exact",
    "structuralParameter": "exact",
    "calculatedParameter": "calculated",
    "independent": None,
    "input": None,
}
"""default of `initial`; constants aside, outputs and locals are calculated"""
_PARAMETERS = ("parameter", "structuralParameter", "calculatedParameter")


def read_co_simulation(archive: Archive) -> Element:
    """The description of an FMU; raises `UnreadableFmuError` if it is of another FMI, or not for co-simulation."""
    root = read_root(archive)
    if root.find("CoSimulation") is None:
        raise UnreadableFmuError(f"{DESCRIPTION}: expected a CoSimulation element, nothing else was checked")
    return root


def read_fmu(archive: Archive, root: Element) -> Fmu:
    """The view of an archive and its description; raises `UnreadableFmuError` for an invalid number."""
    standard = STANDARDS[version_of(root)]
    read_variables = _variables_2 if standard.version == 2 else _variables_3
    lists = standard.lists
    fmu = Fmu(
        standard=standard,
        archive=archive,
        root=root,
        variables=tuple(read_variables(root)),
        outputs=_unknowns(root, standard, lists.outputs),
        derivatives=_unknowns(root, standard, lists.derivatives),
        initial_unknowns=_unknowns(root, standard, lists.initial_unknowns),
        further_lists={each[0]: _unknowns(root, standard, each) for each in lists.others},
        build=_build(archive) if standard.version > 2 else None,
    )
    _require_numbers(fmu)
    return fmu


def _build(archive: Archive) -> Element | None:
    if BUILD_DESCRIPTION not in archive.files:
        return None
    try:
        return ElementTree.fromstring(archive.files[BUILD_DESCRIPTION])
    except ElementTree.ParseError as error:
        _refuse(f"{BUILD_DESCRIPTION}: expected well-formed XML: {error}")


# -- variables ----------------------------------------------------------------------------------------------


def _variables_2(root: Element) -> Iterable[Variable]:
    """The variables of FMI 2.0: an element for the variable, and in it one for its type."""
    types = {element.get("name"): element[0] for element in root.iterfind("TypeDefinitions/SimpleType") if len(element)}
    for place, element in enumerate(root.iterfind("ModelVariables/ScalarVariable"), start=1):
        name = element.get("name", f"variable {place}")
        typed = next((child for child in element if child.tag in STANDARDS[2].types), None)
        if typed is None:
            *others, last = STANDARDS[2].types
            _refuse(f"{name}: expected an element {', '.join(others)} or {last}")
        yield _variable(STANDARDS[2], place, name, element, typed, types.get(typed.get("declaredType")))


def _variables_3(root: Element) -> Iterable[Variable]:
    """The variables of FMI 3.0: the element is named after the type."""
    types = {element.get("name"): element for element in root.iterfind("TypeDefinitions/*")}
    listed = [element for element in root.iterfind("ModelVariables/*") if element.tag in STANDARDS[3].types]
    sizes = {element.get("valueReference"): element.get("start") for element in listed}
    for place, element in enumerate(listed, start=1):
        name = element.get("name", f"variable {place}")
        found = _variable(STANDARDS[3], place, name, element, element, types.get(element.get("declaredType")))
        yield _with_shape(found, element, sizes) if element.find("Dimension") is not None else found


def _variable(
    standard: Standard, place: int, name: str, element: Element, typed: Element, declared: Element | None
) -> Variable:
    def attribute(key: str) -> str | None:
        return typed.get(key, None if declared is None else declared.get(key))

    kind = standard.types[typed.tag]
    causality = element.get("causality", "local")
    variability = element.get("variability", _variability(standard, causality, kind))
    reference = _whole_number(element.get("valueReference"), f"{name}: valueReference")
    derivative = typed.get("derivative")
    return Variable(
        place=place,
        handle=place if standard.version == 2 else reference,
        name=name,
        further_names=tuple(alias.get("name", "") for alias in element.iterfind("Alias")),
        reference=reference,
        type=typed.tag,
        kind=kind,
        causality=causality,
        variability=variability,
        initial=element.get("initial", None if kind == "Clock" else _initial(causality, variability)),
        starts=_starts(typed, kind),
        unit=attribute("unit"),
        minimum=attribute("min"),
        maximum=attribute("max"),
        nominal=attribute("nominal"),
        items=tuple(
            _whole_number(e.get("value"), f"{name}: Item") for e in (() if declared is None else declared.iter("Item"))
        ),
        derivative_of=None if derivative is None else _whole_number(derivative, f"{name}: derivative"),
        others={key: _whole_numbers(element.get(key, ""), f"{name}: {key}") for key in ("clocks", "previous")},
        whole=name,
    )


def _variability(standard: Standard, causality: str, kind: str) -> str:
    if standard.version == 2:
        return "continuous"
    if causality in _PARAMETERS:
        return "fixed"
    return "continuous" if kind == "Real" else "discrete"


def _initial(causality: str, variability: str) -> str | None:
    return "exact" if variability == "constant" else _INITIAL.get(causality, "calculated")


def _starts(typed: Element, kind: str) -> tuple[str, ...]:
    """A text or bytes are separate elements in FMI 3.0; an array of numbers has several in one text."""
    own = tuple(each.get("value", "") for each in typed.iterfind("Start"))
    text = typed.get("start")
    if text is None or own:
        return own
    return (text,) if kind == "String" else tuple(text.split()) or ("",)


def _with_shape(found: Variable, element: Element, sizes: dict[str | None, str | None]) -> Variable:
    """An array, each dimension a number or the start value of another variable."""
    what = f"{found.name}: Dimension"
    dimensions = list(element.iterfind("Dimension"))
    named = [each.get("valueReference") for each in dimensions]
    shape = [
        _whole_number(each.get("start"), what) if each.get("valueReference") is None else _size(sizes, each)
        for each in dimensions
    ]
    others = {**found.others, "dimension": tuple(_whole_number(each, what) for each in named if each is not None)}
    return replace(found, shape=tuple(shape), others=others)


def _size(sizes: dict[str | None, str | None], dimension: Element) -> int:
    """The start value of the named variable; a rule checks that it is a whole number."""
    try:
        return int(float(sizes.get(dimension.get("valueReference")) or 0))
    except ValueError:
        return 0


# -- the model structure ------------------------------------------------------------------------------------


def _unknowns(root: Element, standard: Standard, called: tuple[str, str]) -> tuple[Unknown, ...]:
    return tuple(_unknown(e, standard.handle) for e in root.iterfind(f"ModelStructure/{called[1]}"))


def _unknown(element: Element, key: str) -> Unknown:
    handle = _whole_number(element.get(key), f"ModelStructure: {key}")
    listed = element.get("dependencies")
    what = f"Unknown {handle}: dependencies"
    return Unknown(handle=handle, dependencies=None if listed is None else _whole_numbers(listed, what))


# -- numbers ------------------------------------------------------------------------------------------------


def _require_numbers(fmu: Fmu) -> None:
    """Raise `UnreadableFmuError` for an attribute that rules take for a number and that is none."""
    numbers = [
        ("DefaultExperiment", key, text) for e in fmu.root.iterfind("DefaultExperiment") for key, text in e.items()
    ]
    numbers += [("CoSimulation", key, text) for key, text in _fixed_steps(fmu.root)]
    numbers += [("BaseUnit", key, text) for e in fmu.root.iter("BaseUnit") for key, text in e.items()]
    for v in fmu.variables:
        if v.kind in NUMBERS:
            found = [("min", v.minimum), ("max", v.maximum), ("nominal", v.nominal)]
            found += [("start", start) for start in v.starts]
            numbers += [(v.name, key, text) for key, text in found if text is not None]
        if v.kind == "Binary":
            for start in v.starts:
                _number(bytes.fromhex, start, f"{v.name}: start = {start}, expected hexadecimal bytes")
    for where, key, text in numbers:
        _number(float, text, f"{where}: {key} = {text}, expected a number")


def _fixed_steps(root: Element) -> list[tuple[str, str]]:
    key = "fixedInternalStepSize"
    return [(key, text) for e in root.iterfind("CoSimulation") if (text := e.get(key)) is not None]


def _number(read: Callable[[str], object], text: str, refusal: str) -> None:
    try:
        read(text)
    except ValueError:
        _refuse(refusal)


def _whole_numbers(text: str, what: str) -> tuple[int, ...]:
    return tuple(_whole_number(each, what) for each in text.split())


def _whole_number(text: str | None, what: str) -> int:
    try:
        return int(text or "")
    except ValueError:
        _refuse(f"{what} = {text}, expected a whole number")


def _refuse(text: str) -> NoReturn:
    raise UnreadableFmuError(text)
