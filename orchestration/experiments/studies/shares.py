"""Cells of a study: the share of its repetitions that are good, and the median or mean of a metric, with intervals."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orchestration.experiments.studies.infinite_means import InfiniteMeans
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.statistics import mean, pair_correlation, quantile, wilson
from orchestration.theory.exact.mean_square import NO_EXPECTATION, NO_VARIANCE, NOT_EXAMINED, VARIANCE

if TYPE_CHECKING:
    import pandas as pd

GOOD = "good"
"""Column of a table of runs: whether a run meets the criterion"""
BOOLEAN = (GOOD, "diverged")
"""Metrics of which cells have the share of the runs, of all, for which they are true; of others medians"""
WITH_VALUE = "with_value"
"""Column of averages: the number of good runs that have the metric, as those that settle have a settling time"""
MEDIAN, MEAN = "median", "mean"
"""Averages of a metric, and their columns: the median over the good runs, the mean over all that have the metric"""
INTERVALS = {MEDIAN: "of order statistics", MEAN: "by Student's t"}
"""Kind of their intervals at 95 %"""
PLACE = "place"
"""Column of one value, by which runs over laws alone are one group"""
RANDOM = "random"
"""Column of a table of runs: whether the repetitions of a run may differ from it by chance"""
REMARKS = "remarks"
"""Column of a table of runs: remarks on means of metrics, by metric"""
REMARK = "remark"
"""Column of means: whether they have no finite expectation or variance, and hence no interval, or whether it is not
known; else empty"""
WITHOUT_INTERVAL = (NO_EXPECTATION, NO_VARIANCE)
"""Remarks on means that have no interval, the graver first"""
PAIR = "paired by"
"""Column of a table of runs: what runs of two cells that belong together have in common, as the seed"""


class TwoLaws(NamedTuple):
    """The two values of an axis of names, in the order of the runs."""

    axis: str
    first: str
    second: str


def with_chance(table: "pd.DataFrame", study: Study, infinite: InfiniteMeans | None = None) -> "pd.DataFrame":
    """The table of the runs of `study` with the columns `RANDOM`, `PAIR` and `REMARKS`, which are those of `infinite`.

    `RANDOM` is false in a cell whose system does not depend on the seed, if only the seed is repeated.
    """
    starts = study.files().start_values if study.needs_start_values else {}
    seeds_alone = all(axis.targets == ("seed",) for axis in study.axes if axis.name == study.repeat)

    def is_random(cell: "pd.Series[Any]") -> bool:
        return not seeds_alone or study.system(int(cell.iloc[0]), starts).depends_on_seed

    cells = table.groupby([axis.name for axis in study.cell_axes], dropna=False)["design_index"]
    repeated = 0 if study.repeat is None else table[study.repeat]
    remarks = [{}] * len(table) if infinite is None else infinite.column(table)
    return table.assign(**{RANDOM: cells.transform(is_random).astype(bool), PAIR: repeated, REMARKS: remarks})


def judged_by(table: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """The table in which those runs are good for which a metric of `BOOLEAN` is true, for its shares.

    Of another metric, for its mean, those that have it.
    """
    return table.assign(**{GOOD: table[metric] if metric in BOOLEAN else table[metric].notna()})


def expect_mean(metric: str | None, repeat: str | None) -> None:
    """Raise `UsageError` where a metric has no mean in cells."""
    if metric in (None, "outcome", *BOOLEAN) or repeat is None:
        raise UsageError(
            "mean: expected a metric that is a number, such as position_rmse, of a study with design.repeat; "
            "good and diverged have shares"
        )


def cells_of(table: "pd.DataFrame", by: Sequence[str], metric: str, average: str = MEDIAN) -> "pd.DataFrame":
    """The share, of a metric of `BOOLEAN`, else the average in each cell, of a table that is `with_chance`."""
    if metric in BOOLEAN:
        return shares_of(judged_by(table, metric), by).rename(columns={GOOD: metric})
    return averages_of(table, by, metric, average)


def differences_in(
    table: "pd.DataFrame", by: Sequence[str], laws: TwoLaws, metric: str, average: str = MEDIAN
) -> "pd.DataFrame":
    """Likewise of the second law minus the first."""
    if [*by] == [laws.axis]:
        every = differences_in(table.assign(**{PLACE: 0}), [*by, PLACE], laws, metric, average)
        return every.drop(columns=PLACE)
    if metric in BOOLEAN:
        return differences_of(judged_by(table, metric), by, laws)
    return differences_of_averages(table, by, laws, metric, average)


def shares_of(table: "pd.DataFrame", by: Sequence[str]) -> "pd.DataFrame":
    """A row for each combination of the values of the axes `by` that has finished runs, in their order.

    The table is one `with_chance`. Columns: those axes, `count` of runs, `good` of them, `share`, and its Wilson
    interval at 95 % `low` and `high`. A cell where nothing is random is one run, whatever its seeds, and its interval
    is nan. Raises `UsageError` if no criterion says what is good.
    """
    import pandas as pd

    done = _judged(table)
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


def _judged(table: "pd.DataFrame") -> "pd.DataFrame":
    """The finished runs; raises `UsageError` if no criterion says which are good."""
    done = table[table["status"] == "done"]
    if done[GOOD].isna().any():
        raise UsageError("expected criterion.good in the base, which says what a good run is; means need none (--mean)")
    return done


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


def averages_of(table: "pd.DataFrame", by: Sequence[str], metric: str, average: str = MEDIAN) -> "pd.DataFrame":
    """The median of a metric over the good runs of each cell, or its mean over all runs that have it.

    Columns: the axes `by`, `count` of runs, also failed ones, `diverged` and `good` of them (for the mean those that
    have it), `with_value`, the number of those averaged, `median` or `mean`, and the ends of its interval at 95 %, of
    order statistics or Student's t, nan where there are too few runs, and where nothing is random, which is one run;
    of means `remark`, which says where they have no finite expectation or variance, and no interval, and where this is
    not known.
    """
    import pandas as pd

    judged = table if average == MEDIAN else judged_by(table, metric)
    good = _judged(judged)[GOOD].astype(bool)
    table = table.assign(averaged=good.reindex(table.index, fill_value=False))
    rows = []
    for key, cell in table.groupby([*by], sort=False):
        values, is_random = cell.loc[cell["averaged"], metric], bool(cell[RANDOM].any())
        counts = [len(cell), int(cell["diverged"].fillna(False).sum()), len(values)]
        counts = counts if is_random else [min(1, each) for each in counts]
        rows.append((*key, *counts, *_average(values.dropna(), average, is_random=is_random), _remark(cell, metric)))
    columns = [*by, "count", "diverged", GOOD, WITH_VALUE, average, "low", "high", REMARK]
    return _with_remarks(pd.DataFrame(rows, columns=columns), average)


def left_out(averages: "pd.DataFrame", word: str) -> str:
    """What a caption says of the runs that are not averaged, with their number; empty without such runs.

    `word` is the name of a good run, of which medians are.
    """
    count, missing, diverged = (
        int(each.sum()) for each in (averages["count"], averages["count"] - averages[WITH_VALUE], averages["diverged"])
    )
    why = f"not {word}, or without a value" if MEDIAN in averages else "without a value"
    which = f", {'all' if diverged == missing else diverged} of them diverged" if diverged else ""
    return f"{missing} of {count} runs left out ({why}){which}" if missing else ""


def remarked(averages: "pd.DataFrame", sign: str = "") -> str:
    """What a caption says of means without an interval, and of those of which too little is known; empty without such.

    Those without a finite expectation say so themselves. `sign` marks means that are not examined.
    """
    remarks = averages[REMARK] if REMARK in averages else averages["count"].iloc[:0].astype(str)
    wide, unknown = (int(remarks.eq(remark).sum()) for remark in (NO_VARIANCE, VARIANCE))
    said = [f"{cells_in_words(wide)} without an interval: {NO_VARIANCE}"] if wide else []
    said += [f"of {cells_in_words(unknown)} the {VARIANCE}"] if unknown else []
    if reasons := sorted({*remarks[is_unknown(remarks)]}):
        said.append(f"{sign}{reasons[0]}" + (" and other reasons" if reasons[1:] else ""))
    return "; ".join(said)


def cells_in_words(number: int) -> str:
    """A number of cells."""
    return f"{number} cell{'s' if number != 1 else ''}"


def is_unknown(remarks: "pd.Series") -> "pd.Series":
    """Whether remarks say that it is not known whether a mean is finite."""
    return remarks.astype(str).str.startswith(NOT_EXAMINED)


def _average(values: "pd.Series", average: str, *, is_random: bool) -> tuple[int, float, float, float]:
    """The number of values, their median or mean, and the ends of its interval at 95 %."""
    if not len(values):
        return 0, math.nan, math.nan, math.nan
    found = (quantile if average == MEDIAN else mean)(values.to_numpy(float))
    low, high = (end if is_random and math.isfinite(end) else math.nan for end in (found.low, found.high))
    return len(values) if is_random else 1, found.value, low, high


def differences_of_averages(
    table: "pd.DataFrame", by: Sequence[str], laws: TwoLaws, metric: str, average: str = MEDIAN
) -> "pd.DataFrame":
    """The median or mean of a metric of the second law minus that of the first, over pairs, as with the same seed.

    Pairs are those in which both are good, for the mean those in which both have the metric. Columns: the other axes,
    `pairs`, their number, `difference`, and its interval at 95 %, `low` and `high`, nan where there are too few pairs,
    and where nothing is random, which is one pair; of means `remark`, that of one of both.
    """
    import pandas as pd

    others = [name for name in by if name != laws.axis]
    judged = table if average == MEDIAN else judged_by(table, metric)
    good = _judged(judged).query(GOOD).dropna(subset=[metric])
    columns, rows = [*others, PAIR, metric, RANDOM, REMARKS], []
    one, other = (good.loc[good[laws.axis] == law, columns] for law in (laws.second, laws.first))
    for key, both in one.merge(other, on=[*others, PAIR], suffixes=("", ".other")).groupby(others, sort=False):
        is_random = bool((both[RANDOM] | both[f"{RANDOM}.other"]).any())
        remark = _remark(both, metric, REMARKS, f"{REMARKS}.other")
        rows.append((*key, *_average(both[metric] - both[f"{metric}.other"], average, is_random=is_random), remark))
    return _with_remarks(pd.DataFrame(rows, columns=[*others, "pairs", "difference", "low", "high", REMARK]), average)


def _remark(cell: "pd.DataFrame", metric: str, *columns: str) -> str:
    """The gravest remark on a metric of the runs of a cell."""
    found: set[str] = {each.get(metric, "") for column in columns or (REMARKS,) for each in cell[column]}
    gravest = [*WITHOUT_INTERVAL, *sorted(found - {*WITHOUT_INTERVAL, ""}), ""]
    return next((remark for remark in gravest if remark in found), "")


def _with_remarks(cells: "pd.DataFrame", average: str) -> "pd.DataFrame":
    """The cells without intervals where a remark says so; medians always have one, and no remarks."""
    if average == MEDIAN:
        return cells.drop(columns=REMARK)
    cells.loc[cells[REMARK].isin(WITHOUT_INTERVAL), ["low", "high"]] = math.nan
    return cells


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
