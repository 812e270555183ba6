"""Linear loops from their FMUs, each linearised once, solved under any timing."""

import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from orchestration.components.fmi.read_description import Model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.systems.expressions.syntax import Call
from orchestration.systems.schedule.overload import errors_name_overload
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.component import Sampling, has_scheduled_instants
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.file_tables import tables_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import at_operating_point
from orchestration.theory.exact.as_simulated import SimulatedEffects, expect_rows
from orchestration.theory.exact.components import ComponentIdentifier
from orchestration.theory.exact.effects import ContinuousEffects, LoopEffects
from orchestration.theory.exact.initial_state import InitialState, initial_state_of, steps_of
from orchestration.theory.exact.moments import JumpLinear
from orchestration.theory.exact.objectives import ObjectiveMeans
from orchestration.theory.exact.random_times import ATTOSECONDS, RandomLink, SampledTask, attoseconds, exact_seconds
from orchestration.theory.exact.timing import by_turns, links_of, sampled_tasks
from orchestration.theory.exact.timing_chain import TimingChain, costs_until
from orchestration.theory.stability.in_double import as_it_is
from orchestration.theory.stability.loop_at_rest import ExtraSignals, KnownTangents, Start, whole_at_rest
from orchestration.theory.stability.matrices import OF_FIXED_STEP, Components, Continuous, SampledSystem
from orchestration.theory.stability.periodic_schedule import periodic_schedule
from orchestration.theory.stability.scheduled import without_scheduler

T = TypeVar("T")

ORDERS = (1, 2, 4, 8, 16, 32)
"""Orders of Gauss's rule, tried in turn until the next one changes nothing"""
ORDER_TOLERANCE = 1e-10
"""Difference of a result allowed from order to order"""
SURE = 4.0
"""Factor on the root mean square of a few drawn changes of a cost, which no further one may exceed"""


@dataclass(frozen=True, kw_only=True)
class Linear:
    """The components of a system linearised about its rest, and its objectives expanded there."""

    parts: Components
    methods: Mapping[str, str]
    """Methods by which each is identified"""
    accuracy: float
    """Accuracy of the responses of the least accurately identified one, relative"""
    others: Sequence[Components]
    """The components as other measurements may show them"""
    objectives: ObjectiveMeans
    noise: Mapping[str, float]
    """the intensities of white noise, by input"""
    start: Start | None
    """Begin, where the system has come to rest; None: its operating point is at rest at once"""
    initial: InitialState | None = None
    """None: not requested"""


