"""Precomputing of values that depend on parameters alone: when these are read, and not in every step.

The operations and their numbers are the same, so the bits are too; only the time of computing differs.
"""

from __future__ import annotations

from dataclasses import replace

from fmu_kit.compiler.trace.statements import Block, Call, Function, Place, Statement, statement, symbols_of
from fmu_kit.compiler.trace.symbols import CHEAP, Symbol, closure, node, unknown_below
from fmu_kit.compiler.trace.tracing import Program

TAKING = "take_parameters"
"""The function that reads the parameters."""


def precompute(program: Program) -> Program:
    """The program with a place for each costly value that depends on parameters alone."""
    taking, before = _taking(program)
    whole = _Precomputing(program, fixed_places(program))
    whole.made.update({f: f for f in before})
    for f in _others(program, before):
        if f not in (program.initialise, program.do_step):  # these read the parameters
            whole.function(f)
    if not whole.places:
        return program
    *rest, last = taking.body
    call = next(each for each in reversed(rest) if each.op == "call")
    version = program.versions[call.data.memory, call]
    computed = tuple(
        statement("store", (whole.as_read(value, version),), place.name) for place, value in whole.places.values()
    )
    stores = taking.stores | {place.name for place, _ in whole.places.values()}
    whole.made[taking] = replace(taking, body=(*rest, *computed, last), stores=stores)
    functions = tuple(whole.function(f) for f in program.functions)
    return replace(
        program,
        places=(*program.places, *(place for place, _ in whole.places.values())),
        functions=functions,
        initialise=whole.function(program.initialise),
        do_step=whole.function(program.do_step),
        versions={**program.versions, **whole.versions},
    )


def fixed_places(program: Program) -> frozenset[str]:
    """The places that change only when the parameters are read."""
    taking, before = _taking(program)
    changed = {name for f in _others(program, before) for name in _stored_directly(f.body)}
    parameters = {v.name for v in program.slave.variables if v.causality == "parameter"}
    return frozenset((taking.stores | parameters) - changed)


def _taking(program: Program) -> tuple[Function, set[Function]]:
    """The function that reads the parameters; and it together with those that it calls."""
    (taking,) = (f for f in program.functions if f.name == TAKING)
    return taking, _called_by(taking) | {taking}


def _others(program: Program, before: set[Function]) -> list[Function]:
    return [f for f in program.functions if f not in before]


def _called_by(function: Function) -> set[Function]:
    found: set[Function] = set()

    def look(block: Block) -> None:
        for each in block:
            if each.op == "call" and each.data.function not in found:
                found.add(each.data.function)
                look(each.data.function.body)
            for inner in each.blocks:
                look(inner)

    look(function.body)
    return found


def _stored_directly(block: Block) -> set[str]:
    found = {each.data for each in block if each.op == "store"}
    return found.union(*(_stored_directly(inner) for each in block for inner in each.blocks)) if block else found


class _Precomputing:
    """Makes the functions that read precomputed values."""

    def __init__(self, program: Program, fixed: frozenset[str]) -> None:
        self.program = program
        self.fixed = fixed
        self.places: dict[Symbol, tuple[Place, Symbol]] = {}
        """place and value, by the value as at the end of `TAKING`"""
        self.versions: dict[tuple[int, Statement], int] = {}
        self.made: dict[Function, Function] = {}
        self._kinds: dict[int, tuple[bool, bool]] = {}
        self._read: dict[int, dict[int, Symbol]] = {}
        """the results of `as_read`, by version and identity"""

    def function(self, f: Function) -> Function:
        """`f`, with the functions that it calls, reading precomputed values."""
        if f not in self.made:
            for symbol in closure(symbols_of(f.body)).values():
                self._know(symbol)
            block = _Body(self, f).block(f.body)
            stores = f.stores | {name for made in _calls(block) for name in made.stores}
            self.made[f] = replace(f, body=block, stores=stores)
        return self.made[f]

    def place_of(self, value: Symbol) -> Place:
        """The place of a precomputed value."""
        if value not in self.places:
            self.places[value] = (Place(f"self.computed.{len(self.places) + 1}", value.kind, None), value)
        return self.places[value][0]

    def as_read(self, value: Symbol, version: int) -> Symbol:
        """A value that depends on parameters alone, computed from this version of the memory."""
        known = self._read.setdefault(version, {})
        for one in unknown_below(value, lambda each: id(each) in known):
            args = [known[id(arg)] for arg in one.args]
            data = (one.data[0], version) if one.op == "load" else one.data
            known[id(one)] = node(one.op, args, one.kind, data)
        return known[id(value)]

    def is_precomputable(self, symbol: Symbol) -> bool:
        """Whether a value depends on parameters alone, and needs more than a few sums and products."""
        return symbol.kind != "wide" and self._kinds.get(id(symbol)) == (True, True)

    def _know(self, symbol: Symbol) -> None:
        """Record whether a value depends on parameters alone, and whether it is costly, given this for its operands."""
        below = [self._kinds[id(arg)] for arg in symbol.args] if symbol.op != "phi" else [(False, False)]
        fixed = all(of for of, _ in below)
        costly = bool(below) and (symbol.op not in CHEAP or any(of for _, of in below))
        if not below:
            fixed = symbol.op == "constant" or (symbol.op == "load" and symbol.data[0] in self.fixed)
        self._kinds[id(symbol)] = fixed, costly


def _calls(block: Block) -> list[Function]:
    found = [each.data.function for each in block if each.op == "call"]
    return found + [function for each in block for inner in each.blocks for function in _calls(inner)]


class _Body:
    """Makes the body of one function that reads precomputed values."""

    def __init__(self, whole: _Precomputing, function: Function) -> None:
        self.whole = whole
        self._after_taking = function not in (whole.program.initialise, whole.program.do_step)
        self._known: dict[int, Symbol] = {}
        self._loops: dict[Statement, Statement] = {}

    def block(self, block: Block) -> Block:
        """The rewritten statements of a block."""
        return tuple(self._made(each) for each in block)

    def _made(self, each: Statement) -> Statement:
        if each.op == "call":
            call: Call = each.data
            made = statement(
                "call", [self.value(s) for s in each.symbols], Call(self.whole.function(call.function), call.memory)
            )
            self.whole.versions[call.memory, made] = self.whole.program.versions[call.memory, each]
            return made
        blocks = tuple(self.block(inner) for inner in each.blocks)
        made = statement(each.op, [self.value(s) for s in each.symbols], each.data, blocks)
        if each.op == "loop":
            self._loops[each] = made
        return made

    def value(self, symbol: Symbol) -> Symbol:
        """The symbol of the rewritten function."""
        for one in unknown_below(symbol, self._is_known):
            self._known[id(one)] = node(one.op, [self._known[id(arg)] for arg in one.args], one.kind, one.data)
        return self._known[id(symbol)]

    def _is_known(self, symbol: Symbol) -> bool:
        if id(symbol) not in self._known and (found := self._at_once(symbol)) is not None:
            self._known[id(symbol)] = found
        return id(symbol) in self._known

    def _at_once(self, symbol: Symbol) -> Symbol | None:
        if symbol.op == "outcome":
            k, loop = symbol.data
            made = self._loops[loop] if loop in self._loops else self._made(loop)  # in a later branch
            return node("outcome", (), symbol.kind, (k, made))
        if not symbol.args:
            return symbol
        if self._after_taking and self.whole.is_precomputable(symbol):
            return node("load", (), symbol.kind, (self.whole.place_of(self.whole.as_read(symbol, 0)).name, 0))
        return None
