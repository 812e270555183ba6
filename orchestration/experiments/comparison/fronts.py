"""Pareto fronts of error and effort, over the initial conditions that all controllers survive."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.experiments.comparison.cells import Median
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, START, VEHICLE, Comparison
from orchestration.experiments.comparison.survival import survived
from orchestration.experiments.studies.axes import Value

if TYPE_CHECKING:
    import pandas as pd

MIN_SURVIVING_SHARE = 0.5
"""Share of the initial conditions that a controller has to survive to be included"""


@dataclass(frozen=True, kw_only=True)
class Point:
    """One controller at a value of the axis, among those that survive enough."""

    vehicle: str
    condition: str
    value: Value
    controller: str
    starts: int
    """Number of initial conditions that all of these controllers survive"""
    error: Median
    effort: Median
    """Effort over those initial conditions"""
    on_front: bool
    """whether no other is better in one and no worse in the other"""


def points(comparison: Comparison, table: "pd.DataFrame") -> Iterator[Point]:
    """The controllers that survive half the initial conditions or more, at each value where all survive one of them."""
    done = table[table["status"] == "done"]
    for (vehicle, condition, value), rows in done.groupby([VEHICLE, CONDITION, comparison.axis.name], sort=False):
        alive = rows[survived(rows)]
        counts = alive[CONTROLLER].value_counts()
        enough = MIN_SURVIVING_SHARE * len(comparison.initial_conditions)
        names = [one.name for one in comparison.controllers if counts.get(one.name, 0) >= enough]
        alive = alive[alive[CONTROLLER].isin(names)]
        by_all = alive[START].value_counts() == len(names)
        if not by_all.any():
            continue
        common = alive[alive[START].isin(by_all[by_all].index)]
        medians = [(name, *_medians(comparison, common[common[CONTROLLER] == name])) for name in names]
        for name, error, effort in medians:
            yield Point(
                vehicle=vehicle,
                condition=condition,
                value=value,
                controller=name,
                starts=int(by_all.sum()),
                error=error,
                effort=effort,
                on_front=not any(_dominates((a.value, b.value), (error.value, effort.value)) for _, a, b in medians),
            )


def _medians(comparison: Comparison, rows: "pd.DataFrame") -> tuple[Median, Median]:
    front = comparison.front
    return Median.of(rows[front.error].to_numpy(float)), Median.of(rows[front.effort].to_numpy(float))


def _dominates(one: tuple[float | None, float | None], other: tuple[float | None, float | None]) -> bool:
    """Whether `one` is no worse in both and better in one."""
    pairs = [(a, b) for a, b in zip(one, other) if a is not None and b is not None]
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)
