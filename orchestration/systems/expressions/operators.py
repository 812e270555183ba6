"""The operators of the language and its functions of values at one instant, defined for all targets.

The targets are numpy over a span of a run (`over_run.py`), Python at an instant (`at_instant.py`), C in SIMD lanes,
and C with a bound on its error in the condition of the compiled loop (`engines`). A truth value is 0 or 1.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from orchestration.foundation.basics import unit_algebra as units
from orchestration.foundation.basics.unit_algebra import Rule

Printer: TypeAlias = Callable[..., str]
"""Function from the texts of the operands to that of the result"""


@dataclass(frozen=True, kw_only=True)
class Operator:
    """One operator, or function of values at one instant."""

    tree: type[ast.AST] | None = None
    """its node in Python's grammar; None: it is called by its name"""
    arguments: tuple[int, int] = (1, 1)
    """the fewest and most of a function"""
    joins: bool = False
    """whether it combines the components of vectors; others apply component by component"""
    unit: Rule
    gives_truth: bool = False
    """whether the result in the targets is true or false, not 0 or 1"""
    takes_truths: bool = False
    """whether its operands are truth values; a number is true unless it is 0"""
    python: Printer
    """Python on names and numbers; it calls functions of `PYTHON`"""
    numpy: Callable[..., Any]
    lanes: Printer
    """C on names and calls; it calls functions of lanes.h, mathematics.h and batch.c"""
    bounded: str | None = None
    """C on `n` operands `a`, each a `Known` of condition.h; None: Python evaluates it"""


def _infix(sign: str) -> Printer:
    return lambda *texts: f" {sign} ".join(texts)


def _called(function: str) -> Printer:
    return lambda *texts: f"{function}({', '.join(texts)})"


def _two_by_two(function: str) -> Printer:
    def write(first: str, *others: str) -> str:
        for other in others:
            first = f"{function}({first}, {other})"
        return first

    return write


def _root_of_squares(root: str) -> Printer:
    return lambda *texts: f"{root}({' + '.join(f'{text} * {text}' for text in texts)})"


def _or_nan(function: Callable[..., float]) -> Callable[..., float]:
    def guarded(*values: float) -> float:
        try:
            return function(*values)
        except (ArithmeticError, ValueError):
            return math.nan

    return guarded


def _of_all(function: np.ufunc) -> Callable[..., Any]:
    return lambda *values: function.reduce(np.broadcast_arrays(*values))


def _norm(*parts: Any) -> Any:
    numbers = [number for part in parts for number in (part if np.ndim(part) == 2 else [part])]
    return np.sqrt(sum(np.square(number) for number in numbers))


def _comparison(sign: str, tree: type[ast.AST], numpy: Callable[..., Any], lanes: str) -> Operator:
    return Operator(
        tree=tree, unit=units.compared, gives_truth=True,
        python=_infix(sign), numpy=numpy, lanes=_called(lanes),
        bounded=f"truth(a[0].value {sign} a[1].value, is_close(a[0], a[1]))",
    )  # fmt: skip


def _mathematical(name: str, unit: Rule, numpy: Callable[..., Any], count: int = 1) -> Operator:
    return Operator(arguments=(count, count), unit=unit, python=_called(name), numpy=numpy, lanes=_called(f"q_{name}"))


# The root of the sum of the squares, in order: the same bits on all targets.
_NORM = Operator(
    arguments=(1, 99), joins=True, unit=units.agreed,
    python=_root_of_squares("root"), numpy=_norm, lanes=_root_of_squares("q_sqrt"), bounded="norm(a, n)",
)  # fmt: skip

