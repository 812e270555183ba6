"""Expressions in C: the values of symbols, with names for those that are used more than once."""

from __future__ import annotations

import math
from collections import Counter
from typing import ClassVar

from fmu_kit.compiler.emit.c_names import c_type
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.symbols import Kind, Symbol, integer_of, node, unknown_below, value_of

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
_ASSIGNED = ("load", "result", "failed", "phi", "outcome")
"""Values that statements assign"""
_OF_LOOP = ("variable", "index", "parameter")
"""Values that exist in a loop alone"""
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


class ExpressionWriter:
    """Writes the values of one function: `lines` are those of the blocks in which it is, `scopes` the names there."""

    def __init__(self, name: str, used: dict[int, Symbol]) -> None:
        self.name = name
        self.used = used
        self.uses = Counter(id(arg) for symbol in used.values() for arg in symbol.args)
        self.declared: list[str] = []
        self.pinned: dict[int, str] = {}
        self.scopes: list[dict[int, str]] = [{}]
        self.lines: list[list[str]] = [[]]
        self.count = 0

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
        if symbol.op in _ASSIGNED:
            return self._pin(symbol)
        if symbol.op in _OF_LOOP:
            raise TraceError(f"{self.name}: {symbol.op} {symbol.data} is used outside of its loop")
        for waiting in unknown_below(symbol, self._is_known, lambda one: reversed(one.args)):
            text = self._expression(waiting)
            is_part = waiting is not symbol and self.uses[id(waiting)] == 1 and waiting.kind == "real"
            if is_part and len(text) <= _LONGEST_PART:
                self.scopes[-1][id(waiting)] = f"({text})"
            else:
                self.scopes[-1][id(waiting)] = self._define(waiting, text)
        return self.scopes[-1][id(symbol)]

    def _is_known(self, symbol: Symbol) -> bool:
        return not symbol.args or symbol.op == "phi" or any(id(symbol) in scope for scope in self.scopes)

    def _as_real(self, symbol: Symbol) -> str:
        if symbol.kind == "bool" and symbol.op == "constant":
            return self._broadcast(f"{value_of(symbol)!r}")
        name = self.value(symbol)
        return f"q_select({name}, {self._broadcast('1.0')}, {self.zero})" if symbol.kind == "bool" else name

    def _as_argument(self, symbol: Symbol) -> str:
        """A value as an argument of a function; constants are broadcast to all lanes."""
        text = self._as_real(symbol)
        is_number = symbol.op == "constant" and symbol.kind != "bool" and text.strip("(-")[0].isdigit()
        return self._broadcast(text) if is_number else text

    zero: ClassVar[str] = "0.0"

    def _broadcast(self, number: str) -> str:
        """A constant in the type of a variable."""
        return number

    def _as_kind(self, kind: Kind, symbol: Symbol) -> str:
        """A value converted to a kind."""
        return self.value(symbol) if kind == "bool" else self._as_argument(symbol)

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
        return self.value(symbol) if symbol.kind == "wide" else f"q_wide_of({self._as_argument(symbol)})"

    def _of_reals(self, symbol: Symbol) -> str:
        op, args = symbol.op, symbol.args
        if op in _BINARY:
            first = self._as_argument(args[0]) if args[1].op == "constant" else self._as_real(args[0])
            return f"{first} {_BINARY[op]} {self._as_real(args[1])}"
        if op in ("lt", "le", "gt", "ge", "eq", "ne"):
            return f"q_{op}({self._as_real(args[0])}, {self._as_real(args[1])})"
        if op == "neg":
            return f"-{self._as_real(args[0])}"
        if op in ("and", "or"):
            return f"{self.value(args[0])} {'&' if op == 'and' else '|'} {self.value(args[1])}"
        if op == "not":
            return f"q_not({self.value(args[0])})"
        if op == "select":
            if symbol.kind == "bool":
                c, a, b = map(self.value, args)
                return f"({c} & {a}) | (q_not({c}) & {b})"
            return f"q_select({self.value(args[0])}, {self._as_argument(args[1])}, {self._as_argument(args[2])})"
        if op in ("sin", "cos") and id(self._other_of_the_pair(symbol)) in self.used:
            return f"{self._pair(args[0])}.{op}"
        if op in _CALLED:
            return f"{_CALLED[op]}({', '.join(map(self._as_argument, args))})"
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
        self._line(f"const q_sines {name} = {self._sines(self._as_argument(angle))};")
        return name

    def _sines(self, angle: str) -> str:
        """The sine and cosine of an angle."""
        return f"q_sin_cos({angle})"


def _constant(symbol: Symbol) -> str:
    value = value_of(symbol)
    if symbol.kind == "bool":
        return f"q_known({int(value)})"
    if math.isnan(value):
        return "Q_NAN"
    if math.isinf(value):
        return "Q_INFINITY" if value > 0.0 else "(-Q_INFINITY)"
    return f"({value!r})" if value < 0 or repr(value).startswith("-") else repr(value)
