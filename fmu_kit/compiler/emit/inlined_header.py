"""The definitions of the headers that code uses, for one lane, each after those that it needs."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from fmu_kit.compiler.runtime import FOLDER

_DOUBLE, _SINGLE = ("lanes.h", "mathematics.h", "integers.h"), ("single.h", "integers.h")
_NAME = re.compile(r"\b(?:[qQ]_\w+|QUADCOSIM_LANES)\b")
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_KNOWN = {"#if QUADCOSIM_LANES == 1": True, "#ifndef QUADCOSIM_LANES": True, "#ifdef QUADCOSIM_LIBM": False}
"""Conditions with known results, for one lane without libm; include guards are handled separately."""
_GUARD = re.compile(r"#(ifndef|define) QUADCOSIM_\w+_H$")
_SHORTHAND = {
    r"^Q_FUNCTION\((\w+)\)$": r"Q_ONE q_real q_\1(q_real x) { return q_own_\1(x); }",
    r"^Q_FUNCTION2\((\w+)\)$": r"Q_ONE q_real q_\1(q_real x, q_real y) { return q_own_\1(x, y); }",
}


@dataclass(frozen=True)
class _Part:
    """A definition, or an #if with all up to its #endif, with the comment before it."""

    text: str
    defines: frozenset[str]
    needs: frozenset[str]


def inlined_header(text: str, *, single: bool = False) -> str:
    """The definitions that the code in `text` uses, in the order of the headers; without the includes of the latter.

    `single`: in single precision, with the functions of libm.
    """
    parts = [part for name in (_SINGLE if single else _DOUBLE) for part in _parts((FOLDER / name).read_text("utf-8"))]
    needed = set(_NAME.findall(_COMMENT.sub("", text)))
    kept: list[_Part] = []
    for part in reversed(parts):
        if part.defines & needed or not part.defines:
            kept.append(part)
            needed |= part.needs
    text = "\n\n".join(part.text for part in reversed(kept)) + "\n"
    return re.sub(r"(?m)^(#define .*|Q_ONE .*\}|typedef .*;)\n\n(?=#define|Q_ONE .*\}|typedef .*;)", r"\1\n", text)


def _parts(header: str) -> list[_Part]:
    lines: list[str] = []
    found: list[_Part] = []
    for line in _one_lane(header.splitlines()):
        if not line.strip() and not _COMMENT.sub("", "\n".join(lines)).strip():
            lines = []  # heading of a section
            continue
        lines.append(line)
        text = "\n".join(lines)
        if _is_whole(text):
            lines = []
            bare = _COMMENT.sub("", text)
            part = _Part(text, frozenset(_defined(bare.strip())), frozenset(_NAME.findall(bare)))
            if "#include <" in bare and found:  # used by the definition before it
                found[-1] = replace(found[-1], text=f"{found[-1].text}\n\n{text}")
            elif not bare.startswith("#include"):
                found.append(part)
    return found


def _defined(text: str) -> list[str]:
    """The names that a part defines."""
    if text.startswith("#"):
        return re.findall(r"#define (\w+)", text)
    return _NAME.findall(text)[-1:] if text.startswith("typedef") else re.findall(r"(q_\w+)\(", text)[:1]


def _one_lane(lines: Iterable[str]) -> list[str]:
    """The lines of a header that remain for one lane without libm."""
    found: list[str] = []
    conditions: list[bool | None] = []
    """Conditions of each #if around a line: whether its lines are included; None: unknown here"""
    for line in lines:
        if line.startswith("#if"):
            conditions.append(True if _GUARD.match(line) else _KNOWN.get(line))
        known = conditions[-1] is not None if conditions else False
        if line.startswith("#else") and known:
            conditions[-1] = not conditions[-1]
        is_directive = line.startswith(("#if", "#else", "#elif", "#endif"))
        if False not in conditions and not (is_directive and known) and not _GUARD.match(line):
            for short, long in _SHORTHAND.items():
                line = re.sub(short, long, line)
            found.append(line)
        if line.startswith("#endif"):
            conditions.pop()
    return found


def _is_whole(text: str) -> bool:
    """Whether a text is a complete definition."""
    bare = _COMMENT.sub("", text).strip()
    if not bare or "/*" in bare or bare.endswith("\\"):
        return False
    if len(re.findall(r"^#if", bare, re.MULTILINE)) != len(re.findall(r"^#endif", bare, re.MULTILINE)):
        return False
    return bare.startswith("#") or (bare.count("{") == bare.count("}") and bare[-1] in ";}")
