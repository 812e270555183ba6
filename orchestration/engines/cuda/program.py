"""The runs of a shape as one text of CUDA: that of lanes, for threads (`threads.h`, `flights.cu`)."""

import ctypes
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from fmu_kit.compiler.runtime import FOLDER
from orchestration.basics.errors import UsageError
from orchestration.engines.batch.kernels import FILES, sources_of
from orchestration.engines.batch.shape import Shape
from orchestration.engines.structures import shared
from orchestration.fmi.model import Model

_OF_KIT = ("lanes.h", "mathematics.h", "integers.h")
_OWN = ("flights.cu", "threads.h", "component.h")
_INCLUDE = re.compile(r'(?m)^#include "(.+)"\n')
_LITERAL = re.compile(r"\((q_\w+|[A-Z]\w+)\)\{")
"""A structure of known values, as C has it: C++ has no parentheses there"""
_LINE = """
extern "C" __global__ void line(q_place *v, q_real t, q_real h, int *through) {
    through[threadIdx.x] = component::STRAIGHT_STEP(v + threadIdx.x, 1, t, h);
}
"""


def program(shape: Shape) -> str:
    """What flies runs of a shape; raises `UsageError` naming a component of another kit than this one."""
    written = {
        "components.h": "\n".join([
            *(_in_space(f"component_{i}", _functions(name, model) + '#include "component.h"\n')
              for i, (name, model) in enumerate(shape.models.items())),
            "static int step_of(int64_t index, q_place *v, q_real t, q_real h) {",
            "    switch (index) {",
            *(f"    case {i}: return component_{i}::step(v, t, h);" for i in range(len(shape.models))),
            "    }",
            "    return -1;",
            "}",
        ]),
        **shape.texts,
    }  # fmt: skip
    sizes = "\n".join(
        f'static_assert(sizeof({name}) == {ctypes.sizeof(each)}, "{name} as in Python");'
        for name, each in shared(shape.lanes).items()
    )
    return _of_threads(f'#include "flights.cu"\n{sizes}\n', shape.lanes, written)


def line(name: str, model: Model, lanes: int) -> str:
    """The straight line of a component's step alone, as a kernel: to see what it takes of a processor."""
    text = f'#include "threads.h"\n#include "integers.h"\n{_in_space("component", _functions(name, model))}{_LINE}'
    return _of_threads(text, lanes, {})


def _in_space(name: str, text: str) -> str:
    return f"namespace {name} {{\n{text}}}\n"


def _functions(name: str, model: Model) -> str:
    """Those of a component over lanes, by the mathematics that all components have."""
    sources = sources_of(name, model)
    if any(sources.get(header) != (FOLDER / header).read_bytes() for header in _OF_KIT):
        raise UsageError(
            f"components.{name}: {model.path.name}: expected a native FMU built by this version, to be one of many in "
            "threads of a GPU"
        )
    return (sources["places.h"] + sources["lane_functions.h"]).decode()


def _of_threads(text: str, lanes: int, written: Mapping[str, str]) -> str:
    """A text with all that it includes, each once, as C++."""
    files, seen = {**_files(), **written}, set[str]()

    def content(found: re.Match[str]) -> str:
        name = found[1]
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
