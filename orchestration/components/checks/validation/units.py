"""Rules on units: their base units correspond to their names."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element

from orchestration.components.checks.validation.fmu import Fmu

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_SYMBOLS: dict[str, dict[str, int]] = {
    "1": {},
    **{symbol: {symbol: 1} for symbol in BASE},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}
"""Coherent symbols with one meaning only; `Hz`, with or without a turn, and `C` have two"""


def dimensions(name: str) -> Counter[str] | None:
    """Exponents of the base units, read from the name: `N.m.s`, `m/s3`, `J/(kg.K)`; None if it cannot be read."""
    above, _, below = name.partition("/")
    total: Counter[str] = Counter()
    for sign, part in ((1, above), (-1, re.sub(r"^\((.*)\)$", r"\1", below) or "1")):
        for factor in part.split("."):
            match = re.fullmatch(r"([A-Za-z]+|1)(-?\d+)?", factor)
            if match is None or match[1] not in _SYMBOLS:
                return None
            for base, exponent in _SYMBOLS[match[1]].items():
                total[base] += sign * exponent * int(match[2] or 1)
    return total


def base_units(fmu: Fmu) -> dict[str, Element | None]:
    """The definition of each unit by base units; None for one without."""
    return {e.get("name", ""): e.find("BaseUnit") for e in fmu.root.iterfind("UnitDefinitions/Unit")}


def unit_meaning(fmu: Fmu) -> Iterator[str]:
    """A unit with a coherent name has the exponents of that name, a factor of 1 and no offset."""
    for name, base in base_units(fmu).items():
        expected = dimensions(name)
        if base is None or expected is None:
            continue
        found = {symbol: int(base.get(symbol, "0")) for symbol in BASE}
        wrong = [symbol for symbol in BASE if found[symbol] != expected[symbol]]
        if wrong == ["rad"] and found["rad"] == 0 and not fmu.is_ours:
            wrong = []  # FMI allows a tool to take the radian for 1
        if wrong:
            yield f"unit {name}: base units {_listed(found)}, expected {_listed(expected)}"
        factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
        if (factor, offset) != (1.0, 0.0):
            yield f"unit {name}: factor = {factor:g} and offset = {offset:g}, expected 1 and 0"


def _listed(exponents: Mapping[str, int]) -> str:
    return " ".join(f"{symbol}={exponents[symbol]}" for symbol in BASE if exponents[symbol]) or "none"


RULES = (unit_meaning,)
