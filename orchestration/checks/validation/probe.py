"""Where an FMU is put through its paces: instances of it, what they are given, and runs of them."""

import functools
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from orchestration.checks.validation.declared import Variable
from orchestration.checks.validation.finding import Note
from orchestration.checks.validation.fmu import Fmu
from orchestration.checks.validation.instance import Instance, RefusedError, Row, Value, Values, instance_of, same
from orchestration.checks.validation.variables import limits
from orchestration.fmi.messages import Message
from orchestration.fmi.values import INTEGERS
from orchestration.processes.waiting import own_clock

STEPS = 100
"""Communication steps of a run"""
FEWEST = 3
"""Steps of a run of an FMU however slow it is"""
SHARE = 0.02
"""Of the time there is for an FMU that one run may take; a slow FMU gets fewer steps"""
MOST_WATCHED = 1000
"""Variables that are compared between runs, of an FMU that has many more"""
TOLERANCE = 1e-4
"""Between runs of an FMU that is not ours, relative to the largest value of a variable in the run"""
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


@dataclass(frozen=True, kw_only=True, slots=True)
class FirstRun:
    """The first run at start values."""

    steps: int
    whole: bool
    """Whether it went through all steps that it was meant to"""
    seconds: float
    messages: tuple[Message, ...]


@dataclass(frozen=True, eq=False)
class Probe:
    """An FMU and the folder that it is unpacked in."""

    fmu: Fmu
    folder: Path
    budget: float
    """[s] for all that is done with it"""
    beat: Callable[[], None] = lambda: None
    """Hears that a call of the FMU begins or returns"""
    _numbers: Iterator[int] = field(default_factory=itertools.count)

    def instance(self) -> Instance:
        """A fresh one, of a name of its own."""
        return instance_of(self.fmu, self.folder, f"{self.fmu.model_identifier} {next(self._numbers)}", self.beat)

    # -- time -----------------------------------------------------------------------------------------------

    @functools.cached_property
    def start(self) -> float:
        """Start time of the default experiment, in seconds."""
        return self.fmu.experiment.get("startTime", 0.0)

    @functools.cached_property
    def step(self) -> float:
        """Communication step of the default experiment, in seconds; if it has none, that which the FMU takes inside.

        Without any a hundredth of the experiment, or 10 ms.
        """
        experiment = self.fmu.experiment
        share = (experiment.get("stopTime", self.start + 1.0) - self.start) / STEPS
        given = experiment.get("stepSize", self.fmu.fixed_step or share)
        return given if math.isfinite(given) and given > 0.0 else 0.01

    def points(self, plan: Plan) -> list[tuple[float, float]]:
        """Communication point and step size of each step, up to the end of the default experiment.

        Nothing is accumulated. No more steps than an FMU of its pace has time for.
        """
        return self._points(plan)[: self.first.steps]

    def _points(self, plan: Plan) -> list[tuple[float, float]]:
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

    def of(self, causality: str) -> tuple[Variable, ...]:
        """Scalars and elements of arrays of this causality."""
        return tuple(v for v in self.fmu.elements if v.causality == causality)

    @functools.cached_property
    def inputs(self) -> tuple[Variable, ...]:
        """All inputs."""
        return self.of("input")

    @functools.cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """All outputs."""
        return self.of("output")

    @functools.cached_property
    def general_parameters(self) -> dict[str, Value]:
        """Real parameters a little away from their starts.

        At its defaults a model may leave out what it has: a lag of time constant zero has no state to lose.
        """
        return {v.name: _moved(v) for v in self.of("parameter") if v.kind == "Real" and v.start}

    def inputs_at(self, k: int) -> dict[str, Value]:
        """Values of the Real inputs at step `k`: each by its own amount away from its start, and swinging."""
        values: dict[str, Value] = {}
        for i, v in enumerate(self.inputs):
            if v.kind == "Real":
                away = 0.05 * (i % 7 + 1) + 0.1 * math.sin(0.7 * k + i)
                values[v.name] = _within(v, float(v.start or 0.0) + _scale(v) * away)
        return values

    def around(self, v: Variable) -> list[Value]:
        """The value of an input at step 0, or that a parameter starts at, and values near it that it may take."""
        value = v.start_value
        if v.kind == "Boolean":
            return [value, not value]
        if isinstance(value, str):
            return [value, f"{value}+"]
        if isinstance(value, bytes):
            return [value, value + b"+"]
        if v.kind == "Enumeration":
            return [value, *(item for item in v.items if item != value)]
        if v.kind == "Real":
            value = float(self.inputs_at(0).get(v.name, value))
            return [value, *(_within(v, value + sign * _scale(v) / 16.0) for sign in (1.0, -1.0))]
        return [value, *(int(_within(v, value + sign)) for sign in (1, -1))]

    @functools.cached_property
    def watched(self) -> tuple[Variable, ...]:
        """Variables that are compared between runs: all; of very many the outputs and some of the others."""
        every = self.fmu.elements
        if len(every) <= MOST_WATCHED or self.fmu.is_ours:
            return every
        some = every[:: math.ceil(len(every) / MOST_WATCHED)]
        return tuple({v.name: v for v in (*self.outputs[:MOST_WATCHED], *some)}.values())

    # -- runs -----------------------------------------------------------------------------------------------

    @functools.cached_property
    def first(self) -> FirstRun:
        """The first run, which tells how many steps there is time for; raises `RefusedError`."""
        started = own_clock()
        points = self._points(PLAIN)
        with self.instance() as instance:
            self.begin(instance, PLAIN)
            done, goes_on = 0, True
            for t, h in points:
                if done >= FEWEST and own_clock() - started > SHARE * self.budget:
                    break
                goes_on = instance.step(t, h)
                done += 1
                if not goes_on:
                    break
            instance.terminate()
            return FirstRun(
                steps=max(done, 1) if done < len(points) and goes_on else STEPS,
                whole=done == len(points) or not goes_on,
                seconds=own_clock() - started,
                messages=tuple(instance.messages),
            )

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
            rows.append(instance.get(self.watched))
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

    @functools.cached_property
    def repeats(self) -> str | None:
        """Where an equal run of another fresh instance parts from the first; None if it does not."""
        return difference(self.flown(self.rich), self.expected)

    def parted(self, found: list[Row], expected: list[Row], text: str) -> Iterator[str]:
        """Where two runs that should be the same part, put into `text`; of an FMU that is not ours a little is noted.

        FMI asks that a simulation can go on, not for the last bit.
        """
        exact = difference(found, expected)
        if exact is None:
            return
        large = exact if self.fmu.is_ours else difference(found, expected, TOLERANCE)
        if large is not None:
            yield text.format(large)
        else:
            yield Note(f"{text.format(exact)}: less than {TOLERANCE:g} of the largest value in the run")


