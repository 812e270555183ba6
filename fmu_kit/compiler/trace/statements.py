"""Statements: the effects of a traced function, in order; the values that it computes are in the graph of symbols.

Statements are interned like symbols, so that two paths that do the same have identical statements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fmu_kit.compiler.trace.symbols import Kind, Symbol, both, closure, either, negation
from fmu_kit.compiler.trace.texts import Piece, pieces
from fmu_kit.errors import DivergenceError, FmuError

Block = tuple["Statement", ...]

TANGENT = "tangent of "
"""The prefix of the name of a place in the name of its tangent's place"""


class Statement:
    """One statement.

    | op | symbols | data | blocks |
    |---|---|---|---|
    | `if` | condition | | then, else |
    | `assign` | what, value | | |
    | `store` | value | name of the place | |
    | `call` | arguments | `Call` | |
    | `loop` | count, initial values, next values | depth | body |
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
    """The interned statement of these parts."""
    key = (op, tuple(map(id, symbols)), data, tuple(tuple(map(id, block)) for block in blocks))
    found = _interned.get(key)
    if found is None:
        found = _interned[key] = Statement(op, tuple(symbols), data, blocks)
    return found


def branch(condition: Any, then: Block, otherwise: Block) -> Block:
    """The choice between two blocks; statements with which both end are moved behind it."""
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
        return (*branch(both(condition, inner.symbols[0]), inner.blocks[0], otherwise), *tail)
    if len(then) == 1 and then[0].op == "if" and then[0].blocks == (otherwise, ()):  # if a: (if b: X) else X
        return (*branch(either(negation(condition), then[0].symbols[0]), otherwise, ()), *tail)
    if len(otherwise) == 1 and otherwise[0].op == "if" and otherwise[0].blocks == (then, ()):  # if a: X elif b: X
        return (*branch(either(condition, otherwise[0].symbols[0]), then, ()), *tail)
    if len(otherwise) == 1 and otherwise[0].op == "if" and otherwise[0].blocks[0] == then:  # if a: X elif b: X else Y
        inner, nots = otherwise[0], negation(condition)
        return (*branch(both(nots, negation(inner.symbols[0])), inner.blocks[1], then), *tail)
    if ends(then) and otherwise:  # nothing follows a raise: the rest needs no branch
        return (statement("if", (condition,), None, (then, ())), *otherwise, *tail)
    return (statement("if", (condition,), None, (then, otherwise)), *tail)


def ends(block: Block) -> bool:
    """Whether a block always ends the function."""
    return bool(block) and (
        block[-1].op in ("raise", "return")
        or (block[-1].op == "if" and ends(block[-1].blocks[0]) and ends(block[-1].blocks[1]))
    )


@dataclass(frozen=True)
class Place:
    """A place of the memory: a variable of the FMU, or a number that the model keeps beside them."""

    name: str
    kind: Kind
    reference: int | None
    """value reference of a variable; None for a number kept by the model"""


@dataclass(frozen=True, eq=False)
class Function:
    """One method of the slave, traced."""

    name: str
    parameters: tuple[Symbol, ...]
    names: tuple[str, ...]
    """Names of the parameters"""
    body: Block
    results: int
    """number of values that it returns"""
    stores: frozenset[str]
    """names of the places that it or a function that it calls changes"""
    raises: frozenset[str]
    """classes of the errors that it or a function that it calls raises"""
    doc: str = ""


@dataclass(frozen=True)
class Call:
    """A call of a function."""

    function: Function
    memory: int
    """version of the memory before it"""


def all_statements(block: Block) -> Iterator[Statement]:
    """The statements of a block, each before those inside it."""
    for each in block:
        yield each
        for inner in each.blocks:
            yield from all_statements(inner)


def used_symbols(
    statements: Iterable[Statement], named_by: Callable[[Statement], Sequence[Symbol]] = lambda each: each.symbols
) -> dict[int, Symbol]:
    """The symbols that statements use, without those assigned only to merged values that are not used."""
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
    """The symbols that the statements of a block use directly."""
    found: list[Symbol] = []
    for each in block:
        found += each.symbols
        for inner in each.blocks:
            found += symbols_of(inner)
    return found


def has_effect(statement: Statement) -> bool:
    """Whether a statement may fail, warn, or change the memory; a store only writes what was changed before."""
    if statement.op == "call":
        function: Function = statement.data.function
        return bool(function.stores or function.raises) or any(map(has_effect, function.body))
    return statement.op in ("raise", "warn") or any(has_effect(inner) for block in statement.blocks for inner in block)


def stores_of(block: Block) -> set[str]:
    """The names of the places that a block changes, by itself or in what it calls."""
    found: set[str] = set()
    for each in block:
        if each.op == "store":
            found.add(each.data)
        elif each.op == "call":
            found |= each.data.function.stores
        for inner in each.blocks:
            found |= stores_of(inner)
    return found


def raises_of(block: Block) -> set[str]:
    """The classes of the errors that a block raises, by itself or in what it calls."""
    found: set[str] = set()
    for each in block:
        if each.op == "raise":
            found.add(each.data[0])
        elif each.op == "call":
            found |= each.data.function.raises
        for inner in each.blocks:
            found |= raises_of(inner)
    return found


_CLASSES: dict[str, type[Exception]] = {
    each.__name__: each for each in (FmuError, DivergenceError, ZeroDivisionError, OverflowError, ValueError)
}


def error_class(name: str) -> type[Exception]:
    """The error class of a name."""
    return _CLASSES[name]


def raise_statement(error: Exception) -> Statement:
    """The statement that raises an error of the FMU."""
    name = next(name for name, each in reversed(_CLASSES.items()) if isinstance(error, each))
    if type(error).__name__ in _CLASSES:
        name = type(error).__name__
    message = pieces(str(error))
    return statement("raise", _values(message), (name, _words(message)))


def warn_statement(key: str, text: str) -> Statement:
    """The statement that logs a warning, the first time only."""
    message = pieces(text)
    return statement("warn", _values(message), (key, _words(message)))


def _values(text: list[Piece]) -> list[Symbol]:
    return [piece[0] for piece in text if not isinstance(piece, str)]


def _words(text: list[Piece]) -> tuple[str | tuple[str], ...]:
    """The text without its values: a format in place of each."""
    return tuple(piece if isinstance(piece, str) else (piece[1],) for piece in text)
