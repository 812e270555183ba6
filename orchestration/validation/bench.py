"""Where an FMU is put through its paces: instances of it, what they are given, and runs of them."""

import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from orchestration.validation.fmu import Fmu, Variable
from orchestration.validation.instance import Instance, RefusedError, Row, Value, Values, same
from orchestration.validation.variables import limits

STEPS = 100
"""Communication steps of a run"""
UNEVEN = (0.4, 0.6, 1.0, 0.3, 0.7)
"""Lengths of variable steps, of that of the default experiment: between samples, on them and across them"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """What happens to an instance in a run."""

    parameters: Values = field(default_factory=dict)
    moving: bool = False
    """Whether the inputs move from step to step; else they stay at their starts"""
    uneven: bool = False
    """Whether the steps are of different lengths"""
    times_set: int = 1
    """How often the inputs are set before a step"""
    steps: int = STEPS


PLAIN = Plan()
"""At start values, by the default experiment"""


@dataclass(frozen=True, eq=False)
class Bench:
    """An FMU and the folder that it is unpacked in."""

    fmu: Fmu
    folder: Path
    _numbers: Iterator[int] = field(default_factory=itertools.count)

    def instance(self) -> Instance:
        """A fresh one, of a name of its own."""
        return Instance(self.fmu, self.folder, f"{self.fmu.model_identifier} {next(self._numbers)}")

    # -- time -----------------------------------------------------------------------------------------------

    @functools.cached_property
    def start(self) -> float:
        """Start time of the default experiment, in seconds."""
        return self.fmu.experiment.get("startTime", 0.0)

    @functools.cached_property
    def step(self) -> float:
        """Communication step of the default experiment, in seconds; a hundredth of it, or 10 ms, if it has none."""
        experiment = self.fmu.experiment
        given = experiment.get("stepSize", (experiment.get("stopTime", self.start + 1.0) - self.start) / STEPS)
        return given if math.isfinite(given) and given > 0.0 else 0.01

    def points(self, plan: Plan) -> list[tuple[float, float]]:
        """Communication point and step size of each step, up to the end of the default experiment.

        Nothing is accumulated.
        """
        shares = UNEVEN if plan.uneven else (1.0,)
        stop = self.fmu.experiment.get("stopTime", math.inf) + 1e-6 * self.step
        points: list[tuple[float, float]] = []
        for k in range(plan.steps):
            done = k // len(shares) * math.fsum(shares) + math.fsum(shares[: k % len(shares)])
            t, h = self.start + done * self.step, shares[k % len(shares)] * self.step
            if t + h <= stop or not points:
                points.append((t, h))
        return points

    # -- values ---------------------------------------------------------------------------------------------

    @functools.cached_property
    def inputs(self) -> tuple[Variable, ...]:
        """All inputs."""
        return self.fmu.of_causality("input")

    @functools.cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """All outputs."""
        return self.fmu.of_causality("output")

    @functools.cached_property
    def general_parameters(self) -> dict[str, Value]:
        """Real parameters a little away from their starts.

        At its defaults a model may leave out what it has: a lag of time constant zero has no state to lose.
        """
        return {v.name: _moved(v) for v in self.fmu.of_causality("parameter") if v.type == "Real" and v.start}

    def inputs_at(self, k: int) -> dict[str, Value]:
        """Values of the Real inputs at step `k`: each by its own amount away from its start, and swinging."""
        values: dict[str, Value] = {}
        for i, v in enumerate(self.inputs):
            if v.type == "Real":
                away = 0.05 * (i % 7 + 1) + 0.1 * math.sin(0.7 * k + i)
                values[v.name] = _within(v, float(v.start_value) + _scale(v) * away)
        return values

    def around(self, v: Variable) -> list[Value]:
        """The value of an input at step 0, and values near it that it may take."""
        value = v.start_value
        if v.type == "Boolean":
            return [value, not value]
        if isinstance(value, str):
            return [value, f"{value}+"]
        if v.type == "Enumeration":
            return [value, *(item for item in v.items if item != value)]
        if v.type == "Real":
            value = float(self.inputs_at(0)[v.name])
            return [value, *(_within(v, value + sign * _scale(v) / 16.0) for sign in (1.0, -1.0))]
        return [value, *(int(_within(v, value + sign)) for sign in (1, -1))]

    # -- runs -----------------------------------------------------------------------------------------------

    def begin(self, instance: Instance, plan: Plan) -> None:
        """Through initialisation."""
        instance.initialise({**plan.parameters, **(self.inputs_at(0) if plan.moving else {})}, self.start)

    def fly(self, instance: Instance, plan: Plan, first: int = 0, last: int | None = None) -> list[Row]:
        """Steps `first` to before `last`; every variable after each of them."""
        rows = []
        for k, (t, h) in list(enumerate(self.points(plan)))[first:last]:
            for _ in range(plan.times_set if plan.moving else 0):
                instance.set(self.inputs_at(k))
            if not instance.step(t, h):
                break
            rows.append(instance.get(self.fmu.variables))
        return rows

    def flown(self, plan: Plan) -> list[Row]:
        """A whole run of an instance of its own."""
        with self.instance() as instance:
            self.begin(instance, plan)
            return self.fly(instance, plan)

    @functools.cached_property
    def everything(self) -> Plan:
        """General parameters, moving inputs, and uneven steps if the FMU says that it takes them."""
        uneven = self.fmu.can("canHandleVariableCommunicationStepSize")
        return Plan(parameters=self.general_parameters, moving=True, uneven=uneven, steps=40)

    @functools.cached_property
    def _rich(self) -> tuple[Plan, list[Row]]:
        plan = self.everything
        at_starts = replace(plan, parameters={})
        for candidate in (plan, at_starts, replace(at_starts, uneven=False), replace(at_starts, moving=False)):
            try:
                return candidate, self.flown(candidate)
            except RefusedError:
                continue
        plain = Plan(steps=plan.steps)
        return plain, self.flown(plain)

    @property
    def rich(self) -> Plan:
        """As much of `everything` as the FMU takes; of what is not its own it need not take all."""
        return self._rich[0]

    @property
    def expected(self) -> list[Row]:
        """The rich run of an instance alone."""
        return self._rich[1]


def difference(found: list[Row], expected: list[Row]) -> str | None:
    """Where two runs part: step, variable and both values; None if they are the same to the last bit."""
    if len(found) != len(expected):
        return f"the run ends after {len(found)} steps, expected {len(expected)}"
    for k, (a, b) in enumerate(zip(found, expected)):
        for name, value in a.items():
            if not same(value, b[name]):
                return f"{name} = {value!r} after step {k + 1} of {len(found)}, expected {b[name]!r}"
    return None


def _scale(v: Variable) -> float:
    return abs(float(v.nominal)) if v.nominal is not None else max(1.0, abs(float(v.start_value)))


def _moved(v: Variable) -> float:
    start = float(v.start_value)
    step = 0.05 * (start or _scale(v))
    up = _within(v, start + step)
    return up if up != start else _within(v, start - step)


def _within(v: Variable, value: float) -> float:
    low, high = limits(v)
    return min(max(value, low), high)
