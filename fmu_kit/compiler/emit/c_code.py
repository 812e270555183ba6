"""A program as C: one function for each method, with the names of the Python."""

from __future__ import annotations

import itertools
from collections.abc import Container, Mapping
from typing import ClassVar

from fmu_kit.compiler.emit.c_expressions import ExpressionWriter
from fmu_kit.compiler.emit.c_names import c_name, c_string, c_type, identifier, place_names, unused_name
from fmu_kit.compiler.trace.statements import (
    TANGENT,
    Block,
    Call,
    Function,
    Statement,
    all_statements,
    ends,
    used_symbols,
)
from fmu_kit.compiler.trace.symbols import Symbol, closure
from fmu_kit.compiler.trace.tracing import Program

_FORMATS = {"g": "general", "e": "exponential", "f": "fixed"}
ERRORS = ("FmuError", "DivergenceError", "ZeroDivisionError", "OverflowError", "ValueError")
"""The errors of a function; it returns their position here, from 1 on."""


def c_code(program: Program) -> str:
    """The functions of a program in C, each after those that it calls."""
    names = place_names(program.places)
    return "\n\n".join(FunctionWriter(function, program, names).text() for function in program.functions) + "\n"


class FunctionWriter(ExpressionWriter):
    """Writes one function for an FMU, whose memory is an array and whose messages contain numbers."""

    def __init__(self, function: Function, program: Program, places: dict[str, str]) -> None:
        self.function = function
        super().__init__(function.name, used_symbols(all_statements(function.body), self._named))
        self.uses.update(id(symbol) for each in all_statements(function.body) for symbol in self._named(each))
        self.program = program
        self.places = places
        self.parameters: list[str] = []
        for name in function.names:
            self.parameters.append(unused_name(f"p_{identifier(name)}", self.parameters))
        self.definitions: dict[int, set[tuple[str, int]]] = {}

    def text(self) -> str:
        """The function in C."""
        f = self.function
        for symbol, name in zip(f.parameters, self.parameters):
            self.scopes[0][id(symbol)] = name
        self._load_places()
        self._block(f.body)
        if not ends(f.body):
            self._line(self.through)
        head = f"static {self.type} {c_name(f.name)}({', '.join([*self.first, *self._parameters()])})\n{{\n"
        doc = f"/* {f.doc.replace('*/', '* /')} */\n" if f.doc else ""
        before = self._memory()
        before.append(", ".join(f"(void){name}" for name in (*self.always, *self._unused_parameters())) + ";")
        return doc + head + "\n".join([*(f"    {line}" for line in (*before, *self.declared)), *self.lines[0]]) + "\n}"

    type: ClassVar = "int"
    """type of the returned status: 0, or the number of an error"""
    first: ClassVar[tuple[str, ...]] = ("Instance *m",)
    """its first parameters"""
    through: str = "return 0;"
    """the statement at its end"""

    # -- used symbols ----------------------------------------------------------------------------------------

    def _named(self, statement: Statement) -> tuple[Symbol, ...]:
        """The symbols that a statement uses directly, as far as it is written."""
        return statement.symbols

    def _named_in(self, block: Block) -> list[Symbol]:
        found: list[Symbol] = []
        for each in block:
            found += self._named(each)
            for inner in each.blocks:
                found += self._named_in(inner)
        return found

    def _parameters(self) -> list[str]:
        """The declarations of its parameters after the first ones."""
        parameters = [f"{c_type(symbol)} {name}" for symbol, name in zip(self.function.parameters, self.parameters)]
        return [*parameters, "q_real *out"] if self.function.results else parameters

    def _unused_parameters(self) -> list[str]:
        return [name for symbol, name in zip(self.function.parameters, self.parameters) if id(symbol) not in self.used]

    # -- memory ----------------------------------------------------------------------------------------------

    always: ClassVar[tuple[str, ...]] = ("v",)
    """variables that may be unused in a function"""

    def _memory(self) -> list[str]:
        """The declarations through which a function accesses its memory."""
        read = {symbol.data[0] for symbol in self.used.values() if symbol.op == "load"}
        tangents = any(name.startswith(TANGENT) for name in read | self.function.stores)
        return [
            "q_real *const v = m->state.memory;",
            *(["q_real *const d = m->tangents;", "(void)d;"] if tangents else []),
        ]

    def _place(self, name: str) -> str:
        of = name.removeprefix(TANGENT)
        return f"v[{self.places[of]}]" if of == name else f"d[{self.places[of]}]"

    def _load_places(self) -> None:
        """Write the values that places have at the beginning."""
        for symbol in self.used.values():
            if symbol.op == "load" and symbol.data[1] == 0:
                self._take_from_memory(symbol)

    def _take_from_memory(self, symbol: Symbol) -> None:
        self.scopes[-1][id(symbol)] = self._define(symbol, self._load(symbol))

    def _load(self, symbol: Symbol) -> str:
        value = self._place(symbol.data[0])
        return f"q_ne({value}, 0.0)" if symbol.kind == "bool" else value

    # -- statements ------------------------------------------------------------------------------------------

    def _block(self, block: Block) -> None:
        for i, each in enumerate(block):
            getattr(self, f"_{each.op}")(each, block[i + 1 :])

    def _if(self, statement: Statement, rest: Block) -> None:
        (condition,), (then, otherwise) = statement.symbols, statement.blocks
        name = self.value(condition)
        if not ends(then):
            self._hoist(then, otherwise, rest)
        self._line(f"if ({name}) {{")
        self._inner(then)
        if otherwise:
            self._line("} else {")
            self._inner(otherwise)
        self._line("}")

    def _hoist(self, then: Block, otherwise: Block, rest: Block) -> None:
        """Compute before a branch what is needed in both of its blocks, or in one and after it."""
        a, b, after = (closure(self._named_in(block)) for block in (then, otherwise, rest))
        several = {key for key in {**a, **b} if (key in a) + (key in b) + (key in after) > 1}
        self._compute_unless_defined_in({**a, **b}, (*then, *otherwise), several)

    def _compute_unless_defined_in(self, needed: Mapping[int, Symbol], block: Block, chosen: Container[int]) -> None:
        """Compute now the symbols that do not depend on assignments in a block, or in a later loop.

        `needed`: the symbols, each after its operands; only those that are `chosen` are computed.
        """
        defined, waiting = self._definitions_in(block), set[int]()
        for key, symbol in needed.items():
            operands = () if symbol.op == "phi" else symbol.args
            is_later = self._is_of_later_loop(symbol) or _definition_of(symbol) in defined
            if is_later or any(id(operand) in waiting for operand in operands):
                waiting.add(key)
            elif key in chosen and symbol.args and not self._is_known(symbol):
                self.value(symbol)

    def _is_of_later_loop(self, symbol: Symbol) -> bool:
        return symbol.op in ("index", "variable") and not any(id(symbol) in scope for scope in self.scopes)

    def _definitions_in(self, block: Block) -> set[tuple[str, int]]:
        """The definitions in a block, in the form of `_definition_of`."""
        found: set[tuple[str, int]] = set()
        for each in block:
            if id(each) not in self.definitions:
                inner = self._definitions_in(tuple(itertools.chain(*each.blocks)))
                inner.add(("loop", id(each)))
                if each.op == "assign":
                    inner.add(("choice", id(each.symbols[0])))
                if each.op == "call":
                    inner.add(("call", self.program.versions[each.data.memory, each]))
                self.definitions[id(each)] = inner
            found |= self.definitions[id(each)]
        return found

    def _inner(self, block: Block) -> None:
        self.scopes.append({})
        self._block(block)
        self.scopes.pop()

    def _assign(self, statement: Statement, rest: Block) -> None:
        target, value = statement.symbols
        if id(target) in self.used:
            self._set(target, self._as_kind(target.kind, value))

    def _set(self, symbol: Symbol, value: str) -> None:
        """Assign a value to a symbol."""
        self._line(f"{self._pin(symbol)} = {value};")

    def _store(self, statement: Statement, rest: Block) -> None:
        self._line(f"{self._place(statement.data)} = {self._as_argument(statement.symbols[0])};")

    def _return(self, statement: Statement, rest: Block) -> None:
        for k, symbol in enumerate(statement.symbols):
            self._line(f"out[{k}] = {self._as_argument(symbol)};")
        self._line("return 0;")

    def _call(self, statement: Statement, rest: Block) -> None:
        call: Call = statement.data
        given = [self._as_kind(p.kind, symbol) for symbol, p in zip(statement.symbols, call.function.parameters)]
        results = [self._name("r")] if call.function.results else []
        self.declared += [f"q_real {name}[{call.function.results}] = {{{self.zero}}};" for name in results]
        status = self._name("status")
        self._called(statement, [*given, *results], status)
        for symbol in self._values_after(statement):
            if symbol.op == "failed":
                self._set(symbol, self._has_failed(status, 1 + ERRORS.index(symbol.data[0])))
            elif symbol.op == "result":
                name = f"{results[0]}[{symbol.data[0]}]"
                self._set(symbol, f"q_ne({name}, 0.0)" if symbol.kind == "bool" else name)
            else:
                self._set(symbol, self._load(symbol))

    def _called(self, statement: Statement, given: list[str], status: str) -> None:
        """Call a function; return its error unless the caller handles it."""
        callee = statement.data.function
        text = f"{c_name(callee.name)}({', '.join(['m', *given])})"
        self._line(f"const int {status} = {text};" if callee.raises else f"{text};")
        if callee.raises and not self._is_caught(statement):
            self._line(f"if ({status}) return {status};")

    def _has_failed(self, status: str, number: int) -> str:
        return f"{status} == {number}"

    def _values_after(self, call: Statement) -> list[Symbol]:
        """The used symbols that a call defines: its results, its errors, and the memory that it has changed."""
        version = self.program.versions[call.data.memory, call]
        mine = {s.data: s for s in self.used.values() if s.op in ("result", "failed", "load") and s.data[1] == version}
        return list(mine.values())

    def _is_caught(self, call: Statement) -> bool:
        return any(symbol.op == "failed" for symbol in self._values_after(call))

    def _loop(self, statement: Statement, rest: Block) -> None:
        depth, (body,) = statement.data, statement.blocks
        size = (len(statement.symbols) - 1) // 2
        count, starts, nexts = statement.symbols[0], statement.symbols[1 : 1 + size], statement.symbols[1 + size :]
        needed = closure([*self._named_in(body), *nexts])
        self._compute_unless_defined_in(needed, body, needed)
        states = []
        for start in starts:
            states.append(self._name("s"))
            self._line(f"{c_type(start)} {states[-1]} = {self._as_kind(start.kind, start)};")
        last, index = self.value(count), self._name("i")
        self._line(f"for (q_real {index} = {self.zero}; {self._goes_on(index, last)}; {index} = {index} + 1.0) {{")
        self.scopes.append({})
        for symbol in needed.values():
            if symbol.op == "index" and symbol.data == depth:
                self.scopes[-1][id(symbol)] = index
            elif symbol.op == "variable" and symbol.data[0] == depth:
                self.scopes[-1][id(symbol)] = self._define(symbol, states[symbol.data[1]])
        self._round(body, states, nexts)
        self.scopes.pop()
        self._line("}")
        for symbol in self.used.values():
            if symbol.op != "outcome" or symbol.data[1] is not statement:
                continue
            if len(self.scopes) > 1:  # it may be in several branches, and used after them
                self._set(symbol, states[symbol.data[0]])
            else:
                self.scopes[-1][id(symbol)] = states[symbol.data[0]]

    def _goes_on(self, index: str, last: str) -> str:
        """The condition of a loop."""
        return f"{index} < {last}"

    def _round(self, body: Block, states: list[str], nexts: tuple[Symbol, ...]) -> None:
        """One round of a loop."""
        self._block(body)
        for state, name in zip(states, [self._as_kind(symbol.kind, symbol) for symbol in nexts]):
            self._line(f"{state} = {name};")

    def _warn(self, statement: Statement, rest: Block) -> None:
        key, words = statement.data
        bit = self.program.warnings.index(key)
        self._line(f"if (!(m->state.warned & {1 << bit}u)) {{")
        self.scopes.append({})
        self._line(f"m->state.warned |= {1 << bit}u;")
        self._text(statement, words)
        self._line("warn(m);")
        self.scopes.pop()
        self._line("}")

    def _raise(self, statement: Statement, rest: Block) -> None:
        kind, words = statement.data
        if words == (("failure",),):
            self._line(f"return {1 + ERRORS.index(kind)};")
            return
        self._text(statement, words)
        self._line(f"return fail(m, {1 + ERRORS.index(kind)}); /* {kind} */")

    def _text(self, statement: Statement, words: tuple[str | tuple[str], ...]) -> None:
        values = iter(statement.symbols)
        self._line("text_begin(m);")
        for word in words:
            if isinstance(word, str):
                self._line(f"text_add(m, {c_string(word)});")
                continue
            symbol, (spec,) = next(values), word
            if spec == "failure":
                self._line("text_add(m, m->failure);")
            elif symbol.kind == "bool":
                self._line(f'text_add(m, {self.value(symbol)} ? "True" : "False");')
            elif symbol.kind == "int":
                self._line(f"text_integer(m, {self.value(symbol)});")
            elif spec == "":
                self._line(f"text_real(m, {self.value(symbol)});")
            else:
                precision = spec[1:-1] or "6"
                self._line(f"q_text_{_FORMATS[spec[-1]]}(&m->text, {self.value(symbol)}, {precision});")


def _definition_of(symbol: Symbol) -> tuple[str, int] | None:
    """The statement that defines a symbol, if any."""
    if symbol.op == "phi":
        return "choice", id(symbol)
    if symbol.op == "outcome":
        return "loop", id(symbol.data[1])
    if symbol.op in ("load", "result", "failed"):
        return "call", symbol.data[1]
    return None