OPERATORS: Mapping[str, Operator] = {
    "+": Operator(
        tree=ast.Add, unit=units.agreed, python=_infix("+"), numpy=np.add, lanes=_infix("+"),
        bounded="known(a[0].value + a[1].value, a[0].error + a[1].error)",
    ),
    "-": Operator(
        tree=ast.Sub, unit=units.agreed, python=_infix("-"), numpy=np.subtract, lanes=_infix("-"),
        bounded="known(a[0].value - a[1].value, a[0].error + a[1].error)",
    ),
    "*": Operator(
        tree=ast.Mult, unit=units.product, python=_infix("*"), numpy=np.multiply, lanes=_infix("*"),
        bounded="product(a[0], a[1])",
    ),
    "/": Operator(
        tree=ast.Div, unit=units.quotient, python=_called("quotient"), numpy=np.divide, lanes=_infix("/"),
        bounded="quotient(a[0], a[1])",
    ),
    "**": Operator(
        tree=ast.Pow, unit=units.power, python=_called("power"), numpy=np.power,
        lanes=lambda base, by: f"{base} * {base}" if by == "q_all(2.0)" else f"q_pow({base}, {by})",
    ),
    "neg": Operator(
        tree=ast.USub, unit=units.first, python="-{}".format, numpy=np.negative, lanes="-{}".format,
        bounded="known(-a[0].value, a[0].error)",
    ),
    "<": _comparison("<", ast.Lt, np.less, "q_lt"),
    "<=": _comparison("<=", ast.LtE, np.less_equal, "q_le"),
    ">": _comparison(">", ast.Gt, np.greater, "q_gt"),
    ">=": _comparison(">=", ast.GtE, np.greater_equal, "q_ge"),
    "==": _comparison("==", ast.Eq, np.equal, "q_eq"),
    "!=": _comparison("!=", ast.NotEq, np.not_equal, "q_ne"),
    "and": Operator(
        tree=ast.And, unit=units.none, gives_truth=True, takes_truths=True,
        python=_infix("and"), numpy=_of_all(np.logical_and), lanes=_infix("&"), bounded="joined(0, a, n)",
    ),
    "or": Operator(
        tree=ast.Or, unit=units.none, gives_truth=True, takes_truths=True,
        python=_infix("or"), numpy=_of_all(np.logical_or), lanes=_infix("|"), bounded="joined(1, a, n)",
    ),
    "not": Operator(
        tree=ast.Not, unit=units.none, gives_truth=True, takes_truths=True,
        python="not {}".format, numpy=np.logical_not, lanes=_called("q_not"),
        bounded="truth(a[0].value == 0.0, is_undecided(a[0]))",
    ),
    "abs": Operator(
        unit=units.agreed, python=_called("abs"), numpy=np.abs, lanes=_called("q_fabs"),
        bounded="known(fabs(a[0].value), a[0].error)",
    ),
    "sqrt": _mathematical("sqrt", units.root, np.sqrt),
    "exp": _mathematical("exp", units.ratio, np.exp),
    "log": _mathematical("log", units.ratio, np.log),
    "sin": _mathematical("sin", units.ratio, np.sin),
    "cos": _mathematical("cos", units.ratio, np.cos),
    "tan": _mathematical("tan", units.ratio, np.tan),
    "asin": _mathematical("asin", units.angle, np.arcsin),
    "acos": _mathematical("acos", units.angle, np.arccos),
    "atan2": _mathematical("atan2", units.direction, np.arctan2, count=2),
    "tanh": _mathematical("tanh", units.ratio, np.tanh),
    "hypot": _NORM,
    "norm": _NORM,
    "min": Operator(
        arguments=(2, 99), unit=units.agreed, python=_called("min"), numpy=_of_all(np.minimum),
        lanes=_two_by_two("lowest"),
    ),
    "max": Operator(
        arguments=(2, 99), unit=units.agreed, python=_called("max"), numpy=_of_all(np.maximum),
        lanes=_two_by_two("highest"),
    ),
}  # fmt: skip
"""Operators by the sign of an `Operation` or the function of a `Call`"""

PYTHON: Mapping[str, Any] = {
    "__builtins__": {}, "abs": abs, "min": min, "max": max, "root": math.sqrt,
    "quotient": _or_nan(operator.truediv), "power": _or_nan(math.pow),
    **{name: _or_nan(getattr(math, name))
       for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan2", "tanh")},
}  # fmt: skip
"""The functions that the Python texts call"""


def applied(word: str, *values: Any) -> Any:
    """The result of an operator on numbers or arrays."""
    definition = OPERATORS[word]
    if not definition.gives_truth:
        return definition.numpy(*values)
    if definition.takes_truths:
        values = tuple(np.asarray(value) != 0.0 for value in values)
    found = np.asarray(definition.numpy(*values))
    return found.astype(float) if found.ndim else float(found)
