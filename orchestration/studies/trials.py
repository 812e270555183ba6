"""Flights that decide whether a value of a quantity flies, with one seed or many."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orchestration.quadrotor.measures import Outcome
from orchestration.scenario import Scenario
from orchestration.statistics import refutes, wilson
from orchestration.studies.engine import Pool
from orchestration.studies.ranges import Range
from orchestration.studies.study import changed

RELIABILITY = 0.9
"""For random quantities: the share of seeds that fly, which the stated confidence is in."""


def flies(metrics: dict[str, Any]) -> bool:
    """The criterion: settled, which is not diverged and within 5 cm in the last third of the run."""
    return bool(metrics["outcome"] == "settled")


@dataclass(frozen=True, kw_only=True)
class Tried:
    """One value that was flown, with one seed or many."""

    value: float
    outcome: Outcome
    """settled if all were; else that of the first seed that did not settle"""
    divergence_time: float | None
    """of that seed [s]"""
    flew: int
    runs: int
    """how many were flown: all seeds, or up to the first that did not fly"""
    share: tuple[float, float] | None
    """Wilson interval of the share of seeds that fly, at the confidence; None: nothing is random, or not all flown"""


class Trials:
    """Flies values of a quantity, each with all seeds, and keeps what became of them."""

    def __init__(
        self,
        scenario: Scenario,
        of: str,
        span: Range,
        seeds: int,
        confidence: float | None,
        pool: Pool,
        announce: Callable[[str], None],
    ) -> None:
        self._scenario, self._of, self._span, self._seeds = scenario, of, span, seeds
        self._confidence, self._pool, self._announce = confidence, pool, announce
        self.tolerance = span.tolerance
        self.tried: dict[float, Tried] = {}

    def fails(self, value: float) -> bool:
        """Whether a seed does not fly; the rest is not flown then."""
        return self._fly(value, stop=lambda metrics: not flies(metrics)).outcome != "settled"

    def is_refuted(self, value: float) -> bool:
        """Whether so many of all seeds do not fly that `RELIABILITY` is refuted at the confidence."""
        found = self._fly(value, stop=lambda metrics: False)
        return self._confidence is not None and refutes(found.flew, found.runs, RELIABILITY, self._confidence)

    def _fly(self, value: float, stop: Callable[[Any], bool]) -> Tried:
        varied = changed(self._scenario, {f"timing.{self._of}": value})
        runs = [varied.with_changes(seed=self._scenario.seed + i) for i in range(self._seeds)]
        flown = self._pool.fly(runs, stop=stop)
        down = next((metrics for metrics in flown if not flies(metrics)), None)
        flew = sum(map(flies, flown))
        known = self._confidence is not None and len(flown) == self._seeds
        found = self.tried[value] = Tried(
            value=value,
            outcome="settled" if down is None else down["outcome"],
            divergence_time=None if down is None else down["divergence_time"],
            flew=flew,
            runs=len(flown),
            share=wilson(flew, len(flown), self._confidence) if known and self._confidence is not None else None,
        )
        self._announce(f"{self._of} {value:.6g}{self._span.unit}: {said(found)}")
        return found


def said(tried: Tried) -> str:
    """What became of a value, in words."""
    if tried.share is not None:
        low, high = tried.share
        return f"{tried.flew} of {tried.runs} seeds fly, a share of {low:.2f} to {high:.2f}"
    if tried.outcome == "settled":
        return "flies"
    return "fails, bounded" if tried.divergence_time is None else f"fails, diverged at {tried.divergence_time:.3g} s"
