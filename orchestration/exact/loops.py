"""Linear loops from their FMUs, each taken apart once, and what follows from their timing."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.exact.as_simulated import SimulatedEffects, expect_rows
from orchestration.exact.clockwork import Clockwork, Task
from orchestration.exact.components import Measured
from orchestration.exact.effects import LoopEffects, TrueEffects
from orchestration.exact.linear import Components, Continuous, Sampled
from orchestration.exact.moments import JumpLinear
from orchestration.exact.timing import links_of, tasks_of
from orchestration.exact.wanted import Wanted
from orchestration.expressions.syntax import Call
from orchestration.fmi.model import Model
from orchestration.fmi.reuse import Instances
from orchestration.stability.linear_loop import Beside, at_rest
from orchestration.system.model import System, component_of, is_foreseen
from orchestration.system.paths import changed
from orchestration.system.written import tables_of

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
    wanted: Wanted
    noise: Mapping[str, float]
    """the intensities of white noise, by input"""


@dataclass(frozen=True, kw_only=True)
class Solved:
    """A loop under its timing."""

    loop: JumpLinear
    period: float
    """[s]"""
    means: Mapping[Call, float] | None
    """None: the second moments have no end"""
    apart: float
    """what the last doubling of the nodes has changed, relative"""
    order: int | None
    """of Gauss's rule; None: all random times are listed"""


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

    def linear(self, system: System) -> Linear:
        """The components and objectives of a system; raises `UsageError` for one that is not linear about a rest."""
        key = json.dumps(tables_of(_unhurried(system)), default=str, sort_keys=True)
        if key not in self._known:
            self._known[key] = self._taken_apart(system)
        return self._known[key]

    def _taken_apart(self, system: System) -> Linear:
        noise = _white(system, simulated=self.simulated)
        models = {name: self._models[component.fmu] for name, component in system.components.items()}
        wanted = Wanted(system, models)
        beside = Beside(moved=tuple(noise), seen=wanted.seen)
        with at_rest(system, self._instances, beside=beside, models=models) as loop:
            wanted.about(loop)
            known = self._measured.of(loop)
        parts, how = {name: one.part for name, one in known.items()}, {name: one.how for name, one in known.items()}
        for name, part in parts.items():
            if isinstance(part, Continuous) and part.unfit is not None and not self.simulated:
                raise UsageError(
                    f"{name} is no linear system in continuous time: {part.unfit}; expected --as-simulated"
                )
        return Linear(parts=parts, how=how, wanted=wanted, noise=noise)

    def solved(self, system: System, *, agree: float = AGREE) -> Solved:
        """A system by finer and finer rules, until they agree; raises `UsageError` where there is too much of it."""
        system = changed(system, system.operating_point)
        _expect_unshared(system)
        linear = self.linear(system)
        tasks, links = tasks_of(system), links_of(system)
        expect_same_steps(tasks, linear.parts)
        effects = self._effects(system, linear)
        used = [call for call, mean in linear.wanted.means.items() if np.any(mean.Q)]
        effects.charge([linear.wanted.means[call] for call in used])
        by_rule = any(x.late.is_by_rule for x in links) or any(task.jitter.is_by_rule for task in tasks)
        found: list[tuple[JumpLinear, Floats]] = []
        apart, order, period = 0.0, ORDERS[0], 1.0
        for next_order in ORDERS if by_rule else ORDERS[:1]:
            try:
                clock = Clockwork(tasks, links, effects, order=next_order, grids=effects.grids)
                loop = JumpLinear(*clock.stages())
            except UsageError:
                if len(found) < 2:
                    raise
                break
            order, period = next_order, float(clock.period)
            found.append((loop, loop.costs() / period if loop.radius < 1.0 else np.full(len(used), math.inf)))
            if len(found) > 1:
                apart = _apart(found[-2], found[-1])
                if apart <= agree:
                    break
        loop, costs = found[-1]
        means = None
        if loop.radius < 1.0:
            means = {call: mean.c for call, mean in linear.wanted.means.items()}
            means |= {call: means[call] + cost for call, cost in zip(used, costs.tolist())}
        return Solved(loop=loop, period=period, means=means, apart=apart, order=order if by_rule else None)

    def _effects(self, system: System, linear: Linear) -> LoopEffects:
        tasks = tasks_of(system)
        names = [task.name for task in tasks]
        if not self.simulated:
            return TrueEffects(system, linear.parts, names, linear.noise)
        expect_rows(system, tasks, links_of(system))
        return SimulatedEffects(system, linear.parts, names)


def _expect_unshared(system: System) -> None:
    """Raise `UsageError` for what a scheduler decides: how late a task is depends on all that were before."""
    places = [f"{table}.{name}" for table in ("computers", "networks") for name in getattr(system, table)]
    places += [
        f"components.{name}.sampling.on"
        for name, one in system.components.items()
        if one.sampling is not None and is_foreseen(one.sampling)
    ]
    for place in places:
        raise UsageError(
            f"{place}: what a scheduler makes late has no exact expectation here; expected delays and jitter of "
            "connections and components"
        )


def expect_same_steps(tasks: Sequence[Task], parts: Components) -> None:
    """Raise `UsageError` for a task whose samples are irregular, and do what depends on when the next one is."""
    for task in tasks:
        part = parts[task.name]
        if isinstance(part, Sampled) and part.minds_step and not task.jitter.is_certain:
            raise UsageError(
                f"components.{task.name}.sampling.jitter: what {task.name} does depends on how long it is to the next "
                "sample; expected none"
            )


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


def _apart(one: tuple[JumpLinear, Floats], other: tuple[JumpLinear, Floats]) -> float:
    """How far two answers are from each other, relative."""
    radii = abs(one[0].radius - other[0].radius) / max(other[0].radius, 1e-300)
    if not (np.isfinite(one[1]).all() and np.isfinite(other[1]).all()):
        return radii
    return max(radii, float((np.abs(one[1] - other[1]) / np.maximum(np.abs(other[1]), 1e-300)).max(initial=0.0)))
