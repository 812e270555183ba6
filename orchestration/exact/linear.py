"""Components as linear ones about the point where they rest: what a loop is put together from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from orchestration.basics.simulator import Floats
from orchestration.stability.matrices import Matrices

Derivatives = Callable[[float], tuple[Floats, Floats]]
"""Of the outputs after a step of a length [s] and, below, of the state then: by the state before, and by the inputs"""


@dataclass(frozen=True, kw_only=True)
class Continuous(Matrices):
    """x' = A x + B u, y = C x + D u."""

    step: Derivatives | None = None
    """as it is stepped, where that is not what the matrices say"""
    unfit: str | None = None
    """why the matrices do not say what it does; None: they do"""


@dataclass(frozen=True, kw_only=True)
class Sampled(Matrices):
    """At each sample y = C x + D u, and then x becomes A x + B u."""

    minds_step: bool = False
    """whether a sample does something else where the next one comes at another time"""


Components = dict[str, Continuous | Sampled]
