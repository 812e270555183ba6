"""The components of a system about its rest as matrices, identified from responses of their FMUs.

A component whose response to a random input is predicted to rounding is taken as linear; any other is identified by
small differences, as accurately as that response is predicted.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.theory.stability.excitation import STANDS_OUT
from orchestration.theory.stability.in_double import are_in_double, of_code
from orchestration.theory.stability.lifted_component import LiftedTangent
from orchestration.theory.stability.linearised_component import UNPROVEN, Tangent
from orchestration.theory.stability.loop_at_rest import AtRest
from orchestration.theory.stability.matrices import (
    INEXACT,
    Continuous,
    SampledSystem,
    continuous,
    depends_on_step,
    in_continuous_time,
    turns_of,
    whole_nanoseconds,
)
from orchestration.theory.stability.operating_point import periods_of

SAME = 1e-9
"""Error of the predicted response, relative to the largest, up to which a component is linear, and difference of a step
of 2 h to two of h; more where rounding of its coordinates decides"""
ROUNDING = 1e-11
"""Least effect of rounding on a result, as a share of a response"""
DRAWS = 3
"""Drawn errors by which it is seen what those of a measurement do"""


@dataclass(frozen=True, kw_only=True)
class IdentifiedComponent:
    """A component as matrices."""

    part: Continuous | SampledSystem
    method: str
    """it is identified"""
    accuracy: float
    """Accuracy of its responses, relative"""
    others: tuple[Continuous | SampledSystem, ...]
    """The component as other measurements may show it: with errors as large as those of its own"""
    tangent: Tangent
    """whose coordinates its state has, of several rates that before all samples"""


class ComponentIdentifier:
    """Identifies components, each once about each point where it rests."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], IdentifiedComponent] = {}

    def of(self, loop: AtRest) -> dict[str, IdentifiedComponent]:
        """The components of a loop, sampled ones from the first sample of a run on."""
        found = {}
        keys = {name: _cache_key(loop, name) for name in loop.simulation.instances}
        for name, key in keys.items():
            if key not in self._known:
                self._known[key] = _identified(loop, name)
            known = self._known[key]
            if isinstance(known.part, SampledSystem):
                begun = -loop.taken(name)
                others = [one.turned(begun) for one in known.others if isinstance(one, SampledSystem)]
                known = replace(known, part=known.part.turned(begun), others=tuple(others))
            found[name] = known
        return found


def _cache_key(loop: AtRest, name: str) -> tuple[object, ...]:
    """All that the matrices of a component depend on."""
    component = json.dumps(asdict(loop.simulation.system.components[name]), default=str, sort_keys=True)
    rest = loop.rest_of(name)
    return (
        name,
        component,
        loop.saved_states[name],
        rest.inputs,
        rest.held.tobytes(),
        rest.outputs,
        rest.time,
        loop.period,
    )


def _identified(loop: AtRest, name: str) -> IdentifiedComponent:
    component, step = loop.simulation.system.components[name], _informative_step(loop, name)
    found = loop.tangent(name)
    tangent = found.whole if isinstance(found, LiftedTangent) else found
    accuracy, differs = tangent.accuracy, max(SAME, min(tangent.rounding, INEXACT))
    error = max(ROUNDING, tangent.rounding)
    part: Continuous | SampledSystem
    if component.sampling is not None:
        part = _sampled(found, step)
    else:
        most = max(INEXACT, min(STANDS_OUT * tangent.rounding, UNPROVEN))
        matrices = in_continuous_time(tangent, step, differs if accuracy <= SAME else INEXACT, component.step, most)
        part = replace(matrices, step=tangent.derivatives)
        if accuracy > SAME or matrices.misfit > differs:
            accuracy = max(accuracy, matrices.misfit)
        if matrices.unfit is None:
            error = max(error, matrices.misfit)
    is_exact = accuracy <= SAME and error <= SAME
    method = "saved states, to rounding" if is_exact else "saved states, by differences"
    method += of_code(are_in_double({name: component}))
    accuracy = max(ROUNDING, accuracy)
    rng = np.random.default_rng(0)
    others = tuple(_otherwise(part, tangent, error, rng) for _ in range(DRAWS))
    return IdentifiedComponent(part=part, method=method, accuracy=accuracy, others=others, tangent=tangent)


def _otherwise(
    part: Continuous | SampledSystem, tangent: Tangent, error: float, rng: np.random.Generator
) -> Continuous | SampledSystem:
    """A component with errors drawn, as they are distributed in its measurement, the largest at least an `error`."""
    if isinstance(part, SampledSystem):

        def near(M: Floats) -> Floats:
            return M + error * M * rng.standard_normal(M.shape)

        first, *later = (
            replace(turn, A=near(turn.A), B=near(turn.B), C=near(turn.C), D=near(turn.D)) for turn in part.turns
        )
        return SampledSystem(**vars(first), later=tuple(later), depends_on_step=part.depends_on_step)
    largest = float(tangent.noise[0].max(initial=0.0))
    by_coordinates, by_inputs = (
        (max(1.0, error / largest) * noise if largest else error * np.abs(M)) * rng.standard_normal(M.shape)
        for M, noise in zip(tangent.derivatives(part.length), tangent.noise)
    )

    def stepped(h: float) -> tuple[Floats, Floats]:
        by_state, by_input = tangent.derivatives(h)
        return by_state + by_coordinates, by_input + by_inputs

    return replace(continuous(tangent, stepped(part.length), part.length), step=stepped)


def _sampled(tangent: Tangent | LiftedTangent, period: float) -> SampledSystem:
    """A sampled component from its rest on."""
    turns, whole = turns_of(tangent, period), tangent.whole if isinstance(tangent, LiftedTangent) else tangent
    first, *later = turns
    return SampledSystem(**vars(first), later=tuple(later), depends_on_step=depends_on_step(whole, len(turns) * period))


def _informative_step(loop: AtRest, name: str) -> float:
    """A step that shows much of a component [s]."""
    component = loop.simulation.system.components[name]
    if component.sampling is not None:
        return component.sampling.period
    if not loop.simulation.instances[name].model.varies_step:
        return component.step or 0.0
    quickest = whole_nanoseconds(float(min(periods_of(loop.simulation.system))) / NANOSECONDS / 4.0)
    return max(quickest, component.step or 0.0)  # shorter ones than its own differ less than those that are simulated
