"""The components of a system about its rest as matrices, from the derivatives that their FMUs show.

A component that answers a pulse of 1 as it answers one of 1e-6 is linear as far as that can be seen: by the larger
pulse it is known to rounding. Any other is known as far as small differences tell.
"""

from __future__ import annotations

import numpy as np

from orchestration.basics.errors import SimulatorError, UsageError
from orchestration.exact.linear import Components, Continuous, Sampled
from orchestration.stability.linear_loop import AtRest
from orchestration.stability.linearised_component import Tangent
from orchestration.stability.matrices import BLURRED, in_continuous_time, minds_its_step, of_samples, whole
from orchestration.system.times import NANOSECONDS

LARGE_PULSE = 1.0
SAME = 1e-7
"""of an answer: what those to both pulses may differ by"""
DIFFERS = 1e-9
"""of a step of 2h: what two of h may differ from it by, of a component that is known to rounding"""


def components_of(loop: AtRest) -> tuple[Components, dict[str, str]]:
    """The components of a loop as matrices, and how each is known."""
    large = _larger(loop)
    found: Components = {}
    how: dict[str, str] = {}
    for name, component in loop.simulation.system.components.items():
        is_linear = large is not None and _agree(loop.tangents[name], large[name], _step_of(loop, name))
        tangent = large[name] if large is not None and is_linear else loop.tangents[name]
        how[name] = "saved states, to rounding" if is_linear else "saved states, by differences"
        if component.sampling is not None:
            period = component.sampling.period
            found[name] = Sampled(**vars(of_samples(tangent, period)), minds_step=minds_its_step(tangent, period))
        else:
            differs = DIFFERS if is_linear else BLURRED
            matrices, unfit = in_continuous_time(tangent, _step_of(loop, name), differs)
            found[name] = Continuous(**vars(matrices), step=tangent.derivatives, unfit=unfit)
    return found, how


def _step_of(loop: AtRest, name: str) -> float:
    """A step that tells much of a component [s]."""
    component = loop.simulation.system.components[name]
    if component.sampling is not None:
        return component.sampling.period
    if not loop.simulation.instances[name].model.varies_step:
        return component.step or 0.0
    return whole(float(loop.period) / NANOSECONDS / 4.0)


def _larger(loop: AtRest) -> dict[str, Tangent] | None:
    """The tangents by large pulses, where all components take them."""
    try:
        return loop.retaken(LARGE_PULSE)
    except (UsageError, SimulatorError, ValueError, np.linalg.LinAlgError):
        return None


def _agree(small: Tangent, large: Tangent, step: float) -> bool:
    """Whether the answers to both pulses are the same: over a step, and over several, which go through the states."""
    answers = []
    for tangent in (small, large):
        by_state, by_input = tangent.derivatives(step)
        count = len(tangent.outputs)
        state, parts = by_input[count:], [by_input[:count]]
        for _ in range(4):
            parts.append(by_state[:count] @ state)
            state = by_state[count:] @ state
        answers.append(np.array(parts))
    scale = np.abs(answers[0]).max(axis=(0, 2), initial=0.0)[:, None]
    return bool((np.abs(answers[0] - answers[1]) <= SAME * np.maximum(scale, 1e-300)).all())
