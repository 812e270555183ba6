"""What no other controller beats in error and in effort, on the starts that all of them survive."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.comparison.cells import Median
from orchestration.comparison.design import CONDITION, CONTROLLER, START, VEHICLE, Comparison
from orchestration.comparison.fates import survived
from orchestration.studies.axes import Value

if TYPE_CHECKING:
    import pandas as pd

LEAST = 0.5
"""Share of the starts that a controller has to survive to be weighed against others."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """One controller among those that survive at a value of the axis."""

    vehicle: str
    condition: str
    value: Value
    controller: str
    starts: int
    """that all of these controllers survive"""
    error: Median
    effort: Median
    """over those starts"""
    on_front: bool
    """whether no other has less of both"""


def points(comparison: Comparison, table: "pd.DataFrame") -> Iterator[Point]:
    """The controllers that survive half the starts or more, at each value of the axis."""
    done = table[table["status"] == "done"]
    for (vehicle, condition, value), rows in done.groupby([VEHICLE, CONDITION, comparison.axis.name], sort=False):
        alive = rows[survived(rows)]
        counts = alive[CONTROLLER].value_counts()
        enough = LEAST * len(comparison.drawn)
        chosen = [one.name for one in comparison.controllers if counts.get(one.name, 0) >= enough]
        alive = alive[alive[CONTROLLER].isin(chosen)]
        by_all = alive[START].value_counts() == len(chosen)
        common = alive[alive[START].isin(by_all[by_all].index)]
        found = [(name, *_medians(comparison, common[common[CONTROLLER] == name])) for name in chosen]
        for name, error, effort in found:
            yield Point(
                vehicle=vehicle,
                condition=condition,
                value=value,
                controller=name,
                starts=int(by_all.sum()),
                error=error,
                effort=effort,
                on_front=not any(_beats((a.value, b.value), (error.value, effort.value)) for _, a, b in found),
            )


def _medians(comparison: Comparison, rows: "pd.DataFrame") -> tuple[Median, Median]:
    front = comparison.front
    return Median.of(rows[front.error].to_numpy(float)), Median.of(rows[front.effort].to_numpy(float))


def _beats(one: tuple[float | None, float | None], other: tuple[float | None, float | None]) -> bool:
    """Whether one is no worse in either and better in one."""
    if None in one or None in other:
        return False
    pairs = [(a, b) for a, b in zip(one, other) if a is not None and b is not None]
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)
