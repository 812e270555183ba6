"""The components of a system about its rest as matrices, from the derivatives that their FMUs show.

A component that answers a pulse of 1 as it answers one of 1e-6 is linear as far as that can be seen: by the larger
pulse it is known to rounding. Any other is known as far as small differences tell.
"""

from __future__ import annotations

import numpy as np

from orchestration.basics.errors import SimulatorError, UsageError
from orchestration.basics.simulator import Floats
from orchestration.exact.linear import Components, Continuous, Sampled
from orchestration.stability.linear_loop import AtRest
from orchestration.stability.linearised_component import Tangent
from orchestration.stability.matrices import minds_its_step
from orchestration.system.times import NANOSECONDS, nanoseconds

LARGE_PULSE = 1.0
SAME = 1e-7
"""of an answer: what those to both pulses may differ by"""
NEAR, FAR = 0.1, 0.5
"""of the norm of Φ(h) - I: between them its logarithm is known best"""
HALVINGS = 40
DIFFERS = 1e-9
"""of Φ(2h): what Φ(h)² may differ from it by; more, and the FMU is no linear system in continuous time"""
BLURRED = 1e-7
"""likewise, of one that is known by small differences"""
NO_FEEDTHROUGH = 1e-6
"""of the most that an input makes of an output in a step: what is smaller comes through states alone"""
TERMS = 24


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
            found[name] = _sampled(tangent, component.sampling.period)
        else:
            first = _step_of(loop, name)
            found[name] = _continuous(tangent, first, DIFFERS if is_linear else BLURRED, unit=tangent.unit)
    return found, how


def _step_of(loop: AtRest, name: str) -> float:
    """A step that tells much of a component [s]."""
    component = loop.simulation.system.components[name]
    if component.sampling is not None:
        return component.sampling.period
    if not loop.simulation.instances[name].model.varies_step:
        return component.step or 0.0
    return _whole(float(loop.period) / NANOSECONDS / 4.0)


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


def _sampled(tangent: Tangent, period: float) -> Sampled:
    by_state, by_input = tangent.derivatives(period)
    count = len(tangent.outputs)
    return Sampled(
        inputs=tangent.inputs, outputs=tangent.outputs,
        A=by_state[count:], B=by_input[count:], C=by_state[:count], D=by_input[:count],
        minds_step=minds_its_step(tangent, period),
    )  # fmt: skip


def _continuous(tangent: Tangent, first: float, differs: float, unit: float | None) -> Continuous:
    count = len(tangent.outputs)
    h = first if unit is not None else _telling(tangent, first)
    by_state, by_input = tangent.derivatives(h)
    change = by_state[count:] - np.eye(len(by_state) - count)
    state, moved = by_state[count:], by_input[count:]
    if len(change) and np.linalg.norm(change, 2) > 2.0 * FAR:
        unfit: str | None = f"a step of {h:g} s is too long to tell what happens within it"
        A, B, C, D = np.zeros_like(change), np.zeros_like(moved), by_state[:count], by_input[:count]
    else:
        unfit = _unfit(tangent, state, h, differs)
        A = _logarithm(change) / h
        B = np.asarray(np.linalg.solve(_mean_exponential(A * h), moved)) / h
        C = by_state[:count] @ np.linalg.inv(state)
        D = _through(by_input[:count], C @ moved)
    return Continuous(
        inputs=tangent.inputs, outputs=tangent.outputs, A=A, B=B, C=C, D=D, step=tangent.derivatives, unfit=unfit
    )


def _through(whole: Floats, by_states: Floats) -> Floats:
    """What inputs make of outputs at once: none where it may be rounding."""
    found: Floats = whole - by_states
    found[np.abs(found) <= NO_FEEDTHROUGH * np.abs(whole).max(axis=1, keepdims=True, initial=0.0)] = 0.0
    return found


def _unfit(tangent: Tangent, once: Floats, h: float, differs: float) -> str | None:
    """Why what it does is not that of a linear system in continuous time; None: it is."""
    count = len(tangent.outputs)
    twice = tangent.derivatives(2.0 * h)[0][count:]
    apart = float(np.abs(twice - once @ once).max(initial=0.0)) / max(1.0, float(np.abs(twice).max(initial=0.0)))
    if apart <= differs:
        return None
    return f"a step of {2 * h:g} s differs from two of {h:g} s by {apart:.1g}"


def _telling(tangent: Tangent, first: float) -> float:
    """A step over which the state changes neither too little nor too much."""
    count, h = len(tangent.outputs), first
    for _ in range(HALVINGS):
        by_state = tangent.derivatives(h)[0][count:]
        size = float(np.linalg.norm(by_state - np.eye(len(by_state)), 2)) if len(by_state) else NEAR
        if size > FAR and nanoseconds(h) >= 2:
            h = _whole(0.5 * h)
        elif size < NEAR and h < 64.0 * first:
            h = 2.0 * h
        else:
            break
    return h


def _whole(seconds: float) -> float:
    """In whole nanoseconds, by which derivatives are known."""
    return max(1, nanoseconds(seconds)) / NANOSECONDS


def _logarithm(change: Floats) -> Floats:
    """Of I + change, by the series of the inverse hyperbolic tangent."""
    if not len(change):
        return change
    x = np.linalg.solve(2.0 * np.eye(len(change)) + change, change)
    square, power = x @ x, x
    found: Floats = np.zeros_like(x)
    for k in range(TERMS):
        found = found + power / (2 * k + 1)
        power = power @ square
    return 2.0 * found


def _mean_exponential(A: Floats) -> Floats:
    """(e^A - I) A⁻¹, by its series."""
    found, term = np.eye(len(A)), np.eye(len(A))
    for k in range(1, TERMS + 1):
        term = term @ A / (k + 1)
        found = found + term
    return found
