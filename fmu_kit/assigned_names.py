"""Names in the methods of a slave, checked when its FMU is built: a mistyped one would be found in a run, or never."""

import ast
import builtins
import dis
import functools
import inspect
import textwrap
from collections.abc import Iterator
from types import CodeType, FunctionType
from typing import Any

from fmu_kit.declared_names import PYTHONFMU_NAMES
from fmu_kit.syntax_trees import parse_module

_OF_EVERY_SLAVE = ("fmu_kit", "pythonfmu")
"""Packages of the classes that every slave is made from"""


def expect_declared(slave: Any) -> None:
    """Raise `AttributeError` for an attribute of `self` that a method sets or reads without its being declared.

    Likewise for a name that neither the module of the method nor Python has.
    """
    of_users = [cls for cls in slave.__mro__ if cls.__module__.partition(".")[0] not in _OF_EVERY_SLAVE]
    for cls in of_users:
        for method in filter(inspect.isfunction, vars(cls).values()):
            for name, line, is_set in _attributes(method):
                if not (name.startswith("_") or hasattr(slave, name) or name in PYTHONFMU_NAMES):
                    declared = slave._own if is_set else [each.attribute for each in slave._declared]
                    raise AttributeError(
                        f"{inspect.getsourcefile(method)}, line {line}: self.{name}: no such variable; expected "
                        f"{', '.join(declared)}, or a name that begins with _"
                    )
            for name, line in _globals(method.__code__):
                if name not in method.__globals__ and not hasattr(builtins, name):
                    place = f"{inspect.getsourcefile(method)}, line {line}"
                    raise AttributeError(f"{place}: {name}: expected a name of its module or of Python")


@functools.cache
def _attributes(method: FunctionType) -> tuple[tuple[str, int, bool], ...]:
    """The attributes of `self` in a method, each with its line and whether it is set."""
    source, first = inspect.getsourcelines(method)
    return tuple(
        (each.attr, first + each.lineno - 1, isinstance(each.ctx, ast.Store))
        for each in ast.walk(parse_module(textwrap.dedent("".join(source))))
        if isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name) and each.value.id == "self"
    )


def _globals(code: CodeType) -> Iterator[tuple[str, int]]:
    """The names of its module, or of Python, that code and functions in it read, each with its line."""
    line = code.co_firstlineno
    for each in dis.get_instructions(code):
        line = getattr(each, "line_number", each.starts_line) or line  # from Python 3.13 on, or before
        if each.opname == "LOAD_GLOBAL":
            yield each.argval, line
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _globals(inner)
