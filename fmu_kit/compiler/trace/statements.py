"""Statements: what a traced function does, in order; the values that it computes lie in the graph of symbols.

Statements are interned as symbols are, so that two paths that do the same do identical statements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fmu_kit.compiler.trace.symbols import Kind, Symbol, both, closure, either, negation

Block = tuple["Statement", ...]

TANGENT = "tangent of "
"""Before the name of a place, in that of the place of its tangent"""


class Statement:
    """One thing that is done.

    | op | symbols | data | blocks |
    |---|---|---|---|
    | `if` | condition | | then, else |
    | `assign` | what, value | | |
    | `store` | value | name of the place | |
    | `call` | arguments | `Call` | |
    | `loop` | count, starts, what they are in the loop, what they are next | depth | body |
    | `warn` | values in the text | key, text | |
    | `raise` | values in the text | class of the error, text | |
    | `return` | values | | |
    """

    __slots__ = ("blocks", "data", "op", "symbols")

    def __init__(self, op: str, symbols: tuple[Symbol, ...], data: Any, blocks: tuple[Block, ...]) -> None:
        self.op = op
        self.symbols = symbols
        self.data = data
        self.blocks = blocks


_interned: dict[Any, Statement] = {}


def statement(op: str, symbols: Sequence[Symbol] = (), data: Any = None, blocks: tuple[Block, ...] = ()) -> Statement:
    """The one statement of these parts."""
    key = (op, tuple(map(id, symbols)), data, tuple(tuple(map(id, block)) for block in blocks))
    found = _interned.get(key)
    if found is None:
        found = _interned[key] = Statement(op, tuple(symbols), data, blocks)
    return found


def branched(condition: Any, then: Block, otherwise: Block) -> Block:
    """Either of two blocks; what both end with is done once, after them."""
    if isinstance(condition, bool):
        return then if condition else otherwise
    common = 0
    while common < min(len(then), len(otherwise)) and then[-1 - common] is otherwise[-1 - common]:
        common += 1
    tail = then[len(then) - common :]
    then, otherwise = then[: len(then) - common], otherwise[: len(otherwise) - common]
    if not then and not otherwise:
        return tail
    if not then:
        condition, then, otherwise = negation(condition), otherwise, ()
    if len(then) == 1 and then[0].op == "if" and then[0].blocks[1] == otherwise:  # if a: (if b: X else Y) else Y
        inner = then[0]
        return (*branched(both(condition, inner.symbols[0]), inner.blocks[0], otherwise), *tail)
    if len(then) == 1 and then[0].op == "if" and then[0].blocks == (otherwise, ()):  # if a: (if b: X) else X
        return (*branched(either(negation(condition), then[0].symbols[0]), otherwise, ()), *tail)
    if len(otherwise) == 1 and otherwise[0].op == "if" and otherwise[0].blocks == (then, ()):  # if a: X elif b: X
        return (*branched(either(condition, otherwise[0].symbols[0]), then, ()), *tail)
    if len(otherwise) == 1 and otherwise[0].op == "if" and otherwise[0].blocks[0] == then:  # if a: X elif b: X else Y
        inner, nots = otherwise[0], negation(condition)
        return (*branched(both(nots, negation(inner.symbols[0])), inner.blocks[1], then), *tail)
    if ends(then) and otherwise:  # nothing comes after a raise: the rest need not stand in a branch
        return (statement("if", (condition,), None, (then, ())), *otherwise, *tail)
    return (statement("if", (condition,), None, (then, otherwise)), *tail)


def ends(block: Block) -> bool:
    """Whether nothing that follows a block is ever done."""
    return bool(block) and (
        block[-1].op in ("raise", "return")
        or (block[-1].op == "if" and ends(block[-1].blocks[0]) and ends(block[-1].blocks[1]))
    )


@dataclass(frozen=True)
class Place:
    """Where a value stays from call to call: a variable of the FMU, or what the model keeps beside them."""

    name: str
    kind: Kind
    reference: int | None
    """value reference of a variable; None: kept by the model"""


@dataclass(frozen=True, eq=False)
class Function:
    """One method of the slave, traced."""

    name: str
    parameters: tuple[Symbol, ...]
    names: tuple[str, ...]
    """of the parameters"""
    body: Block
    results: int
    """how many values it returns"""
    stores: frozenset[str]
    """names of the places that it changes, with those of what it calls"""
    raises: frozenset[str]
    """classes of the errors that it ends with, its own and of what it calls"""
    doc: str = ""


@dataclass(frozen=True)
class Call:
    """A call of a function."""

    function: Function
    memory: int
    """version of the memory before it"""


def each_of(block: Block) -> Iterator[Statement]:
    """The statements of a block, each before those inside of it."""
    for each in block:
        yield each
        for inner in each.blocks:
            yield from each_of(inner)


def used_by(
    statements: Iterable[Statement], named_by: Callable[[Statement], Sequence[Symbol]] = lambda each: each.symbols
) -> dict[int, Symbol]:
    """The symbols that statements make use of, other than to choose between values that nobody asks for."""
    assigned: dict[int, list[Symbol]] = {}
    named: list[Symbol] = []
    for each in statements:
        if each.op == "assign":
            assigned.setdefault(id(each.symbols[0]), []).append(each.symbols[1])
        else:
            named += named_by(each)
    found: dict[int, Symbol] = {}
    while named:
        new = {key: symbol for key, symbol in closure(named).items() if key not in found}
        found |= new
        named = [value for key in new for value in assigned.get(key, ())]
    return found


def symbols_of(block: Block) -> list[Symbol]:
    """Every symbol that the statements of a block name themselves."""
    found: list[Symbol] = []
    for each in block:
        found += each.symbols
        for inner in each.blocks:
            found += symbols_of(inner)
    return found
