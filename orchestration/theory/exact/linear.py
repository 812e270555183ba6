"""Linear components about the point where they rest, of which a loop consists."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.stability.matrices import Matrices

Derivatives = Callable[[float], tuple[Floats, Floats]]
"""Of a step length [s]: the derivatives of the outputs and, below, the state after it, by the state before and by the
inputs"""


@dataclass(frozen=True, kw_only=True)
class Continuous(Matrices):
    """x' = A x + B u, y = C x + D u."""

    step: Derivatives | None = None
    """the step of the simulated component, where that differs from the matrices"""
    unfit: str | None = None
    """why the matrices do not describe the component; None: they do"""


@dataclass(frozen=True, kw_only=True)
class SampledSystem(Matrices):
    """At each sample y = C x + D u, and then x becomes A x + B u."""

    depends_on_step: bool = False
    """whether a sample depends on the time to the next one"""


Components = dict[str, Continuous | SampledSystem]
