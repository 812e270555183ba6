"""What a linear loop costs on average, exactly: no run, no seed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.building.inputs import files_of
from orchestration.exact.as_simulated import SimulatedEffects, expect_rows
from orchestration.exact.clockwork import Clockwork
from orchestration.exact.components import components_of
from orchestration.exact.effects import LoopEffects, TrueEffects
from orchestration.exact.linear import Components, Continuous
from orchestration.exact.moments import JumpLinear
from orchestration.exact.objectives import Mean, means_of, quadratic, squared, value, whole
from orchestration.exact.timing import links_of, tasks_of
from orchestration.expressions.syntax import Call, names
from orchestration.fmi.foreign import computed
from orchestration.fmi.model import Model
from orchestration.fmi.reuse import Instances
from orchestration.requests.request import Asked, asked_for
from orchestration.stability.known_loops import LOOPS
from orchestration.stability.linear_loop import AtRest, Beside, at_rest
from orchestration.system.model import System, component_of, variable_of
from orchestration.system.paths import changed
from orchestration.system.request import in_its_own_words

ORDERS = (1, 2, 4, 8, 16, 32)
"""of Gauss's rule, tried in turn until the next one changes nothing"""
AGREE = 1e-10
"""of a figure: what may differ from order to order"""
ROUNDING, DIFFERENCES = 1e-11, 1e-7
"""of a figure: how far it is known, by how the components are"""


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Expectations of a linear loop, where it has come to stay."""

    objectives: Mapping[str, float | None]
    """By name; None: there is none."""
    reasons: Mapping[str, str]
    """Why there is none, by name."""
    mean_square_radius: float
    """By how much second moments grow in a common period; from 1 on no mean of squares is finite."""
    fourth_moment_radius: float | None
    """Likewise of fourth moments; from 1 on no Monte-Carlo interval of a mean square means anything. None: too many to
    be told."""
    accuracy: float
    """Of the figures, relative: what the finest steps of the computation still change."""
    method: str
    """How the components are known, and what was done."""
    period: float
    """The common period of all that samples [s]."""

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {'-' if v is None else f'{v:.6g}'}" for name, v in self.objectives.items())
        return f"<Expected: {listed or 'no objectives'}; mean-square radius {self.mean_square_radius:.6g}>"


def expect(asked: Asked, *, as_simulated: bool = False) -> Expected:
    """The stationary expectation of each objective that is made of means of quadratic expressions of signals.

    The system is linearised about its operating point, or where it begins. Noise of sources is white; delays, jitter
    and losses are drawn as a run draws them. `as_simulated` it is the expectation of what a run prints when it is long:
    noise is held for the period of its source, what is in continuous time is stepped, and means are over rows.

    Raises `UsageError` for a system that does not rest there, or of which there is no exact answer, naming why.
    """
    request = asked_for(asked)
    known = LOOPS.of(request.kind)
    with in_its_own_words(request):
        system = request.as_system() if known is None else known.at_rest(request)
        files = files_of(system)
        return computed(files.fmus.values(), expected_of, system, files.models_of(system), as_simulated)


def expected_of(system: System, models: Mapping[str, Model], simulated: bool = False) -> Expected:
    """As `expect`, of a system whose FMUs are loaded in this process."""
    chosen = changed(system, system.operating_point)
    noise = _white(chosen, simulated=simulated)
    wanted = Wanted(chosen, models)
    beside = Beside(moved=tuple(noise), seen=wanted.seen)
    instances = Instances()
    try:
        with at_rest(system, instances, beside=beside) as loop:
            wanted.about(loop)
            parts, how = components_of(loop)
    finally:
        instances.close()
    for name, part in parts.items():
        if isinstance(part, Continuous) and part.unfit is not None and not simulated:
            raise UsageError(f"{name} is no linear system in continuous time: {part.unfit}; expected --as-simulated")
    return _answer(chosen, parts, noise, wanted, how, simulated=simulated)


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


class Wanted:
    """The objectives of a system, as far as there can be an expectation of them, and why not."""

    def __init__(self, system: System, models: Mapping[str, Model]) -> None:
        self._system = system
        self._nodes = whole(system.objectives)
        self.calls: dict[str, list[Call]] = {}
        self.reasons: dict[str, str] = {}
        self.means: dict[Call, Mean] = {}
        self._numbers: Mapping[str, float] = {}
        for name, node in self._nodes.items():
            try:
                self.calls[name] = means_of(node, name)
            except UsageError as error:
                self.reasons[name] = str(error)
        used = {part for calls in self.calls.values() for call in calls for part in names(call)}
        self._signals = dict.fromkeys(signal for part in sorted(used) for signal in _signals_of(part, models))
        self.seen = tuple(
            signal for signal in self._signals
            if models[component_of(signal)].variables[variable_of(signal)].causality != "input"
        )  # fmt: skip

    def about(self, loop: AtRest) -> None:
        """The means as polynomials about the point where the loop rests."""
        for name, state in loop.begun.items():
            loop.simulation.instances[name].restore(state)
        rest = {
            signal: float(loop.simulation.instances[component_of(signal)].get(variable_of(signal)))
            for signal in self._signals
        }
        for name, source in self._system.sources.items():
            rest |= dict.fromkeys(source.signals(name), source.constant or 0.0) if source.is_held else {}
        self._numbers = loop.simulation.parameters
        for name, calls in [*self.calls.items()]:
            try:
                for call in calls:
                    if call not in self.means:
                        self.means[call] = quadratic(squared(call), rest, self._numbers, name)
            except UsageError as error:
                self.reasons[name] = str(error)
                del self.calls[name]

    def values(self, means: Mapping[Call, float]) -> dict[str, float | None]:
        """All objectives in the order of the system, by their means."""
        found: dict[str, float | None] = dict.fromkeys(self._nodes)
        for name in self.calls:
            try:
                found[name] = value(self._nodes[name], means, self._numbers)
            except UsageError as error:
                self.reasons[name] = f"{name}: {error}"
        return found


def _signals_of(name: str, models: Mapping[str, Model]) -> list[str]:
    """The Real signals that a name in an expression stands for; none for a parameter, time, or a source's."""
    owner = component_of(name)
    if owner not in models:
        return []
    known = models[owner].variables
    parts = [name] if variable_of(name) in known else [f"{name}.{axis}" for axis in "xyzw"]
    return [
        part for part in parts
        if variable_of(part) in known
        and known[variable_of(part)].kind == "Real"
        and known[variable_of(part)].causality in ("input", "output", "local")
    ]  # fmt: skip


