"""Linear loops from their FMUs, each taken apart once, and what follows from their timing."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.exact.as_simulated import SimulatedEffects, expect_rows
from orchestration.exact.clockwork import ATTOSECONDS, Clockwork, Link, Task
from orchestration.exact.components import Measured
from orchestration.exact.effects import LoopEffects, TrueEffects
from orchestration.exact.horizon import costs_until
from orchestration.exact.linear import Components, Continuous, Sampled
from orchestration.exact.moments import JumpLinear
from orchestration.exact.repeating import foretold
from orchestration.exact.shared import by_itself
from orchestration.exact.start import Start, start_of
from orchestration.exact.timing import links_of, tasks_of
from orchestration.exact.wanted import Wanted
from orchestration.expressions.syntax import Call
from orchestration.fmi.model import Model
from orchestration.fmi.reuse import Instances
from orchestration.schedule.plan import Plan
from orchestration.stability.linear_loop import Beside, at_rest
from orchestration.stability.operating_point import true_period
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.sampling import Sampling, is_foreseen
from orchestration.system.times import NANOSECONDS, exact_nanoseconds
from orchestration.system.variable_names import component_of
from orchestration.system.written import tables_of

T = TypeVar("T")

ORDERS = (1, 2, 4, 8, 16, 32)
"""of Gauss's rule, tried in turn until the next one changes nothing"""
AGREE = 1e-10
"""of a figure: what may differ from order to order"""


@dataclass(frozen=True, kw_only=True)
class Linear:
    """The components of a system about its rest, and its objectives there."""

    parts: Components
    how: Mapping[str, str]
    """each is known"""
    accuracy: float
    """of what the least known of them answers, relative"""
    wanted: Wanted
    noise: Mapping[str, float]
    """the intensities of white noise, by input"""
    start: Start | None = None
    """where the system begins, if that was asked for"""


@dataclass(frozen=True, kw_only=True)
class Solved:
    """A loop under its timing."""

    linear: Linear
    loop: JumpLinear
    period: float
    """[s]"""
    means: Mapping[Call, float] | None
    """None: the second moments have no end"""
    apart: float
    """what the last doubling of the nodes has changed, relative"""
    order: int | None
    """of Gauss's rule; None: all random times are listed"""


@dataclass(frozen=True, kw_only=True)
class Until:
    """A loop from where it begins to a given time, as `Solved`."""

    means: Mapping[Call, float]
    """over that time"""
    apart: float
    order: int | None


@dataclass(frozen=True, kw_only=True)
class _Finest(Generic[T]):
    found: tuple[T, Floats]
    """an answer, and the numbers of it that were compared"""
    period: float
    apart: float
    order: int | None


