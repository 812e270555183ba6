"""Values within texts: each is represented by a marker, at which the text is split later."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, TypeAlias

from fmu_kit.compiler.trace.errors import TraceError

if TYPE_CHECKING:
    from fmu_kit.compiler.trace.symbols import Kind, Symbol

OPENING, CLOSING = "\x02", "\x03"
_NAMES: dict[Kind, str] = {"int": "an integer", "real": "a float", "bool": "a truth value"}
_FORMATS: dict[Kind, str] = {"int": " or {value:d}", "real": " or a format as :g, :.3g, :.3f or :.3e", "bool": ""}
_marked: list[tuple[Symbol, str]] = []
_numbers: dict[tuple[int, str], int] = {}

Piece: TypeAlias = "str | tuple[Symbol, str]"
"""A part of a text: words, or a value and its format."""


def marker(symbol: Symbol, spec: str) -> str:
    """The marker of a storable value in a text; raises `TraceError` for a format that the C runtime does not have."""
    known = {"int": r"d?", "real": r"(\.\d+)?g|\.\d+[ef]|", "bool": ""}[symbol.kind]
    if spec != "failure" and not re.fullmatch(known, spec):
        raise TraceError(
            f"{{value:{spec}}} of {_NAMES[symbol.kind]} in a text: expected {{value}}{_FORMATS[symbol.kind]}"
        )
    key = (id(symbol), spec)
    if key not in _numbers:
        _numbers[key] = len(_marked)
        _marked.append((symbol, spec))
    return f"{OPENING}{_numbers[key]}{CLOSING}"


def pieces(text: str) -> list[Piece]:
    """A text split at the values in it."""
    first, *rest = text.split(OPENING)
    found: list[Piece] = [first] if first else []
    for part in rest:
        number, _, words = part.partition(CLOSING)
        found.append(_marked[int(number)])
        if words:
            found.append(words)
    return found
