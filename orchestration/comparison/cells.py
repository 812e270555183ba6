"""What each cell of a comparison comes to: who flies, how well, and at what effort, each with its interval."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orchestration.basics.statistics import quantile, wilson
from orchestration.comparison.design import START, Comparison
from orchestration.studies.axes import Value
from orchestration.studies.figures import flew

if TYPE_CHECKING:
    import pandas as pd

PEAK, VARIATION = "torque_max", "total_variation.torque"


@dataclass(frozen=True, kw_only=True)
class Median:
    """Of an objective over the runs that fly, with the interval of two order statistics at 95 %."""

    value: float | None
    low: float | None
    high: float | None
    """None: no run flies, or too few to bound it"""

    @classmethod
    def of(cls, values: Sequence[float]) -> "Median":
        """The median of values."""
        known = [value for value in values if not math.isnan(value)]
        if not known:
            return cls(value=None, low=None, high=None)
        found = quantile(known)
        return cls(value=found.value, low=_finite(found.low), high=_finite(found.high))

    def is_near(self, other: "Median", tolerance: float) -> bool:
        """Whether it is another one within a relative tolerance."""
        pairs = ((getattr(self, key), getattr(other, key)) for key in ("value", "low", "high"))
        return all(a == b or (None not in (a, b) and math.isclose(a, b, rel_tol=tolerance)) for a, b in pairs)


@dataclass(frozen=True, kw_only=True)
class Result:
    """One cell."""

    cell: int
    vehicle: str
    condition: str
    controller: str
    value: Value
    runs: int
    """that there are"""
    flown: int
    diverged: int
    share: float
    low: float
    high: float
    """Wilson interval of the share that flies, at 95 %"""
    medians: dict[str, Median]
    """by objective"""

    def row(self, axis: str) -> dict[str, Any]:
        """As the row of a table."""
        found = {key: value for key, value in vars(self).items() if key not in ("value", "medians")}
        found[axis] = self.value
        for name, median in self.medians.items():
            found |= {name: median.value, f"{name}.low": median.low, f"{name}.high": median.high}
        return found


def judged(comparison: Comparison) -> tuple[str, ...]:
    """The objectives that are told of a cell."""
    front = comparison.front
    return tuple(dict.fromkeys((front.error, PEAK, VARIATION, front.effort)))


def results(comparison: Comparison, table: "pd.DataFrame") -> list[Result]:
    """Of all cells that have runs in a table of rows of the study."""
    cells = [*comparison.cells()]
    done = table[table["status"] == "done"]
    numbers = done["design_index"].to_numpy(int) // len(comparison.drawn)
    found = []
    for index, rows in done.groupby(numbers, sort=True):
        cell = cells[int(index)]
        good = rows[flew(rows)]
        low, high = wilson(len(good), len(rows))
        found.append(
            Result(
                cell=cell.index,
                vehicle=cell.vehicle,
                condition=cell.condition,
                controller=cell.controller,
                value=cell.value,
                runs=len(rows),
                flown=len(good),
                diverged=int((rows["outcome"] == "diverged").sum()),
                share=len(good) / len(rows),
                low=low,
                high=high,
                medians={name: Median.of(good[name].to_numpy(float)) for name in judged(comparison)},
            )
        )
    return found


def frame_of(comparison: Comparison, rows: Iterable[tuple[int, dict[str, Any]]]) -> "pd.DataFrame":
    """A table of runs that are in no store, from their indices and metrics."""
    import pandas as pd

    listed = [
        {"design_index": index, "status": "done", **comparison.study.points[index], **metrics}
        for index, metrics in rows
    ]
    return pd.DataFrame(listed)


def sizes(comparison: Comparison, table: "pd.DataFrame") -> "pd.Series":
    """The size of the initial error of each run."""
    known = [start.size for start in comparison.drawn]
    return table[START].map(lambda index: known[int(index)])


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