class Loops:
    """Takes systems apart, those that differ in nothing but delays, losses and jitter once.

    Models are by what systems call their FMUs.
    """

    def __init__(self, models: Mapping[str, Model], *, simulated: bool = False) -> None:
        self.simulated = simulated
        self._models = models
        self._known: dict[str, Linear] = {}
        self._measured = Measured()

    @cached_property
    def _instances(self) -> Instances:
        """FMUs in the process that computes, kept from system to system."""
        return Instances()

    def linear(self, system: System, *, begins: System | None = None) -> Linear:
        """The components and objectives of a system; raises `UsageError` for one that is not linear about a rest.

        With where `begins` does by itself, if that is given.
        """
        system, begins = by_itself(system), None if begins is None else by_itself(begins)
        key = json.dumps([tables_of(_unhurried(x)) for x in (system, begins) if x], default=str, sort_keys=True)
        if key not in self._known:
            self._known[key] = self._taken_apart(system, begins)
        return self._known[key]

    def _taken_apart(self, system: System, begins: System | None) -> Linear:
        noise = _white(system, simulated=self.simulated)
        models = {name: self._models[component.fmu] for name, component in system.components.items()}
        wanted, start = Wanted(system, models), None
        beside = Beside(moved=tuple(noise), seen=wanted.seen)
        with at_rest(system, self._instances, beside=beside, models=models) as loop:
            wanted.about(loop)
            known = self._measured.of(loop)
            parts = {name: one.part for name, one in known.items()}
            if begins is not None:
                tangents = {name: one.tangent for name, one in known.items()}
                start = start_of(begins, loop, parts, tangents, self._instances)
        how = {name: one.how for name, one in known.items()}
        accuracy = max((one.accuracy for one in known.values()), default=0.0)
        for name, part in parts.items():
            if isinstance(part, Continuous) and part.unfit is not None and not self.simulated:
                raise UsageError(
                    f"{name} is no linear system in continuous time: {part.unfit}; expected --as-simulated"
                )
        return Linear(parts=parts, how=how, accuracy=accuracy, wanted=wanted, noise=noise, start=start)

    def radius(self, system: System, *, agree: float) -> float:
        """The mean-square radius alone, as `solved` has it."""
        system = changed(system, system.operating_point)
        linear = self.linear(system)

        def answer(clock: Clockwork) -> tuple[float, Floats]:
            radius = JumpLinear(*clock.stages()).radius
            return radius, np.array([radius])

        effects = self._effects(system, linear, ())
        return self._finest(self._timing(system, linear, effects), effects, answer, agree).found[0]

    def solved(self, system: System) -> Solved:
        """A system by finer and finer rules, until they agree; raises `UsageError` where there is too much of it."""
        system = changed(system, system.operating_point)
        linear = self.linear(system)
        used = [call for call, mean in linear.wanted.means.items() if np.any(mean.Q)]

        def answer(clock: Clockwork) -> tuple[JumpLinear, Floats]:
            loop = JumpLinear(*clock.stages())
            costs = loop.costs() / float(clock.period) if loop.radius < 1.0 else np.full(len(used), math.inf)
            return loop, np.array([loop.radius, *costs])

        effects = self._effects(system, linear, used)
        finest = self._finest(self._timing(system, linear, effects), effects, answer, AGREE)
        (loop, (_, *costs)) = finest.found
        means = None
        if loop.radius < 1.0:
            means = {call: mean.c for call, mean in linear.wanted.means.items()}
            means |= {call: means[call] + cost for call, cost in zip(used, costs)}
        return Solved(
            linear=linear, loop=loop, period=finest.period, means=means, apart=finest.apart, order=finest.order
        )

    def until(self, system: System, horizon: float) -> Until:
        """The means of a system from where it begins to `horizon` [s], as `solved`."""
        rests = changed(system, system.operating_point)
        linear = self.linear(rests, begins=system)
        used = [call for call, mean in linear.wanted.means.items() if np.any(mean.Q) or np.any(mean.g)]
        effects = self._effects(rests, linear, used, one=True)
        assert linear.start is not None
        start, one = effects.begin(linear.start), effects.places("one", "").start
        end = round(exact_nanoseconds(horizon) * (ATTOSECONDS // NANOSECONDS))

        def answer(clock: Clockwork) -> tuple[None, Floats]:
            return None, costs_until(clock, start, one, end) / (end / ATTOSECONDS) if used else np.zeros(0)

        finest = self._finest(self._timing(rests, linear, effects, horizon), effects, answer, AGREE)
        means = {call: mean.c for call, mean in linear.wanted.means.items()}
        means |= {call: means[call] + cost for call, cost in zip(used, finest.found[1].tolist())}
        return Until(means=means, apart=finest.apart, order=finest.order)

    def _finest(
        self,
        timing: tuple[Sequence[Task], Sequence[Link]],
        effects: LoopEffects,
        answer: Callable[[Clockwork], tuple[T, Floats]],
        agree: float,
    ) -> _Finest[T]:
        """An answer, numbers of which may not change any more, by the least order of Gauss's rule that will do."""
        tasks, links = timing
        by_rule = any(x.late.is_by_rule for x in links) or any(task.jitter.is_by_rule for task in tasks)
        found: list[tuple[T, Floats]] = []
        apart, order, period = 0.0, ORDERS[0], 1.0
        for next_order in ORDERS if by_rule else ORDERS[:1]:
            try:
                clock = Clockwork(tasks, links, effects, order=next_order, grids=effects.grids)
                one = answer(clock)
            except UsageError:
                if len(found) < 2:
                    raise
                break
            order, period = next_order, float(clock.period)
            found.append(one)
            if len(found) > 1:
                apart = _apart(found[-2][1], found[-1][1])
                if apart <= agree:
                    break
        return _Finest(found=found[-1], period=period, apart=apart, order=order if by_rule else None)

    def _effects(self, system: System, linear: Linear, used: Sequence[Call], *, one: bool = False) -> LoopEffects:
        """Of which the costs are these means."""
        names = Plan(system).sampled
        effects: LoopEffects
        if self.simulated:
            effects = SimulatedEffects(system, linear.parts, names, one=one)
        else:
            effects = TrueEffects(system, linear.parts, names, linear.noise, one=one)
        effects.charge([linear.wanted.means[call] for call in used])
        return effects

    def _timing(
        self, system: System, linear: Linear, effects: LoopEffects, horizon: float | None = None
    ) -> tuple[Sequence[Task], Sequence[Link]]:
        """When what happens, where the scheduler decides it too: again and again, or up to a `horizon` [s]."""
        by_themselves = [task.period for task in tasks_of(system) if not is_foreseen(_sampling(system, task.name))]
        steps = [link.step for link in links_of(system) if link.step is not None]
        told = foretold(system, horizon=horizon, beside=[*by_themselves, *steps, *effects.grids])
        tasks, links = tasks_of(system, told), links_of(system, told)
        expect_same_steps(system, tasks, linear.parts, repeating=horizon is None)
        if self.simulated:
            expect_rows(system, tasks, links)
        return tasks, links


def expect_same_steps(system: System, tasks: Sequence[Task], parts: Components, *, repeating: bool = True) -> None:
    """Raise `UsageError` for a task whose samples are irregular, and do what depends on when the next one is.

    They come again in the next period where that is `repeating`.
    """
    for task in tasks:
        part = parts[task.name]
        if not (isinstance(part, Sampled) and part.minds_step):
            continue
        if not task.jitter.is_certain:
            raise UsageError(
                f"components.{task.name}.sampling.jitter: what {task.name} does depends on how long it is to the next "
                "sample; expected none"
            )
        step = true_period(_sampling(system, task.name)) / NANOSECONDS
        ends = [*task.offsets, *(task.period + offset for offset in task.offsets[:1] if repeating)]
        if any(then - now != step for now, then in itertools.pairwise(ends)):
            raise UsageError(
                f"components.{task.name}: what it does depends on how long it is to the next sample, which is not "
                f"{float(step):g} s each time; expected nobody else to make it late"
            )


def _sampling(system: System, name: str) -> Sampling:
    """Of a component that is sampled."""
    sampling = system.components[name].sampling
    assert sampling is not None
    return sampling


def _unhurried(system: System) -> System:
    """A system without what its timing leaves to chance, and how late it is."""
    return replace(
        system,
        components={
            name: one if one.sampling is None else replace(one, sampling=replace(one.sampling, jitter=0.0))
            for name, one in system.components.items()
        },
        connections=tuple(
            replace(x, delay=0.0, delay_jitter=0.0, jitter_distribution="uniform", loss=0.0, burst_length=None)
            for x in system.connections
        ),
    )


def _white(system: System, *, simulated: bool) -> dict[str, float]:
    """The intensities of white noise by input; raises `UsageError` for what drives a system otherwise."""
    found = {}
    for name, source in system.sources.items():
        if source.is_random and source.noise is None:
            raise UsageError(f"sources.{name}: gusts by name; expected white noise, of which there is an expectation")
        for end in source.to if source.noise else ():
            if not simulated and system.components[component_of(end)].sampling is not None:
                raise UsageError(
                    f"sources.{name}: white noise into {end}, which samples it: its variance has no limit; "
                    "expected noise of a connection, or --as-simulated"
                )
            found[end] = float(source.noise or 0.0)
    return found


def _apart(one: Floats, other: Floats) -> float:
    """How far the numbers of two answers are from each other, relative."""
    finite = np.isfinite(one) & np.isfinite(other)
    one, other = one[finite], other[finite]
    return float((np.abs(one - other) / np.maximum(np.abs(other), 1e-300)).max(initial=0.0))
