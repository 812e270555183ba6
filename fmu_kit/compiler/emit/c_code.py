"""A program as C: one function for each method, with the names of the Python."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from typing import ClassVar

from fmu_kit.compiler.trace.statements import (
    TANGENT,
    Block,
    Call,
    Function,
    Place,
    Statement,
    all_statements,
    ends,
    used_symbols,
)
from fmu_kit.compiler.trace.symbols import Kind, Symbol, TraceError, closure, integer_of, node, value_of
from fmu_kit.compiler.trace.tracing import Program

_BINARY = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_CALLED = {
    **{name: f"q_{name}" for name in (
        "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh", "exp", "expm1", "log", "pow",
        "floor", "ceil", "copysign", "isfinite", "isinf", "isnan",
    )},
    "abs": "q_fabs",
    "mod": "q_modulo",
    "floordiv": "q_floor_divide",
}  # fmt: skip
_OF_BITS = ("bit_and", "bit_or", "bit_xor")
_SIGNED_ZEROS = ("neg", "mul", "mod", "floordiv", "floor", "ceil")
"""Operations on real numbers that may give a signed zero."""
_WIDE_COMPARED = {
    "lt": ("less", False, False),
    "ge": ("less", False, True),
    "gt": ("less", True, False),
    "le": ("less", True, True),
    "eq": ("equal", False, False),
    "ne": ("equal", False, True),
}
"""Comparisons of wide numbers: the function, whether its operands are swapped, whether its result is negated"""
_LONGEST_PART = 60
"""length of an expression within another, in characters"""
_FORMATS = {"g": "general", "e": "exponential", "f": "fixed"}
ERRORS = ("FmuError", "DivergenceError", "ZeroDivisionError", "OverflowError", "ValueError")
"""The errors of a function; it returns their position here, from 1 on."""


def c_code(program: Program) -> str:
    """The functions of a program in C, each after those that it calls."""
    names = place_names(program.places)
    return "\n\n".join(FunctionWriter(function, program, names).text() for function in program.functions) + "\n"


def place_names(places: Iterable[Place]) -> dict[str, str]:
    """The name in C of each place."""
    found: dict[str, str] = {}
    for place in places:
        kept = f"KEPT_{identifier(place.name.removeprefix('self')).strip('_')}"
        name = (kept if place.reference is None else f"AT_{identifier(place.name)}").upper()
        found[place.name] = _unused(name, found.values())
    return found


class FunctionWriter:
    """Writes one function for an FMU, whose memory is an array and whose messages contain numbers."""

    def __init__(self, function: Function, program: Program, places: dict[str, str]) -> None:
        self.function = function
        self.program = program
        self.places = places
        self.declared: list[str] = []
        self.pinned: dict[int, str] = {}
        self.scopes: list[dict[int, str]] = [{}]
        self.lines: list[list[str]] = [[]]
        self.count = 0
        self.parameters: list[str] = []
        for name in function.names:
            self.parameters.append(_unused(f"p_{identifier(name)}", self.parameters))
        self.used = used_symbols(all_statements(function.body), self._named)
        self.uses = Counter(id(arg) for symbol in self.used.values() for arg in symbol.args)
        self.uses.update(id(symbol) for each in all_statements(function.body) for symbol in self._named(each))
        self.definitions: dict[int, set[tuple[str, int]]] = {}

    def text(self) -> str:
        """The function in C."""
        f = self.function
        for symbol, name in zip(f.parameters, self.parameters):
            self.scopes[0][id(symbol)] = name
        for symbol in self.used.values():
            if symbol.op == "load" and symbol.data[1] == 0:
                self.scopes[0][id(symbol)] = self._define(symbol, self._load(symbol))
        self._block(f.body)
        if not ends(f.body):
            self._line(self.through)
        parameters = [f"{c_type(symbol)} {name}" for symbol, name in zip(f.parameters, self.parameters)]
        parameters += ["q_real *out"] if f.results else []
        head = f"static {self.type} {c_name(f.name)}({', '.join([*self.first, *parameters])})\n{{\n"
        doc = f"/* {f.doc.replace('*/', '* /')} */\n" if f.doc else ""
        before = self._memory()
        unused = [name for symbol, name in zip(f.parameters, self.parameters) if id(symbol) not in self.used]
        before.append(", ".join(f"(void){name}" for name in (*self.always, *unused)) + ";")
        return doc + head + "\n".join([*(f"    {line}" for line in (*before, *self.declared)), *self.lines[0]]) + "\n}"

    type: ClassVar = "int"
    """type of the returned status: 0, or the number of an error"""
    first: ClassVar[tuple[str, ...]] = ("Instance *m",)
    """its first parameters"""
    through: str = "return 0;"
    """the statement at its end"""

    # -- used symbols ----------------------------------------------------------------------------------------

    def _named(self, each: Statement) -> tuple[Symbol, ...]:
        """The symbols that a statement uses directly, as far as it is written."""
        return each.symbols

    def _named_in(self, block: Block) -> list[Symbol]:
        found: list[Symbol] = []
        for each in block:
            found += self._named(each)
            for inner in each.blocks:
                found += self._named_in(inner)
        return found

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

    def _load(self, symbol: Symbol) -> str:
        value = self._place(symbol.data[0])
        return f"q_ne({value}, 0.0)" if symbol.kind == "bool" else value

    # -- lines and names -------------------------------------------------------------------------------------

    def _line(self, text: str) -> None:
        self.lines[-1].append("    " * len(self.scopes) + text)

    def _name(self, prefix: str = "x") -> str:
        self.count += 1
        return f"{prefix}{self.count}"

    def _define(self, symbol: Symbol, expression: str) -> str:
        name = self._name()
        self._line(f"const {c_type(symbol)} {name} = {expression};")
        return name

    def _pin(self, symbol: Symbol) -> str:
        """The variable of a symbol that statements assign; it is declared at the start of the function."""
        if id(symbol) not in self.pinned:
            name = self.pinned[id(symbol)] = self._name("y")
            unknown = "q_known(0)" if symbol.kind == "bool" else self.zero
            self.declared.append(f"{c_type(symbol)} {name} = {unknown};")
        return self.pinned[id(symbol)]

    # -- values ----------------------------------------------------------------------------------------------

    def value(self, symbol: Symbol) -> str:
        """The name of a value; it is computed here unless it is known."""
        for scope in reversed(self.scopes):
            if id(symbol) in scope:
                return scope[id(symbol)]
        if id(symbol) in self.pinned:
            return self.pinned[id(symbol)]
        if symbol.op == "constant":
            return _constant(symbol)
        if symbol.op in ("load", "result", "failed", "phi", "outcome", "variable", "index", "parameter"):
            if symbol.op in ("load", "result", "failed", "phi", "outcome"):
                return self._pin(symbol)
            raise TraceError(f"{self.function.name}: {symbol.op} {symbol.data} is used outside of its loop")
        for waiting in _unknown_below(symbol, self._is_known):
            text = self._expression(waiting)
            is_part = waiting is not symbol and self.uses[id(waiting)] == 1 and waiting.kind == "real"
            if is_part and len(text) <= _LONGEST_PART:
                self.scopes[-1][id(waiting)] = f"({text})"
            else:
                self.scopes[-1][id(waiting)] = self._define(waiting, text)
        return self.scopes[-1][id(symbol)]

    def _is_known(self, symbol: Symbol) -> bool:
        return not symbol.args or symbol.op == "phi" or any(id(symbol) in scope for scope in self.scopes)

    def _real(self, symbol: Symbol) -> str:
        if symbol.kind == "bool" and symbol.op == "constant":
            return self._everywhere(f"{value_of(symbol)!r}")
        name = self.value(symbol)
        return f"q_select({name}, {self._everywhere('1.0')}, {self.zero})" if symbol.kind == "bool" else name

    def _lanes(self, symbol: Symbol) -> str:
        """A value as an argument of a function; constants are broadcast to all lanes."""
        text = self._real(symbol)
        is_number = symbol.op == "constant" and symbol.kind != "bool" and text.strip("(-")[0].isdigit()
        return self._everywhere(text) if is_number else text

    zero: ClassVar[str] = "0.0"

    def _everywhere(self, number: str) -> str:
        """A constant in the type of a variable."""
        return number

    def _as(self, kind: Kind, symbol: Symbol) -> str:
        """A value converted to a kind."""
        return self.value(symbol) if kind == "bool" else self._lanes(symbol)

    def _expression(self, symbol: Symbol) -> str:
        op, args = symbol.op, symbol.args
        if op in _OF_BITS or any(each.kind == "wide" for each in (symbol, *args)):
            return self._of_wide(symbol)
        if symbol.kind == "int" and op in _SIGNED_ZEROS:
            return f"({self._of_reals(symbol)}) + 0.0"  # a whole number has no zero with a sign
        return self._of_reals(symbol)

    def _of_wide(self, symbol: Symbol) -> str:
        """An operation with operands or result that are whole numbers of more bits than a real number has."""
        op, given = symbol.op, [self._wide(arg) for arg in symbol.args]
        if op in ("narrow", "beyond"):
            return f"{'q_narrow' if op == 'narrow' else 'q_wide_beyond'}({given[0]})"
        if op in _WIDE_COMPARED:
            name, turned, negated = _WIDE_COMPARED[op]
            text = f"q_wide_compared(q_int128_{name}, {', '.join(given[::-1] if turned else given)})"
            return f"q_not({text})" if negated else text
        text = f"q_wide_{len(given)}(q_int128_{op}, {', '.join(given)})"
        return text if symbol.kind == "wide" else f"q_narrow({text})"

    def _wide(self, symbol: Symbol) -> str:
        """A whole number in its wide form."""
        if symbol.op == "constant":
            high, low = divmod(integer_of(symbol) % 2**128, 2**64)
            return f"q_wide_known({high:#x}u, {low:#x}u)"
        return self.value(symbol) if symbol.kind == "wide" else f"q_wide_of({self._lanes(symbol)})"

    def _of_reals(self, symbol: Symbol) -> str:
        op, args = symbol.op, symbol.args
        if op in _BINARY:
            first = self._lanes(args[0]) if args[1].op == "constant" else self._real(args[0])
            return f"{first} {_BINARY[op]} {self._real(args[1])}"
        if op in ("lt", "le", "gt", "ge", "eq", "ne"):
            return f"q_{op}({self._real(args[0])}, {self._real(args[1])})"
        if op == "neg":
            return f"-{self._real(args[0])}"
        if op in ("and", "or"):
            return f"{self.value(args[0])} {'&' if op == 'and' else '|'} {self.value(args[1])}"
        if op == "not":
            return f"q_not({self.value(args[0])})"
        if op == "select":
            if symbol.kind == "bool":
                c, a, b = map(self.value, args)
                return f"({c} & {a}) | (q_not({c}) & {b})"
            return f"q_select({self.value(args[0])}, {self._lanes(args[1])}, {self._lanes(args[2])})"
        if op in ("sin", "cos") and id(self._other_of_the_pair(symbol)) in self.used:
            return f"{self._pair(args[0])}.{op}"
        if op in _CALLED:
            return f"{_CALLED[op]}({', '.join(map(self._lanes, args))})"
        raise TraceError(f"{op} of computed values cannot be written in C")

    @staticmethod
    def _other_of_the_pair(symbol: Symbol) -> Symbol:
        """The cosine for a sine, the sine for a cosine."""
        return node("cos" if symbol.op == "sin" else "sin", symbol.args, "real")

    def _pair(self, angle: Symbol) -> str:
        """The name of sine and cosine of an angle, computed together."""
        both = node("sin and cos", (angle,), "real")
        for scope in self.scopes:
            if id(both) in scope:
                return scope[id(both)]
        name = self.scopes[-1][id(both)] = self._name("p")
        self._line(f"const q_sines {name} = q_sin_cos({self._lanes(angle)});")
        return name

    # -- statements ------------------------------------------------------------------------------------------

    def _block(self, block: Block) -> None:
        for i, each in enumerate(block):
            getattr(self, f"_{each.op}")(each, block[i + 1 :])

    def _if(self, each: Statement, rest: Block) -> None:
        (condition,), (then, otherwise) = each.symbols, each.blocks
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

    def _assign(self, each: Statement, rest: Block) -> None:
        target, value = each.symbols
        if id(target) in self.used:
            self._set(target, self._as(target.kind, value))

    def _set(self, symbol: Symbol, value: str) -> None:
        """Assign a value to a symbol."""
        self._line(f"{self._pin(symbol)} = {value};")

    def _store(self, each: Statement, rest: Block) -> None:
        self._line(f"{self._place(each.data)} = {self._lanes(each.symbols[0])};")

    def _return(self, each: Statement, rest: Block) -> None:
        for k, symbol in enumerate(each.symbols):
            self._line(f"out[{k}] = {self._lanes(symbol)};")
        self._line("return 0;")

    def _call(self, each: Statement, rest: Block) -> None:
        call: Call = each.data
        given = [self._as(p.kind, symbol) for symbol, p in zip(each.symbols, call.function.parameters)]
        results = [self._name("r")] if call.function.results else []
        self.declared += [f"q_real {name}[{call.function.results}] = {{{self.zero}}};" for name in results]
        status = self._name("status")
        self._called(each, [*given, *results], status)
        for symbol in self._values_after(each):
            if symbol.op == "failed":
                self._set(symbol, self._has_failed(status, 1 + ERRORS.index(symbol.data[0])))
            elif symbol.op == "result":
                name = f"{results[0]}[{symbol.data[0]}]"
                self._set(symbol, f"q_ne({name}, 0.0)" if symbol.kind == "bool" else name)
            else:
                self._set(symbol, self._load(symbol))

    def _called(self, each: Statement, given: list[str], status: str) -> None:
        """Call a function; return its error unless the caller handles it."""
        callee = each.data.function
        text = f"{c_name(callee.name)}({', '.join(['m', *given])})"
        self._line(f"const int {status} = {text};" if callee.raises else f"{text};")
        if callee.raises and not self._is_caught(each):
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

    def _loop(self, each: Statement, rest: Block) -> None:
        depth, (body,) = each.data, each.blocks
        size = (len(each.symbols) - 1) // 2
        count, starts, nexts = each.symbols[0], each.symbols[1 : 1 + size], each.symbols[1 + size :]
        needed = closure([*self._named_in(body), *nexts])
        self._compute_unless_defined_in(needed, body, needed)
        states = []
        for start in starts:
            states.append(self._name("s"))
            self._line(f"{c_type(start)} {states[-1]} = {self._as(start.kind, start)};")
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
            if symbol.op != "outcome" or symbol.data[1] is not each:
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
        for state, name in zip(states, [self._as(symbol.kind, symbol) for symbol in nexts]):
            self._line(f"{state} = {name};")

    def _warn(self, each: Statement, rest: Block) -> None:
        key, words = each.data
        bit = self.program.warnings.index(key)
        self._line(f"if (!(m->state.warned & {1 << bit}u)) {{")
        self.scopes.append({})
        self._line(f"m->state.warned |= {1 << bit}u;")
        self._text(each, words)
        self._line("warn(m);")
        self.scopes.pop()
        self._line("}")

    def _raise(self, each: Statement, rest: Block) -> None:
        kind, words = each.data
        if words == (("failure",),):
            self._line(f"return {1 + ERRORS.index(kind)};")
            return
        self._text(each, words)
        self._line(f"return fail(m, {1 + ERRORS.index(kind)}); /* {kind} */")

    def _text(self, each: Statement, words: tuple[str | tuple[str], ...]) -> None:
        values = iter(each.symbols)
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


def identifier(name: str) -> str:
    """A name of ASCII letters, digits and underscores."""
    return "".join(c if c.isascii() else f"u{ord(c):04x}" for c in re.sub(r"\W+", "_", name))


def _unused(name: str, used: Iterable[str]) -> str:
    """A name, with underscores appended if it is already used."""
    taken = set(used)
    while name in taken:
        name += "_"
    return name


def c_name(name: str) -> str:
    """The name of a function of the model in C, with a prefix that avoids conflicts."""
    of = name.removeprefix(TANGENT)
    return f"{'model' if of == name else 'tangents'}_{identifier(of)}"


KEYWORDS = frozenset({
    "auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "float", "goto", "inline", "int",
    "long", "register", "restrict", "short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union",
    "unsigned", "void", "volatile",
    "asm", "bool", "catch", "delete", "explicit", "export", "false", "friend", "mutable", "namespace", "new",
    "operator", "private", "protected", "public", "template", "this", "throw", "true", "typename", "using", "virtual",
    "linux", "unix", "I", "NAN", "INFINITY", "NULL",
})  # fmt: skip
"""Keywords of C and C++ that are not keywords of Python, and names defined by headers and compilers."""


def c_string(text: str) -> str:
    """A text as a string literal of C."""
    escaped = "".join(
        c if 32 <= ord(c) < 127 and c not in '"\\?' else "".join(f"\\{byte:03o}" for byte in c.encode()) for c in text
    )
    return f'"{escaped}"'


def c_type(symbol: Symbol) -> str:
    """The type of a value in C."""
    return {"bool": "q_mask", "wide": "q_wide"}.get(symbol.kind, "q_real")


def _constant(symbol: Symbol) -> str:
    value = value_of(symbol)
    if symbol.kind == "bool":
        return f"q_known({int(value)})"
    if math.isnan(value):
        return "Q_NAN"
    if math.isinf(value):
        return "Q_INFINITY" if value > 0.0 else "(-Q_INFINITY)"
    return f"({value!r})" if value < 0 or repr(value).startswith("-") else repr(value)


def _definition_of(symbol: Symbol) -> tuple[str, int] | None:
    """The statement that defines a symbol, if any."""
    if symbol.op == "phi":
        return "choice", id(symbol)
    if symbol.op == "outcome":
        return "loop", id(symbol.data[1])
    if symbol.op in ("load", "result", "failed"):
        return "call", symbol.data[1]
    return None


def _unknown_below(symbol: Symbol, is_known: object) -> list[Symbol]:
    """The unknown symbols that must be computed for a symbol, in order."""
    found: dict[int, Symbol] = {}
    stack: list[tuple[Symbol, bool]] = [(symbol, False)]
    while stack:
        one, visited = stack.pop()
        if visited:
            found[id(one)] = one
        elif id(one) not in found and not is_known(one):  # type: ignore[operator]
            stack.append((one, True))
            stack += [(arg, False) for arg in reversed(one.args)]
    return list(found.values())
