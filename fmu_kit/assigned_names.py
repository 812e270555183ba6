"""Names that the methods of a slave assign, checked when its FMU is built: a typing error would be a new attribute."""

import ast
import functools
import inspect
import textwrap
from types import FunctionType
from typing import Any

from fmu_kit.declared_names import PYTHONFMU_NAMES
from fmu_kit.syntax_trees import parse_module


def expect_declared(slave: Any) -> None:
    """Raise `AttributeError` for an attribute that a method sets without being declared, probably by a typing error."""
    for cls in slave.__mro__:
        for method in filter(inspect.isfunction, vars(cls).values()):
            for name, line in _assigned(method):
                if not (name.startswith("_") or hasattr(slave, name) or name in PYTHONFMU_NAMES):
                    own = ", ".join(slave._own)
                    raise AttributeError(
                        f"{inspect.getsourcefile(method)}, line {line}: self.{name}: no such variable; expected {own}, "
                        "or a name that begins with _"
                    )


@functools.cache
def _assigned(method: FunctionType) -> tuple[tuple[str, int], ...]:
    """The attributes of `self` that a method sets, each with its line."""
    source, first = inspect.getsourcelines(method)
    return tuple(
        (each.attr, first + each.lineno - 1)
        for each in ast.walk(parse_module(textwrap.dedent("".join(source))))
        if isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store)
        if isinstance(each.value, ast.Name) and each.value.id == "self"
    )
