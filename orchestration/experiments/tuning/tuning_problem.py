"""The tuning problem: parameters with their ranges, a cost, the search effort; and its minimisation by CMA-ES."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from orchestration.experiments.studies.axes import Axis
from orchestration.foundation.basics.errors import UsageError, did_you_mean, listed, prefixed
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.resolved import periods_in_words
from orchestration.simulation.requests.ranges import Varied, default_quantity, own_value, paths_in
from orchestration.systems.expressions.over_run import STOP_TIME, TIME
from orchestration.systems.expressions.syntax import names, parse
from orchestration.systems.schedule.overload import overloads_in_words
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of

Costs = Callable[[Sequence[Floats]], Sequence[float]]
"""The costs of points of the unit cube"""
COST = "cost.of"
"""Name of the objective that a tuning adds: the key of its file"""
AT_BOUND = 0.005
"""Share of a range that counts as its bound"""
CONVERGED = 0.01
"""Share of a cost by which the last third of a search may lower it without a word on more evaluations"""
_WIDTH = 0.25
"""Standard deviation of the first generation, as a share of each range"""


@record()
class TuningProblem:
    """Parameters to tune for a cost; raises `UsageError` for invalid values."""

    name: str
    """The name of the tuning, with which the names of its files begin."""
    base: Request
    """The scenario or the system whose parameters are tuned."""
    parameters: tuple[Axis, ...]
    """The parameters to tune, each between its `low` and its `high`."""
    cost: str
    """The cost to minimise: an expression over the objectives of the base."""
    evaluations: int
    """The number of evaluations of the cost in a search, per parameter; rounded up to whole generations of points."""
    seeds: tuple[int, ...]
    """The seeds of the optimiser, each for a separate search; the search with the lowest cost is taken."""
    periods: tuple[float, ...] | None = None
    """The sampling periods [s] of the only sampled component, for each of which it is tuned separately; default: all
    that is sampled keeps its own period."""

    def __post_init__(self) -> None:
        if not self.parameters:
            raise UsageError("parameters: expected at least one")
        if self.evaluations < 1:
            raise UsageError(f"evaluations = {self.evaluations}: expected at least 1")
        for name in ("periods", "seeds"):
            if getattr(self, name) == ():
                raise UsageError(f"{name}: expected at least one")
        known = list(self.origin.objectives)
        with prefixed(f"{COST}: "):
            for name in names(parse(self.cost)):
                if "." not in name and name not in (*known, TIME, STOP_TIME):
                    closest = did_you_mean(name, known) or ";"
                    raise UsageError(f"there is no objective {name}{closest} expected one of {listed(known)}")
        assert self._paths
        if self.periods is not None:
            assert self._period_paths

    @cached_property
    def origin(self) -> System:
        """The system that the base describes."""
        return system_of(self.base)

    @cached_property
    def _paths(self) -> dict[str, tuple[str, ...]]:
        return {target: paths_in(self.base, target) for axis in self.parameters for target in axis.targets}

    @cached_property
    def _period_paths(self) -> tuple[str, ...]:
        try:
            return Varied(request=self.base, of=default_quantity(self.base)).paths
        except UsageError:
            raise UsageError(
                "search.periods: expected a base with one period, of its only sampled component; leave out "
                "search.periods to keep the periods of the file"
            ) from None

    @cached_property
    def own(self) -> list[float | None]:
        """The values of the base as shares of the ranges, in [0, 1] if within; None: none there, or several."""
        models = self.files().models_of(self.origin)

        def share(axis: Axis) -> float | None:
            paths = [path for target in axis.targets for path in self._paths[target]]
            values = {own_value(Varied(request=self.origin, of=path), models) for path in paths}
            (value, *others) = values
            return None if others or value is None else axis.share(value)

        return [share(axis) for axis in self.parameters]

    @property
    def searched_periods(self) -> tuple[float | None, ...]:
        """The periods [s] of searches; None: those of the base."""
        return (None,) if self.periods is None else self.periods

    def describe_cost(self) -> list[str]:
        """The definition of the cost, line by line, for the file of tuned parameters."""
        raise NotImplementedError

    @property
    def generation(self) -> int:
        """Points that a search evaluates together, as many as CMA-ES has by default."""
        return 4 + int(3.0 * math.log(max(len(self.parameters), 2)))

    @property
    def budget(self) -> int:
        """Evaluations of the cost in one search: whole generations."""
        return self.generation * -(-self.evaluations * len(self.parameters) // self.generation)

    @property
    def effort(self) -> str:
        """The number of searches and their evaluations, in words."""
        asked, searches = self.evaluations * len(self.parameters), len(self.searched_periods) * len(self.seeds)
        text = f"{searches} search{'es' if searches > 1 else ''} of {self.budget} evaluations of the cost each"
        if asked == self.budget:
            return text
        return (
            f"{text}: {self.evaluations} a parameter are {asked}, rounded up to whole generations of {self.generation}"
        )

    def files(self) -> Files:
        """All files of the runs; missing FMUs are built."""
        return files_of(self.origin)

    def values(self, shares: Sequence[float]) -> dict[str, float]:
        """The value of each target, at a share in [0, 1] of the range of each parameter."""
        return {
            target: axis.at(float(share)) for axis, share in zip(self.parameters, shares) for target in axis.targets
        }

    def named(self, shares: Sequence[float]) -> str:
        """The parameters there by name, in words."""
        return ", ".join(f"{axis.name} = {axis.at(float(share)):.4g}" for axis, share in zip(self.parameters, shares))

    def of_ranges(self, shares: Sequence[float]) -> str:
        """The parameters that the ranges cut off, there and in the base, in words; empty: none."""
        cut = []
        for axis, share, own in zip(self.parameters, shares, self.own):
            if end := "lower" if share <= AT_BOUND else "upper" if share >= 1.0 - AT_BOUND else "":
                cut.append(f"{axis.name} = {axis.at(share):.4g} lies on the {end} bound of its range: widen it")
            if own is None:
                cut.append(f"the file has no single number for {axis.name}, so its own values are not compared")
            elif not 0.0 <= own <= 1.0:
                cut.append(f"the file's own {axis.name} = {axis.at(own):.4g} lies outside of its range")
        return "; ".join(cut)

    def system(self, period: float | None, values: Mapping[str, float]) -> System:
        """The system with a period and values of the targets; raises `UsageError` for an invalid value."""
        changes = {path: value for target, value in values.items() for path in self._paths[target]}
        if period is not None:
            changes |= dict.fromkeys(self._period_paths, period)
        with errors_in_own_terms(self.base):
            system = changed(self.origin, changes)
            return replace(system, objectives={**system.objectives, COST: self.cost})

    def warnings(self, period: float | None) -> list[str]:
        """A warning for each component whose code believes another period than it has in a search, and overloads."""
        system = self.system(period, self.values([0.5] * len(self.parameters)))
        return [*periods_in_words(system, self.files().models_of(system)), *overloads_in_words([system])]


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """The result of one search."""

    period: float | None
    """Period [s]; None: those of the base"""
    seed: int
    values: dict[str, float]
    """Values of each target"""
    cost: float
    """Cost of these values, as minimised"""
    evaluations: int
    own_cost: float | None
    """Cost of the values of the file; None: they are not compared"""
    lowered: float | None
    """Share of the lowest cost by which the last third of the generations lowered it; None: it is of one generation"""
    of_ranges: str
    """Parameters that the ranges cut off, in words; empty: none"""
    note: str = ""
    """Failures of candidates on the way, in one line; empty: none"""

    @property
    def place(self) -> str:
        """The period, in words."""
        return "own periods" if self.period is None else f"period {self.period:g} s"

    @property
    def compared(self) -> str:
        """The cost beside that of the file's own values, in words."""
        if self.own_cost is None:
            return f"cost {self.cost:.4g}"
        if math.isclose(self.cost, self.own_cost, rel_tol=1e-9):
            return f"cost {self.cost:.4g}, that of the file's own values: none costs less"
        ratio = f"{self.cost / self.own_cost:.3g} times " if 0.0 < self.own_cost < math.inf else "where it is "
        return f"cost {self.cost:.4g}, {ratio}{self.own_cost:.4g} with the file's own values"

    @property
    def convergence(self) -> str:
        """How much the end of the search still gained, in words."""
        if self.lowered is None:
            return f"a single generation of {self.evaluations} evaluations: no search yet"
        end = f"the last third of {self.evaluations} evaluations"
        if self.lowered == 0.0:
            return f"{end} found no lower one, though there may be one near by"
        further = ": more may lower it further" if self.lowered > CONVERGED else ""
        return f"{end} lowered it by {100.0 * self.lowered:.2g} %{further}"

    @property
    def judgement(self) -> str:
        """An assessment besides the cost, in words."""
        raise NotImplementedError

    @property
    def figures(self) -> dict[str, float | None]:
        """The same assessment in numbers, by name."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Minimum:
    """The point of lowest cost that a search has evaluated."""

    shares: Floats
    cost: float
    own_cost: float | None
    """the cost of the values of the base; None: a parameter has none there, or several"""
    lowered: float | None
    """share by which the last third lowered the cost; None: of one generation"""
    evaluations: int


def minimise(
    tuning: TuningProblem,
    seed: int,
    costs: Costs,
    progress: Callable[[float], None],
) -> Minimum:
    """The best point of one search by CMA-ES (Hansen, arXiv:1604.00772), which starts at a point drawn by the seed.

    The values of the base are a point of the first generation, or beside it if the ranges are without them. `costs`
    gives the costs of points of the unit cube, a generation at a time.
    """
    import cma  # deferred: it imports matplotlib

    size = len(tuning.parameters)
    first = np.random.default_rng(seed).uniform(0.25, 0.75, max(size, 2))  # a second one without effect: cma needs two
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9, "popsize": tuning.generation}
    strategy = cma.CMAEvolutionStrategy(first, _WIDTH, options)
    best, least, bests, own_cost = first[:size], math.inf, list[float](), None
    own = None if None in tuning.own else np.array(tuning.own, dtype=float)
    place = tuning.generation  # of the values of the base in the first one: beside it, or that of its first point
    if own is not None and ((own >= 0.0) & (own <= 1.0)).all():
        place = 0
        point = strategy.gp.geno([*own, *first[size:]], strategy.boundary_handler.inverse)
        strategy.inject([point], force=True)
    generations = tuning.budget // tuning.generation
    for count in range(1, generations + 1):  # no other stopping rule: every controller gets the same effort
        asked = strategy.ask()
        candidates = [np.asarray(candidate)[:size] for candidate in asked]
        if own is not None:
            candidates[place : place + 1] = [own]
        values = list(costs(candidates))
        if own is not None:
            own_cost, own = float(values[place]), None
        values = values[: len(asked)]
        strategy.tell(asked, values)
        found = int(np.argmin(values))
        if values[found] < least:
            best, least = candidates[found], float(values[found])
        bests.append(least)
        progress(count / generations)
    return Minimum(
        shares=best,
        cost=least,
        own_cost=own_cost,
        lowered=_lowered(bests),
        evaluations=tuning.budget,
    )


def _lowered(bests: Sequence[float]) -> float | None:
    """Share by which the last third of generations lowered the lowest cost."""
    if len(bests) < 2:
        return None
    before, after = bests[2 * len(bests) // 3 - 1], bests[-1]
    return 0.0 if before == after else 1.0 if math.isinf(before) or not before else (before - after) / abs(before)


def best_by_period(results: Sequence[SearchResult]) -> Iterator[SearchResult]:
    """The search with the lowest cost for each period."""
    for period in dict.fromkeys(one.period for one in results):
        yield min((one for one in results if one.period == period), key=lambda one: one.cost)
