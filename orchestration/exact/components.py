"""The components of a system about its rest as matrices, from the derivatives that their FMUs show.

A component that answers a pulse of 1 as it answers one of 1e-3 is linear as far as that can be seen: by the larger
pulse it is known to rounding. Any other is known by small differences, as far as pulses of ten times the size agree.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict, dataclass

import numpy as np

from orchestration.basics.errors import SimulatorError, UsageError
from orchestration.exact.linear import Continuous, Sampled
from orchestration.stability.linear_loop import AtRest
from orchestration.stability.linearised_component import Tangent
from orchestration.stability.matrices import BLURRED, in_continuous_time, minds_its_step, of_samples, whole
from orchestration.system.times import NANOSECONDS

LARGE_PULSE, LESS = 1.0, 1e-3
"""pulses that a linear component answers alike"""
SAME = 1e-9
"""of an answer: what those to both may differ by"""
MORE = 10.0
"""times as large are the pulses that tell how far small ones can be trusted"""
ROUNDING = 1e-11
"""of an answer: what rounding makes of it at least, on its way to a figure"""
DIFFERS = 1e-9
"""of a step of 2h: what two of h may differ from it by, of a component that is known to rounding"""


@dataclass(frozen=True, kw_only=True)
class Known:
    """A component as matrices."""

    part: Continuous | Sampled
    how: str
    """it is known"""
    accuracy: float
    """how far: of its answers, relative"""
    tangent: Tangent
    """in whose coordinates its state is"""


class Measured:
    """Components as matrices, each measured once about each point where it rests."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], Known] = {}

    def of(self, loop: AtRest) -> dict[str, Known]:
        """The components of a loop."""
        found = {}
        for name in loop.simulation.instances:
            key = _all_of(loop, name)
            if key not in self._known:
                self._known[key] = _measured(loop, name)
            found[name] = self._known[key]
        return found


def _all_of(loop: AtRest, name: str) -> tuple[object, ...]:
    """All that the matrices of a component depend on."""
    component = json.dumps(asdict(loop.simulation.system.components[name]), default=str, sort_keys=True)
    rest = loop.rest_of(name)
    return name, component, loop.begun[name], rest.inputs, rest.held.tobytes(), rest.outputs, rest.time, loop.period


def _measured(loop: AtRest, name: str) -> Known:
    component, step = loop.simulation.system.components[name], _step_of(loop, name)
    tangent, is_linear, apart = _by_pulses(loop, name, step)
    part: Continuous | Sampled
    if component.sampling is not None:
        part = Sampled(**vars(of_samples(tangent, step)), minds_step=minds_its_step(tangent, step))
    else:
        matrices, unfit = in_continuous_time(tangent, step, DIFFERS if is_linear else BLURRED)
        part = Continuous(**vars(matrices), step=tangent.derivatives, unfit=unfit)
    how = "saved states, to rounding" if is_linear else "saved states, by differences"
    return Known(part=part, how=how, accuracy=max(ROUNDING, apart), tangent=tangent)


def _by_pulses(loop: AtRest, name: str, step: float) -> tuple[Tangent, bool, float]:
    """A component by the pulses that serve it, whether it is linear, and how far its answers are known."""
    with suppress(UsageError, SimulatorError, ValueError, np.linalg.LinAlgError):  # one that takes no large pulses
        large = loop.tangent(name, LARGE_PULSE)
        apart = large.missed_by(LESS, step)
        if apart <= SAME:
            return large, True, apart
    small = loop.tangent(name, loop.pulse)
    return small, False, small.missed_by(MORE * loop.pulse, step)


def _step_of(loop: AtRest, name: str) -> float:
    """A step that tells much of a component [s]."""
    component = loop.simulation.system.components[name]
    if component.sampling is not None:
        return component.sampling.period
    if not loop.simulation.instances[name].model.varies_step:
        return component.step or 0.0
    return whole(float(loop.period) / NANOSECONDS / 4.0)
