"""Symbols: the numbers with which a slave computes while it is traced, nodes of a graph of operations.

Nodes are interned: the same operation on the same operands is the same object, so that nothing is computed twice and
two paths through the code can be compared. No operation is reordered or simplified: each is the operation of Python
floats, so that C gives the same bits.
"""

from __future__ import annotations

import math
import operator
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from ctypes import c_float
from typing import Any, Literal, NamedTuple

from fmu_kit.compiler.trace import integers
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.texts import marker
from fmu_kit.errors import FmuError

Kind = Literal["real", "int", "wide", "bool"]
"""A whole number is `int` where C can store it as a real number, and `wide` within an expression, where it is larger"""


class Symbol:
    """A number that is not known until the FMU runs."""

    __slots__ = ("args", "data", "kind", "op")

    def __init__(self, op: str, args: tuple[Symbol, ...], kind: Kind, data: Any) -> None:
        self.op = op
        self.args = args
        self.kind = kind
        self.data = data

    # -- arithmetic: as Python floats do it ----------------------------------------------------------------

    def __add__(self, other: Any) -> Any:
        return _arithmetic("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return _arithmetic("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return _arithmetic("sub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return _arithmetic("sub", other, self)

    def __mul__(self, other: Any) -> Any:
        return _arithmetic("mul", self, other)

    def __rmul__(self, other: Any) -> Any:
        return _arithmetic("mul", other, self)

    def __truediv__(self, other: Any) -> Any:
        return _checked("div", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _checked("div", other, self)

    def __floordiv__(self, other: Any) -> Any:
        return _checked("floordiv", self, other)

    def __rfloordiv__(self, other: Any) -> Any:
        return _checked("floordiv", other, self)

    def __mod__(self, other: Any) -> Any:
        return _checked("mod", self, other)

    def __rmod__(self, other: Any) -> Any:
        return _checked("mod", other, self)

    def __pow__(self, other: Any) -> Any:
        return _checked("pow", self, other)

    def __rpow__(self, other: Any) -> Any:
        return _checked("pow", other, self)

    def __neg__(self) -> Symbol:
        return node("neg", (self,), "real") if self.kind == "real" else whole_number("neg", self)

    def __pos__(self) -> Symbol:
        return self

    def __abs__(self) -> Symbol:
        return node("abs", (self,), "real") if self.kind == "real" else whole_number("abs", self)

    def __lshift__(self, bits: Any) -> Any:
        return whole_number("mul", self, 1 << _known_bits(self, bits))

    def __rshift__(self, bits: Any) -> Any:
        return whole_number("floordiv", self, 1 << _known_bits(self, bits))

    def __rlshift__(self, other: Any) -> Any:
        return other << _known_bits(other, self)

    def __rrshift__(self, other: Any) -> Any:
        return other >> _known_bits(other, self)

    def __xor__(self, other: Any) -> Any:
        return _bitwise(lambda a, b: node("ne", (lifted(a), lifted(b)), "bool"), "bit_xor", self, other)

    __rxor__ = __xor__

    # -- conditions ----------------------------------------------------------------------------------------

    def __lt__(self, other: Any) -> Any:
        return _comparison("lt", self, other)

    def __le__(self, other: Any) -> Any:
        return _comparison("le", self, other)

    def __gt__(self, other: Any) -> Any:
        return _comparison("gt", self, other)

    def __ge__(self, other: Any) -> Any:
        return _comparison("ge", self, other)

    def __eq__(self, other: object) -> Any:
        return _comparison("eq", self, other)

    def __ne__(self, other: object) -> Any:
        return _comparison("ne", self, other)

    def __and__(self, other: Any) -> Any:
        return _bitwise(both, "bit_and", self, other)

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return _bitwise(either, "bit_or", self, other)

    __ror__ = __or__

    def __invert__(self) -> Any:
        if self.kind == "real":
            raise TraceError("~ of a float: expected a condition or an integer")
        return negation(self) if self.kind == "bool" else -self - 1

    def __bool__(self) -> bool:
        condition = decided(truth(self))
        return condition if isinstance(condition, bool) else hooks.decide(condition)

    # -- conversions that would lose the symbol----------------------------------------------------------------------

    def __float__(self) -> float:
        raise TraceError(
            "a function that takes floats only was given a computed value: expected one of the module `math`, "
            "called as math.NAME, or of the ScalarOps"
        )

    def __int__(self) -> int:
        raise TraceError("a computed value where an integer must be known: expected fmu_kit.scalar.repeat for a loop")

    __index__ = __int__

    def __round__(self, digits: Any = None) -> Any:
        raise TraceError("round() of a computed value: expected math.floor or math.ceil")

    def __trunc__(self) -> Any:
        raise TraceError("math.trunc() of a computed value: expected math.floor or math.ceil")

    def __floor__(self) -> Any:
        return whole("floor", self)

    def __ceil__(self) -> Any:
        return whole("ceil", self)

    def __hash__(self) -> int:
        if not hooks.is_running():
            return object.__hash__(self)
        raise TraceError("a computed value as the key of a dictionary, in a set or in a cache: expected an if")

    def __reduce__(self) -> Any:
        raise TraceError("a computed value cannot be pickled")

    def __copy__(self) -> Symbol:
        return self

    def __deepcopy__(self, memo: Any) -> Symbol:
        return self

    # -- text ------------------------------------------------------------------------------------------------

    def __format__(self, spec: str) -> str:
        return marker(storable(_rounded_as_stored(self)), spec)

    def __repr__(self) -> str:
        return format(self)

    __str__ = __repr__


class Hooks:
    """Callbacks of symbols to the explorer of the current path."""

    decide: Callable[[Symbol], bool]
    """the branch that the path takes at a condition"""
    fail_if: Callable[[Any, Exception], None]
    """adds an error that is raised if the condition holds"""
    effects: Callable[[], int]
    """number of statements on this path that may fail, warn, or change the memory"""
    is_running: Callable[[], bool] = staticmethod(lambda: False)
    """whether a path is being run: code of a slave, not of the compiler"""
    digits: int = 53
    """bits of the real numbers for which the slave is traced: whole numbers of so many bits are exact"""


hooks = Hooks()

# -- the graph ---------------------------------------------------------------------------------------------------

_interned: dict[Any, Symbol] = {}


def node(op: str, args: Sequence[Symbol], kind: Kind, data: Any = None) -> Symbol:
    """The interned node of this operation on these operands."""
    if op in _DECIDED and all(arg.op == "constant" for arg in args):
        return constant(_DECIDED[op](*map(_as_computed, args)))
    key = (op, tuple(map(id, args)), kind, data)
    found = _interned.get(key)
    if found is None:
        found = _interned[key] = Symbol(op, tuple(args), kind, data)
    return found


_DECIDED: dict[str, Callable[..., bool]] = {
    **{name: getattr(operator, name) for name in ("lt", "le", "gt", "ge", "eq", "ne")},
    **{name: getattr(math, name) for name in ("isfinite", "isinf", "isnan")},
    "not": operator.not_,
    "and": lambda a, b: bool(a and b),
    "or": lambda a, b: bool(a or b),
}
"""Conditions on constants are evaluated while the slave is traced; arithmetic is left to C"""


def _as_computed(symbol: Symbol) -> float:
    """The number of a constant, rounded as in the generated C."""
    value = integer_of(symbol) if symbol.kind == "wide" else value_of(symbol)
    return value if hooks.digits >= 53 else c_float(value).value


def constant(value: float | int | bool) -> Symbol:
    """The node of a known number."""
    if isinstance(value, int) and not _fits((value, value)):
        return node("constant", (), "wide", value)
    kind: Kind = "bool" if isinstance(value, bool) else "int" if isinstance(value, int) else "real"
    return node("constant", (), kind, struct.pack("<d", value))


def value_of(symbol: Symbol) -> float:
    """The number of a constant."""
    return float(integer_of(symbol) if symbol.kind == "wide" else struct.unpack("<d", symbol.data)[0])


def integer_of(symbol: Symbol) -> int:
    """The whole number of a constant that is not a float."""
    return int(symbol.data if symbol.kind == "wide" else value_of(symbol))


def lifted(value: Any) -> Symbol:
    """A symbol in its storable form, or a number as a constant; raises `TraceError` for anything else."""
    if isinstance(value, Symbol):
        return storable(value)
    if isinstance(value, bool | int | float):
        return storable(constant(value))
    raise TraceError(f"{type(value).__name__}: expected a number")


def is_known(*values: Any) -> bool:
    """Whether none of the values is a symbol."""
    return not any(isinstance(value, Symbol) for value in values)


def truth(value: Symbol) -> Symbol:
    """The truth value of a symbol."""
    value = _rounded_as_stored(value)
    return value if value.kind == "bool" else node("ne", (value, constant(0 if value.kind == "wide" else 0.0)), "bool")


def decided(condition: Any) -> Any:
    """A condition, as True or False if it is a constant."""
    if isinstance(condition, Symbol) and condition.op == "constant":
        return bool(value_of(condition))
    return condition


def negation(condition: Any) -> Any:
    """Logical not of a condition."""
    condition = decided(condition)
    if is_known(condition):
        return not condition
    return condition.args[0] if condition.op == "not" else node("not", (truth(condition),), "bool")


def both(a: Any, b: Any) -> Any:
    """Logical and of conditions."""
    a, b = decided(a), decided(b)
    for one, other in ((a, b), (b, a)):
        if is_known(one):
            return other if one else False
    return truth(a) if a is b else node("and", (truth(a), truth(b)), "bool")


def either(a: Any, b: Any) -> Any:
    """Logical or of conditions."""
    a, b = decided(a), decided(b)
    for one, other in ((a, b), (b, a)):
        if is_known(one):
            return True if one else other
    return truth(a) if a is b else node("or", (truth(a), truth(b)), "bool")


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`; both are computed."""
    condition = decided(condition)
    if is_known(condition):
        return a if condition else b
    if is_known(a, b) and isinstance(a, bool) and isinstance(b, bool):
        return a if a is b else truth(condition) if a else negation(condition)
    left, right = lifted(a), lifted(b)
    return left if left is right else node("select", (truth(condition), left, right), common_kind(left, right))


def common_kind(a: Symbol, b: Symbol) -> Kind:
    """The kind of a value that is one of two."""
    if a.kind == b.kind:
        return a.kind
    return "real" if "real" in (a.kind, b.kind) else "int"


def whole(op: Literal["floor", "ceil"], x: Symbol) -> Symbol:
    """math.floor, math.ceil: an integer."""
    if x.kind != "real":
        return x
    hooks.fail_if(node("isnan", (x,), "bool"), error_raised_by(lambda: int(float("nan"))))
    hooks.fail_if(node("isinf", (x,), "bool"), error_raised_by(lambda: int(float("inf"))))
    return node(op, (x,), "wide")


def error_raised_by(call: Callable[[], object]) -> Exception:
    """The error that a call raises in Python."""
    try:
        call()
    except Exception as error:
        return error
    raise AssertionError("expected the call to raise")


def _are_integers(*values: Any) -> bool:
    return not any(isinstance(each, float) or (isinstance(each, Symbol) and each.kind == "real") for each in values)


def _as_float_operand(value: Any) -> Symbol:
    """An operand of a float operation, which Python converts to a float first."""
    return (
        constant(float(value)) if is_known(value) and not isinstance(value, bool) else lifted(_rounded_as_stored(value))
    )


def _arithmetic(op: str, a: Any, b: Any) -> Any:
    if not (isinstance(a, Symbol | float | int) and isinstance(b, Symbol | float | int)):
        return NotImplemented
    if _are_integers(a, b):
        return whole_number(op, a, b)
    return node(op, (_as_float_operand(a), _as_float_operand(b)), "real")


def _checked(op: str, a: Any, b: Any) -> Any:
    """An operation that raises an error for some operands."""
    if not (isinstance(a, Symbol | float | int) and isinstance(b, Symbol | float | int)):
        return NotImplemented
    if op == "pow":
        if _are_integers(a, b):
            return _integer_power(a, b)
        return power(_as_float_operand(a), _as_float_operand(b), _POWER_ERRORS)
    zero: Any = _comparison("eq", b, 0.0 if not _are_integers(b) else 0)
    hooks.fail_if(zero, error_raised_by((lambda: 1 // 0) if _are_integers(a, b) else _DIVISIONS[op]))
    if _are_integers(a, b) and op != "div":
        return whole_number(op, a, b)
    return node(
        op, (lifted(a), lifted(b)) if _are_integers(a, b) else (_as_float_operand(a), _as_float_operand(b)), "real"
    )


_DIVISIONS: dict[str, Callable[[], object]] = {
    "div": lambda: 1.0 / 0.0,
    "floordiv": lambda: 1.0 // 0.0,
    "mod": lambda: 1.0 % 0.0,
}


class PowerErrors(NamedTuple):
    """Errors for zero to a negative power, a negative number to a fractional power, and an overflow."""

    zero: Exception
    negative: Exception
    large: Exception


_POWER_ERRORS = PowerErrors(
    error_raised_by(lambda: 0.0 ** float("-1")),
    # Python returns a complex number, which no variable can hold
    ValueError("a negative number to a power that is no integer"),
    error_raised_by(lambda: 10.0 ** float("400")),
)


def power(base: Symbol, exponent: Symbol, errors: PowerErrors) -> Symbol:
    """`base` to the power of `exponent`."""
    known = value_of(exponent) if exponent.op == "constant" else None
    if known is None or known < 0.0:
        negative: Any = known is not None or exponent < 0.0
        hooks.fail_if(both(base == 0.0, negative), errors.zero)
    if known is None or not known.is_integer():
        fractional: Any = known is not None or node("ne", (exponent, node("floor", (exponent,), "real")), "bool")
        hooks.fail_if(both(base < 0.0, fractional), errors.negative)
    result = node("pow", (base, exponent), "real")
    finite = both(
        node("isfinite", (base,), "bool"), True if known is not None else node("isfinite", (exponent,), "bool")
    )
    hooks.fail_if(both(node("isinf", (result,), "bool"), finite), errors.large)
    return result


def _comparison(op: str, a: Any, b: Any) -> Any:
    if not (isinstance(a, Symbol | float | int) and isinstance(b, Symbol | float | int)):
        return NotImplemented
    if is_known(a, b):
        return getattr(operator, op)(a, b)
    if not _are_integers(a, b):
        return node(op, (_as_compared_with_float(a), _as_compared_with_float(b)), "bool")
    left, right = _rounded_as_stored(_operand(a)), _rounded_as_stored(_operand(b))
    if "wide" in (left.kind, right.kind):
        left, right = _wide_operand(left), _wide_operand(right)
    return node(op, (left, right), "bool")


def _as_compared_with_float(value: Any) -> Symbol:
    """An operand compared with a float, without rounding: a known integer may be as large as a float."""
    return constant(float(value)) if is_known(value) and float(value) == value else lifted(_rounded_as_stored(value))


# -- whole numbers: stored ones are exact real numbers in C; within an expression they may be larger -----------------

_spans: dict[int, integers.Span] = {}
"""Spans of whole numbers computed within expressions; all others are stored ones"""


def whole_number(op: str, *values: Any) -> Symbol:
    """The result of an operation on whole numbers; raises `TraceError` if it is too large even within an expression."""
    operands = tuple(_wide_operand(_operand(value)) for value in values)
    if not _is_in_range(op, operands):
        operands = tuple(each if each.op == "constant" else storable(each) for each in operands)
    if not _is_in_range(op, operands):
        raise TraceError(f"an integer of more than {integers.BITS} bits: expected smaller ones, by % in between")
    span = integers.span_of(op, *map(_span, operands))
    result = node(op, operands, "int" if _fits(span) else "wide")
    _spans[id(result)] = span
    return result


def storable(symbol: Symbol) -> Symbol:
    """A symbol in the form in which it can be stored; the step fails if its value is too large for that."""
    if symbol.kind != "wide":
        return symbol
    if symbol.op == "constant":
        raise TraceError(f"{symbol.data}: expected {_SMALL.format(hooks.digits)}")
    if symbol.op in ("mod", "bit_and"):
        raise TraceError(
            f"an integer of {integers.size(_span(symbol)).bit_length()} bits: expected {_SMALL.format(hooks.digits)}"
        )
    if symbol.op in (*_ROUNDED, "add", "sub", "mul") and all(arg.kind != "wide" for arg in symbol.args):
        kept = node(symbol.op, symbol.args, "int")  # exact: a result that rounds to a smaller number was not rounded
        too_large = _is_too_large(kept)
    else:
        kept = node("narrow", (symbol,), "int")
        too_large = node("beyond", (symbol,), "bool")
    hooks.fail_if(too_large, _too_large())
    return kept


def _is_in_range(op: str, operands: Iterable[Symbol]) -> bool:
    return integers.size(integers.span_of(op, *map(_span, operands))).bit_length() <= integers.BITS


_SMALL = "integers smaller than 2**{}, or larger ones only within an expression that ends in % or //"


def _too_large() -> Exception:
    return FmuError(f"an integer is too large for C: expected {_SMALL.format(hooks.digits)}")


def _is_too_large(kept: Symbol) -> Symbol:
    return node("ge", (node("abs", (kept,), "int"), constant(2.0**hooks.digits)), "bool")


def _fits(span: integers.Span) -> bool:
    return bool(integers.size(span) < 2**hooks.digits)


_ROUNDED = ("floor", "ceil")
"""Operations that give whole numbers of any size, exact as real numbers in C."""


def _rounded_as_stored(value: Any) -> Any:
    """The result of floor or ceil as a real number, where it is used only like a float."""
    return node(value.op, value.args, "int") if isinstance(value, Symbol) and value.op in _ROUNDED else value


def _wide_operand(symbol: Symbol) -> Symbol:
    """An operand of an operation on whole numbers."""
    return storable(node(symbol.op, symbol.args, "wide")) if symbol.op in _ROUNDED else symbol


def _operand(value: Any) -> Symbol:
    return value if isinstance(value, Symbol) else constant(value)


def _span(symbol: Symbol) -> integers.Span:
    if symbol.op == "constant":
        return integer_of(symbol), integer_of(symbol)
    if symbol.kind == "bool":
        return 0, 1
    most = 2**hooks.digits - 1
    if symbol.op == "index":
        return 0, most - 1  # smaller than the count
    return _spans.get(id(symbol), (-most, most))


def _integer_power(base: Any, exponent: Any) -> Any:
    if not is_known(exponent) or exponent < 0:
        raise TraceError("** of two integers: expected a float among them, or an exponent that is known")
    if exponent > integers.BITS:
        raise TraceError(f"an integer to the power of {exponent}: expected at most {integers.BITS}")
    result: Any = 1
    for _ in range(exponent):
        result = result * base
    return result


def _known_bits(value: Any, bits: Any) -> int:
    """The number of bits by which a whole number is shifted."""
    if not _are_integers(value, bits):
        raise TraceError("<< or >> of a float: expected integers")
    if not is_known(bits):
        raise TraceError("<< or >> by a computed integer: expected a known one")
    if bits < 0:
        raise ValueError("negative shift count")
    return int(bits)


def _bitwise(of_conditions: Callable[[Any, Any], Any], op: str, a: Any, b: Any) -> Any:
    """&, | or ^, of conditions or of the bits of whole numbers."""
    if not _are_integers(a, b) or not isinstance(b, Symbol | int):
        return NotImplemented
    if all(isinstance(each, bool) or (isinstance(each, Symbol) and each.kind == "bool") for each in (a, b)):
        return of_conditions(a, b)
    return whole_number(op, a, b)


CHEAP = frozenset({"add", "sub", "mul", "neg", "abs", "lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not", "select"})
"""Operations that take a few instructions"""


def closure(symbols: Iterable[Symbol]) -> dict[int, Symbol]:
    """All symbols from which some are computed, by identity, each after its operands.

    The operands of merged values (phi) are not included: the statements that assign them use them.
    """
    found: dict[int, Symbol] = {}
    for start in symbols:
        for symbol in unknown_below(start, lambda one: id(one) in found, unmerged):
            found[id(symbol)] = symbol
    return found


def unmerged(symbol: Symbol) -> tuple[Symbol, ...]:
    """The operands of a symbol; none of a merged value."""
    return () if symbol.op == "phi" else symbol.args


def unknown_below(
    symbol: Symbol,
    is_known: Callable[[Symbol], bool],
    operands: Callable[[Symbol], Iterable[Symbol]] = lambda one: one.args,
) -> Iterator[Symbol]:
    """The unknown symbols from which one is computed, then itself: each after its operands, of which the last is first.

    Each must be known when the next is asked for. Not by recursion: the graph is deep.
    """
    waiting = [(symbol, False)]
    while waiting:
        one, is_ready = waiting.pop()
        if is_ready:
            yield one
        elif not is_known(one):
            waiting.append((one, True))
            waiting += [(arg, False) for arg in operands(one)]
