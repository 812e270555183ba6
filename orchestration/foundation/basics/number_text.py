"""Numbers with their units, as people read them: with few digits, and a prefix where the unit takes one."""

from collections.abc import Iterable

from orchestration.foundation.basics.unit_algebra import after

DIGITS = 4
"""Significant digits in a sentence"""
EXACT_DIGITS = 9
"""Significant digits of what was set, as of a period"""
PREFIXES = (("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9))
WITH_PREFIX = ("s", "m")
"""Units that take a prefix"""
MAX_NAMED = 3
"""Names, or values, in a sentence; more are counted"""


def quantity(value: float, unit: str | None, digits: int = DIGITS, like: float | None = None) -> str:
    """A value in its unit, as `71.75 ms`; with that many significant digits, and the prefix of a value `like` it."""
    if unit not in WITH_PREFIX:
        return f"{value:.{digits}g}{after(unit)}"
    value = float(f"{value:.{digits}g}")
    of = value if like is None else like
    prefix, size = next((pair for pair in PREFIXES if abs(of) >= pair[1]), PREFIXES[-1 if of else 0])
    return f"{value / size:.{digits}g} {prefix}{unit}"


def time_text(value: float) -> str:
    """A time with a readable unit, exactly as it was set."""
    return quantity(value, "s", EXACT_DIGITS)


def some(texts: Iterable[str], separator: str = ", ") -> str:
    """The first few of some texts, and how many more there are."""
    known = list(texts)
    more = f" and {len(known) - MAX_NAMED} more" if len(known) > MAX_NAMED else ""
    return separator.join(known[:MAX_NAMED]) + more
