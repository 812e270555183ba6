"""Sampled states of a slave, and the values of symbols in them, which show the usual path of a step.

They influence the speed of a kernel, never its results.
"""

from __future__ import annotations

import contextlib
import math
import operator
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fmu_kit.compiler.passes.precomputing import TAKING
from fmu_kit.compiler.trace.memory import Memory, attribute_name
from fmu_kit.compiler.trace.statements import all_statements
from fmu_kit.compiler.trace.symbols import Symbol, unknown_below, value_of
from fmu_kit.compiler.trace.tracing import Program
from fmu_kit.compiler.trace.tree import is_number, leaves
from fmu_kit.errors import FmuError
from fmu_kit.slave import Phase, Slave
from fmu_kit.variables import Variable

_SIZES = (0.02, 0.3, 3.0)
"""Deviations of inputs from their start values, relative to their nominal values"""
_STEPS = 8
"""A state is taken after fewer steps"""


@dataclass(frozen=True, kw_only=True)
class State:
    """The memory before a step, by place, and the step: from t, of length h [s]."""

    memory: Mapping[str, float]
    t: float
    h: float


def states_of(program: Program, count: int = 24) -> list[State]:
    """States of a slave with its usual parameters after steps with random inputs; fewer than `count` if steps fail."""
    rng = random.Random(0)
    found = []
    for k in range(count):
        with contextlib.suppress(FmuError, ArithmeticError, ValueError):
            found.append(_state(program.slave, rng, _SIZES[k % len(_SIZES)]))
    return found


def _state(slave: type[Slave], rng: random.Random, size: float) -> State:
    step = float(slave.default_experiment.step_size) / rng.choice((1.0, 10.0, 11.0, 13.0))
    instance, t = slave(instance_name="sample"), 0.0
    for variable in instance.variables:
        if variable.causality == "parameter" and variable.name in slave.usual_parameters:
            setattr(instance, variable.name, slave.usual_parameters[variable.name])
    instance._phase = Phase.INITIALIZATION
    _set_inputs(instance, rng, size)
    instance._initialise()
    instance._phase = Phase.STEPPING
    for _ in range(rng.randrange(1, _STEPS)):
        _set_inputs(instance, rng, size)
        instance._advance(t, step)  # not by do_step, which would log a failure
        t += step
    _set_inputs(instance, rng, size)
    memory = {
        _name(instance, path): float(value)
        for path, value in leaves(Memory(instance, {}).attributes())
        if is_number(value)
    }
    return State(memory=memory, t=t, h=step)


def _set_inputs(instance: Slave, rng: random.Random, size: float) -> None:
    for reference, variable in enumerate(instance.variables):
        if variable.causality == "input" and variable.type == "Real":
            instance.set_real([reference], [_random_near_start(variable, rng, size)])


def _random_near_start(variable: Variable, rng: random.Random, size: float) -> float:
    usual = variable.nominal if variable.nominal is not None else max(abs(float(variable.start)), 1.0)
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    return min(max(float(variable.start) + size * usual * (2.0 * rng.random() - 1.0), low), high)


def _name(instance: Slave, path: tuple[Any, ...]) -> str:
    is_variable = path[0] in ("_reals", "_others") and len(path) > 1
    return instance.variables[path[1]].name if is_variable else attribute_name(path)


class Values:
    """The values of symbols of a step in each state, up to the accuracy of Python's functions."""

    def __init__(self, program: Program, states: Sequence[State]) -> None:
        self.states = states
        taking = [f for f in program.functions if f.name == TAKING]
        self._computed = {
            each.data: each.symbols[0] for f in taking for each in all_statements(f.body) if each.op == "store"
        }
        """the values computed when parameters are taken over, by place"""
        self._known: dict[int, list[float]] = {}

    def of(self, symbol: Symbol) -> list[float]:
        """A value for each state, NaN for none; raises `KeyError` if the state does not determine the value."""
        for one in unknown_below(symbol, lambda each: id(each) in self._known, self._operands):
            self._known[id(one)] = list(self._values(one))
        return self._known[id(symbol)]

    def _operands(self, symbol: Symbol) -> tuple[Symbol, ...]:
        if symbol.op == "load" and not self._is_kept(symbol):
            return (self._computed[symbol.data[0]],)
        return symbol.args

    def _is_kept(self, symbol: Symbol) -> bool:
        return all(symbol.data[0] in state.memory for state in self.states)

    def _values(self, symbol: Symbol) -> Iterator[float]:
        operands = [self._known[id(each)] for each in self._operands(symbol)]
        for k, state in enumerate(self.states):
            if symbol.op == "constant":
                yield value_of(symbol)
            elif symbol.op == "parameter":
                yield (state.t, state.h)[symbol.data]
            elif symbol.op == "load":
                yield operands[0][k] if operands else state.memory[symbol.data[0]]
            else:
                yield _result(_FUNCTIONS[symbol.op], [values[k] for values in operands])


def _result(function: Callable[..., float], operands: list[float]) -> float:
    try:
        return float(function(*operands))
    except (ArithmeticError, ValueError):
        return math.nan


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(operator, name) for name in ("add", "sub", "mul", "neg", "lt", "le", "gt", "ge", "eq", "ne")},
    **{
        name: getattr(math, name)
        for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh", "exp", "expm1", "log", "pow",
                     "floor", "ceil", "copysign", "isfinite", "isinf", "isnan")
    },
    "div": operator.truediv,
    "mod": operator.mod,
    "floordiv": operator.floordiv,
    "abs": abs,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
    "select": lambda condition, a, b: a if condition else b,
    "bit_and": lambda a, b: int(a) & int(b),
    "bit_or": lambda a, b: int(a) | int(b),
    "bit_xor": lambda a, b: int(a) ^ int(b),
    "narrow": lambda whole: whole,
    "beyond": lambda whole: abs(whole) >= 2.0**53,
}  # fmt: skip
