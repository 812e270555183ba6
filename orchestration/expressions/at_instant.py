"""Conditions that are looked at while a run goes on: an expression made into a function of the current values."""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from orchestration.basics.errors import UsageError
from orchestration.expressions.syntax import Call, Name, Node, Number, Operation, Sampled, is_over_run

Current: TypeAlias = Callable[[Sequence[float]], float]
"""A number from the values of the signals that an expression names"""


def compiled(node: Node, places: Mapping[str, int]) -> Current:
    """A function of a sequence of values, of which `places` says which signal stands where.

    Raises `UsageError` for a name that is not there, a vector outside `norm`, or a function over a whole run.
    """
    found = _parts(node, places)
    if len(found) != 1:
        raise UsageError("it is a vector; expected a number, such as norm(…)")
    return found[0]


def _parts(node: Node, places: Mapping[str, int]) -> list[Current]:
    """One function for a number, several for a vector."""
    if isinstance(node, Number):
        constant = node.value
        return [lambda values: constant]
    if isinstance(node, Name):
        return [_At(place) for place in _places(node.text, places)]
    if isinstance(node, Operation):
        return _operation(node.sign, [_parts(operand, places) for operand in node.operands])
    if isinstance(node, Sampled):
        raise UsageError("sampled is of a whole run; expected functions of values at one instant")
    return [_call(node, places)]


def _places(name: str, places: Mapping[str, int]) -> list[int]:
    if name in places:
        return [places[name]]
    found = [places[f"{name}.{axis}"] for axis in "xyzw" if f"{name}.{axis}" in places]
    if not found:
        raise UsageError(f"there is no {name}; expected a recorded signal or time")
    return found


def _operation(sign: str, operands: list[list[Current]]) -> list[Current]:
    size = max(map(len, operands))
    if any(len(parts) not in (1, size) for parts in operands):
        raise UsageError(f"{sign} of vectors of different sizes")
    function = _OPERATIONS[sign]
    return [function(*(parts[i if len(parts) > 1 else 0] for parts in operands)) for i in range(size)]


def _call(node: Call, places: Mapping[str, int]) -> Current:
    if is_over_run(node):
        raise UsageError(f"{node.function} is of a whole run; expected functions of values at one instant")
    arguments = [_parts(argument, places) for argument in node.arguments]
    if node.function in ("norm", "hypot"):
        return _norm([part for argument in arguments for part in argument])
    if any(len(argument) > 1 for argument in arguments):
        raise UsageError(f"{node.function} of a vector; expected a number, such as norm(…)")
    function, flat = _FUNCTIONS[node.function], [argument[0] for argument in arguments]

    def call(values: Sequence[float]) -> float:
        try:
            return function(*[argument(values) for argument in flat])
        except (ValueError, OverflowError):
            return math.nan

    return call


class _At:
    """The value at a place; the commonest operands are told apart, since this is done at every instant of a run."""

    def __init__(self, place: int) -> None:
        self.place = place

    def __call__(self, values: Sequence[float]) -> float:
        return values[self.place]


def _difference(a: Current, b: Current) -> Current:
    if isinstance(a, _At) and isinstance(b, _At):
        i, j = a.place, b.place
        return lambda values: values[i] - values[j]
    return lambda values: a(values) - b(values)


def _norm(parts: Sequence[Current]) -> Current:
    """The root of the sum of the squares, one after another: what it comes to over rows and in lanes, to the bit."""

    def norm(values: Sequence[float]) -> float:
        total = 0.0
        for part in parts:
            x = part(values)
            total += x * x
        return math.sqrt(total)

    return norm


def _binary(function: Callable[[float, float], float]) -> Callable[[Current, Current], Current]:
    def build(a: Current, b: Current) -> Current:
        def apply(values: Sequence[float]) -> float:
            try:
                return function(a(values), b(values))
            except (ArithmeticError, ValueError):
                return math.nan

        return apply

    return build


def _compare(function: Callable[[float, float], bool]) -> Callable[[Current, Current], Current]:
    return lambda a, b: lambda values: function(a(values), b(values))


_OPERATIONS: dict[str, Callable[..., Current]] = {
    "+": _binary(operator.add), "-": _difference, "*": _binary(operator.mul),
    "/": _binary(operator.truediv), "**": _binary(math.pow), "neg": lambda a: lambda values: -a(values),
    "<": _compare(operator.lt), "<=": _compare(operator.le), ">": _compare(operator.gt),
    ">=": _compare(operator.ge), "==": _compare(operator.eq), "!=": _compare(operator.ne),
    "not": lambda a: lambda values: not a(values),
    "and": lambda *sides: lambda values: all(side(values) for side in sides),
    "or": lambda *sides: lambda values: any(side(values) for side in sides),
}  # fmt: skip

_FUNCTIONS: dict[str, Callable[..., float]] = {
    "abs": abs, "sqrt": math.sqrt, "exp": math.exp, "log": math.log, "sin": math.sin, "cos": math.cos,
    "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan2": math.atan2, "tanh": math.tanh,
    "min": min, "max": max,
}  # fmt: skip
