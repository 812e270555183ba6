"""Merging of the ends of two paths, which become one again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.memory import Memory
from fmu_kit.compiler.trace.statements import Statement, statement
from fmu_kit.compiler.trace.symbols import Symbol, common_kind, lifted, node, select, storable
from fmu_kit.compiler.trace.tree import bare_leaves, difference, is_number, map_leaves, shape


@dataclass(frozen=True)
class PathEnd:
    """The end of a path that did not fail."""

    value: Any
    view: Any
    holders: dict[Any, int]
    written: dict[str, Symbol]
    version: int


class Merge:
    """The merge of two paths at their ends."""

    def __init__(self, condition: Symbol, memory: Memory, branches: bool) -> None:
        self.condition = condition
        self.memory = memory
        self.branches = branches
        self.then: list[Statement] = []
        self.otherwise: list[Statement] = []

    def end(self, a: PathEnd, b: PathEnd) -> PathEnd:
        """The merged end."""
        version = a.version if a.version == b.version else self.memory.joined(self.condition, a.version, b.version)
        return PathEnd(
            self.value(a.value, b.value, "the result"),
            self.value(a.view, b.view, "the state"),
            {path: holder for path, holder in a.holders.items() if b.holders.get(path) == holder},
            {name: self.number(a.written[name], b.written[name]) for name in a.written.keys() & b.written.keys()},
            version,
        )

    def value(self, a: Any, b: Any, what: str) -> Any:
        """The merged value; raises `TraceError` for values that differ in more than numbers."""
        if shape(a) != shape(b):
            found = difference(a, b, self.memory.name_in_view)
            raise TraceError(f"{what} differs in more than numbers between two paths: {found}")
        others = iter(list(bare_leaves(b)))

        def either(_: Any, leaf: Any) -> Any:
            other = next(others)
            return self.number(leaf, other) if is_number(leaf) else leaf

        return map_leaves(a, either)

    def number(self, a: Any, b: Any) -> Any:
        """The number that is `a` on one path and `b` on the other."""
        left, right = lifted(a), lifted(b)
        if left is right:
            return a
        if not self.branches and _is_cheap(left) and _is_cheap(right):
            return select(self.condition, a, b)
        if isinstance(a, bool) and isinstance(b, bool):
            return select(self.condition, a, b)
        merged = node("phi", (self.condition, left, right), common_kind(left, right))
        if not any(each.symbols[0] is merged for each in self.then):
            self.then.append(statement("assign", (merged, left)))
            self.otherwise.append(statement("assign", (merged, right)))
        return merged


def storable_value(value: Any) -> Any:
    """A value with its wide whole numbers narrowed, so that they can be stored."""
    if any(isinstance(leaf, Symbol) and leaf.kind == "wide" for leaf in bare_leaves(value)):
        return map_leaves(value, lambda _, leaf: storable(leaf) if isinstance(leaf, Symbol) else leaf)
    return value


def _is_cheap(symbol: Symbol) -> bool:
    return not symbol.args or (symbol.op in ("neg", "not") and _is_cheap(symbol.args[0]))
