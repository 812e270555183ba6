"""A program as C for a microcontroller: its memory is a struct with named fields, its messages are numbers."""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable
from ctypes import c_float
from dataclasses import dataclass, field
from typing import ClassVar

from fmu_kit.compiler.emit.c_code import ERRORS, FunctionWriter
from fmu_kit.compiler.emit.c_names import KEYWORDS, identifier
from fmu_kit.compiler.trace.statements import Block, Statement
from fmu_kit.compiler.trace.tracing import Program
from fmu_kit.variables import Variable

GROUPS = {"input": "in", "output": "out", "parameter": "par", "local": "local", None: "kept"}
"""The part of the struct for variables of a causality; None: for what the model keeps beside them."""
_MAX_FLOAT, _MIN_FLOAT = 3.4028234663852886e38, 1.1754943508222875e-38


@dataclass(kw_only=True)
class MessageTable:
    """The numbers of messages, which replace texts at run time."""

    errors: list[str] = field(default_factory=list)
    """Texts of errors by status, from 1 on"""
    warnings: dict[str, str] = field(default_factory=dict)
    """Texts of warnings by key"""

    def status(self, text: str) -> int:
        """The status of a text."""
        if text not in self.errors:
            self.errors.append(text)
        return 1 + self.errors.index(text)


def fields(program: Program) -> dict[str, str]:
    """The field of the struct for each place, such as `par.mass`; constants have none."""
    found: dict[str, str] = {}
    constants = {v.name for v in program.slave.variables if v.variability == "constant"}
    for place in program.places:
        if place.reference is not None and place.name in constants:
            continue
        group = GROUPS[None if place.reference is None else program.slave.variables[place.reference].causality]
        name = identifier(place.name.removeprefix("self."))
        name = (name.strip("_") or name) if group == "kept" else name
        name = f"_{name}" if name[0].isdigit() else name
        while f"{group}.{name}" in found.values() or keyword.iskeyword(name) or name in KEYWORDS:
            name += "_"
        found[place.name] = f"{group}.{name}"
    return found


def functions(program: Program, messages: MessageTable, *, single: bool) -> str:
    """The functions of a program; their messages are added to `messages`."""
    places = fields(program)
    written = (_StructWriter(function, program, places, messages).text() for function in program.functions)
    text = "\n\n".join(written) + "\n"
    return in_single(text) if single else text


def in_single(text: str) -> str:
    """C with its real numbers in single precision, clamped to its largest and smallest magnitudes."""

    def rounded(found: re.Match[str]) -> str:
        return found[0] if found[0].startswith("/*") else single_number(float(found[0]))

    return re.sub(r"/\*.*?\*/|(?<![\w.])\d+(?:\.\d*(?:e[+-]?\d+)?|e[+-]?\d+)(?!\w)", rounded, text, flags=re.DOTALL)


def single_number(value: float) -> str:
    """The nearest number in single precision, as a literal of C with the fewest digits."""
    size = min(max(abs(value), _MIN_FLOAT), _MAX_FLOAT) if value else 0.0
    nearest = c_float(size).value
    digits = next(text for n in range(1, 10) if c_float(float(text := f"{nearest:.{n}g}")).value == nearest)
    shown = digits if re.search(r"[.e]", digits) else f"{digits}.0"
    return f"{'-' if math.copysign(1.0, value) < 0.0 else ''}{shown}f"


class _StructWriter(FunctionWriter):
    """Writes one function for a microcontroller."""

    always: ClassVar[tuple[str, ...]] = ("m",)
    first: ClassVar[tuple[str, ...]] = ("q_model *m",)

    def __init__(self, function: object, program: Program, places: dict[str, str], messages: MessageTable) -> None:
        super().__init__(function, program, places)  # type: ignore[arg-type]
        self.messages = messages

    def _memory(self) -> list[str]:
        return []

    def _place(self, name: str) -> str:
        return f"m->{self.places[name]}"

    def _warn(self, statement: Statement, rest: Block) -> None:
        key, words = statement.data
        self.messages.warnings[key] = _plain(words)
        self._line(f"m->warnings |= {1 << self.program.warnings.index(key)}u; /* {comment(key)} */")

    def _raise(self, statement: Statement, rest: Block) -> None:
        kind, words = statement.data
        number = 1 + ERRORS.index(kind)
        if ("failure",) in words:  # its status is already set
            self._line(f"return {number};")
            return
        text = _plain(words)
        self._line(f"return q_fail(m, {self.messages.status(text)}, {number}); /* {comment(text)} */")


def _plain(words: Iterable[str | tuple[str]]) -> str:
    """A text without its numbers."""
    return "".join(word if isinstance(word, str) else "..." for word in words)


def comment(text: str) -> str:
    """A text that is valid in a comment of C."""
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())


def describe(variable: Variable) -> str:
    """The description of a variable, with its unit and bounds."""
    unit = f" [{variable.unit}]" if variable.unit else ""
    kind = {"Real": "", "Integer": "an integer; ", "Boolean": "0 or 1; ", "Enumeration": ""}[variable.type]
    _, _, bounds = variable.bounds.rpartition("a finite value")
    bounds = bounds.removeprefix("a whole number").strip()
    return comment(f"{variable.name}{unit}: {kind}{variable.description}{bounds and '; '}{bounds}")
