"""Replacements for `math`, some built-in functions and `FLOAT` in the modules of a slave while it is traced."""

from __future__ import annotations

import builtins
import contextlib
import dataclasses
import math
import random
import sys
import time
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from fmu_kit import scalar
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.symbols import (
    PowerErrors,
    Symbol,
    both,
    either,
    error_raised_by,
    hooks,
    is_known,
    lifted,
    node,
    power,
    select,
    truth,
    whole,
)

# -- the module math -----------------------------------------------------------------------------------------------


def _always_defined(name: str) -> Callable[[Any], Any]:
    """A function that is defined for every float."""
    return lambda x: getattr(math, name)(x) if is_known(x) else node(name, (lifted(x),), "real")


def _defined(name: str, outside: Callable[[Any], Any], example: float) -> Callable[[Any], Any]:
    """A function that raises an error outside its domain."""

    def function(x: Any) -> Any:
        if is_known(x):
            return getattr(math, name)(x)
        hooks.fail_if(outside(x), error_raised_by(lambda: getattr(math, name)(example)))
        return node(name, (lifted(x),), "real")

    return function


def _bounded(name: str) -> Callable[[Any], Any]:
    """A function that may overflow."""

    def function(x: Any) -> Any:
        if is_known(x):
            return getattr(math, name)(x)
        result = node(name, (lifted(x),), "real")
        hooks.fail_if(both(isinf(result), isfinite(x)), error_raised_by(lambda: getattr(math, name)(1e4)))
        return result

    return function


def _test(name: str) -> Callable[[Any], Any]:
    return lambda x: getattr(math, name)(x) if is_known(x) else node(name, (lifted(x),), "bool")


isfinite, isinf, isnan = _test("isfinite"), _test("isinf"), _test("isnan")


def _of_two(name: str) -> Callable[[Any, Any], Any]:
    def function(a: Any, b: Any) -> Any:
        return getattr(math, name)(a, b) if is_known(a, b) else node(name, (lifted(a), lifted(b)), "real")

    return function


def _rounded(name: Any) -> Callable[[Any], Any]:
    return lambda x: getattr(math, name)(x) if is_known(x) else whole(name, x)


_POWER_ERRORS = PowerErrors(
    zero=error_raised_by(lambda: math.pow(0.0, -1.0)),
    negative=error_raised_by(lambda: math.pow(-1.0, 0.5)),
    large=error_raised_by(lambda: math.pow(10.0, 400.0)),
)


def _power(a: Any, b: Any) -> Any:
    return math.pow(a, b) if is_known(a, b) else power(lifted(a), lifted(b), _POWER_ERRORS)


MATH: Mapping[str, Any] = {
    "sqrt": _defined("sqrt", lambda x: x < 0.0, -1.0),
    **{name: _defined(name, isinf, math.inf) for name in ("sin", "cos", "tan")},
    **{name: _defined(name, lambda x: either(x > 1.0, x < -1.0), 2.0) for name in ("asin", "acos")},
    "log": _defined("log", lambda x: x <= 0.0, 0.0),
    **{name: _bounded(name) for name in ("exp", "expm1")},
    **{name: _always_defined(name) for name in ("tanh", "atan")},
    "atan2": _of_two("atan2"),
    "copysign": _of_two("copysign"),
    "fabs": lambda x: abs(x) if not is_known(x) else math.fabs(x),
    "floor": _rounded("floor"),
    "ceil": _rounded("ceil"),
    "pow": _power,
    "isfinite": isfinite,
    "isinf": isinf,
    "isnan": isnan,
}
"""Functions of computed values; all others of `math` accept only known values."""


class _Math(types.ModuleType):
    """The replacement of the module `math`."""

    def __init__(self) -> None:
        super().__init__("math")
        vars(self).update({name: getattr(math, name) for name in dir(math) if not name.startswith("__")})
        vars(self).update(MATH)


# -- built-in functions ----------------------------------------------------------------------------------------------


def _condition(value: Any) -> Any:
    return bool(value) if is_known(value) else truth(value)


def _any(values: Iterable[Any]) -> Any:
    found: Any = False
    for value in _without_effects("any", values):
        found = either(found, _condition(value))
    return found


def _all(values: Iterable[Any]) -> Any:
    found: Any = True
    for value in _without_effects("all", values):
        found = both(found, _condition(value))
    return found


def _without_effects(name: str, values: Iterable[Any]) -> Iterator[Any]:
    """The values; since Python stops at the one that decides, only the first may fail or have effects."""
    decided, before = False, 0
    for value in values:
        if decided and hooks.effects() != before:
            raise TraceError(f"{name}() of values of which a later one may fail: expected an if for each")
        yield value
        decided, before = decided or not is_known(value), hooks.effects()


