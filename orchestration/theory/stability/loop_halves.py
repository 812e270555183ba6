"""The two halves of a loop that is cut open, closed again: poles, commands, and what a step on commands does."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.theory.stability.linearise import Linearised
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.resolvent import Resolvent


@dataclass(frozen=True, kw_only=True)
class ClosedLoop:
    """Both halves over a period: the state, that of the rest before that of the component."""

    A: Floats
    """The state after a period by that before it."""
    commands: Floats
    """Commands, with their factors, by the state."""
    steps: Floats
    """The state after a period by what is added to the commands in it."""
    direct: Floats
    """Commands by what is added to commands of earlier samples of the period."""


def closed(loop: Linearised, factors: Floats | Complexes | None = None) -> ClosedLoop:
    """The loop with `factors` on the commands, default 1."""
    rest, law = loop.rest, loop.component
    gain = np.eye(len(law.outputs)) if factors is None else np.diag(factors)
    identity = np.eye(len(gain))
    sent: Any = np.linalg.inv(identity - gain @ law.D @ rest.D) if rest.D.any() else identity
    commands = sent @ np.hstack([gain @ law.D @ rest.C, gain @ law.C])
    moved = np.vstack([rest.B, law.B @ rest.D])
    open_loop = np.block([[rest.A, np.zeros((len(rest.A), len(law.A)))], [law.B @ rest.C, law.A]])
    return ClosedLoop(A=open_loop + moved @ commands, commands=commands, steps=moved @ sent, direct=sent - identity)


def radius(loop: Linearised, factors: Floats | Complexes | None = None) -> float:
    """The spectral radius of both halves with `factors` on the commands."""
    return float(np.abs(np.linalg.eigvals(closed(loop, factors).A)).max(initial=0.0))


def with_rest(loop: Linearised, A: Floats, B: Floats, C: Floats, D: Floats) -> Linearised:
    """The loop with another rest, of the same signals."""
    return replace(loop, rest=replace(loop.rest, A=A, B=B, C=C, D=D))


def places(loop: Linearised, i: int) -> Integers:
    """The places of a command at its samples, among those of all."""
    count = len(loop.component.outputs) // loop.samples
    return i + count * np.arange(loop.samples)


Sensitivity = Callable[[Floats], Complexes]
"""A command by what is added to it, both at all of its samples, by frequencies [rad/s], shape (n, samples, samples)"""


def sensitivity_of(loop: Linearised, i: int) -> Sensitivity:
    """That of a command, the loop closed."""
    whole, own = closed(loop), places(loop, i)
    direct = np.eye(len(own)) + whole.direct[np.ix_(own, own)]
    by_states = Resolvent.of(whole.A, whole.steps[:, own], whole.commands[own])
    return lambda frequencies: direct + by_states.at(np.exp(1j * frequencies * loop.rest.dt))
