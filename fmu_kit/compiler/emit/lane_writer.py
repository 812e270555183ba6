"""Writes functions as C for several SIMD lanes, one run in each: branches become masks over lanes.

A function gets the lanes in which it is executed, and returns those in which it succeeded; of a lane that fails it
stores the number of the error. Nothing is logged: messages are for instances.
"""

from __future__ import annotations

import itertools
from typing import ClassVar

from fmu_kit.compiler.emit.c_code import ERRORS, FunctionWriter
from fmu_kit.compiler.emit.c_names import c_name
from fmu_kit.compiler.trace.statements import Block, Function, Statement, ends
from fmu_kit.compiler.trace.symbols import Symbol
from fmu_kit.compiler.trace.tracing import Program


class LaneWriter(FunctionWriter):
    """Writes one function in lanes.

    `masks` are the variables with the lanes in which the current blocks are executed, the innermost last.
    """

    always: ClassVar[tuple[str, ...]] = ("v", "failed")
    type: ClassVar = "q_mask"
    first: ClassVar[tuple[str, ...]] = ("q_place *v", "q_mask live", "q_real *failed")

    def __init__(self, function: Function, program: Program, places: dict[str, str]) -> None:
        super().__init__(function, program, places)
        self.masks = ["live"]
        self.returns_early = any(_returns(inner) for each in function.body for inner in each.blocks)
        self.through = "return done | live;" if self.returns_early else "return live;"
        if self.returns_early:
            self.declared.append("q_mask done = q_known(0);")

    def _memory(self) -> list[str]:
        return []

    def _named(self, statement: Statement) -> tuple[Symbol, ...]:
        return () if statement.op == "raise" or _is_silent((statement,)) else statement.symbols

    zero: ClassVar[str] = "q_all(0.0)"

    def _broadcast(self, number: str) -> str:
        return f"q_all({number.strip('()')})"

    # -- lanes -----------------------------------------------------------------------------------------------

    def _takes_out(self, block: Block) -> bool:
        """Whether lanes may leave a block early."""
        return any(
            each.op in ("raise", "return")
            or (each.op == "call" and bool(each.data.function.raises) and not self._is_caught(each))
            or any(map(self._takes_out, each.blocks))
            for each in block
        )

    def _set(self, symbol: Symbol, value: str) -> None:
        """Set a symbol; for the first time in all lanes, since it is read only in those of the current block."""
        first = id(symbol) not in self.pinned
        name = self._pin(symbol)
        self._line(f"{name} = {value if first else self._choice(symbol, value, name)};")

    def _choice(self, symbol: Symbol, value: str, otherwise: str) -> str:
        mask = self.masks[-1]
        if symbol.kind == "bool":
            return f"({mask} & {value}) | (q_not({mask}) & {otherwise})"
        return f"q_select({mask}, {value}, {otherwise})"

    # -- statements ------------------------------------------------------------------------------------------

    def _block(self, block: Block) -> None:
        done = 0
        while done < len(block):
            checks = list(itertools.takewhile(_is_check, block[done:]))
            if checks:
                self._check(checks)
            else:
                getattr(self, f"_{block[done].op}")(block[done], block[done + 1 :])
            done += max(len(checks), 1)

    def _check(self, checks: list[Statement]) -> None:
        """Write successive checks, under a test whether any of them fails."""
        mask = self.masks[-1]
        conditions: dict[str, Statement] = {}
        for each in checks:
            conditions.setdefault(self.value(each.symbols[0]), each)
        self._line(f"Q_IF_EVER(q_any({mask} & ({' | '.join(conditions)}))) {{")
        for condition, each in conditions.items():
            self.masks.append(self._name("m"))
            self._line(f"    const q_mask {self.masks[-1]} = {mask} & {condition};")
            self._inner(each.blocks[0])
            self.masks.pop()
            self._line(f"    {mask} = {mask} & q_not({condition});")
        self._line("}")

    def _if(self, statement: Statement, rest: Block) -> None:
        (condition,), (then, otherwise) = statement.symbols, statement.blocks
        if _is_silent(then) and _is_silent(otherwise):
            return
        holds, mask = self.value(condition), self.masks[-1]
        if not ends(then):
            self._hoist(then, otherwise, rest)
        branches = [(then, holds, f"q_not({holds})"), (otherwise, f"q_not({holds})", holds)]
        branches = [branch for branch in branches if not _is_silent(branch[0])]
        masks = [self._name("m") for _ in branches]
        for own, (_, condition_of_block, _) in zip(masks, branches):
            self._line(f"q_mask {own} = {mask} & {condition_of_block};")
        for own, (block, _, others) in zip(masks, branches):
            self._line(f"{'Q_IF_EVER' if block[-1].op == 'raise' else 'if '}(q_any({own})) {{")
            self.masks.append(own)
            self._inner(block)
            self.masks.pop()
            if self._takes_out(block):
                self._line(f"    {mask} = {mask} & {others if ends(block) else f'({others} | {own})'};")
            self._line("}")

    def _store(self, statement: Statement, rest: Block) -> None:
        place = self._place(statement.data)
        self._line(f"{place} = q_select({self.masks[-1]}, {self._as_argument(statement.symbols[0])}, {place});")

    def _return(self, statement: Statement, rest: Block) -> None:
        for k, symbol in enumerate(statement.symbols):
            value = self._as_argument(symbol)
            kept = f"q_select({self.masks[-1]}, {value}, out[{k}])" if self.returns_early else value
            self._line(f"out[{k}] = {kept};")
        if len(self.masks) == 1:
            self._line(self.through)
        else:
            self._line(f"done = done | {self.masks[-1]};")

    def _called(self, statement: Statement, given: list[str], status: str) -> None:
        callee, mask = statement.data.function, self.masks[-1]
        text = f"{c_name(callee.name)}({', '.join(['v', mask, 'failed', *given])})"
        if not callee.raises:
            self._line(f"{text};")
        elif self._is_caught(statement):
            self._line(f"const q_mask {status} = {mask} & q_not({text});")
        else:
            self._line(f"{mask} = {text};")

    def _has_failed(self, status: str, number: int) -> str:
        return f"{status} & q_eq(*failed, {number}.0)"

    def _goes_on(self, index: str, last: str) -> str:
        goes_on = self._name("m")
        self.declared.append(f"q_mask {goes_on};")
        condition = f"q_any({goes_on} = {self.masks[-1]} & q_lt({index}, {last}))"
        self.masks.append(goes_on)
        return condition

    def _round(self, body: Block, states: list[str], nexts: tuple[Symbol, ...]) -> None:
        goes_on, before = self.masks[-1], self._name("m")
        takes_out = self._takes_out(body)
        if takes_out:
            self._line(f"const q_mask {before} = {goes_on};")
        self._block(body)
        for state, symbol, value in zip(states, nexts, [self._as_kind(symbol.kind, symbol) for symbol in nexts]):
            self._line(f"{state} = {self._choice(symbol, value, state)};")
        self.masks.pop()
        if takes_out:
            self._line(f"{self.masks[-1]} = {self.masks[-1]} & (q_not({before}) | {goes_on});")

    def _warn(self, statement: Statement, rest: Block) -> None:
        pass

    def _raise(self, statement: Statement, rest: Block) -> None:
        kind, _ = statement.data
        mask = self.masks[-1]
        self._line(f"*failed = q_select({mask}, q_all({1 + ERRORS.index(kind)}.0), *failed); /* {kind} */")
        if len(self.masks) == 1:
            self._line(f"return {'done' if self.returns_early else 'q_known(0)'};")


def _returns(block: Block) -> bool:
    return any(each.op == "return" or any(map(_returns, each.blocks)) for each in block)


def _is_check(statement: Statement) -> bool:
    """Whether a statement only fails if a condition holds."""
    return (
        statement.op == "if"
        and not statement.blocks[1]
        and len(statement.blocks[0]) == 1
        and statement.blocks[0][0].op == "raise"
    )


def _is_silent(block: Block) -> bool:
    """Whether a block does nothing but log messages."""
    return all(each.op == "warn" or (each.op == "if" and all(map(_is_silent, each.blocks))) for each in block)
