"""Controllers against each other: Pareto fronts of error and effort, and pairs of each with the first."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orchestration.experiments.comparison.cells import FATES, Median, as_drawn, settled, survived
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, START, VEHICLE, Comparison
from orchestration.experiments.studies.axes import Value
from orchestration.experiments.studies.shares import TwoLaws, differences_of

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


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The share of one controller that has a fate minus that of another, with Newcombe's interval for pairs at 95 %."""

    value: float
    low: float
    high: float


_RATIOS = 2
"""reported for a pair: error and effort"""


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A controller and the first of the file, at one value of the axis."""

    vehicle: str
    condition: str
    value: Value
    controller: str
    against: str
    both: int
    """initial conditions that both survive"""
    only_it: int
    only_other: int
    neither: int
    settles: int
    """Number from which it settles minus the number from which the other settles; one that diverges does not settle"""
    error: Median
    effort: Median
    """medians of the ratio of its value to that of the first where both survive; the intervals hold for all pairs of
    the comparison together (Bonferroni)"""
    shares: Mapping[str, Difference]
    """Its shares minus those of the first, by fate; each interval for itself"""

    def row(self) -> dict[str, Any]:
        """The row of the table."""
        row = {**vars(self), **self.error.columns("error"), **self.effort.columns("effort"), **self.differences()}
        del row["shares"]
        return row

    def differences(self) -> dict[str, float]:
        """The columns of the differences of shares."""
        return {
            f"{fate}s.difference{end}": value
            for fate, one in self.shares.items()
            for end, value in (("", one.value), (".low", one.low), (".high", one.high))
        }


def pairs(comparison: Comparison, table: "pd.DataFrame") -> Iterator[Pair]:
    """All controllers but the first, at each value of the axis."""
    first, *others = (one.name for one in comparison.controllers)
    done = table[table["status"] == "done"]
    places = len(comparison.vehicles) * len(comparison.conditions) * len(comparison.values)
    confidence = 1.0 - 0.05 / max(1, len(others) * places * _RATIOS)
    shares = _shares(comparison, done)
    for (vehicle, condition, value), rows in done.groupby([VEHICLE, CONDITION, comparison.axis.name], sort=False):
        by_name = {name: one.set_index(START) for name, one in rows.groupby(CONTROLLER, sort=False)}
        if first not in by_name:
            continue
        for name in others:
            if name in by_name:
                place = {"vehicle": vehicle, "condition": condition, "value": value}
                known = {fate: found[vehicle, condition, value, name] for fate, found in shares.items()}
                yield _pair(comparison, place, name, by_name[name], by_name[first], confidence, known)


def _shares(comparison: Comparison, done: "pd.DataFrame") -> dict[str, dict[tuple[Any, ...], Difference]]:
    """The differences of shares to those of the first controller by fate, then by place and controller."""
    first, *others = (one.name for one in comparison.controllers)
    where = [VEHICLE, CONDITION, comparison.axis.name]
    found: dict[str, dict[tuple[Any, ...], Difference]] = {}
    for fate, has in FATES.items():
        judged = as_drawn(done, has)
        for name in others:
            both = judged[judged[CONTROLLER].isin((first, name))]
            rows = differences_of(both, [*where, CONTROLLER], TwoLaws(CONTROLLER, first, name))
            for row in rows.to_dict("records"):
                key = (*(row[each] for each in where), name)
                ends = {"value": row["difference"], "low": row["low"], "high": row["high"]}
                found.setdefault(fate, {})[key] = Difference(**ends)
    return found


def _pair(
    comparison: Comparison,
    place: dict[str, Value],
    name: str,
    it: "pd.DataFrame",
    other: "pd.DataFrame",
    confidence: float,
    shares: Mapping[str, Difference],
) -> Pair:
    known = it.index.intersection(other.index)
    mine, its = survived(it.loc[known]), survived(other.loc[known])
    both = known[mine & its]
    ahead = settled(it.loc[known]).sum() - settled(other.loc[known]).sum()
    ratios = [
        Median.of((it.loc[both, metric] / other.loc[both, metric]).to_numpy(float), confidence)
        for metric in (comparison.front.error, comparison.front.effort)
    ]
    return Pair(
        vehicle=str(place["vehicle"]),
        condition=str(place["condition"]),
        value=place["value"],
        controller=name,
        against=comparison.controllers[0].name,
        both=len(both),
        only_it=int((mine & ~its).sum()),
        only_other=int((~mine & its).sum()),
        neither=int((~mine & ~its).sum()),
        settles=int(ahead),
        error=ratios[0],
        effort=ratios[1],
        shares=shares,
    )
