"""Loops with a better local limit than the one for any system, by the kind of their request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from orchestration.foundation.basics.registry import Registry

if TYPE_CHECKING:
    from orchestration.foundation.basics.bisection import Range
    from orchestration.simulation.requests.ranges import Varied
    from orchestration.systems.system.model import System
    from orchestration.systems.system.request import Request


@dataclass(frozen=True, kw_only=True)
class LocalLimit:
    """A local limit; None: there is none, for a reason."""

    limit: float | None = None
    outside: float | None = None
    """Limit of the quadrotor with the gain just outside of its boundary layer"""
    method: str | None = None
    accuracy: float | None = None
    reason: str


class KnownLoop(Protocol):
    """The linear loop of one kind of request about its operating point."""

    def at_rest(self, request: Request) -> System:
        """The system of a request at its operating point."""

    def local_limits(self, varied: Varied, span: Range) -> LocalLimit:
        """The local limit of a quantity."""

    def radius_over(self, request: Request, of: str) -> Callable[[float], float] | None:
        """The spectral radius as a function of a quantity; None for an unsupported quantity. Raises `UsageError`."""


LOOPS: Registry[KnownLoop] = Registry()
"""filled by the rooms above"""


def rested(request: Request) -> System:
    """The system that a request means, as one that is at rest at its operating point."""
    known = LOOPS.of(request.kind)
    return request.as_system() if known is None else known.at_rest(request)
