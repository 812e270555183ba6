"""Tuning: the parameters of a controller that cost least on an ensemble of starts, judged on other starts."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.basics.simulator import Floats
from orchestration.basics.statistics import wilson
from orchestration.building.fmus import native_twins
from orchestration.building.inputs import Files, files_of
from orchestration.limits.evaluation import is_good
from orchestration.requests.ranges import paths_in
from orchestration.studies.axes import Axis
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.request import ControlLoop, Ensemble, in_its_own_words, system_meant

Fly = Callable[[Sequence[System]], Sequence[dict[str, Any]]]
"""The metrics of runs, in their order"""
COST = "cost"
"""The objective that a tuning adds"""
_WIDTH = 0.25
"""of the first generation, as a share of each range"""
_PERIOD = "timing.period"


@record()
class Tuning:
    """What is tuned, on what, and with how much effort; raises `UsageError` for what cannot be."""

    name: str
    """The name of the tuning, with which its files begin."""
    base: ControlLoop
    """The scenario whose controller is tuned."""
    parameters: tuple[Axis, ...]
    """What is tuned, each between its `low` and its `high`."""
    cost: str
    """The cost of a run that survives: an expression over the objectives of the base."""
    bad: float
    """The cost of a run that diverges, or whose cost has no value; no run costs more."""
    starts: Ensemble
    """The starts that it is tuned on; those that it is judged on come after them."""
    judged: int
    """How many starts it is judged on."""
    periods: tuple[float, ...]
    """The sampling periods [s]; it is tuned for each by itself."""
    evaluations: int
    """How often the mean cost is evaluated in a search, for each parameter."""
    native: bool = False
    """Whether native FMUs fly."""
    seeds: tuple[int, ...]
    """The seeds of the optimiser, each a search of its own; the best by its cost on the starts that it is tuned on is
    taken."""

    def __post_init__(self) -> None:
        if len(self.parameters) < 2:
            raise UsageError("parameters: expected at least two; one is found by a study with an axis")
        for name in ("evaluations", "judged"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} = {getattr(self, name)}: expected at least 1")
        for name in ("periods", "seeds"):
            if not getattr(self, name):
                raise UsageError(f"{name}: expected at least one")
        if COST in self.origin.objectives:
            raise UsageError(f"objectives.{COST}: expected another name, which a tuning adds")
        assert self._paths

    @cached_property
    def origin(self) -> System:
        """The system that the base means, by native FMUs if these are to fly."""
        system = system_meant(self.base)
        return native_twins(system) if self.native else system

    @cached_property
    def _paths(self) -> dict[str, tuple[str, ...]]:
        return {
            target: paths_in(self.base, target)
            for target in (_PERIOD, *(target for axis in self.parameters for target in axis.targets))
        }

    @property
    def budget(self) -> int:
        """Evaluations of the mean cost in one search."""
        return self.evaluations * len(self.parameters)

    def files(self) -> Files:
        """The files of all flights, FMUs built if need be."""
        return files_of(self.origin)

    def first(self) -> tuple[System, Files]:
        """One of the flights, and the files of all."""
        middle = self.values([0.5] * len(self.parameters))
        return self.systems(self.periods[0], middle, self.starts.some(self.starts.first, 1))[0], self.files()

    def values(self, shares: Sequence[float]) -> dict[str, float]:
        """What each target is set to, at a share in [0, 1] of the range of each parameter."""
        return {
            target: axis.at(float(share)) for axis, share in zip(self.parameters, shares) for target in axis.targets
        }

    def systems(self, period: float, values: Mapping[str, float], starts: Ensemble) -> list[System]:
        """The flights from an ensemble of starts; raises `UsageError` for a value that cannot be."""
        given = {**values, _PERIOD: period}
        with in_its_own_words(self.base):
            system = changed(self.origin, {path: given[target] for target in given for path in self._paths[target]})
            system = replace(system, objectives={**system.objectives, COST: self.cost})
            return [
                changed(system, {path: v for target, v in start.values.items() for path in self.base.paths_of(target)})
                for start in starts.starts_of(self.base)
            ]

    def judging(self) -> Ensemble:
        """The starts that the outcome is judged on."""
        return self.starts.some(self.starts.first + self.starts.count, self.judged)

    def mean_cost(self, runs: Sequence[dict[str, Any]]) -> float:
        """Of runs by their metrics, `bad` for each that diverges: what a search makes small."""
        return sum(self._cost(metrics) for metrics in runs) / len(runs)

    def survivors_cost(self, runs: Sequence[dict[str, Any]]) -> float | None:
        """The mean cost of those that survive; None if none does."""
        surviving = [metrics for metrics in runs if survives(metrics)]
        return self.mean_cost(surviving) if surviving else None

    def _cost(self, metrics: dict[str, Any]) -> float:
        cost = metrics[COST]
        return min(float(cost), self.bad) if survives(metrics) and cost is not None else self.bad


def survives(metrics: Mapping[str, Any]) -> bool:
    """Whether a run does not diverge by its horizon."""
    return not metrics["diverged"]


@dataclass(frozen=True, kw_only=True)
class Found:
    """The outcome of one search."""

    period: float
    """[s]"""
    seed: int
    values: dict[str, float]
    """of each target"""
    cost: float
    """the mean on the starts that it was tuned on, with those that diverge"""
    judged: int
    """how many other starts it is judged on"""
    survives: int
    """how many of these do not diverge by the horizon"""
    good: int
    """how many of these meet the criterion of the base"""
    survivors_cost: float | None
    """the mean of those that survive; None: none does"""
    evaluations: int

    @property
    def judgement(self) -> str:
        """How it does on the other starts, in words."""
        low, high = wilson(self.survives, self.judged)
        cost = "" if self.survivors_cost is None else f" at a mean cost of {self.survivors_cost:.5g}"
        return (
            f"{self.survives} of {self.judged} other starts survive (a share of {low:.3f} to {high:.3f}, Wilson, 95 %)"
            f"{cost}, {self.good} are good"
        )


def search(tuning: Tuning, period: float, seed: int, fly: Fly, judge: Fly, progress: Callable[[float], None]) -> Found:
    """The best of one search by CMA-ES (Hansen, arXiv:1604.00772), begun at a point that the seed draws.

    `fly` flies what is searched through, `judge` what the best is judged by.
    """
    import cma  # with it comes matplotlib

    first = np.random.default_rng(seed).uniform(0.25, 0.75, len(tuning.parameters))
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(first, _WIDTH, options)
    best, lowest, count = first, np.inf, 0
    while count < tuning.budget:  # whatever the optimiser thinks of it: every controller gets the same effort
        candidates = [np.asarray(candidate) for candidate in strategy.ask()]
        costs = _costs(tuning, period, candidates, fly)
        strategy.tell(candidates, costs)
        count += len(candidates)
        place = int(np.argmin(costs))
        if costs[place] < lowest:
            best, lowest = candidates[place], costs[place]
        progress(min(1.0, count / tuning.budget))
    values = tuning.values(list(best))
    judged = judge(tuning.systems(period, values, tuning.judging()))
    return Found(
        period=period,
        seed=seed,
        values=values,
        cost=float(lowest),
        judged=len(judged),
        survives=sum(map(survives, judged)),
        good=sum(map(is_good, judged)),
        survivors_cost=tuning.survivors_cost(judged),
        evaluations=count,
    )


def _costs(tuning: Tuning, period: float, candidates: Sequence[Floats], fly: Fly) -> list[float]:
    """The mean cost of each candidate; all their flights are flown together."""
    systems = [
        system
        for candidate in candidates
        for system in tuning.systems(period, tuning.values(list(candidate)), tuning.starts)
    ]
    flights, size = fly(systems), tuning.starts.count
    return [tuning.mean_cost(flights[i : i + size]) for i in range(0, len(flights), size)]


def best_by_period(found: Sequence[Found]) -> Iterator[Found]:
    """Of the searches for each period the one whose cost on the starts that it was tuned on is lowest."""
    for period in dict.fromkeys(one.period for one in found):
        yield min((one for one in found if one.period == period), key=lambda one: one.cost)