def _extreme(name: str, better: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """min or max: the first of equal values, as in Python."""

    def function(*values: Any, **options: Any) -> Any:
        given = list(values[0]) if len(values) == 1 else list(values)
        if is_known(*given):
            return getattr(builtins, name)(given, **options)
        if options:
            raise TraceError(f"{name}() of computed values with {', '.join(options)}: expected values only")
        best, *others = given
        for other in others:
            best = select(better(other, best), other, best)
        return best

    return function


def _sum(values: Iterable[Any], start: Any = 0) -> Any:
    given = list(values)
    if is_known(start, *given):
        return sum(given, start)
    total, lost = start, 0.0
    for value in given:
        after = total + value
        if _SUMS_ARE_COMPENSATED and _is_real(total) and _is_real(value):
            lost += select(abs(total) >= abs(value), (total - after) + value, (value - after) + total)
        total = after
    return total if is_known(lost) and not lost else select(both(lost != 0.0, isfinite(lost)), total + lost, total)


_SUMS_ARE_COMPENSATED = sys.version_info >= (3, 12)
"""Python adds up floats with what each addition loses (Neumaier), and C is to have its bits"""


def _is_real(value: Any) -> bool:
    return value.kind == "real" if isinstance(value, Symbol) else isinstance(value, float)


class _Converting(type):
    """The metaclass of the replacements of `float`, `int` and `bool`."""

    kind: str

    def __instancecheck__(cls, value: Any) -> bool:
        return isinstance(value, getattr(builtins, cls.__name__)) or (
            isinstance(value, Symbol) and value.kind.replace("wide", "int") == cls.kind
        )

    def __call__(cls, *args: Any) -> Any:
        if not args or is_known(*args):
            return getattr(builtins, cls.__name__)(*args)
        (x,) = args
        if cls.kind == "bool":
            return truth(x)
        if cls.kind == "real":
            return x if x.kind == "real" else x + 0.0
        if x.kind == "real":
            raise TraceError("int() of a computed float: expected math.floor or math.ceil")
        return x + 0 if x.kind == "bool" else x


def _refused(name: str, instead: str) -> Callable[..., Any]:
    """The replacement of a function that an FMU in C cannot have."""

    def refuse(*values: Any, **options: Any) -> Any:
        raise TraceError(f"{name}(): expected {instead}")

    return refuse


class _NonDeterministic(types.ModuleType):
    """The replacement of a module whose results do not depend on the arguments alone."""

    def __getattr__(self, name: str) -> Any:
        return _refused(f"{self.__name__}.{name}", "what follows from the variables and from time alone")


def _converting(name: str, kind: str) -> type:
    return _Converting(name, (), {"kind": kind})


BUILTINS: Mapping[str, Any] = {
    "any": _any,
    "all": _all,
    "min": _extreme("min", lambda a, b: a < b),
    "max": _extreme("max", lambda a, b: a > b),
    "sum": _sum,
    "bool": _converting("bool", "bool"),
    "int": _converting("int", "int"),
    "float": _converting("float", "real"),
    "print": _refused("print", "self.warn_once"),
    "open": _refused("open", "no files"),
    "input": _refused("input", "an input of the FMU"),
}

# -- the operations of scalars -----------------------------------------------------------------------------------------


def _sign(x: Any) -> Any:
    return PLAIN_FLOAT.sign(x) if is_known(x) else select(truth(x), MATH["copysign"](1.0, x), 0.0)


PLAIN_FLOAT = dataclasses.replace(scalar.FLOAT)
SCALARS: Mapping[str, Any] = {
    **{name: MATH[name] for name in ("sqrt", "tanh", "sin", "cos", "atan2")},
    "sign": _sign,
    "maximum": BUILTINS["max"],
    "where": select,
    "all": lambda condition: condition,
}


@contextlib.contextmanager
def installed(modules: Iterable[types.ModuleType], extra: Mapping[Any, Any]) -> Iterator[None]:
    """Install the replacements in these modules, and `extra`, functions by what they replace, under all their names."""
    undone: list[tuple[dict[str, Any], dict[str, Any], list[str]]] = []
    by_identity: dict[int, Any] = {id(module): _NonDeterministic(module.__name__) for module in (random, time)}
    by_identity |= {id(math): _Math(), **{id(getattr(math, name)): f for name, f in MATH.items()}}
    by_identity.update({id(function): stand_in for function, stand_in in extra.items()})
    scalars = {**SCALARS, "resolution": 2.0**-hooks.digits}
    kept = {field.name: getattr(scalar.FLOAT, field.name) for field in dataclasses.fields(scalar.FLOAT)}
    try:
        for module in modules:
            names = vars(module)
            changed = {name: by_identity[id(value)] for name, value in names.items() if id(value) in by_identity}
            changed |= {name: value for name, value in BUILTINS.items() if name not in names}
            undone.append((names, {name: names[name] for name in changed if name in names}, list(changed)))
            names.update(changed)
        for name, function in scalars.items():
            object.__setattr__(scalar.FLOAT, name, function)
        yield
    finally:
        for name, function in kept.items():
            object.__setattr__(scalar.FLOAT, name, function)
        for names, before, put in undone:
            for name in put:
                del names[name]
            names.update(before)
