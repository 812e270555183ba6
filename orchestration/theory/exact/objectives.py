"""Objectives as what can be expected exactly: numbers made of means of quadratic polynomials of signals."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.expressions import syntax
from orchestration.systems.expressions.at_instant import compiled
from orchestration.systems.expressions.operators import OPERATORS, applied
from orchestration.systems.expressions.over_run import STOP_TIME, TIME, inlined, reductions
from orchestration.systems.expressions.syntax import Call, names
from orchestration.systems.system.check import AT_REST
from orchestration.systems.system.connection import Source, component_of, variable_of
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.model import System
from orchestration.theory.stability.loop_at_rest import AtRest

STEP = 1.0
"""Step of a signal: second differences of a quadratic polynomial are exact for any step"""
NOT_QUADRATIC = 1e-9
"""Share of a value by which a quadratic polynomial may miss it"""
TRIALS = 12


@dataclass(frozen=True, kw_only=True)
class Mean:
    """The mean over time of c + g'y + y'Q y, y the deviations of some signals from rest."""

    signals: tuple[str, ...]
    c: float
    g: Floats
    Q: Floats


def means_of(node: syntax.Node) -> list[syntax.Call]:
    """The means in an objective, `rms` included; raises `UsageError` naming any other reduction."""
    if of_jobs := next(filter(syntax.names_job_measure, names(node)), None):
        raise UsageError(f"{of_jobs}: of the jobs of a task there are no expectations: expected a mean of signals")
    found = list(dict.fromkeys(reductions(node)))
    for call in found:
        if call.function not in ("mean", "rms"):
            raise UsageError(_not_a_mean(f"{call.function}(…)"))
        if isinstance(call.arguments[0], syntax.Sampled):
            raise UsageError("over arrivals: expected a mean over time")
        if reductions(call.arguments[0]):
            raise UsageError("of other numbers of the run: expected a mean of signals")
    if not found:
        raise UsageError(_not_a_mean(syntax.text(node)))
    return found


def has_mean_of_squares(node: syntax.Node) -> bool:
    """Whether some mean in an objective may be of products of signals: of these `rms` is a root, others are linear."""
    return any(call.function == "mean" and not _is_linear(call.arguments[0]) for call in reductions(node))


def _is_linear(node: syntax.Node) -> bool:
    match node:
        case syntax.Number() | syntax.Name():
            return True
        case syntax.Operation("+" | "-" | "neg", operands):
            return all(map(_is_linear, operands))
        case syntax.Operation("*", (one, other)):
            constant = not {*syntax.names(one)} or not {*syntax.names(other)}
            return constant and _is_linear(one) and _is_linear(other)
        case syntax.Operation("/", (one, other)):
            return not {*syntax.names(other)} and _is_linear(one)
    return False


def _not_a_mean(written: str) -> str:
    return f"{written}: expected mean(…) or rms(…), of which there are expectations"


def inlined_objectives(objectives: Mapping[str, str]) -> dict[str, syntax.Node]:
    """Objectives by name, with the objectives that they name inlined."""
    found: dict[str, syntax.Node] = {}
    for name, written in objectives.items():
        found[name] = inlined(syntax.parse(written), found)
    return found


def integrand(call: syntax.Call) -> syntax.Node:
    """The expression that a mean averages."""
    inner = call.arguments[0]
    return inner if call.function == "mean" else syntax.Operation("*", (inner, inner))


def evaluated(node: syntax.Node, means: Mapping[syntax.Call, float], numbers: Mapping[str, float]) -> float:
    """An objective by the values of its means."""
    match node:
        case syntax.Number(number):
            return number
        case syntax.Call() if syntax.is_over_run(node):
            mean = means[node]
            return math.sqrt(max(mean, 0.0)) if node.function == "rms" else mean
        case syntax.Name(name) if name in numbers:
            return numbers[name]
        case syntax.Operation(word, operands) | syntax.Call(word, operands) if word in OPERATORS:
            return float(applied(word, *(evaluated(operand, means, numbers) for operand in operands)))
    raise UsageError(f"{syntax.text(node)} has a value at each instant; expected one number of the run")


def quadratic(node: syntax.Node, rest: Mapping[str, float], numbers: Mapping[str, float]) -> Mean:
    """An expression about `rest` as a quadratic polynomial, by second differences, which are exact for one.

    Raises `UsageError` for an expression that is none, or depends on time.
    """
    used = list(dict.fromkeys(syntax.names(node)))
    for name in (TIME, STOP_TIME):
        if name in used:
            raise UsageError(f"depends on {name}: expected signals alone, whose mean is stationary")
    signals = _signals(used, rest, numbers)
    fixed = [name for name in used if name in numbers]
    places = {name: i for i, name in enumerate([*signals, *fixed])}
    function = compiled(node, places)
    at, constants = np.array([rest[name] for name in signals]), [numbers[name] for name in fixed]

    def of(y: Floats) -> float:
        return function([*(at + y).tolist(), *constants])

    n, unit = len(signals), STEP * np.eye(len(signals))
    c = of(np.zeros(n))
    g, Q = np.zeros(n), np.zeros((n, n))
    for i in range(n):
        up, down = of(unit[i]), of(-unit[i])
        g[i], Q[i, i] = (up - down) / 2.0, (up + down) / 2.0 - c
    for i in range(n):
        for j in range(i):
            both = of(unit[i] + unit[j])
            Q[i, j] = Q[j, i] = (both - c - g[i] - g[j] - Q[i, i] - Q[j, j]) / 2.0
    _expect_quadratic(of, c, g, Q, syntax.text(node))
    return Mean(signals=tuple(signals), c=c, g=g, Q=Q)


def _signals(used: Sequence[str], rest: Mapping[str, float], numbers: Mapping[str, float]) -> list[str]:
    """The signals of an expression, vectors by their components."""
    found: list[str] = []
    for name in used:
        if name in numbers:
            continue
        parts = [name] if name in rest else [f"{name}.{axis}" for axis in "xyzw" if f"{name}.{axis}" in rest]
        if not parts:
            raise UsageError(f"the linear loop has no {name}")
        found += parts
    return list(dict.fromkeys(found))


def _expect_quadratic(of: Callable[[Floats], float], c: float, g: Floats, Q: Floats, written: str) -> None:
    draw = np.random.default_rng(0)
    for _ in range(TRIALS):
        y = draw.uniform(-3.0, 3.0, len(g))
        expected = c + g @ y + y @ Q @ y
        size = abs(c) + np.abs(g) @ np.abs(y) + np.abs(y) @ np.abs(Q) @ np.abs(y)
        found = of(y)
        if not (math.isfinite(found) and abs(found - expected) <= NOT_QUADRATIC * max(size, 1e-300)):
            raise UsageError(f"{written}: expected a polynomial of signals of degree two at most")


class ObjectiveMeans:
    """The objectives of a system that have an expectation, and for the others the reasons why not."""

    def __init__(self, system: System, models: Mapping[str, Model]) -> None:
        self._system = system
        self._nodes = inlined_objectives(system.objectives)
        self.calls: dict[str, list[Call]] = {}
        self.reasons: dict[str, str] = {}
        self.means: dict[Call, Mean] = {}
        self.rest: dict[str, float] = {}
        """values of the signals of objectives at rest, once expanded"""
        self._numbers: Mapping[str, float] = {}
        for name, node in self._nodes.items():
            try:
                self.calls[name] = means_of(node)
            except UsageError as error:
                self.reasons[name] = str(error)
        used = {part for calls in self.calls.values() for call in calls for part in names(call)}
        self._signals = dict.fromkeys(signal for part in sorted(used) for signal in _signals_of(part, models))
        self.outputs = tuple(
            signal for signal in self._signals
            if models[component_of(signal)].variables[variable_of(signal)].causality != "input"
        )  # fmt: skip
        """signals of objectives that are no inputs"""

    def expand_about(self, loop: AtRest) -> None:
        """Expand the means as polynomials about the point where the loop rests."""
        for name, state in loop.saved_states.items():
            loop.simulation.instances[name].restore(state)
        self.rest = {
            signal: float(loop.simulation.instances[component_of(signal)].get(variable_of(signal)))
            for signal in self._signals
        }
        for name, source in self._system.sources.items():
            self.rest |= constant_signals(name, source)
        self._numbers = loop.simulation.parameters
        for name, calls in [*self.calls.items()]:
            try:
                for call in calls:
                    if call not in self.means:
                        mean = quadratic(integrand(call), self.rest, self._numbers)
                        _expect_current(self._system, mean.signals)
                        self.means[call] = mean
            except UsageError as error:
                self.reasons[name] = str(error)
                del self.calls[name]

    def values(self, means: Mapping[Call, float]) -> dict[str, float | None]:
        """All objectives in the order of the system, by the values of their means; None: see `reasons`."""
        found: dict[str, float | None] = dict.fromkeys(self._nodes)
        for name in self.calls:
            try:
                found[name] = evaluated(self._nodes[name], means, self._numbers)
            except UsageError as error:
                self.reasons[name] = str(error)
        return found


def _expect_current(system: System, signals: Sequence[str]) -> None:
    """Raise `UsageError` for an input that a run has as its last sample took it, while a later message is here."""
    sampled = {name for name, one in system.components.items() if one.sampling is not None}
    for x in system.connections:
        waits = x.sender in sampled or x.delay_jitter != 0.0 or highest(x.delay) > 0.0
        for end in x.end if waits and x.receiver in sampled else ():
            if end in signals:
                raise UsageError(f"{end} has what its last sample took: expected {x.start[x.end.index(end)]}")


def constant_signals(name: str, source: Source) -> dict[str, float]:
    """The signals of a source that is constant but for noise; none of any other."""
    if source.signal == AT_REST:
        places = {f"position.{axis}": source.scale * source.parameters.get(axis, 0.0) for axis in "xyz"}
        return {each: places.get(".".join(each.split(".")[-2:]), 0.0) for each in source.signals(name)}
    return dict.fromkeys(source.signals(name), source.constant or 0.0) if source.is_held else {}


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
