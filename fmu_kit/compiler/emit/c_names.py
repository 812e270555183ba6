"""Names and literals in C."""

from __future__ import annotations

import re
from collections.abc import Iterable

from fmu_kit.compiler.trace.statements import TANGENT, Place
from fmu_kit.compiler.trace.symbols import Symbol


def place_names(places: Iterable[Place]) -> dict[str, str]:
    """The name in C of each place."""
    found: dict[str, str] = {}
    for place in places:
        kept = f"KEPT_{identifier(place.name.removeprefix('self')).strip('_')}"
        name = (kept if place.reference is None else f"AT_{identifier(place.name)}").upper()
        found[place.name] = unused_name(name, found.values())
    return found


def identifier(name: str) -> str:
    """A name of ASCII letters, digits and underscores."""
    return "".join(c if c.isascii() else f"u{ord(c):04x}" for c in re.sub(r"\W+", "_", name))


def unused_name(name: str, used: Iterable[str]) -> str:
    """A name, with underscores appended if it is already used."""
    taken = set(used)
    while name in taken:
        name += "_"
    return name


def c_name(name: str) -> str:
    """The name of a function of the model in C, with a prefix that avoids conflicts."""
    of = name.removeprefix(TANGENT)
    return f"{'model' if of == name else 'tangents'}_{identifier(of)}"


KEYWORDS = frozenset({
    "auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "float", "goto", "inline", "int",
    "long", "register", "restrict", "short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union",
    "unsigned", "void", "volatile",
    "asm", "bool", "catch", "delete", "explicit", "export", "false", "friend", "mutable", "namespace", "new",
    "operator", "private", "protected", "public", "template", "this", "throw", "true", "typename", "using", "virtual",
    "linux", "unix", "I", "NAN", "INFINITY", "NULL",
})  # fmt: skip
"""Keywords of C and C++ that are not keywords of Python, and names defined by headers and compilers."""


def c_string(text: str) -> str:
    """A text as a string literal of C."""
    escaped = "".join(
        c if 32 <= ord(c) < 127 and c not in '"\\?' else "".join(f"\\{byte:03o}" for byte in c.encode()) for c in text
    )
    return f'"{escaped}"'


def c_type(symbol: Symbol) -> str:
    """The type of a value in C."""
    return {"bool": "q_mask", "wide": "q_wide"}.get(symbol.kind, "q_real")
