"""Rules on clocks and on what ticks with them (FMI 3.0, section 2.4.7.6)."""

from collections.abc import Iterator
from fractions import Fraction

from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.fmi.read_description import PERIODIC

_OF_PERIODS = ("intervalDecimal", "intervalCounter", "resolution", "shiftDecimal", "shiftCounter")


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


RULES = (clocks,)
