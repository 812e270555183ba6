"""What each cell of a comparison comes to: who survives, who settles, how well and at what effort, with intervals."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orchestration.basics.statistics import quantile, wilson
from orchestration.comparison.design import START, Comparison
from orchestration.comparison.fates import RESIDUAL, SETTLING, diverged_late, settled, survived
from orchestration.studies.axes import Value

if TYPE_CHECKING:
    import pandas as pd

PEAK, VARIATION = "torque_max", "total_variation.torque"


@dataclass(frozen=True, kw_only=True)
class Share:
    """So many of all, and the Wilson interval of that share at 95 %."""

    count: int
    value: float
    low: float
    high: float

    @classmethod
    def of(cls, count: int, runs: int) -> "Share":
        """`count` of `runs`."""
        low, high = wilson(count, runs)
        return cls(count=count, value=count / runs, low=low, high=high)


@dataclass(frozen=True, kw_only=True)
class Median:
    """Of some values, with the interval of two order statistics at 95 %."""

    value: float | None
    low: float | None
    high: float | None
    """None: there is no value, or there are too few to bound it"""

    @classmethod
    def of(cls, values: Sequence[float], confidence: float = 0.95) -> "Median":
        """The median of values, with its interval at a confidence."""
        known = [value for value in values if not math.isnan(value)]
        if not known:
            return cls(value=None, low=None, high=None)
        found = quantile(known, confidence=confidence)
        return cls(value=found.value, low=_finite(found.low), high=_finite(found.high))

    def is_near(self, other: "Median", tolerance: float) -> bool:
        """Whether it is another one within a relative tolerance."""
        pairs = ((getattr(self, key), getattr(other, key)) for key in ("value", "low", "high"))
        return all(a == b or (None not in (a, b) and math.isclose(a, b, rel_tol=tolerance)) for a, b in pairs)


@dataclass(frozen=True, kw_only=True)
class CellSummary:
    """One cell: what became of its runs."""

    cell: int
    vehicle: str
    condition: str
    controller: str
    value: Value
    count: int
    """runs that there are"""
    survives: Share
    """have not diverged by the horizon"""
    settles: Share
    """have settled by the horizon"""
    diverged: int
    diverged_late: int
    """of these, in the second half of the horizon: as long as some do, the share still moves with it"""
    medians: dict[str, Median]
    """of those that survive, by objective; `settling_time` of those that settle, `residual` the error at the end"""

    def row(self, axis: str) -> dict[str, Any]:
        """As the row of a table, and as JSON has it."""
        found: dict[str, Any] = {
            "cell": self.cell, "vehicle": self.vehicle, "condition": self.condition, "controller": self.controller,
            axis: self.value, "count": self.count,
        }  # fmt: skip
        for name, share in (("survives", self.survives), ("settles", self.settles)):
            found |= {name: share.count, f"{name}.share": share.value, f"{name}.low": share.low}
            found |= {f"{name}.high": share.high}
        found |= {"diverged": self.diverged, "diverged_late": self.diverged_late}
        for name, median in self.medians.items():
            found |= {name: median.value, f"{name}.low": median.low, f"{name}.high": median.high}
        return found


def judged(comparison: Comparison) -> tuple[str, ...]:
    """The objectives that are told of a cell, beside settling time and residual."""
    front = comparison.front
    return tuple(dict.fromkeys((front.error, PEAK, VARIATION, front.effort)))


def results(comparison: Comparison, table: "pd.DataFrame") -> list[CellSummary]:
    """Of all cells that have runs in a table of rows of the study."""
    cells = [*comparison.cells()]
    done = table[table["status"] == "done"]
    numbers = done["design_index"].to_numpy(int) // len(comparison.drawn)
    found = []
    for index, rows in done.groupby(numbers, sort=True):
        cell = cells[int(index)]
        alive = rows[survived(rows)]
        found.append(
            CellSummary(
                cell=cell.index,
                vehicle=cell.vehicle,
                condition=cell.condition,
                controller=cell.controller,
                value=cell.value,
                count=len(rows),
                survives=Share.of(len(alive), len(rows)),
                settles=Share.of(int(settled(rows).sum()), len(rows)),
                diverged=len(rows) - len(alive),
                diverged_late=int(diverged_late(rows, comparison.study.origin.stop_time).sum()),
                medians={
                    "settling_time": Median.of(alive[SETTLING].to_numpy(float)),
                    "residual": Median.of(alive[RESIDUAL].to_numpy(float)),
                    **{name: Median.of(alive[name].to_numpy(float)) for name in judged(comparison)},
                },
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