@dataclass(frozen=True, kw_only=True)
class Converged(Generic[T]):
    """A result by the least order of Gauss's rule at which it converges."""

    result: T
    numbers: Floats
    """Numbers of the result that were compared"""
    period: float
    """Period [s]"""
    difference: float
    """change by the last doubling of the nodes, relative, and the error of the initial state"""
    sensitivity: float = 0.0
    """Change of costs by errors of the components, relative; 0: not asked for"""
    order: int | None
    """Order of Gauss's rule; None: all random times are enumerated"""


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A loop under its timing."""

    linear: Linear
    loop: Converged[JumpLinear]
    means: Mapping[Call, float] | None
    """None: the second moments are unbounded"""


class Loops:
    """Linearises and solves systems; those that differ in delays, losses and jitter alone are linearised once.

    Models are by the names of FMUs in systems, not in double precision. What is linearised `nearly` takes components as
    they were measured in other systems where they still predict a response to one part in a million: in the order of
    shorter periods.
    """

    def __init__(self, models: Mapping[str, Model], *, simulated: bool = False, nearly: bool = False) -> None:
        self.simulated = simulated
        self._tangents = KnownTangents() if nearly else None
        self._models = models
        self._known: dict[str, Linear] = {}
        self._identifier = ComponentIdentifier()

    @cached_property
    def instances(self) -> Instances:
        """FMUs in the computing process, kept from system to system."""
        return Instances()

    def linear(self, system: System, *, initial: System | None = None) -> Linear:
        """The components and objectives of a system; raises `UsageError` for one that is not linear about a rest.

        With the initial state of the system `initial`, if given.
        """
        key = linearised_as(*(x for x in (system, initial) if x))
        system, initial = without_scheduler(system), None if initial is None else without_scheduler(initial)
        if key not in self._known:
            try:
                self._known[key] = self._linearised(system, initial)
            except UsageError:
                if not self._tangents:
                    raise
                self._tangents, self._identifier = KnownTangents(), ComponentIdentifier()  # none of other systems
                self._known[key] = self._linearised(system, initial)
        return self._known[key]

    def _linearised(self, system: System, initial: System | None) -> Linear:
        noise = _white_noise(system, simulated=self.simulated)
        models = {name: self._models[as_it_is(component.fmu)] for name, component in system.components.items()}
        objectives, initial_state = ObjectiveMeans(system, models), None
        stepped = [] if initial is None else [end for name in steps_of(initial) for end in initial.sources[name].to]
        extra = ExtraSignals(inputs=(*noise, *stepped), outputs=objectives.outputs)
        at_rest = KnownTangents() if self._tangents is None else self._tangents
        with whole_at_rest(system, self.instances, extra=extra, models=models, known=at_rest) as loop:
            objectives.expand_about(loop)
            known = self._identifier.of(loop)
            parts = {name: one.part for name, one in known.items()}
            if initial is not None:
                for name, one in known.items():
                    if isinstance(one.part, SampledSystem) and one.part.later:
                        raise UsageError(
                            f"horizon: the initial state of {name}, code of several rates, is not identified: expected "
                            "none, for stationary means, or an average over runs (quadcosim sweep)"
                        )
                tangents = {name: one.tangent for name, one in known.items()}
                means = objectives.means.values()
                initial_state = initial_state_of(initial, loop, parts, tangents, means, self.instances)
        methods = {name: one.method for name, one in known.items()}
        accuracy = max((one.accuracy for one in known.values()), default=0.0)
        others = [dict(zip(known, each)) for each in zip(*(one.others for one in known.values()))]
        for name, part in parts.items():
            if isinstance(part, Continuous) and part.unfit is not None and not self.simulated:
                raise UsageError(
                    f"{name} is no linear system in continuous time, or rounding hides that it is: {part.unfit}; "
                    "expected --as-simulated of expect, or a component with more internal steps, or a method of "
                    "higher order"
                )
        return Linear(
            parts=parts, methods=methods, accuracy=accuracy, others=others, objectives=objectives, noise=noise,
            start=at_rest.start, initial=initial_state,
        )  # fmt: skip

    def radius(self, system: System, *, agree: float) -> float:
        """The mean-square radius alone, as `solve` has it."""
        return self.jump_linear(system, agree=agree).radius

    def jump_linear(self, system: System, *, agree: float) -> JumpLinear:
        """The loop without costs, by as fine a rule as its radius needs."""
        system = at_operating_point(system)
        linear = self.linear(system)

        def answer(chain: TimingChain) -> tuple[JumpLinear, Floats]:
            loop = JumpLinear(*chain.stages())
            return loop, np.array([loop.radius])

        effects = self._effects(system, linear, ())
        return self._refined(self._tasks_and_links(system, linear, effects), effects, answer, agree).result

    def solve(self, system: System, *, judged: bool = False) -> Solution:
        """Solve a system by finer and finer rules, until they agree; raises `UsageError` where it is too large.

        How errors of the components change costs is computed where they are `judged`.
        """
        system = at_operating_point(system)
        linear = self.linear(system)
        used = [call for call, mean in linear.objectives.means.items() if np.any(mean.Q)]

        def answer(chain: TimingChain) -> tuple[JumpLinear, Floats]:
            loop = JumpLinear(*chain.stages())
            costs = loop.costs() / float(chain.period) if loop.radius < 1.0 else np.full(len(used), math.inf)
            return loop, np.array([loop.radius, *costs])

        effects = self._effects(system, linear, used)
        timing = self._tasks_and_links(system, linear, effects)
        converged = self._refined(timing, effects, answer, ORDER_TOLERANCE)
        if judged and used and converged.result.radius < 1.0:
            others = [self._effects(system, replace(linear, parts=parts), used) for parts in linear.others]
            converged = _with_sensitivity(converged, timing, others, lambda chain: answer(chain)[1][1:])
        costs = converged.numbers[1:].tolist()
        means = _with_costs(linear, used, costs) if converged.result.radius < 1.0 else None
        return Solution(linear=linear, loop=converged, means=means)

    def solve_to(self, system: System, horizon: float, *, judged: bool = False) -> Converged[Mapping[Call, float]]:
        """The means of a system from its initial state to `horizon` [s], as `solve`."""
        rests = at_operating_point(system)
        linear = self.linear(rests, initial=replace(system, stop_time=horizon))
        used = [call for call, mean in linear.objectives.means.items() if np.any(mean.Q) or np.any(mean.g)]

        def effects_of(parts: Components) -> LoopEffects:
            return self._effects(rests, replace(linear, parts=parts), used, with_means=True, steps=steps_of(system))

        effects = effects_of(linear.parts)
        assert linear.initial is not None
        start, constant = effects.initial_vector(linear.initial), effects.places("constant", "").start
        end = attoseconds(exact_seconds(horizon))

        def answer(chain: TimingChain) -> tuple[Mapping[Call, float], Floats]:
            costs = costs_until(chain, start, constant, end) / (end / ATTOSECONDS) if used else np.zeros(0)
            return _with_costs(linear, used, costs.tolist()), costs

        timing = self._tasks_and_links(rests, linear, effects, horizon)
        found = self._refined(timing, effects, answer, ORDER_TOLERANCE)
        if judged and used:
            found = _with_sensitivity(found, timing, map(effects_of, linear.others), lambda chain: answer(chain)[1])
        return replace(found, difference=found.difference + linear.initial.accuracy)

    def _refined(
        self,
        timing: tuple[Sequence[SampledTask], Sequence[RandomLink]],
        effects: LoopEffects,
        answer: Callable[[TimingChain], tuple[T, Floats]],
        agree: float,
    ) -> Converged[T]:
        tasks, links = timing
        by_rule = any(x.delay_jitter.is_by_rule for x in links) or any(task.jitter.is_by_rule for task in tasks)
        found: list[tuple[T, Floats]] = []
        difference, order, period = 0.0, ORDERS[0], 1.0
        for next_order in ORDERS if by_rule else ORDERS[:1]:
            try:
                chain = TimingChain(tasks, links, effects, order=next_order, grids=effects.grids)
                one = answer(chain)
            except UsageError:
                if len(found) < 2:
                    raise
                break
            order, period = next_order, float(chain.period)
            found.append(one)
            if len(found) > 1:
                difference = _relative_difference(found[-2][1], found[-1][1])
                if difference <= agree:
                    break
        return Converged(
            result=found[-1][0], numbers=found[-1][1], period=period, difference=difference,
            order=order if by_rule else None,
        )  # fmt: skip

    def _effects(
        self,
        system: System,
        linear: Linear,
        used: Sequence[Call],
        *,
        with_means: bool = False,
        steps: Mapping[str, float] | None = None,
    ) -> LoopEffects:
        """The effects, with these means as costs."""
        names = Plan(system).sampled
        effects: LoopEffects
        if self.simulated:
            effects = SimulatedEffects(system, linear.parts, names, with_means=with_means, steps=steps)
        else:
            effects = ContinuousEffects(system, linear.parts, names, linear.noise, with_means=with_means, steps=steps)
        effects.charge([linear.objectives.means[call] for call in used])
        return effects

    def _tasks_and_links(
        self, system: System, linear: Linear, effects: LoopEffects, horizon: float | None = None
    ) -> tuple[Sequence[SampledTask], Sequence[RandomLink]]:
        """The tasks and links, those of a scheduler included: over its period, or up to a `horizon` [s]."""
        unscheduled = [
            task.period for task in sampled_tasks(system) if not has_scheduled_instants(_sampling(system, task.name))
        ]
        steps = [link.step for link in links_of(system) if link.step is not None]
        schedule = periodic_schedule(system, horizon=horizon, other_periods=[*unscheduled, *steps, *effects.grids])
        tasks, links = sampled_tasks(system, schedule), links_of(system, schedule)
        turns = {name: len(part.turns) for name, part in linear.parts.items() if isinstance(part, SampledSystem)}
        tasks, links = by_turns(tasks, links, turns)
        with errors_name_overload(system):
            expect_same_steps(system, tasks, linear.parts, repeating=horizon is None)
        if self.simulated:
            expect_rows(system, tasks, links)
        return tasks, links


def _with_sensitivity(
    found: Converged[T],
    timing: tuple[Sequence[SampledTask], Sequence[RandomLink]],
    others: Iterable[LoopEffects],
    costs_of: Callable[[TimingChain], Floats],
) -> Converged[T]:
    """A result with the change of its costs, the last of its numbers, by components as other measurements show them."""
    tasks, links = timing
    order, apart = found.order or ORDERS[0], list[float]()
    for each in others:
        costs = costs_of(TimingChain(tasks, links, each, order=order, grids=each.grids))
        apart.append(_relative_difference(costs, found.numbers[-len(costs) :]) if np.isfinite(costs).all() else 1.0)
    return replace(found, sensitivity=min(1.0, SURE * math.sqrt(np.mean(np.square(apart)))))


def _with_costs(linear: Linear, used: Sequence[Call], costs: Sequence[float]) -> dict[Call, float]:
    """All means, some by their costs, the others constant."""
    means = {call: mean.c for call, mean in linear.objectives.means.items()}
    return means | {call: means[call] + cost for call, cost in zip(used, costs)}


def expect_same_steps(
    system: System, tasks: Sequence[SampledTask], parts: Components, *, repeating: bool = True
) -> None:
    """Raise `UsageError` for a task with irregular samples that depend on the time to the next one.

    `repeating`: the last sample of a period is followed by the first of the next.
    """
    for task in tasks:
        part = parts[task.name]
        if not (isinstance(part, SampledSystem) and part.depends_on_step):
            continue
        if not task.jitter.is_certain:
            raise UsageError(
                f"components.{task.name}.sampling.jitter: the samples of {task.name} depend on the time to the "
                f"next one; expected none, or {OF_FIXED_STEP}"
            )
        step = _sampling(system, task.name).true_period / NANOSECONDS
        ends = [*task.offsets, *(task.period + offset for offset in task.offsets[:1] if repeating)]
        steps = {then - now for now, then in itertools.pairwise(ends)}
        if steps - {step}:
            each = " to ".join(dict.fromkeys(f"{float(end):g}" for end in (min(steps), max(steps))))
            raise UsageError(
                f"components.{task.name}: its samples depend on the time to the next one, which is {each} s, not its "
                f"period of {float(step):g} s; expected no other task or message to delay it, no job skipped, "
                f"or {OF_FIXED_STEP}"
            )


def _sampling(system: System, name: str) -> Sampling:
    """The sampling of a sampled component."""
    sampling = system.components[name].sampling
    assert sampling is not None
    return sampling


def linearised_as(*systems: System) -> str:
    """All that the linearisation of systems depends on."""
    return json.dumps(
        [tables_of(_without_random_timing(without_scheduler(x))) for x in systems], default=str, sort_keys=True
    )


def _without_random_timing(system: System) -> System:
    """A system without delays, jitter and losses."""
    return replace(
        system,
        components={
            name: one if one.sampling is None else replace(one, sampling=replace(one.sampling, jitter=0.0))
            for name, one in system.components.items()
        },
        connections=tuple(x.with_delay(0.0) for x in system.connections),
    )


def _white_noise(system: System, *, simulated: bool) -> dict[str, float]:
    """The intensities of white noise by input; raises `UsageError` for any other random source."""
    found = {}
    for name, source in system.sources.items():
        if source.is_random and source.noise is None:
            raise UsageError(f"sources.{name}: gusts by name; expected white noise, of which there is an expectation")
        for end in source.to if source.noise else ():
            if not simulated and system.components[component_of(end)].sampling is not None:
                raise UsageError(
                    f"sources.{name}: white noise into {end}, which samples it: its variance has no limit; "
                    "expected noise of a connection, or --as-simulated of expect"
                )
            found[end] = float(source.noise or 0.0)
    return found


def _relative_difference(one: Floats, other: Floats) -> float:
    """The largest difference of two rows of numbers, relative."""
    finite = np.isfinite(one) & np.isfinite(other)
    one, other = one[finite], other[finite]
    return float((np.abs(one - other) / np.maximum(np.abs(other), 1e-300)).max(initial=0.0))
