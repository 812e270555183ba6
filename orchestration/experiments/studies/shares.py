"""Cells of a study: the share of its repetitions that are good, with its interval, and the median of a metric."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.statistics import pair_correlation, quantile, wilson

if TYPE_CHECKING:
    import pandas as pd

GOOD = "good"
"""Column of a table of runs: whether a run meets the criterion"""
BOOLEAN = (GOOD, "diverged")
"""Metrics of which cells have the share of the runs, of all, for which they are true; of others medians"""
WITH_VALUE = "with_value"
"""Column of medians: the number of good runs that have the metric, as those that settle have a settling time"""
RANDOM = "random"
"""Column of a table of runs: whether the repetitions of a run may differ from it by chance"""
PAIR = "paired by"
"""Column of a table of runs: what runs of two cells that belong together have in common, as the seed"""


def with_chance(table: "pd.DataFrame", study: Study) -> "pd.DataFrame":
    """The table of the runs of `study` with the columns `RANDOM` and `PAIR`.

    `RANDOM` is false in a cell whose system does not depend on the seed, if only the seed is repeated.
    """
    starts = study.files().start_values if study.needs_start_values else {}
    seeds_alone = all(axis.targets == ("seed",) for axis in study.axes if axis.name == study.repeat)

    def is_random(cell: "pd.Series[Any]") -> bool:
        return not seeds_alone or study.system(int(cell.iloc[0]), starts).depends_on_seed

    cells = table.groupby([axis.name for axis in study.cell_axes], dropna=False)["design_index"]
    repeated = 0 if study.repeat is None else table[study.repeat]
    return table.assign(**{RANDOM: cells.transform(is_random).astype(bool), PAIR: repeated})


def judged_by(table: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """The table in which those runs are good for which a metric of `BOOLEAN` is true, for its shares."""
    return table.assign(**{GOOD: table[metric]})


def shares_of(table: "pd.DataFrame", by: Sequence[str]) -> "pd.DataFrame":
    """A row for each combination of the values of the axes `by` that has finished runs, in their order.

    The table is one `with_chance`. Columns: those axes, `count` of runs, `good` of them, `share`, and its Wilson
    interval at 95 % `low` and `high`. A cell where nothing is random is one run, whatever its seeds, and its interval
    is nan. Raises `UsageError` if no criterion says what is good.
    """
    import pandas as pd

    done = table[table["status"] == "done"]
    if done["good"].isna().any():
        raise UsageError("expected criterion.good in the base, which says what a good run is")
    counted = done.assign(count=1, good=done["good"].astype(int))
    cells = counted.groupby([*by], sort=False).agg(count=("count", "sum"), good=("good", "sum"), random=(RANDOM, "any"))
    cells = cells.reset_index()
    cells["share"] = cells["good"] / cells["count"]
    intervals = [
        wilson(int(good), int(count)) if random else (np.nan, np.nan)
        for good, count, random in zip(cells["good"], cells["count"], cells["random"])
    ]
    alike = ~cells["random"] & cells["share"].isin((0.0, 1.0))  # one flight, whatever its seeds
    cells.loc[alike, "good"], cells.loc[alike, "count"] = cells.loc[alike, "share"].astype(int), 1
    cells[["low", "high"]] = pd.DataFrame(intervals, index=cells.index, columns=["low", "high"], dtype=float)
    return cells[[*by, "count", "good", "share", "low", "high"]]


def interval_of_difference(
    one: Mapping[str, float], other: Mapping[str, float], *, correlation: float = 0.0
) -> tuple[float, float]:
    """The 95 % interval of the share of one cell minus that of another, by Newcombe's methods 10.

    `correlation` is that of pairs of runs, such as those with the same seed; 0: independent runs. A share without an
    interval is known exactly; of two such ones the difference has none either, but nan.
    """
    difference = one["share"] - other["share"]
    if math.isnan(one["low"]) and math.isnan(other["low"]):
        return math.nan, math.nan
    one, other = (
        {**each, "low": each["share"], "high": each["share"]} if math.isnan(each["low"]) else each
        for each in (one, other)
    )
    below = _apart(one["share"] - one["low"], other["high"] - other["share"], correlation)
    above = _apart(one["high"] - one["share"], other["share"] - other["low"], correlation)
    return difference - below, difference + above


def _apart(one: float, other: float, correlation: float) -> float:
    """The third side of a triangle with these two, whose angle has that cosine."""
    return math.sqrt(one * one - 2.0 * correlation * one * other + other * other)


class TwoLaws(NamedTuple):
    """The two values of an axis of names, in the order of the runs."""

    axis: str
    first: str
    second: str


def laws_of(table: "pd.DataFrame", by: Sequence[str]) -> TwoLaws | None:
    """The laws of a table, if just one of the axes `by` has names, and these are two."""
    axes = [name for name in by if table[name].map(type).eq(str).all()]
    found = [TwoLaws(name, *table[name].unique()) for name in axes if table[name].nunique() == 2]
    return found[0] if len(found) == 1 else None


def differences_of(table: "pd.DataFrame", by: Sequence[str], laws: TwoLaws) -> "pd.DataFrame":
    """The second law minus the first, by the values of the other axes: `difference`, `low` and `high`.

    The interval is of pairs: of runs with the same value of the axis that repeats, as the same seed.
    """
    import pandas as pd

    axis, first, second = laws
    cells, others = shares_of(table, by), [name for name in by if name != axis]
    both = cells[cells[axis] == second].merge(cells[cells[axis] == first], on=others, suffixes=("", ".other"))
    correlations, rows = _correlations(table, others, laws), []
    for row in both.to_dict("records"):
        one, other = ({name: row[name + end] for name in ("share", "low", "high")} for end in ("", ".other"))
        correlation = correlations.get(tuple(row[name] for name in others), 0.0)
        low, high = interval_of_difference(one, other, correlation=correlation)
        key = {name: row[name] for name in others}
        rows.append({**key, "difference": one["share"] - other["share"], "low": low, "high": high})
    return pd.DataFrame(rows, columns=[*others, "difference", "low", "high"])


def medians_of(table: "pd.DataFrame", by: Sequence[str], metric: str) -> "pd.DataFrame":
    """The median of a metric over the good runs of each cell.

    Columns: the axes `by`, `good`, the number of those runs, `with_value`, of those that have the metric, `median`, and
    the interval of order statistics at 95 %, `low` and `high`, nan where there are too few runs, and where nothing is
    random, which is one run.
    """
    import pandas as pd

    done = table[table["status"] == "done"]
    rows = []
    for key, cell in done.groupby([*by], sort=False):
        values, is_random = cell.loc[cell["good"].fillna(False).astype(bool), metric], bool(cell[RANDOM].any())
        good = len(values) if is_random else min(1, len(values))
        rows.append((*key, good, *_median(values.dropna(), is_random=is_random)))
    return pd.DataFrame(rows, columns=[*by, "good", WITH_VALUE, "median", "low", "high"])


def without_value(medians: "pd.DataFrame") -> str:
    """What a caption says of good runs that lack the metric, with their number; empty without such runs."""
    missing = int((medians["good"] - medians[WITH_VALUE]).sum())
    return f"{missing} good run{'s' if missing > 1 else ''} without a value left out" if missing else ""


def _median(values: "pd.Series", *, is_random: bool) -> tuple[int, float, float, float]:
    """The number of values, their median, and the ends of its interval at 95 %."""
    if not len(values):
        return 0, math.nan, math.nan, math.nan
    found = quantile(values.to_numpy(float))
    low, high = (end if is_random and math.isfinite(end) else math.nan for end in (found.low, found.high))
    return len(values) if is_random else 1, found.value, low, high


def differences_of_medians(table: "pd.DataFrame", by: Sequence[str], laws: TwoLaws, metric: str) -> "pd.DataFrame":
    """The median of a metric of the second law minus that of the first, over the pairs in which both are good.

    Columns: the other axes, `pairs`, the number of those in which both have the metric, `difference`, and the interval
    of order statistics at 95 %, `low` and `high`, nan where there are too few pairs, and where nothing is random, which
    is one pair.
    """
    import pandas as pd

    others = [name for name in by if name != laws.axis]
    good = table[(table["status"] == "done") & table["good"].fillna(False).astype(bool) & table[metric].notna()]
    columns, rows = [*others, PAIR, metric, RANDOM], []
    one, other = (good.loc[good[laws.axis] == law, columns] for law in (laws.second, laws.first))
    for key, both in one.merge(other, on=[*others, PAIR], suffixes=("", ".other")).groupby(others, sort=False):
        is_random = bool((both[RANDOM] | both[f"{RANDOM}.other"]).any())
        rows.append((*key, *_median(both[metric] - both[f"{metric}.other"], is_random=is_random)))
    return pd.DataFrame(rows, columns=[*others, "pairs", "difference", "low", "high"])


def _correlations(table: "pd.DataFrame", others: list[str], laws: TwoLaws) -> dict[tuple[Any, ...], float]:
    """The correlation of the shares of both laws, by the values of the other axes.

    It is that of the pairs, less where some runs have no partner, as theirs are independent.
    """
    done = table[table["status"] == "done"]
    counted = done.assign(count=done.groupby([laws.axis, *others])["good"].transform("size"))
    columns = [*others, PAIR, "good", "count"]
    one, other = (counted.loc[done[laws.axis] == law, columns] for law in (laws.second, laws.first))
    found = {}
    for key, rows in one.merge(other, on=[*others, PAIR], suffixes=("", ".other")).groupby(others):
        good, its = rows["good"].astype(bool), rows["good.other"].astype(bool)
        counts = (int(each.sum()) for each in (good & its, good & ~its, ~good & its, ~good & ~its))
        paired = len(rows) / math.sqrt(rows["count"].iloc[0] * rows["count.other"].iloc[0])
        found[key] = pair_correlation(*counts) * paired
    return found
