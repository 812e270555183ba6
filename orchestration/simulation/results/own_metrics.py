"""Metrics that the user writes as Python functions of a result; their source code is what is run and stored."""

import ast
import builtins
import inspect
import symtable
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from orchestration.foundation.basics.errors import UsageError

_EXPECTED = "expected a function of one argument, a Result, defined by def in a file or a notebook"


@dataclass(frozen=True, kw_only=True)
class OwnMetric:
    """A function of a result, by its source, from which any process can compile it."""

    name: str
    source: str
    """Source without comments and annotations, and with the imports that it needs"""
    function: str
    """its name in the source"""
    _compiled: list[Callable[[Any], Any]] = field(default_factory=list, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_compiled": []}

    def of(self, result: Any) -> float | None:
        """Its value for a result; None if it has none. Raises `UsageError` for an error in it, or for no number."""
        if not self._compiled:
            space: dict[str, Any] = {}
            exec(compile(self.source, f"<metrics.{self.name}>", "exec"), space)
            self._compiled.append(space[self.function])
        try:
            value = self._compiled[0](result)
            return None if value is None else float(value)
        except Exception as error:
            raise UsageError(f"metrics.{self.name}: {type(error).__name__}: {error}") from error


def metric_from_source(name: str, function: Any) -> OwnMetric:
    """A metric from a function; raises `UsageError` for one whose source is not self-contained."""
    place = f"metrics.{name}"
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        raise UsageError(f"{place}: has no source: {_EXPECTED}") from None
    (node,) = tree.body
    if not isinstance(node, ast.FunctionDef) or node.decorator_list or len(inspect.signature(function).parameters) != 1:
        raise UsageError(f"{place}: {_EXPECTED}")
    for each in ast.walk(node):
        if isinstance(each, ast.arg):
            each.annotation = None
        if isinstance(each, ast.FunctionDef):
            each.returns = None
    source = ast.unparse(node)
    taken = inspect.getclosurevars(function).nonlocals
    imports = []
    for used in sorted(set(_free_names(symtable.symtable(source, place, "exec"))) - {node.name}):
        value = taken.get(used, function.__globals__.get(used, getattr(builtins, used, None)))
        if isinstance(value, ModuleType):
            imports.append(f"import {value.__name__} as {used}")
        elif used in taken or value is not getattr(builtins, used, function):
            raise UsageError(
                f"{place}: {used} is not in it: expected all that it uses in the function, but for modules"
            )
    return OwnMetric(name=name, source="\n".join([*imports, source]), function=node.name)


def metrics_from_sources(functions: Mapping[str, Any]) -> tuple[OwnMetric, ...]:
    """Metrics by name; raises `UsageError` as `metric_from_source`."""
    return tuple(metric_from_source(name, function) for name, function in functions.items())


def _free_names(table: symtable.SymbolTable) -> Iterator[str]:
    """The free names of a piece of source code, nested scopes included."""
    top = table.get_type() == "module"
    for symbol in table.get_symbols():
        if symbol.is_referenced() and not symbol.is_assigned() if top else symbol.is_global():
            yield symbol.get_name()
    for child in table.get_children():
        yield from _free_names(child)
