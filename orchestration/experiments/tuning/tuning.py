"""Tuning by runs: parameters of lowest mean cost over an ensemble of initial conditions, judged on others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from orchestration.components.building.fmus import native_twins
from orchestration.experiments.limits.evaluation import is_good
from orchestration.experiments.tuning.tuning_problem import COST, Costs, SearchResult, TuningProblem, minimise
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.statistics import wilson
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import ControlLoop, errors_in_own_terms, system_of
from orchestration.systems.system.starts import Starts

RunSystems = Callable[[Sequence[System]], Sequence[dict[str, Any]]]
"""The metrics of runs, in their order"""


@record()
class Tuning(TuningProblem):
    """A tuning by runs; raises `UsageError` for invalid values."""

    base: ControlLoop
    """The scenario whose controller is tuned."""
    bad: float
    """The cost of a run that diverges, or whose cost has no value; no run costs more."""
    starts: Starts
    """The initial conditions that it is tuned on; those that it is judged on follow them."""
    judged: int
    """The number of initial conditions that it is judged on."""
    native: bool = False
    """Whether it is run with the native twins of its FMUs."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.judged < 1:
            raise UsageError(f"judged = {self.judged}: expected at least 1")

    @cached_property
    def origin(self) -> System:
        """The system that the base describes, with native FMUs if requested."""
        system = system_of(self.base)
        return native_twins(system) if self.native else system

    def first_run(self) -> tuple[System, Files]:
        """The system of one of the runs, and the files of all."""
        middle = self.values([0.5] * len(self.parameters))
        return self.systems(self.searched_periods[0], middle, replace(self.starts, count=1))[0], self.files()

    def systems(self, period: float | None, values: Mapping[str, float], starts: Starts) -> list[System]:
        """The systems from an ensemble of initial conditions, each with its own seed, as in a comparison.

        Raises `UsageError` for an invalid value.
        """
        system = self.system(period, values)
        with errors_in_own_terms(self.base):
            return [
                changed(
                    system,
                    {path: v for target, v in start.values.items() for path in self.base.paths_of(target)}
                    | {"seed": self.base.seed + starts.first + index},
                )
                for index, start in enumerate(self.base.initial_conditions(starts))
            ]

    def judging_ensemble(self) -> Starts:
        """The initial conditions that the result is judged on."""
        return replace(self.starts, first=self.starts.first + self.starts.count, count=self.judged)

    def mean_cost(self, runs: Sequence[dict[str, Any]]) -> float:
        """The mean cost of runs by their metrics, `bad` for each that diverges: what a search minimises."""
        return sum(self._cost(metrics) for metrics in runs) / len(runs)

    def survivors_cost(self, runs: Sequence[dict[str, Any]]) -> float | None:
        """The mean cost of the surviving runs; None if none survives."""
        surviving = [metrics for metrics in runs if survives(metrics)]
        return self.mean_cost(surviving) if surviving else None

    def describe_cost(self) -> list[str]:
        """The definition of the cost, for the file of tuned parameters."""
        return [
            f"the mean of ({self.cost}), {self.bad:g} where it diverges,",
            f"over {self.starts.count} starts and {self.origin.stop_time:g} s.",
        ]

    def _cost(self, metrics: dict[str, Any]) -> float:
        cost = metrics[COST]
        return min(float(cost), self.bad) if survives(metrics) and cost is not None else self.bad


def survives(metrics: Mapping[str, Any]) -> bool:
    """Whether a run does not diverge before its stop time."""
    return not metrics["diverged"]


@dataclass(frozen=True, kw_only=True)
class TuningResult(SearchResult):
    """The result of one search by runs; its cost is the mean over its initial conditions, diverging runs included."""

    judged: int
    """number of other initial conditions that it is judged on"""
    survives: int
    """Number of these that do not diverge before the stop time"""
    good: int
    """Number of these that meet the criterion of the base"""
    survivors_cost: float | None
    """mean cost of the surviving ones; None: none survives"""

    @property
    def judgement(self) -> str:
        """The results on the other initial conditions, in words."""
        low, high = wilson(self.survives, self.judged)
        cost = "" if self.survivors_cost is None else f" at a mean cost of {self.survivors_cost:.5g}"
        return (
            f"{self.survives} of {self.judged} other starts survive (a share of {low:.3f} to {high:.3f}, Wilson, 95 %)"
            f"{cost}, {self.good} are good"
        )

    @property
    def figures(self) -> dict[str, float | None]:
        """The same in numbers, by name."""
        return {f"survive, of {self.judged}": self.survives, "cost of those": self.survivors_cost}


def search(
    tuning: Tuning,
    period: float | None,
    seed: int,
    run: RunSystems,
    judge: RunSystems,
    progress: Callable[[float], None],
    keeping: Callable[[Costs], Costs] = lambda costs: costs,
) -> TuningResult:
    """The result of one search; `run` simulates the candidates, `judge` the runs that the best one is judged on.

    `keeping` wraps the costs of candidates to keep them.
    """
    best = minimise(tuning, seed, keeping(lambda shares: _costs(tuning, period, shares, run)), progress)
    values = tuning.values(list(best.shares))
    judged = judge(tuning.systems(period, values, tuning.judging_ensemble()))
    return TuningResult(
        period=period,
        seed=seed,
        values=values,
        cost=best.cost,
        own_cost=best.own_cost,
        lowered=best.lowered,
        of_ranges=tuning.of_ranges(best.shares.tolist()),
        evaluations=best.evaluations,
        judged=len(judged),
        survives=sum(map(survives, judged)),
        good=sum(map(is_good, judged)),
        survivors_cost=tuning.survivors_cost(judged),
    )


def _costs(tuning: Tuning, period: float | None, candidates: Sequence[Floats], run: RunSystems) -> list[float]:
    """The mean cost of each candidate; all runs of all candidates are submitted together."""
    systems = [
        system
        for candidate in candidates
        for system in tuning.systems(period, tuning.values(list(candidate)), tuning.starts)
    ]
    metrics, size = run(systems), tuning.starts.count
    return [tuning.mean_cost(metrics[i : i + size]) for i in range(0, len(metrics), size)]
