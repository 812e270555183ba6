"""Metrics that somebody has written as Python functions of a result: by their source, which is what is run and kept."""

import ast
import builtins
import inspect
import symtable
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from orchestration.basics.errors import UsageError

ONE = "expected a function of one argument, a Result, defined by def in a file or a notebook"


@dataclass(frozen=True, kw_only=True)
class OwnMetric:
    """A function of a result that can be made again from this anywhere."""

    name: str
    source: str
    """without comments and annotations, and with the imports that it needs"""
    function: str
    """what it is called there"""
    _made: list[Callable[[Any], Any]] = field(default_factory=list, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_made": []}

    def of(self, result: Any) -> float | None:
        """Of a result; None where it has no value. Raises `UsageError` for what is no number, or an error in it."""
        if not self._made:
            space: dict[str, Any] = {}
            exec(compile(self.source, f"<metrics.{self.name}>", "exec"), space)
            self._made.append(space[self.function])
        try:
            value = self._made[0](result)
            return None if value is None else float(value)
        except Exception as error:
            raise UsageError(f"metrics.{self.name}: {type(error).__name__}: {error}") from error


def sourced(name: str, function: Any) -> OwnMetric:
    """A metric from a function; raises `UsageError` for one that its source does not say as a whole."""
    place = f"metrics.{name}"
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        raise UsageError(f"{place}: has no source: {ONE}") from None
    (node,) = tree.body
    if not isinstance(node, ast.FunctionDef) or node.decorator_list or len(inspect.signature(function).parameters) != 1:
        raise UsageError(f"{place}: {ONE}")
    for each in ast.walk(node):
        if isinstance(each, ast.arg):
            each.annotation = None
        if isinstance(each, ast.FunctionDef):
            each.returns = None
    source = ast.unparse(node)
    taken = inspect.getclosurevars(function).nonlocals
    imports = []
    for used in sorted(set(_outside(symtable.symtable(source, place, "exec"))) - {node.name}):
        value = taken.get(used, function.__globals__.get(used, getattr(builtins, used, None)))
        if isinstance(value, ModuleType):
            imports.append(f"import {value.__name__} as {used}")
        elif used in taken or value is not getattr(builtins, used, function):
            raise UsageError(
                f"{place}: {used} is not in it: expected all that it uses in the function, but for modules"
            )
    return OwnMetric(name=name, source="\n".join([*imports, source]), function=node.name)


def all_sourced(functions: Mapping[str, Any]) -> tuple[OwnMetric, ...]:
    """Metrics by name; raises `UsageError` as `sourced`."""
    return tuple(sourced(name, function) for name, function in functions.items())


def _outside(table: symtable.SymbolTable) -> Iterator[str]:
    """The names that a piece of source, or anything in it, takes from around it."""
    top = table.get_type() == "module"
    for symbol in table.get_symbols():
        if symbol.is_referenced() and not symbol.is_assigned() if top else symbol.is_global():
            yield symbol.get_name()
    for child in table.get_children():
        yield from _outside(child)
