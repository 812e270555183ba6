"""What every tuning says: parameters in their ranges, a cost, and how long is searched."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.basics.simulator import Floats
from orchestration.building.inputs import Files, files_of
from orchestration.requests.ranges import Varied, default_quantity, paths_in
from orchestration.studies.axes import Axis
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.request import Request, errors_in_own_terms, system_of

COST = "cost"
"""The objective that a tuning adds"""
_WIDTH = 0.25
"""of the first generation, as a share of each range"""


@record()
class Sought:
    """Parameters that are looked for; raises `UsageError` for what cannot be."""

    name: str
    """The name of the tuning, with which its files begin."""
    base: Request
    """The scenario or the system whose parameters are tuned."""
    parameters: tuple[Axis, ...]
    """What is tuned, each between its `low` and its `high`."""
    cost: str
    """What is made small: an expression over the objectives of the base."""
    periods: tuple[float, ...]
    """The sampling periods [s]; it is tuned for each by itself."""
    evaluations: int
    """How often the cost is evaluated in a search, for each parameter."""
    seeds: tuple[int, ...]
    """The seeds of the optimiser, each a search of its own; the best by its cost is taken."""

    def __post_init__(self) -> None:
        if len(self.parameters) < 2:
            raise UsageError("parameters: expected at least two; one is found by a study with an axis")
        if self.evaluations < 1:
            raise UsageError(f"evaluations = {self.evaluations}: expected at least 1")
        for name in ("periods", "seeds"):
            if not getattr(self, name):
                raise UsageError(f"{name}: expected at least one")
        if COST in self.origin.objectives:
            raise UsageError(f"objectives.{COST}: expected another name, which a tuning adds")
        assert self._paths
        assert self._of_period

    @cached_property
    def origin(self) -> System:
        """The system that the base means."""
        return system_of(self.base)

    @cached_property
    def _paths(self) -> dict[str, tuple[str, ...]]:
        return {target: paths_in(self.base, target) for axis in self.parameters for target in axis.targets}

    @cached_property
    def _of_period(self) -> tuple[str, ...]:
        try:
            return Varied(request=self.base, of=default_quantity(self.base)).paths
        except UsageError:
            raise UsageError("search.periods: expected a base with one period, of its only sampled component") from None

    def described(self) -> list[str]:
        """What the cost of a search is, line by line, for the file of its outcome."""
        raise NotImplementedError

    @property
    def budget(self) -> int:
        """Evaluations of the cost in one search."""
        return self.evaluations * len(self.parameters)

    def files(self) -> Files:
        """All files that are needed, FMUs built if need be."""
        return files_of(self.origin)

    def values(self, shares: Sequence[float]) -> dict[str, float]:
        """What each target is set to, at a share in [0, 1] of the range of each parameter."""
        return {
            target: axis.at(float(share)) for axis, share in zip(self.parameters, shares) for target in axis.targets
        }

    def system(self, period: float, values: Mapping[str, float]) -> System:
        """With a period and values of the targets; raises `UsageError` for one that cannot be."""
        given = {path: value for target, value in values.items() for path in self._paths[target]}
        with errors_in_own_terms(self.base):
            system = changed(self.origin, {**given, **dict.fromkeys(self._of_period, period)})
            return replace(system, objectives={**system.objectives, COST: self.cost})


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of one search."""

    period: float
    """[s]"""
    seed: int
    values: dict[str, float]
    """of each target"""
    cost: float
    """of these, as it was searched by"""
    evaluations: int

    @property
    def judgement(self) -> str:
        """What is known of it beside its cost, in words."""
        raise NotImplementedError

    @property
    def figures(self) -> dict[str, float | None]:
        """Likewise in numbers, by name."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Lowest:
    """The cheapest of all points that a search has seen."""

    shares: Floats
    cost: float
    evaluations: int


def lowest(
    tuning: Sought, seed: int, costs: Callable[[Sequence[Floats]], Sequence[float]], progress: Callable[[float], None]
) -> Lowest:
    """The best of one search by CMA-ES (Hansen, arXiv:1604.00772), begun at a point that the seed draws.

    `costs` are those of points of the unit cube, a generation at a time.
    """
    import cma  # with it comes matplotlib

    first = np.random.default_rng(seed).uniform(0.25, 0.75, len(tuning.parameters))
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(first, _WIDTH, options)
    best, least, count = first, np.inf, 0
    while count < tuning.budget:  # whatever the optimiser thinks of it: every controller gets the same effort
        candidates = [np.asarray(candidate) for candidate in strategy.ask()]
        found = costs(candidates)
        strategy.tell(candidates, found)
        count += len(candidates)
        place = int(np.argmin(found))
        if found[place] < least:
            best, least = candidates[place], found[place]
        progress(min(1.0, count / tuning.budget))
    return Lowest(shares=best, cost=float(least), evaluations=count)


def best_by_period(found: Sequence[Outcome]) -> Iterator[Outcome]:
    """Of the searches for each period the one whose cost is lowest."""
    for period in dict.fromkeys(one.period for one in found):
        yield min((one for one in found if one.period == period), key=lambda one: one.cost)
