"""Rules on units: their base units correspond to their names."""

from collections.abc import Iterator, Mapping

from fmu_kit.units import BASE, SYMBOLS, base_unit_exponents
from orchestration.components.checks.validation.fmu import Fmu

COHERENT = {symbol: SYMBOLS[symbol] for symbol in ("1", *BASE, "N", "Pa", "J", "W", "V")}
"""Symbols with one meaning only, whoever writes them; `Hz`, with or without a turn, and `C` have two."""


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


RULES = (unit_meaning,)
