"""Tuning without runs: the parameters that minimise the exact expectation of a cost."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.experiments.tuning.tuning_problem import COST, Costs, SearchResult, TuningProblem, minimise
from orchestration.foundation.basics.errors import UsageError, told_apart
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System
from orchestration.systems.system.request import errors_in_own_terms
from orchestration.theory.exact.expect import Expected, expected_of
from orchestration.theory.exact.loops import Loops
from orchestration.theory.stability.known_loops import rested

UNSTABLE = 1e100
"""Factor on the mean-square radius in place of an infinite cost, so that a search can find where it becomes finite"""


@record()
class ExactTuning(TuningProblem):
    """A tuning for the exact expectation of its cost; raises `UsageError` for invalid values."""

    as_simulated: bool = False
    """Whether it is the expectation of what runs print, as of `expect`."""

    @cached_property
    def origin(self) -> System:
        """The system that the base describes, at its operating point."""
        with errors_in_own_terms(self.base):
            return rested(self.base)

    def describe_cost(self) -> list[str]:
        """The definition of the cost, for the file of tuned parameters."""
        return [f"the exact expectation{', as simulated,' if self.as_simulated else ''} of ({self.cost})."]


@dataclass(frozen=True, kw_only=True)
class ExactTuningResult(SearchResult):
    """The result of one search by expectations; its cost is infinite if no evaluated point has a finite one."""

    mean_square_radius: float
    """growth factor of second moments in a common period"""
    accuracy: float
    """relative, of the cost"""
    doubt: str
    """The reason why runs with these values may cost more, as of `expect`; empty: none is seen"""

    @property
    def judgement(self) -> str:
        """The margin to an infinite cost, in words, and what makes the cost doubtful."""
        radius = f"the mean-square radius is {told_apart(self.mean_square_radius, 1.0)[0]}"
        return f"{radius}; warning: {self.doubt}" if self.doubt else radius

    @property
    def figures(self) -> dict[str, float | None]:
        """The same in numbers, by name."""
        return {"mean-square radius": self.mean_square_radius}


def search_exactly(
    tuning: ExactTuning,
    period: float | None,
    seed: int,
    progress: Callable[[float], None],
    keeping: Callable[[Costs], Costs] = lambda costs: costs,
) -> ExactTuningResult:
    """The result of one search; `keeping` wraps the costs of candidates to keep them."""
    files = tuning.files()
    loops = Loops(files.models, simulated=tuning.as_simulated)

    def expected(points: Sequence[Sequence[float]], flown: bool = False) -> list[Expected | str]:
        systems = [tuning.system(period, tuning.values(shares)) for shares in points]
        with errors_in_own_terms(tuning.base):
            return isolated_call(files.fmus.values(), _expected, systems, loops, flown)

    def costs(points: Sequence[Floats]) -> list[float]:
        return [_cost(each) for each in expected([point.tolist() for point in points])]

    kept, tried = keeping(costs), list[tuple[Floats, float]]()

    def refused() -> list[Floats]:
        return [point for point, cost in tried if cost == math.inf]

    def told() -> str:
        """Why the first that has no expectation has none."""
        first = refused()[0].tolist()
        return f"{tuning.named(first)}: {expected([first])[0]}"

    def noted(points: Sequence[Floats]) -> Sequence[float]:
        values = kept(points)
        tried.extend(zip(points, values))
        if len(refused()) == len(tried):
            raise UsageError(f"none of the first {len(tried)} candidates has an expectation, the first, {told()}")
        return values

    best = minimise(tuning, seed, noted, progress)
    (expectation,) = expected([best.shares.tolist()], flown=True)
    assert isinstance(expectation, Expected)
    cost, without = expectation.objectives[COST], len(refused())
    return ExactTuningResult(
        period=period,
        seed=seed,
        values=tuning.values(best.shares.tolist()),
        cost=math.inf if cost is None else cost,
        own_cost=math.inf if best.own_cost is not None and best.own_cost >= UNSTABLE else best.own_cost,
        lowered=best.lowered,
        of_ranges=tuning.of_ranges(best.shares.tolist()),
        evaluations=best.evaluations,
        note=f"{without} of {len(tried)} candidates had no expectation, the first, {told()}" if without else "",
        mean_square_radius=expectation.mean_square_radius,
        accuracy=expectation.accuracy,
        doubt=expectation.doubt,
    )


def _expected(systems: Sequence[System], loops: Loops, flown: bool) -> list[Expected | str]:
    """The expectations of each system, in order, or why it has none, as one that does not come to rest.

    Raises `UsageError` if a cost has none whatever the parameters.
    """
    return [_expected_or_why(system, loops, flown) for system in systems]


def _expected_or_why(system: System, loops: Loops, flown: bool) -> Expected | str:
    try:
        found = expected_of(system, loops, flown=flown)
    except UsageError as error:
        return str(error)
    if found.objectives[COST] is None and found.mean_square_radius < 1.0:
        raise UsageError(found.reasons[COST])
    return found


def _cost(expected: Expected | str) -> float:
    """Infinite without an expectation, which is worse than any that is unstable."""
    if isinstance(expected, str):
        return math.inf
    cost = expected.objectives[COST]
    return UNSTABLE * expected.mean_square_radius if cost is None else cost
