"""Results of the findings as texts: counts, shares, limits, intervals."""

from typing import Any

import numpy as np
import pandas as pd

from docs import comparisons
from orchestration.experiments.comparison.survival import FATES, survived
from orchestration.foundation.basics.statistics import first_end, quantile, wilson


def fates(table: pd.DataFrame) -> str:
    """How many survive and settle, and from when on: whether another horizon would change the result."""
    by = {name: "/".join(map(str, counts.values())) for name, counts in comparisons.by_horizon(table).items()}
    alive = survived(table)
    return (
        f"{len(table)} flights, {alive.sum()} survive (diverged by {'/'.join(f'{t:g}' for t in comparisons.HORIZONS)} "
        f"s: {by['diverged_by']}), {FATES['settle'](table).sum()} settle (inside from then on: {by['inside_from']})"
    )


def up_to(table: pd.DataFrame, by: str, axis: str) -> list[str]:
    """For each value of one axis: the value of the other up to which flights survive and settle, and those beyond."""
    ends, lines = first_ends(table, by, axis), []
    for i, (value, group) in enumerate(table.sort_values(axis).groupby(by, sort=True)):
        texts = []
        for fate, has in FATES.items():
            end = ends[fate][i]
            again = group[has(group) & ~(group[axis] <= end)][axis]
            texts.append(f"{fate} up to {end:g}, again at {listed(again)}")
        lines.append(f"{by} {value:g}: {'; '.join(texts)}")
    return lines


def first_ends(table: pd.DataFrame, by: str, axis: str) -> dict[str, Any]:
    """For each fate and value of `by`, upward, the last value along `axis` before the first without it; nan: none."""
    groups = [group for _, group in table.sort_values(axis).groupby(by, sort=True)]
    return {
        fate: np.array([first_end(group[axis], has(group)) for group in groups], float) for fate, has in FATES.items()
    }


def changed_by_halving(table: pd.DataFrame, by: str, periods: tuple[float, float]) -> str:
    """The outcomes that change when the period that approximates continuous time is halved."""
    fine, coarse = (table[table["period"] == period].set_index(by) for period in periods)
    changed = [f"{value:g}" for value in fine.index if fine["outcome"][value] != coarse["outcome"][value]]
    settled = fine.index[FATES["settle"](fine)]
    return f"{all_in_ms(periods)}: outcomes differ at {by} {changed or 'none'}; settle at {listed(settled)}"


def share(has: pd.Series) -> str:
    """The number of runs that have a fate, and the share with its Wilson interval."""
    low, high = wilson(int(has.sum()), len(has))
    return f"{int(has.sum())} of {len(has)}, {has.mean():.0%} [{low:.0%}, {high:.0%}]"


def rank_correlation(x: pd.Series, y: pd.Series) -> str:
    """Spearman's rank correlation, with its 95 % interval by the bootstrap."""
    from scipy.stats import bootstrap, spearmanr

    def of(x: Any, y: Any) -> float:
        return float(spearmanr(x, y).statistic)

    found = bootstrap(
        (x.to_numpy(float), y.to_numpy(float)), of, paired=True, vectorized=False, n_resamples=1000,
        method="percentile", random_state=np.random.default_rng(1),
    ).confidence_interval  # fmt: skip
    return f"{of(x, y):.2f} [{found.low:.2f}, {found.high:.2f}]"


def median_with_interval(values: Any) -> str:
    """The median of some values, with its interval."""
    median, low, high, _ = quantile(values)
    return f"{median:.3g} [{low:.3g}, {high:.3g}]"


def listed(values: Any) -> str:
    """Values in order, or `none`."""
    return ", ".join(f"{value:g}" for value in sorted(values)) or "none"


def all_in_ms(values: Any) -> str:
    """Times [s] in milliseconds."""
    return ", ".join(in_ms(value) for value in values)


def in_ms(seconds: float | None) -> str:
    """A time in milliseconds, or `none`."""
    return "none" if seconds is None else f"{seconds * 1e3:.4g} ms"
