"""Loops with a better local limit than the one for any system, by the kind of their request."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.foundation.basics.registry import Registry
from orchestration.foundation.basics.terminal import warn
from orchestration.foundation.processes.passable import passable

if TYPE_CHECKING:
    from orchestration.foundation.basics.bisection import Range
    from orchestration.simulation.requests.ranges import Varied
    from orchestration.systems.system.files import Files
    from orchestration.systems.system.model import System
    from orchestration.systems.system.request import Request


@passable
@dataclass(frozen=True, kw_only=True)
class LinearLimit:
    """A limit of small deviations, or of their mean squares; None: there is none, for a reason."""

    limit: float | None = None
    lower: float | None = None
    """The value below which, down from the system's own, small deviations grow as well"""
    outside: float | None = None
    """Limit of the quadrotor with the gain just outside of its boundary layer"""
    method: str | None = None
    accuracy: float | None = None
    reason: str = ""
    """Why there is none; beside one, what else is to be said of it"""


@dataclass(frozen=True, kw_only=True)
class KnownLoop:
    """The linear loop of one kind of request about its operating point."""

    at_rest: Callable[[Request], System]
    """the system of a request at its operating point"""
    local_limits: Callable[[Varied, Range], LinearLimit]
    """the local limit of a quantity"""
    radius_over: Callable[[Request, str], Callable[[float], float] | None]
    """the spectral radius as a function of a quantity; None for an unsupported quantity; raises `UsageError`"""


LOOPS: Registry[KnownLoop] = Registry()
"""filled by the rooms above"""


def rested(request: Request, *, checked: bool = True) -> System:
    """The system that a request means, as one that is at rest at its operating point.

    Raises `UsageError` for one that a run refuses, too, be it for an objective; unless `checked`, which builds FMUs.
    """
    known = LOOPS.of(request.kind)
    if known is not None:
        return known.at_rest(request)
    if checked:
        from orchestration.simulation.engines.resolved import resolve  # not before: loads the engines

        resolve(request)
    return request.as_system()


@contextmanager
def warned_of_timing(system: System, files: Files, ends: tuple[System, System] | None = None) -> Iterator[None]:
    """Warn, as a run does, of components whose code believes another period than theirs; of a range, by its two ends.

    Of overloaded processors where the block finds an answer: where it does not, its error names them.
    """
    from orchestration.simulation.engines.resolved import (  # not before: loads the engines
        periods_in_words,
        varied_periods_in_words,
    )
    from orchestration.systems.schedule.overload import overloads_in_words

    models = files.models_of(system)
    for text in varied_periods_in_words(system, *ends, models) if ends else periods_in_words(system, models):
        warn(text)
    yield
    for text in overloads_in_words(ends or (system,)):
        warn(text)
