"""The objectives of a system as means of quadratic polynomials of signals, as far as they are such."""

from collections.abc import Mapping

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.expressions.syntax import Call, names
from orchestration.systems.system.check import AT_REST
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.source import Source
from orchestration.theory.exact.objectives import Mean, evaluated, inlined_objectives, integrand, means_of, quadratic
from orchestration.theory.stability.loop_at_rest import AtRest


class ObjectiveMeans:
    """The objectives of a system that have an expectation, and for the others the reasons why not."""

    def __init__(self, system: System, models: Mapping[str, Model]) -> None:
        self._system = system
        self._nodes = inlined_objectives(system.objectives)
        self.calls: dict[str, list[Call]] = {}
        self.reasons: dict[str, str] = {}
        self.means: dict[Call, Mean] = {}
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
        rest = {
            signal: float(loop.simulation.instances[component_of(signal)].get(variable_of(signal)))
            for signal in self._signals
        }
        for name, source in self._system.sources.items():
            rest |= _constant_signals(name, source)
        self._numbers = loop.simulation.parameters
        for name, calls in [*self.calls.items()]:
            try:
                for call in calls:
                    if call not in self.means:
                        self.means[call] = quadratic(integrand(call), rest, self._numbers)
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


def _constant_signals(name: str, source: Source) -> dict[str, float]:
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
