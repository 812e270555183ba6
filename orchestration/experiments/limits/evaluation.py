"""Evaluation of whether a value of a quantity is good, with one seed or many."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.statistics import refutes, wilson
from orchestration.simulation.requests.ranges import Varied
from orchestration.simulation.results.objectives import judged_objective, missed_objective, unmet
from orchestration.simulation.workers.executors import RunEvaluator

RELIABILITY = 0.9
"""Share of good seeds to which the stated confidence refers, for random quantities"""


def is_good(metrics: dict[str, Any]) -> bool:
    """Whether a run meets the criterion of its system."""
    return bool(metrics["good"])


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """The outcome of the runs at one value, with one seed or many."""

    value: float
    outcome: str
    """Outcome of a good run if all were good, else of the first seed that was not"""
    divergence_time: float | None
    """Divergence time of the run with that seed [s]"""
    flew: int
    """number of good runs"""
    runs: int
    """number of runs: all seeds, or up to the first that was not good"""
    share: tuple[float, float] | None
    """Wilson interval of the share of good seeds, at the confidence; None: nothing is random, or not all were run"""
    measured: float | None = None
    """the judged objective, of the seed that `outcome` is of or else the first; None: it has no value, or is not
    chosen yet"""
    unmet: str | None = None
    """the part of the criterion that this seed did not meet, in words; None: it was met, or the run diverged"""

    @property
    def is_good(self) -> bool:
        """Whether all of its runs were good."""
        return self.flew == self.runs


@dataclass(kw_only=True)
class Evaluator:
    """Evaluates values of a quantity, each with all seeds, and keeps the evaluations."""

    varied: Varied
    span: Range
    seeds: int
    confidence: float | None
    units: Mapping[str, str]
    """Units of the metrics"""
    pool: RunEvaluator
    announce: Callable[[str], None]
    progress: Callable[[float], None]
    tried: dict[float, Evaluation] = field(default_factory=dict)
    shown: dict[float, Mapping[str, Any]] = field(default_factory=dict)
    """The metrics at each value of the seed that `outcome` is of, or else the first"""
    _done: int = 0
    _remaining: int = 0

    @property
    def scheduled(self) -> list[float]:
        """The evaluated values, in rising order, of a system with computers or networks; else none."""
        system = self.varied.system
        return sorted(self.tried) if system.computers or system.networks else []

    def expect_remaining(self, count: int) -> None:
        """Set how many values may follow the next one, for the progress as a share of all of them."""
        self._remaining = count

    def fails(self, value: float) -> bool:
        """Whether some seed is not good; the remaining seeds are not run then."""
        return not self._run(value, stop=lambda metrics: not is_good(metrics)).is_good

    def is_refuted(self, value: float) -> bool:
        """Whether so many of all seeds are not good that `RELIABILITY` is refuted at the confidence."""
        done = self._run(value, stop=lambda metrics: False)
        return self.confidence is not None and refutes(done.flew, done.runs, RELIABILITY, self.confidence)

    def judged_at(self, value: float | None) -> str | None:
        """The objective whose bound a value is the first to miss, or else the one that the criterion judges."""
        missed = None if value is None else missed_objective(self.varied.at(value), self.shown[value])
        return missed or judged_objective(self.varied.system)

    def measuring(self, metric: str | None) -> tuple[Evaluation, ...]:
        """All evaluations, in rising order, with the values of an objective."""
        return tuple(
            replace(self.tried[value], measured=found if isinstance(found, float) and math.isfinite(found) else None)
            for value in sorted(self.tried)
            for found in (self.shown[value].get(metric or ""),)
        )

    def _run(self, value: float, stop: Callable[[Any], bool]) -> Evaluation:
        system = self.varied.at(value)
        runs = [replace(system, seed=system.seed + i) for i in range(self.seeds)]
        all_values = self._done + 1 + self._remaining
        metrics = self.pool.run_until(
            runs, stop=stop, report=lambda seeds: self.progress((self._done + seeds / len(runs)) / all_values)
        )
        self._done += 1
        failed = next((one for one in metrics if not is_good(one)), None)
        good = sum(map(is_good, metrics))
        self.shown[value] = metrics[0] if failed is None else failed
        known = self.confidence is not None and len(metrics) == self.seeds
        evaluation = self.tried[value] = Evaluation(
            value=value,
            outcome=system.criterion.outcomes[0] if failed is None else failed["outcome"],
            divergence_time=None if failed is None else failed["divergence_time"],
            flew=good,
            runs=len(metrics),
            share=wilson(good, len(metrics), self.confidence) if known and self.confidence is not None else None,
            unmet=None if failed is None else unmet(system, failed, self.units),
        )
        self.announce(f"{self.varied.of} {self.span.text(value)}: {describe(evaluation)}")
        return evaluation


def describe(evaluation: Evaluation) -> str:
    """The outcome at a value, in words."""
    if evaluation.share is not None:
        low, high = evaluation.share
        return f"{evaluation.flew} of {evaluation.runs} seeds are good, a share of {low:.2f} to {high:.2f}"
    if evaluation.is_good:
        return evaluation.outcome
    if evaluation.divergence_time is not None:
        return f"fails, {evaluation.outcome} at {evaluation.divergence_time:.3g} s"
    return f"fails, {evaluation.outcome}" + (f": {evaluation.unmet}" if evaluation.unmet else "")
