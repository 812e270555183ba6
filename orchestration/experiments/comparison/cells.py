"""Outcomes of the runs of a comparison, and summaries of its cells, with confidence intervals.

A run survives if it has not diverged by its horizon. It settles if its outcome is `settled`: the error stays within
5 cm throughout the last third. The largest error there is its residual.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from orchestration.experiments.comparison.design import CONDITION, START, VEHICLE, Case, Comparison
from orchestration.experiments.studies.axes import Value
from orchestration.experiments.studies.shares import GOOD, PAIR, RANDOM
from orchestration.foundation.basics.statistics import quantile, wilson

if TYPE_CHECKING:
    import pandas as pd

    Fate = Callable[["pd.DataFrame"], "pd.Series"]
    """A mask of the rows of a table of runs"""

SETTLING = "settling_time"
"""The objective that is the time from which a run stays within 5 cm; a run that settles has one"""
RESIDUAL = "ultimate_bound"
"""The objective that is the largest error at the end"""


def survived(table: "pd.DataFrame") -> "pd.Series":
    """Mask of the runs that have not diverged by their horizon."""
    return table["outcome"].notna() & table["outcome"].ne("diverged")


def settled(table: "pd.DataFrame") -> "pd.Series":
    """Mask of the runs that settle."""
    return table["outcome"].eq("settled")


def diverged_late(table: "pd.DataFrame", horizon: float) -> "pd.Series":
    """Mask of the runs that diverged in the second half of a horizon [s]: with a longer one more might."""
    return ~survived(table) & table["divergence_time"].astype(float).gt(0.5 * horizon)


FATES: Mapping[str, "Fate"] = {"survive": survived, "settle": settled}
"""Fates by the name in tables and files"""
WORDS = {"survive": ("surviving", "diverged"), "settle": ("settled", "not settled")}
"""The names of a run that has a fate, and of one that has not"""


PEAK, VARIATION = "torque_max", "total_variation.torque"


@dataclass(frozen=True, kw_only=True)
class Share:
    """A count of runs, its share of all, and the Wilson interval of that share at 95 %."""

    count: int
    value: float
    low: float
    high: float

    @classmethod
    def of(cls, count: int, runs: int) -> "Share":
        """The share of `count` in `runs`."""
        low, high = wilson(count, runs)
        return cls(count=count, value=count / runs, low=low, high=high)


@dataclass(frozen=True, kw_only=True)
class Median:
    """The median of some values, with the interval of two order statistics at 95 %."""

    value: float | None
    low: float | None
    high: float | None
    """None: no values, or too few to bound it"""

    @classmethod
    def of(cls, values: Sequence[float], confidence: float = 0.95) -> "Median":
        """The median of values, with its interval at this confidence."""
        known = [value for value in values if not math.isnan(value)]
        if not known:
            return cls(value=None, low=None, high=None)
        estimate = quantile(known, confidence=confidence)
        return cls(value=estimate.value, low=_finite(estimate.low), high=_finite(estimate.high))

    def columns(self, name: str) -> dict[str, float | None]:
        """The columns of a table for the median of a quantity of this name."""
        return {name: self.value, f"{name}.low": self.low, f"{name}.high": self.high}

    def is_near(self, other: "Median", tolerance: float) -> bool:
        """Whether it equals another median within a relative tolerance."""
        pairs = ((getattr(self, key), getattr(other, key)) for key in ("value", "low", "high"))
        return all(a == b or (None not in (a, b) and math.isclose(a, b, rel_tol=tolerance)) for a, b in pairs)


@dataclass(frozen=True, kw_only=True)
class CellSummary(Case):
    """The outcomes of the runs of one cell."""

    cell: int
    value: Value
    count: int
    """Number of runs"""
    survives: Share
    """have not diverged by the horizon"""
    settles: Share
    """stay within 5 cm throughout the last third"""
    diverged: int
    diverged_late: int
    """Number of these in the second half of the horizon: if there are any, the share still depends on the horizon"""
    medians: dict[str, Median]
    """Medians over the runs that survive, by objective; `settling_time` over those that settle, `residual` the final
    error"""
    values: Mapping[str, Value] = field(default_factory=dict)
    """Values by axis"""

    def row(self) -> dict[str, Any]:
        """The row of the table: a column for each axis."""
        return self._row(dict(self.values))

    def as_json(self) -> dict[str, Any]:
        """The same in JSON types: `values` by axis, and `value` where there is one axis."""
        one = {"value": self.value} if len(self.values) < 2 else {}
        return self._row({**one, "values": dict(self.values)})

    def _row(self, values_of_axes: Mapping[str, Any]) -> dict[str, Any]:
        values: dict[str, Any] = {
            "cell": self.cell, "vehicle": self.vehicle, "condition": self.condition, "controller": self.controller,
            **values_of_axes, "count": self.count,
        }  # fmt: skip
        for name, share in (("survives", self.survives), ("settles", self.settles)):
            values |= {name: share.count, f"{name}.share": share.value, f"{name}.low": share.low}
            values |= {f"{name}.high": share.high}
        values |= {"diverged": self.diverged, "diverged_late": self.diverged_late}
        for name, median in self.medians.items():
            values |= median.columns(name)
        return values


def reported_objectives(comparison: Comparison) -> tuple[str, ...]:
    """The objectives in the summary of a cell, beside settling time and residual."""
    front = comparison.front
    return tuple(dict.fromkeys((front.error, PEAK, VARIATION, front.effort)))


def cell_summaries(comparison: Comparison, table: "pd.DataFrame") -> list[CellSummary]:
    """The summaries of all cells that have runs in a table of the study."""
    cells = [*comparison.cells()]
    done = table[table["status"] == "done"]
    numbers = done["design_index"].to_numpy(int) // len(comparison.initial_conditions)
    summaries = []
    for index, rows in done.groupby(numbers, sort=True):
        cell = cells[int(index)]
        alive, settling = rows[survived(rows)], rows[settled(rows)]
        summaries.append(
            CellSummary(
                cell=cell.index,
                vehicle=cell.vehicle,
                condition=cell.condition,
                controller=cell.controller,
                value=cell.value,
                values=cell.values,
                count=len(rows),
                survives=Share.of(len(alive), len(rows)),
                settles=Share.of(len(settling), len(rows)),
                diverged=len(rows) - len(alive),
                diverged_late=int(diverged_late(rows, comparison.study.origin.stop_time).sum()),
                medians={
                    "settling_time": Median.of(settling[SETTLING].to_numpy(float)),
                    "residual": Median.of(alive[RESIDUAL].to_numpy(float)),
                    **{name: Median.of(alive[name].to_numpy(float)) for name in reported_objectives(comparison)},
                },
            )
        )
    return summaries


def table_of_runs(comparison: Comparison, rows: Iterable[tuple[int, dict[str, Any]]]) -> "pd.DataFrame":
    """A table of runs that are not in a store, from their indices and metrics."""
    import pandas as pd

    listed = [
        {"design_index": index, "status": "done", **comparison.study.points[index], **metrics}
        for index, metrics in rows
    ]
    return pd.DataFrame(listed)


def with_second_axis(comparison: Comparison, table: "pd.DataFrame") -> "pd.DataFrame":
    """A table of runs with a column of the second axis after that of the first, if there is one."""
    if comparison.second is None:
        return table
    table = table.copy()
    values = table[CONDITION].map({name: one.value for name, one in comparison.on_second.items()})
    table.insert(table.columns.get_loc(comparison.axis.name) + 1, comparison.second.name, values)
    return table


def tables_of_maps(
    comparison: Comparison, table: "pd.DataFrame"
) -> "Iterator[tuple[tuple[str, str], str, pd.DataFrame]]":
    """The finished runs over both axes: a vehicle and a condition of the file, a fate, and which runs have it.

    `table` is one `with_second_axis`; those here are such as `shares_of` reads, with pairs of equal initial conditions.
    """
    stands_for = {name: one.condition for name, one in comparison.on_second.items()}
    done = table[table["status"] == "done"]
    for of, rows in done.groupby([VEHICLE, done[CONDITION].map(stands_for)], sort=False):
        for fate, has in FATES.items():
            yield of, fate, as_drawn(rows, has)


def as_drawn(table: "pd.DataFrame", has: "Fate") -> "pd.DataFrame":
    """Runs such as `shares_of` reads: good if they have a fate, random and paired by their initial conditions."""
    return table.assign(**{GOOD: has(table), RANDOM: True, PAIR: table[START]})


def sizes(comparison: Comparison, table: "pd.DataFrame") -> "pd.Series":
    """The size of the initial error of each run."""
    known = [start.size for start in comparison.initial_conditions]
    return table[START].map(lambda index: known[int(index)])


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
