"""The runs of a shape as one CUDA text: the C for SIMD lanes, used for threads (`threads.h`, `flights.cu`)."""

import ctypes
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from fmu_kit.compiler.runtime import FOLDER
from orchestration.components.fmi.model import Model
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.batch.kernels import FILES, sources_of
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.structures import constants, shared

Known = Mapping[str, float]
"""Numbers that are the same in all runs, by the names in C of their places in a component's memory"""

_OF_KIT = ("lanes.h", "mathematics.h", "integers.h")
_OWN = ("flights.cu", "threads.h", "component.h")
_INCLUDE = re.compile(r'(?m)^#include "(.+)"\n')
_LITERAL = re.compile(r"\((q_\w+|[A-Z]\w+)\)\{")
"""A compound literal of C, which C++ writes without the parentheses"""
_STRAIGHT = re.compile(
    r"static Q_FLAT q_mask (\w+)\([^)]*\)\n\{\n.*?\n\}\n(?=\s*#define STRAIGHT_STEP \1\n)", re.DOTALL
)
_METHOD = re.compile(r"static (?=q_mask (?!model_do_step)\w+\()")
"""A function; if NVRTC inlines it, compilation takes twice as long, and the kernel more registers"""
_FUNCTION = re.compile(r"static q_mask (\w+)\([^)]*\)\n\{\n(.*?)\n\}\n", re.DOTALL)
_CALLED = re.compile(r"\b(model_\w+)\(")
_TAKES_PARAMETERS = "model_take_parameters"
"""The method of all slaves that reads parameters again after one was set"""
_READ, _STORED = re.compile(r"v\[(\w+)\]"), re.compile(r"v\[(\w+)\] = ")
_LINE = """
extern "C" __global__ void line(q_place *v, q_real t, q_real h, int *through) {
    through[threadIdx.x] = component::STRAIGHT_STEP(v + threadIdx.x, 1, NULL, t, h);
}
"""


@dataclass(frozen=True)
class Code:
    """A component as C over lanes."""

    places: str
    functions: str
    constant: Mapping[str, int] = field(default_factory=dict)
    """the places that its straight line reads and that depend on parameters alone, by name"""

    @classmethod
    def of(cls, name: str, model: Model) -> "Code":
        """The code of an FMU; raises `UsageError` naming it if it was built by another version of the kit."""
        sources = sources_of(name, model)
        if any(sources.get(header) != (FOLDER / header).read_bytes() for header in _OF_KIT):
            raise UsageError(
                f"components.{name}: {model.path.name}: expected a native FMU built by this version, to be one of many "
                "in threads of a GPU"
            )
        places, functions = (sources[each].decode() for each in ("places.h", "lane_functions.h"))
        straight = _STRAIGHT.search(functions)
        if straight is None:
            return cls(places, functions)
        inputs = {variable.reference for variable in model.variables.values() if variable.causality == "input"}
        candidates = {*_READ.findall(straight[0])} - {*_STORED.findall(straight[0])} - _changed(functions)
        constant = {
            each: place for each, place in constants(places).items() if each in candidates and place not in inputs
        }
        return cls(places, functions, constant)

    def text(self, known: Known) -> str:
        """The text, with known numbers as constants in its straight line, which are checked after a general step."""

        def number(match: re.Match[str]) -> str:
            return f"({known[match[1]].hex()})" if match[1] in known else match[0]

        functions = _STRAIGHT.sub(lambda straight: _READ.sub(number, straight[0]), self.functions)
        functions = _METHOD.sub("static __noinline__ ", functions)
        same = " & ".join(f"(q_to_bits(v[{each}]) == q_to_bits({value.hex()}))" for each, value in known.items())
        return f"{self.places}{functions}\nstatic int as_known(const q_place *v) {{ return {same or '(void)v, 1'}; }}\n"


def _changed(functions: str) -> set[str]:
    """The places that a general step changes, except where it takes over parameters."""
    bodies: dict[str, str] = dict(_FUNCTION.findall(functions))
    reached, waiting = {_TAKES_PARAMETERS}, ["model_do_step"]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += [called for called in _CALLED.findall(bodies[name]) if called in bodies]
    return {place for name in reached - {_TAKES_PARAMETERS} for place in _STORED.findall(bodies[name])}


def program(shape: Shape, codes: Mapping[str, Code], known: Mapping[str, Known]) -> str:
    """The program that runs a shape, given the known numbers of each component."""
    generated = {
        "components.h": "\n".join([
            *(_in_space(f"component_{i}", code.text(known[name]) + '#include "component.h"\n')
              for i, (name, code) in enumerate(codes.items())),
            "static int step_of(int64_t index, q_place *v, q_real t, q_real h) {",
            "    switch (index) {",
            *(f"    case {i}: return component_{i}::step(v, t, h);" for i in range(len(codes))),
            "    }",
            "    return -1;",
            "}",
            "",
        ]),
        **shape.texts,
    }  # fmt: skip
    sizes = "\n".join(
        f'static_assert(sizeof({name}) == {ctypes.sizeof(each)}, "{name} as in Python");'
        for name, each in shared(shape.lanes).items()
    )
    return _of_threads(f'#include "flights.cu"\n{sizes}\n', shape.lanes, generated)


def line(code: Code, known: Known, lanes: int) -> str:
    """The straight line of a component's step alone as a kernel, to measure its resources."""
    text = f'#include "threads.h"\n#include "integers.h"\n{_in_space("component", code.text(known))}{_LINE}'
    return _of_threads(text, lanes, {})


def _in_space(name: str, text: str) -> str:
    return f"namespace {name} {{\n{text}}}\n"


def _of_threads(text: str, lanes: int, generated: Mapping[str, str]) -> str:
    """A text as C++, with each file that it includes once."""
    files, seen = {**_files(), **generated}, set[str]()

    def content(match: re.Match[str]) -> str:
        name = match[1]
        if name in seen and name != "component.h":
            return ""
        seen.add(name)
        return _INCLUDE.sub(content, files[name])

    return f"#define L {lanes}\n" + _LITERAL.sub(r"\1{", _INCLUDE.sub(content, text))


@cache
def _files() -> Mapping[str, str]:
    here = Path(__file__).parent
    paths = (*FILES, *(FOLDER / name for name in _OF_KIT), *(here / name for name in _OWN))
    return {path.name: path.read_text(encoding="utf-8") for path in paths}
