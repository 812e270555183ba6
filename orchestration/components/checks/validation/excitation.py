"""Plans of runs, and the values of inputs and parameters in them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from orchestration.components.checks.validation.instance import Value, Values
from orchestration.components.fmi.instance import start_number, start_value, within
from orchestration.components.fmi.read_description import Variable

STEPS = 100
"""communication steps of a run"""
UNEVEN = (0.4, 0.6, 1.0, 0.3, 0.7)
"""lengths of variable steps, of that of the default experiment: between samples, on them and across them"""


@dataclass(frozen=True, kw_only=True, slots=True)
class ExcitationPlan:
    """The inputs, parameters and steps of a run."""

    parameters: Values = field(default_factory=dict)
    moving: bool = False
    """whether the inputs move from step to step; else they stay at their starts"""
    uneven: bool = False
    """whether the steps are of different lengths"""
    times_set: int = 1
    """Number of times that the inputs are set before a step"""
    steps: int = STEPS


PLAIN = ExcitationPlan()
"""Plan of start values, by the default experiment"""


def inputs_at(inputs: Iterable[Variable], k: int) -> dict[str, Value]:
    """Values of the Real inputs at step `k`: each oscillates about its own offset from its start."""
    values: dict[str, Value] = {}
    for i, v in enumerate(inputs):
        if v.kind == "Real":
            away = 0.05 * (i % 7 + 1) + 0.1 * math.sin(0.7 * k + i)
            values[v.name] = within(v, start_number(v) + _scale(v) * away)
    return values


def around(v: Variable, values: Values) -> list[Value]:
    """The value of a variable, or its start if it is not among `values`, and nearby values that it may take."""
    value = start_value(v)
    if v.kind == "Boolean":
        return [value, not value]
    if isinstance(value, str):
        return [value, f"{value}+"]
    if isinstance(value, bytes):
        return [value, value + b"+"]
    if v.kind == "Enumeration":
        return [value, *(item for item in v.choices.values() if item != value)]
    if v.kind == "Real":
        value = float(values.get(v.name, value))
        return [value, *(within(v, value + sign * _scale(v) / 16.0) for sign in (1.0, -1.0))]
    return [value, *(int(within(v, value + sign)) for sign in (1, -1))]


def moved(v: Variable) -> float:
    """A value a little away from the start of a variable."""
    start = start_number(v)
    step = 0.05 * (start or _scale(v))
    up = within(v, start + step)
    return up if up != start else within(v, start - step)


def _scale(v: Variable) -> float:
    return abs(v.nominal) if v.nominal is not None else max(1.0, abs(start_number(v)))
