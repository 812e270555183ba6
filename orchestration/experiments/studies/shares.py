"""Cells of a study: the share of its repetitions that are good, with its interval, and the median of a metric."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.statistics import wilson

if TYPE_CHECKING:
    import pandas as pd

GOOD = "good"
"""Metric that is drawn as a share"""


def cells_of(table: "pd.DataFrame", by: Sequence[str], metric: str = GOOD) -> "pd.DataFrame":
    """A row for each combination of the values of the axes `by` that has finished runs.

    Columns: those axes, `count` of runs, `good` of them, `share`, its Wilson interval at 95 % `low` and `high`, and
    `value`: the share, or the median of another `metric` over the good runs, nan if there are none. Raises `UsageError`
    if no criterion says what is good.
    """
    import pandas as pd

    done = table[table["status"] == "done"]
    if done["good"].isna().any():
        raise UsageError("expected criterion.good in the base, which says what a good run is")
    good = done["good"].astype(bool)
    counted = done.assign(count=1, good=good.astype(int), value=np.nan if metric == GOOD else done[metric].where(good))
    cells = counted.groupby([*by], sort=True).agg(
        count=("count", "sum"), good=("good", "sum"), value=("value", "median")
    )
    cells = cells.reset_index()
    cells["share"] = cells["good"] / cells["count"]
    if metric == GOOD:
        cells["value"] = cells["share"]
    intervals = [wilson(int(good), int(count)) for good, count in zip(cells["good"], cells["count"])]
    cells[["low", "high"]] = pd.DataFrame(intervals, index=cells.index, columns=["low", "high"], dtype=float)
    return cells[[*by, "count", "good", "share", "low", "high", "value"]]


def shares_of(table: "pd.DataFrame", by: Sequence[str]) -> "pd.DataFrame":
    """The cells without a metric: axes, `count`, `good`, `share`, `low`, `high`; raises `UsageError` likewise."""
    return cells_of(table, by).drop(columns="value")


def differ(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Whether the 95 % interval of the difference of the shares of two cells, by Newcombe's method 10, excludes 0.

    Runs with the same seed are taken as independent, which makes it wider than a paired one where they are alike.
    """
    difference = one["share"] - other["share"]
    below = math.hypot(one["share"] - one["low"], other["high"] - other["share"])
    above = math.hypot(one["high"] - one["share"], other["share"] - other["low"])
    return bool(difference - below > 0.0 or difference + above < 0.0)
