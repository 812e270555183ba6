"""Rules on variables: their names, bounds, units and clocks, and those that share a value reference."""

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from fractions import Fraction

from fmpy.model_description import ModelVariable

from fmu_kit.units import BASE, SYMBOLS, base_unit_exponents
from orchestration.components.checks.validation.fmu import NUMBERS, Fmu
from orchestration.components.fmi.read_description import PERIODIC, attribute, kind_of, starts_of

COHERENT = {symbol: SYMBOLS[symbol] for symbol in ("1", *BASE, "N", "Pa", "J", "W", "V")}
"""Symbols with one meaning only, whoever writes them; `Hz`, with or without a turn, and `C` have two."""
_OF_PERIODS = ("intervalDecimal", "intervalCounter", "resolution", "shiftDecimal", "shiftCounter")
_QUOTED = r"""'(?:[0-9A-Za-z_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_PART = rf"(?:[A-Za-z_][0-9A-Za-z_]*|{_QUOTED})(?:\[[0-9]+(?:,[0-9]+)*\])?"
_IDENTIFIER = rf"{_PART}(?:\.{_PART})*"
_NAMES = {
    "structured": re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\)"),
    "flat": re.compile(r"[^\r\n\t]+"),
}
"""valid names by convention"""


def names(fmu: Fmu) -> Iterator[str]:
    """Names follow the convention that the FMU declares (FMI 2.0.4, section 2.2.9; FMI 3.0, section 2.4.7)."""
    convention = fmu.description.variableNamingConvention
    legal = _NAMES.get(convention, _NAMES["flat"])  # any other one violates the schema
    for v in fmu.description.modelVariables:
        if not legal.fullmatch(v.name):
            yield f"{v.name!r}: expected a name by the convention {convention}"


def bounds(fmu: Fmu) -> Iterator[str]:
    """min, start and max are in this order."""
    for v in fmu.variables:
        if kind_of(v) not in NUMBERS:
            continue
        minimum, maximum = attribute(v, "min"), attribute(v, "max")
        low = -math.inf if minimum is None else float(minimum)
        high = math.inf if maximum is None else float(maximum)
        if not low <= high:
            yield f"{v.name}: min = {minimum} is above max = {maximum}"
        for start in starts_of(v):
            if kind_of(v) == "Real" and not math.isfinite(float(start)):
                yield f"{v.name}: start = {start}, expected a finite value"
            if float(start) < low:
                yield f"{v.name}: start = {start}, expected at least min = {minimum}"
            if float(start) > high:
                yield f"{v.name}: start = {start}, expected at most max = {maximum}"


def arrays(fmu: Fmu) -> Iterator[str]:
    """An array has dimensions above 0 and a start for all of it, or one for each element (FMI 3.0, section 2.4.7)."""
    for v in fmu.variables:
        count, starts = math.prod(v.shape), starts_of(v)
        if len(starts) not in (0, 1, count):
            yield f"{v.name}: it starts with {len(starts)} values, expected {'1' if count == 1 else f'1 or {count}'}"
        if v.shape and v.causality == "structuralParameter":
            yield f"{v.name}: a structural parameter with dimensions, expected a scalar"
        if not all(n > 0 for n in v.shape):
            yield f"{v.name}: dimensions {', '.join(map(str, v.shape))}, expected each above 0"
        for size in (dimension.variable for dimension in v.dimensions if dimension.variable is not None):
            if size.type != "UInt64" or not (size.causality == "structuralParameter" or size.variability == "constant"):
                found = f"a {size.variability} {size.causality} of {size.type}"
                yield f"{v.name}: its dimension is {size.name}, {found}: expected a structural or constant UInt64"


def aliases(fmu: Fmu) -> Iterator[str]:
    """Variables with one value reference are one value under several names (FMI 2.0.4, section 2.2.7).

    FMI 3.0 has its aliases inside of their variable: `structure.indices`.
    """
    if fmu.version > 2:
        return
    sets: dict[tuple[str, int], list[ModelVariable]] = defaultdict(list)
    for v in fmu.variables:
        sets["Integer" if v.type == "Enumeration" else v.type, v.valueReference].append(v)
    for (_, reference), members in sets.items():
        if len(members) > 1:
            names = ", ".join(v.name for v in members)
            for problem in _alias_problems(members):
                yield f"{names}: value reference {reference} for all of them, but {problem}"


def _alias_problems(members: list[ModelVariable]) -> Iterator[str]:
    constants = [v for v in members if v.variability == "constant"]
    if constants:
        if len(constants) < len(members):
            yield "only some are constants"
        elif len({v.start for v in members}) > 1:
            yield "the constants have different starts"
        return
    if sum(v.causality in ("input", "parameter", "independent") for v in members) > 1:
        yield "more than one of them is set from outside"
    elif sum(v.start is not None for v in members) > 1:
        yield "more than one of them has a start"
    units = [attribute(v, "unit") for v in members]
    if len(set(units)) > 1:
        yield f"their units are {', '.join(map(str, units))}"


def clocks(fmu: Fmu) -> Iterator[str]:
    """Constant and fixed clocks have an interval, a positive one; `clocks` names clocks; clocked is discrete."""
    types = {each.get("name"): each.attrib for each in fmu.root.iterfind("TypeDefinitions/ClockType")}
    for element in fmu.root.iterfind("ModelVariables/Clock"):
        declared = {**types.get(element.get("declaredType"), {}), **element.attrib}
        name, kind = declared.get("name"), declared.get("intervalVariability", "")
        given = {key: _number(declared[key]) for key in _OF_PERIODS if key in declared}
        has_interval = "intervalDecimal" in given or {"intervalCounter", "resolution"} <= {*given}
        if kind in ("constant", "fixed") and not has_interval:
            yield f"{name}: a {kind} clock without an interval: expected intervalDecimal, or a counter and a resolution"
        if kind not in PERIODIC and any(key.startswith("interval") for key in given):
            yield f"{name}: a {kind} clock with an interval: expected one of a periodic clock only"
        for key, value in given.items():
            lowest = "from 0 on" if key.startswith("shift") else "above 0"
            if value is None or value < 0 or (value == 0 and lowest == "above 0"):
                yield f"{name}: {key} = {declared[key]}: expected a number {lowest}"
    for v in fmu.variables:
        others = [each.name for each in v.clocks or () if each.type != "Clock"]
        if others:
            yield f"{v.name}: it ticks with {', '.join(others)}, which is no clock"
        if v.clocks and v.variability not in (None, "discrete"):
            yield f"{v.name}: clocked, and {v.variability}: expected discrete"


def _number(text: str) -> Fraction | None:
    try:
        return Fraction(text)
    except (ValueError, ZeroDivisionError):
        return None


def dimensions(name: str) -> dict[str, int] | None:
    """Exponents of the base units of a name made of `COHERENT` symbols; None for any other."""
    try:
        return base_unit_exponents(name, COHERENT)
    except ValueError:
        return None


def unit_meaning(fmu: Fmu) -> Iterator[str]:
    """A unit with a coherent name has the exponents of that name, a factor of 1 and no offset."""
    for unit in fmu.description.unitDefinitions:
        base, expected = unit.baseUnit, dimensions(unit.name)
        if base is None or expected is None:
            continue
        found = {symbol: getattr(base, symbol) for symbol in BASE}
        wrong = [symbol for symbol in BASE if found[symbol] != expected.get(symbol, 0)]
        if wrong == ["rad"] and found["rad"] == 0 and not fmu.is_ours:
            wrong = []  # FMI allows a tool to take the radian for 1
        if wrong:
            yield f"unit {unit.name}: base units {_listed(found)}, expected {_listed(expected)}"
        if (base.factor, base.offset) != (1.0, 0.0):
            yield f"unit {unit.name}: factor = {base.factor:g} and offset = {base.offset:g}, expected 1 and 0"


def _listed(exponents: Mapping[str, int]) -> str:
    return " ".join(f"{symbol}={exponents[symbol]}" for symbol in BASE if exponents.get(symbol)) or "none"


RULES = (names, bounds, arrays, aliases, clocks, unit_meaning)
