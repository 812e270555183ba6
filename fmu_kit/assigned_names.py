"""Names that the methods of a slave assign, checked when its FMU is built: a typing error would be a new attribute."""

import ast
import inspect
import textwrap
from typing import Any

from fmu_kit.declared_names import PYTHONFMU_NAMES
from fmu_kit.syntax_trees import parse_module


def expect_declared(slave: Any) -> None:
    """Raise `AttributeError` for an attribute that a method sets without being declared, probably by a typing error."""
    for cls in slave.__mro__:
        for method in filter(inspect.isfunction, vars(cls).values()):
            source, first = inspect.getsourcelines(method)
            for each in ast.walk(parse_module(textwrap.dedent("".join(source)))):
                match each:
                    case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                        if not (name.startswith("_") or hasattr(slave, name) or name in PYTHONFMU_NAMES):
                            place = f"{inspect.getsourcefile(method)}, line {first + each.lineno - 1}"
                            own = ", ".join(slave._own)
                            raise AttributeError(
                                f"{place}: self.{name}: no such variable; expected {own}, or a name that begins with _"
                            )
