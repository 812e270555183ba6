"""A slave as two files in C for a microcontroller: Model.h and Model.c.

Writing them imports the slave, so it runs in a separate process: `python -m fmu_kit.compiler.pack.embedded_files`.
"""

from __future__ import annotations

import functools
import math
import sys
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
from fmu_kit.compiler.emit.inlined_header import inlined_header
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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
