"""Runs that decide whether a value of a quantity is good, with one seed or many."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from orchestration.basics.bisection import Range
from orchestration.basics.statistics import refutes, wilson
from orchestration.requests.ranges import Varied
from orchestration.results.criterion import judged_objective, unmet
from orchestration.workers.executors import RunEvaluator

RELIABILITY = 0.9
"""For random quantities: the share of seeds that are good, which the stated confidence is in."""


def is_good(metrics: dict[str, Any]) -> bool:
    """Whether a run meets the criterion of its system; of the quadrotor, whether it flies."""
    return bool(metrics["good"])


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """One value that was run, with one seed or many."""

    value: float
    outcome: str
    """that of a good run if all were; else that of the first seed that was not"""
    divergence_time: float | None
    """of that seed [s]"""
    flew: int
    """how many were good"""
    runs: int
    """how many were run: all seeds, or up to the first that was not good"""
    share: tuple[float, float] | None
    """Wilson interval of the share of seeds that are good, at the confidence; None: no chance, or not all run"""
    measured: float | None = None
    """what the criterion is about, of the first seed or of that one; None: it has no value"""
    unmet: str | None = None
    """what of the criterion that seed did not meet, in words; None: it did, or diverged"""


class Evaluator:
    """Runs values of a quantity, each with all seeds, and keeps what became of them."""

    def __init__(
        self,
        varied: Varied,
        span: Range,
        seeds: int,
        confidence: float | None,
        units: Mapping[str, str],
        pool: RunEvaluator,
        announce: Callable[[str], None],
        progress: Callable[[float], None],
    ) -> None:
        self._varied, self._span, self._seeds = varied, span, seeds
        self._confidence, self._pool, self._announce, self._progress = confidence, pool, announce, progress
        self._units = units
        self._done = self._left = 0
        self.tolerance = span.tolerance
        self.tried: dict[float, Evaluation] = {}

    def expect(self, left: int) -> None:
        """Hear how many values may come after the next one: the progress is a share of all of them."""
        self._left = left

    def fails(self, value: float) -> bool:
        """Whether a seed is not good; the rest is not run then."""
        found = self._run(value, stop=lambda metrics: not is_good(metrics))
        return found.flew < found.runs

    def is_refuted(self, value: float) -> bool:
        """Whether so many of all seeds are not good that `RELIABILITY` is refuted at the confidence."""
        found = self._run(value, stop=lambda metrics: False)
        return self._confidence is not None and refutes(found.flew, found.runs, RELIABILITY, self._confidence)

    def _run(self, value: float, stop: Callable[[Any], bool]) -> Evaluation:
        system = self._varied.at(value)
        runs = [replace(system, seed=system.seed + i) for i in range(self._seeds)]
        all_values = self._done + 1 + self._left
        metrics = self._pool.run_until(
            runs, stop=stop, report=lambda seeds: self._progress((self._done + seeds / len(runs)) / all_values)
        )
        self._done += 1
        down = next((one for one in metrics if not is_good(one)), None)
        flew = sum(map(is_good, metrics))
        measured = metrics[0 if down is None else metrics.index(down)].get(judged_objective(system) or "")
        known = self._confidence is not None and len(metrics) == self._seeds
        found = self.tried[value] = Evaluation(
            value=value,
            outcome=system.criterion.outcomes[0] if down is None else down["outcome"],
            divergence_time=None if down is None else down["divergence_time"],
            flew=flew,
            runs=len(metrics),
            share=wilson(flew, len(metrics), self._confidence) if known and self._confidence is not None else None,
            measured=measured if isinstance(measured, float) and math.isfinite(measured) else None,
            unmet=None if down is None else unmet(system, down, self._units),
        )
        self._announce(f"{self._varied.of} {value:.6g}{self._span.unit}: {said(found)}")
        return found


def said(tried: Evaluation) -> str:
    """What became of a value, in words."""
    if tried.share is not None:
        low, high = tried.share
        return f"{tried.flew} of {tried.runs} seeds are good, a share of {low:.2f} to {high:.2f}"
    if tried.flew == tried.runs:
        return tried.outcome
    if tried.divergence_time is not None:
        return f"fails, {tried.outcome} at {tried.divergence_time:.3g} s"
    return f"fails, {tried.outcome}" + (f": {tried.unmet}" if tried.unmet else "")