def _answer(
    system: System,
    parts: Components,
    noise: Mapping[str, float],
    wanted: Wanted,
    how: Mapping[str, str],
    *,
    simulated: bool,
) -> Expected:
    """By finer and finer rules, until they agree."""
    tasks = tasks_of(system)
    links, names_of_tasks = links_of(system), [task.name for task in tasks]
    effects: LoopEffects
    if simulated:
        expect_rows(system, tasks, links)
        effects = SimulatedEffects(system, parts, names_of_tasks)
    else:
        effects = TrueEffects(system, parts, names_of_tasks, noise)
    used = [call for call, mean in wanted.means.items() if np.any(mean.Q)]
    effects.charge([wanted.means[call] for call in used])
    densities = any(x.late.is_by_rule for x in links) or any(task.jitter.is_by_rule for task in tasks)
    found: list[tuple[JumpLinear, Floats]] = []
    apart, order = 0.0, ORDERS[0]
    for order in ORDERS if densities else ORDERS[:1]:
        try:
            clock = Clockwork(tasks, links, effects, order=order, grids=effects.grids)
            loop = JumpLinear(*clock.stages())
        except UsageError:
            if len(found) < 2:
                raise
            break
        period = float(clock.period)
        found.append((loop, loop.costs() / period if loop.radius < 1.0 else np.full(len(used), math.inf)))
        if len(found) > 1:
            apart = _apart(found[-2], found[-1])
            if apart <= AGREE:
                break
    loop, costs = found[-1]
    reasons, values = dict(wanted.reasons), dict.fromkeys(system.objectives, None)
    if loop.radius < 1.0:
        means = {call: mean.c for call, mean in wanted.means.items()}
        for call, cost in zip(used, costs.tolist()):
            means[call] += cost
        values = wanted.values(means)
        reasons |= wanted.reasons
    else:
        why = f"the mean-square radius is {loop.radius:.6g}: the mean has no finite expectation"
        reasons |= dict.fromkeys(wanted.calls, why)
    known = max((DIFFERENCES if "differences" in each else ROUNDING for each in how.values()), default=ROUNDING)
    return Expected(
        objectives=values, reasons={name: reasons[name] for name in system.objectives if name in reasons},
        mean_square_radius=loop.radius, fourth_moment_radius=loop.fourth_moment_radius, accuracy=apart + known,
        method=_method(how, order if densities else None, system, simulated=simulated), period=period,
    )  # fmt: skip


def _apart(one: tuple[JumpLinear, Floats], other: tuple[JumpLinear, Floats]) -> float:
    """How far two answers are from each other, relative."""
    radii = abs(one[0].radius - other[0].radius) / max(other[0].radius, 1e-300)
    if not (np.isfinite(one[1]).all() and np.isfinite(other[1]).all()):
        return radii
    return max(radii, float((np.abs(one[1] - other[1]) / np.maximum(np.abs(other[1]), 1e-300)).max(initial=0.0)))


def _method(how: Mapping[str, str], order: int | None, system: System, *, simulated: bool) -> str:
    known: dict[str, list[str]] = {}
    for name, by in how.items():
        known.setdefault(by, []).append(name)
    said = ["second moments of the loop about its operating point"]
    said += [f"{', '.join(listed)} known by {by}" for by, listed in known.items()]
    if simulated:
        said.append("noise held, steps and means over rows as in a run")
    if order is not None:
        said.append(f"random times by Gauss's rule with {order} nodes between any two instants")
    rounded = [x.name for x in system.connections if any(x.quantisation.values())]
    if rounded:
        said.append(f"quantisation of {', '.join(rounded)} as noise of a variance of q²/12")
    return "; ".join(said)