def difference(found: list[Row], expected: list[Row], tolerance: float = 0.0) -> str | None:
    """Where two runs part: step, variable and both values; None if they are the same.

    To the last bit, or within `tolerance` of the largest value of a variable in the run.
    """
    if len(found) != len(expected):
        return f"the run ends after {len(found)} steps, expected {len(expected)}"
    largest: dict[str, float] = {}
    for row in expected if tolerance else ():
        for name, value in row.items():
            if isinstance(value, float):
                largest[name] = max(largest.get(name, 0.0), abs(value))
    for k, (a, b) in enumerate(zip(found, expected)):
        for name, value in a.items():
            if not (same(value, b[name]) or _near(value, b[name], tolerance * largest.get(name, 0.0))):
                return f"{name} = {value!r} after step {k + 1} of {len(found)}, expected {b[name]!r}"
    return None


def _near(a: Value, b: Value, distance: float) -> bool:
    return isinstance(a, float) and isinstance(b, float) and abs(a - b) <= distance and distance > 0.0


def _scale(v: Variable) -> float:
    return abs(float(v.nominal)) if v.nominal is not None else max(1.0, abs(float(v.start or 0.0)))


def _moved(v: Variable) -> float:
    start = float(v.start or 0.0)
    step = 0.05 * (start or _scale(v))
    up = _within(v, start + step)
    return up if up != start else _within(v, start - step)


def _within(v: Variable, value: float) -> float:
    low, high = limits(v)
    if v.type in INTEGERS:
        of = np.iinfo(INTEGERS[v.type])
        low, high = max(low, of.min), min(high, of.max)
    return min(max(value, low), high)
