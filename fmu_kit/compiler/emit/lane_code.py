"""Writes a program as C for several SIMD lanes: its functions, and its step as a straight line, one and several."""

from __future__ import annotations

from dataclasses import replace

from fmu_kit.compiler.emit.c_names import c_name, place_names
from fmu_kit.compiler.emit.lane_writer import LaneWriter
from fmu_kit.compiler.emit.line_writers import LineWriter, StepsWriter
from fmu_kit.compiler.trace.statements import Function
from fmu_kit.compiler.trace.tracing import Program


def lane_code(program: Program, line: Function | None = None) -> str:
    """The C of the functions of a program in lanes, each after those that it calls, and of its straight line."""
    names = place_names(program.places)
    writers: list[LaneWriter] = [LaneWriter(function, program, names) for function in program.functions]
    if line is None:
        return "\n\n".join(writer.text() for writer in writers) + "\n"
    read = {symbol.data[0] for writer in writers for symbol in writer.used.values() if symbol.op == "load"}
    unread = {variable.name for variable in program.slave.variables} - read
    several = replace(line, name=f"{line.name} several times", doc="Several of such steps.")
    return "\n\n".join([
        *(writer.text() for writer in (*writers, LineWriter(line, program, names, unread))),
        f"#define STRAIGHT_STEP {c_name(line.name)}", "#ifdef QUADCOSIM_SEVERAL",
        StepsWriter(several, program, names, unread).text(),
        f"#define STRAIGHT_STEPS {c_name(several.name)}", "#endif\n",
    ])  # fmt: skip
