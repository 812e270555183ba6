"""Makes a step one straight line: its usual path, with guards against all others.

Calls are inlined, loops unrolled, and of each `if` the branch is taken that all sampled states take; where they differ,
both are computed, and the values selected. The result is values, then stores, which are done if no guard holds. Each
value is computed as in the step with branches: the same operations on the same numbers, so the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fmu_kit.compiler.passes.precomputing import fixed_places
from fmu_kit.compiler.passes.samples import Values, states_of
from fmu_kit.compiler.trace.statements import Block, Call, Function, Statement, statement
from fmu_kit.compiler.trace.symbols import (
    Symbol,
    both,
    closure,
    constant,
    either,
    lifted,
    negation,
    node,
    select,
    truth,
    unknown_below,
    unmerged,
    value_of,
)
from fmu_kit.compiler.trace.tracing import Program

LEAVES = "leaves the straight line"
"""The error that the function raises where a guard holds"""
MAX_ROUNDS = 4
"""Largest number of rounds of an unrolled loop"""


class _NoLineError(Exception):
    """There is no straight line."""


def straightened(program: Program) -> Function | None:
    """The step of a program as a straight line; None if there is none.

    Where a guard holds, the function fails and stores nothing.
    """
    states = states_of(program)
    if not states:
        return None
    line = _Line(program, Values(program, states))
    step = program.do_step
    try:
        line.call(step, list(step.parameters), None)
    except (_NoLineError, KeyError):  # the path depends on an unknown value
        return None
    fails = statement("raise", (), (LEAVES, ()))
    guards = dict.fromkeys(part for guard in line.guards for part in _alternatives(guard))
    stores = [
        statement("store", (value,), place)
        for place, value in line.memory.items()
        if value is not node("load", (), value.kind, (place, 0))
    ]
    return replace(
        step,
        name=f"{step.name} in a line",
        body=(*(statement("if", (guard,), None, ((fails,), ())) for guard in guards), *stores, statement("return", ())),
        stores=frozenset(each.data for each in stores),
        raises=frozenset({LEAVES}),
        doc="As do_step, where it takes its usual way; it does nothing where it does not.",
    )


@dataclass(frozen=True)
class _Returned:
    values: list[Symbol]


class _Line:
    """The stored values and the guards along the path."""

    def __init__(self, program: Program, values: Values) -> None:
        self.program = program
        self.values = values
        self.memory: dict[str, Symbol] = {}
        """the current values of the places that were written"""
        self.guards: list[Symbol] = []
        self.decided: dict[Symbol, bool | float] = {}
        """values that a guard ensures, of conditions and of numbers of rounds"""
        self.fixed = fixed_places(program)

    def call(self, function: Function, arguments: Sequence[Symbol], under: Symbol | None) -> list[Symbol]:
        """Inline a call of a function under a condition, None for an unconditional one; its results."""
        returned = _Frame(self, function, arguments).block(function.body, under)
        return [] if returned is None else returned.values

    def read(self, place: str, symbol: Symbol, memory: dict[str, Symbol]) -> Symbol:
        """The value of a place."""
        found = memory.get(place)
        return node("load", (), symbol.kind, (place, 0)) if found is None else _as(symbol, found)

    def expect_not(self, condition: Any, under: Symbol | None) -> None:
        """Add the guard that a condition does not hold where `under` does."""
        guard = condition if under is None else both(under, condition)
        if guard is True:
            raise _NoLineError
        if guard is not False:
            self.guards.append(truth(guard))
            if under is None:
                self.decided[guard] = False
                self.decided[negation(guard)] = True

    def decide(self, condition: Any) -> Any:
        """A condition, or its value in the sampled states, with a guard, if it depends on parameters alone."""
        if not isinstance(condition, Symbol) or condition.op == "constant" or not self._is_fixed(condition):
            return condition
        ways = self.ways(condition, None)
        if len(ways) != 1:
            return condition
        (way,) = ways
        self.expect_not(negation(condition) if way else condition, None)
        return way

    def _is_fixed(self, condition: Symbol) -> bool:
        return all(
            each.args or each.op == "constant" or (each.op == "load" and each.data[0] in self.fixed)
            for each in closure([condition]).values()
        )

    def ways(self, condition: Symbol, under: Symbol | None) -> set[bool]:
        """The values that a condition has in the sampled states in which `under` holds."""
        chosen = [True] * len(self.values.states) if under is None else self.values.of(under)
        return {bool(value) for value, here in zip(self.values.of(condition), chosen) if here == 1.0}


class _Frame:
    """One call of a function."""

    def __init__(self, line: _Line, function: Function, arguments: Sequence[Symbol]) -> None:
        self.line = line
        self.arguments = [_as(parameter, value) for parameter, value in zip(function.parameters, arguments)]
        self.memories = {0: dict(line.memory)}
        """Memories by version: at the beginning of the call, and after each call in it"""
        self.results: dict[int, list[Symbol]] = {}
        self.rounds: dict[int, tuple[int, list[Symbol]]] = {}
        """Rounds of loops, by their depth: the current round, and the values of their variables"""
        self.outcomes: dict[Statement, list[Symbol]] = {}
        self.chosen: dict[Symbol, Symbol] = {}
        """the values of symbols that are assigned in branches"""
        self.known: dict[Symbol, Symbol] = {}

    # -- statements ------------------------------------------------------------------------------------------

    def block(self, block: Block, under: Symbol | None) -> _Returned | None:
        """Translate the statements of a block under a condition."""
        for each in block:
            returned: _Returned | None = getattr(self, f"_{each.op}")(each, under)
            if returned is not None:
                return returned
        return None

    def _if(self, statement: Statement, under: Symbol | None) -> _Returned | None:
        then, otherwise = statement.blocks
        if not (_does(then) or _does(otherwise)):
            return None
        condition = self.value(statement.symbols[0])
        if condition.op == "constant":
            return self.block(then if condition is constant(True) else otherwise, under)
        ways = self.line.ways(condition, under)
        if _raises(then) or ways == {False}:
            self.line.expect_not(condition, under)
            return self.block(otherwise, under)
        if _raises(otherwise) or ways == {True}:
            self.line.expect_not(negation(condition), under)
            return self.block(then, under)
        if not ways:
            raise _NoLineError
        self._both_branches(condition, then, otherwise, under)
        return None

    def _both_branches(self, condition: Symbol, then: Block, otherwise: Block, under: Symbol | None) -> None:
        line = self.line
        before, chosen = dict(line.memory), dict(self.chosen)
        left = []
        for block, holds in ((then, condition), (otherwise, negation(condition))):
            line.memory, self.chosen, self.known = dict(before), dict(chosen), {}
            if self.block(block, holds if under is None else both(under, holds)) is not None:
                raise _NoLineError
            left.append((line.memory, self.chosen))
        (memory_a, chosen_a), (memory_b, chosen_b) = left
        self.known = {}
        self.chosen = {
            key: lifted(select(condition, chosen_a.get(key, value), chosen_b.get(key, value)))
            for key, value in {**chosen_a, **chosen_b}.items()
        }
        line.memory = before
        for place, value in {**memory_a, **memory_b}.items():
            a, b = (line.read(place, value, memory) for memory in (memory_a, memory_b))
            line.memory[place] = lifted(select(condition, a, b))

    def _assign(self, statement: Statement, under: Symbol | None) -> None:
        target, value = statement.symbols
        self.chosen[target] = _as(target, self.value(value))
        self.known = {}

    def _store(self, statement: Statement, under: Symbol | None) -> None:
        self.line.memory[statement.data] = self.value(statement.symbols[0])

    def _call(self, statement: Statement, under: Symbol | None) -> None:
        call: Call = statement.data
        after = self.line.program.versions[call.memory, statement]
        self.results[after] = self.line.call(call.function, [self.value(symbol) for symbol in statement.symbols], under)
        self.memories[after] = dict(self.line.memory)
        self.known = {}

    def _loop(self, statement: Statement, under: Symbol | None) -> None:
        size = (len(statement.symbols) - 1) // 2
        count, starts, nexts = statement.symbols[0], statement.symbols[1 : 1 + size], statement.symbols[1 + size :]
        states = [self.value(symbol) for symbol in starts]
        times = self.value(count)
        least = min((value for value in self.line.values.of(times) if value >= 1.0), default=0.0)
        if not 1.0 <= least <= MAX_ROUNDS:
            raise _NoLineError
        if times.op != "constant":
            self.line.expect_not(node("ne", (times, constant(least)), "bool"), under)
            if under is None:
                self.line.decided[times] = least
        for k in range(int(least)):
            self.rounds[statement.data], self.known = (k, states), {}
            if self.block(statement.blocks[0], under) is not None:
                raise _NoLineError
            states = [_as(symbol, self.value(symbol)) for symbol in nexts]
        self.outcomes[statement], self.known = states, {}

    def _warn(self, statement: Statement, under: Symbol | None) -> None:
        pass

    def _raise(self, statement: Statement, under: Symbol | None) -> None:
        self.line.expect_not(True, under)

    def _return(self, statement: Statement, under: Symbol | None) -> _Returned:
        return _Returned([self.value(symbol) for symbol in statement.symbols])

    # -- values ------------------------------------------------------------------------------------------------

    def value(self, symbol: Symbol) -> Symbol:
        """The value of a symbol of the function on the line."""
        for one in unknown_below(symbol, lambda each: each in self.known, unmerged):
            made = self._translated(one, [self.known[arg] for arg in unmerged(one)])
            self.known[one] = constant(self.line.decided[made]) if made in self.line.decided else made
        return self.known[symbol]

    def _translated(self, symbol: Symbol, args: list[Symbol]) -> Symbol:
        op, data = symbol.op, symbol.data
        if op == "add" and symbol.kind == "int" and args[0].op == "constant" and value_of(args[0]) == 0.0:
            return args[1]  # whole numbers have no signed zero
        if op == "select":
            return lifted(select(self.line.decide(args[0]), *args[1:]))
        if op in _SETTLED:
            return lifted(_SETTLED[op](*args))
        if op == "load":
            place, version = data
            return self.line.read(place, symbol, self.memories[version])
        if op == "result":
            return _as(symbol, self.results[data[1]][data[0]])
        if op == "failed":
            return constant(False)  # what fails leaves the line
        if op == "outcome":
            return _as(symbol, self.outcomes[data[1]][data[0]])
        if op == "variable":
            return _as(symbol, self.rounds[data[0]][1][data[1]])
        if op == "index":
            return constant(self.rounds[data][0])
        if op == "parameter":
            return self.arguments[int(data)]
        if op == "phi":
            return self.chosen[symbol]
        return node(op, args, symbol.kind, data) if args else symbol


_SETTLED: dict[str, Callable[..., Any]] = {"and": both, "or": either, "not": negation}


def _as(wanted: Symbol, value: Symbol) -> Symbol:
    """A value converted to the kind of a symbol, as C stores it."""
    if wanted.kind == "bool":
        return truth(value)
    made: Symbol = node("select", (value, constant(1.0), constant(0.0)), "real") if value.kind == "bool" else value
    return made


def _does(block: Block) -> bool:
    """Whether a block does more than log messages."""
    return any(each.op != "warn" and (each.op != "if" or any(map(_does, each.blocks))) for each in block)


def _raises(block: Block) -> bool:
    """Whether a block ends in an error on all paths."""
    if not block:
        return False
    last = block[-1]
    return last.op == "raise" or (last.op == "if" and all(map(_raises, last.blocks)))


def _alternatives(condition: Symbol) -> list[Symbol]:
    """Conditions of which any holds where the given one does, each once."""
    found: dict[Symbol, None] = {}
    seen: set[Symbol] = set()
    waiting = [condition]
    while waiting:
        one = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        if one.op == "or":
            waiting += reversed(one.args)
        elif one.op == "not" and one.args[0].op == "and":
            waiting += (truth(negation(each)) for each in reversed(one.args[0].args))
        else:
            found[one] = None
    return list(found)
