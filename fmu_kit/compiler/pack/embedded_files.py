"""A slave as two files in C for a microcontroller: Model.h and Model.c.

Writing them imports the slave, so it runs in a separate process: `python -m fmu_kit.compiler.pack.embedded_files`.
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from string import Template

from fmu_kit import packaging
from fmu_kit.bundle import PackagingError, Target
from fmu_kit.compiler.emit.c_names import c_name, c_string
from fmu_kit.compiler.emit.embedded_functions import (
    GROUPS,
    MessageTable,
    comment,
    describe,
    fields,
    functions,
    single_number,
)
from fmu_kit.compiler.emit.tables import start_of
from fmu_kit.compiler.pack.building import modules_of
from fmu_kit.compiler.passes.precomputing import precompute
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.memory import attribute_name
from fmu_kit.compiler.trace.tracing import Program, trace
from fmu_kit.new_files import new_files, write_atomically
from fmu_kit.packaging import slave_class
from fmu_kit.versions import generation_tool, version_of

_TITLES = {
    "in": "Inputs: set them before each step.",
    "out": "Outputs.",
    "par": "Parameters: set them between init and start.",
    "local": "Internal values of the model, to be read.",
    "kept": "The state of the model between calls: not to be changed.",
}
_MEMCPY = """#include <float.h>
#include <stdint.h>
#if defined(__GNUC__)
#define memcpy __builtin_memcpy /* of eight bytes: a move, also under -ffreestanding */
#else
#include <string.h>
#endif
"""
_INCLUDES = {False: _MEMCPY, True: "#include <float.h>\n#include <math.h>\n#include <stdint.h>\n"}
_PRECISION = {
    False: "In double precision, without libm.",
    True: "In single precision, with libm: times are\n   floats too, so let a timer be the clock, not the model.",
}


def write(target: Target, folder: Path, *, single: bool = False) -> Path:
    """Write Model.h and Model.c into `folder`; returns the path of the latter. Raises `PackagingError`.

    `single`: in single precision, with the functions of libm; otherwise in double precision, with its own functions.
    """
    slave = slave_class(target)
    try:
        program = precompute(trace(slave, modules_of(target), digits=24 if single else 53))
        header, source = files(program, single=single)
    except TraceError as error:
        raise PackagingError(f"{target.name}: {error}") from error
    with new_files(folder) as new:
        write_atomically(new / f"{target.name}.h", header)
        write_atomically(new / f"{target.name}.c", source)
    return folder / f"{target.name}.c"


def files(program: Program, *, single: bool) -> tuple[str, str]:
    """The header and the source of a program."""
    messages = MessageTable()
    early = messages.status(f"{program.model}_step before start: expected {program.model}_start first")
    twice = messages.status(f"{program.model}_start after start: expected {program.model}_init first")
    never = messages.status("t = ...: expected a finite start time")
    inputs = _refusals(program, messages)
    model_functions = functions(program, messages, single=single)
    known: dict[str, str] = {
        "model": program.model,
        "version": f" {version}" if (version := version_of(program.slave)) else "",
        "tool": generation_tool(),
        "guard": program.model.upper(),
        "description": comment(program.slave.description),
        "precision": _PRECISION[single],
        "real": "float" if single else "double",
        "early": str(early),
        "twice": str(twice),
        "never": str(never),
        "start_time": fields(program)[attribute_name(("_start_time",))],
        "initialise": c_name(program.initialise.name),
        "do_step": c_name(program.do_step.name),
    }
    header = {
        "groups": _groups(program, known["real"]),
        "warnings": _warnings(program, messages),
        "changed": _apply_function(program, whole=False),
    }
    source = {
        "includes": _INCLUDES[single],
        "mathematics": inlined_header(f"{model_functions} q_isfinite Q_ONE", single=single),
        "functions": model_functions,
        "inputs": inputs,
        "starts": _starts(program, single),
        "changed": _apply_function(program, whole=True),
        "texts": "".join(f"    {c_string(text)},\n" for text in ("no error", *messages.errors)),
    }
    return (
        Template((FOLDER / "embedded.h").read_text("utf-8")).substitute(known, **header),
        Template((FOLDER / "embedded.c").read_text("utf-8")).substitute(known, **source),
    )


def _groups(program: Program, precision: str) -> str:
    """The fields of the struct."""
    places = fields(program)
    parts = []
    for group in GROUPS.values():
        found = [place for place in program.places if places.get(place.name, "").startswith(f"{group}.")]
        widest = max((len(places[place.name]) for place in found), default=0) - len(group)
        lines = []
        for place in found:
            name = f"{places[place.name].removeprefix(f'{group}.')};"
            words = "" if place.reference is None else f" /* {describe(program.slave.variables[place.reference])} */"
            lines.append(f"        {precision} {f'{name:<{widest}}{words}'.rstrip()}\n")
        if lines:
            parts.append(f"    /* {_TITLES[group]} */\n    struct {{\n{''.join(lines)}    }} {group};\n")
    return "\n".join(parts)


def _starts(program: Program, single: bool) -> str:
    """The start values that are not zero."""
    slave = program.slave(instance_name="starts")
    places = fields(program)
    lines = []
    for place in program.places:
        if place.name not in places:
            continue
        value = start_of(slave, place)
        if value or math.copysign(1.0, value) < 0.0:
            lines.append(f"        .{places[place.name]} = {single_number(value) if single else repr(value)},\n")
    return "".join(lines)


def _refusals(program: Program, messages: MessageTable) -> str:
    """The checks of the inputs, which like in an FMU must be finite."""
    places = fields(program)
    lines = []
    for variable in program.slave.variables:
        if variable.causality == "input" and variable.type == "Real":
            status = messages.status(f"{variable.name} = ...: expected a finite value")
            lines.append(f"    if (!q_isfinite(m->{places[variable.name]})) return {status};\n")
    return "".join(lines)


def _warnings(program: Program, messages: MessageTable) -> str:
    """The bits of the warnings."""
    lines = [
        f"    {program.model.upper()}_{_constant(key)} = {1 << bit}, /* {comment(messages.warnings[key])} */\n"
        for bit, key in enumerate(program.warnings)
        if key in messages.warnings
    ]
    return f"/* The bits of `warnings`. */\nenum {{\n{''.join(lines)}}};\n\n" if lines else ""


def _constant(key: str) -> str:
    return "".join(c if c.isalnum() and c.isascii() else "_" for c in key).upper()


def _apply_function(program: Program, *, whole: bool) -> str:
    """The function that applies tuned parameters, if the model has any."""
    if not any(variable.variability == "tunable" for variable in program.slave.variables):
        return ""
    head = f"void {program.model}_changed({program.model} *c)"
    if not whole:
        return f"/* After tunable parameters were set between steps: the next step takes them over. */\n{head};\n\n"
    return f"{head}\n{{\n    c->{fields(program)[attribute_name(('_stale',))]} = 1;\n}}\n\n"


def main(arguments: list[str]) -> int:
    """`python -m fmu_kit.compiler.pack.embedded_files [--single] FOLDER …`: as `fmu_kit.packaging`, two files each."""
    single = arguments[:1] == ["--single"]
    return packaging.main(arguments[single:], functools.partial(write, single=single))


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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
