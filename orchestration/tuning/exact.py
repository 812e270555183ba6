"""Tuning without a run: the parameters of which the exact expectation of a cost is least."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.basics.simulator import Floats
from orchestration.exact.expect import Expected, expected_of
from orchestration.exact.loops import Loops
from orchestration.fmi.foreign import isolated_call
from orchestration.stability.known_loops import rested
from orchestration.system.model import System
from orchestration.system.request import errors_in_own_terms
from orchestration.tuning.sought import COST, Outcome, Sought, lowest

UNSTABLE = 1e100
"""times the mean-square radius, in place of an infinite cost: a search sees which way it becomes finite"""


@record()
class ExactTuning(Sought):
    """What is tuned for the exact expectation of its cost; raises `UsageError` for what cannot be."""

    @cached_property
    def origin(self) -> System:
        """The system that the base means, where it is at rest."""
        with errors_in_own_terms(self.base):
            return rested(self.base)

    def described(self) -> list[str]:
        """What the cost of a search is, for the file of its outcome."""
        return [f"the exact expectation of ({self.cost})."]


@dataclass(frozen=True, kw_only=True)
class ExactFound(Outcome):
    """The outcome of one search by expectations; its cost is infinite where it saw no finite one."""

    mean_square_radius: float
    """by how much second moments grow in a common period"""
    accuracy: float
    """of the cost, relative"""

    @property
    def judgement(self) -> str:
        """How far it is from having no finite cost, in words."""
        return f"the mean-square radius is {self.mean_square_radius:.6g}"

    @property
    def figures(self) -> dict[str, float | None]:
        """Likewise in numbers, by name."""
        return {"mean-square radius": self.mean_square_radius}


def search_exactly(tuning: ExactTuning, period: float, seed: int, progress: Callable[[float], None]) -> ExactFound:
    """The best of one search."""
    files = tuning.files()
    loops = Loops(files.models)

    def expected(points: Sequence[Sequence[float]]) -> list[Expected]:
        systems = [tuning.system(period, tuning.values(shares)) for shares in points]
        with errors_in_own_terms(tuning.base):
            return isolated_call(files.fmus.values(), _expected, systems, loops)

    def costs(points: Sequence[Floats]) -> list[float]:
        return [_cost(each) for each in expected([point.tolist() for point in points])]

    best = lowest(tuning, seed, costs, progress)
    (found,) = expected([best.shares.tolist()])
    cost = found.objectives[COST]
    return ExactFound(
        period=period,
        seed=seed,
        values=tuning.values(best.shares.tolist()),
        cost=math.inf if cost is None else cost,
        evaluations=best.evaluations,
        mean_square_radius=found.mean_square_radius,
        accuracy=found.accuracy,
    )


def _expected(systems: Sequence[System], loops: Loops) -> list[Expected]:
    """Of each, in their order; raises `UsageError` where a cost has no expectation at all."""
    found = [expected_of(system, loops) for system in systems]
    for one in found:
        if one.objectives[COST] is None and one.mean_square_radius < 1.0:
            raise UsageError(one.reasons[COST])
    return found


def _cost(one: Expected) -> float:
    cost = one.objectives[COST]
    return UNSTABLE * one.mean_square_radius if cost is None else cost
