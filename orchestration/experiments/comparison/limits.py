"""Limits of controllers: the largest value of the axis up to which runs survive, or settle, and its quantiles."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orchestration.experiments.comparison.bandwidth import Bandwidths
from orchestration.experiments.comparison.cells import FATES
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, START, VEHICLE, Case, Comparison
from orchestration.foundation.basics.statistics import Estimate, first_end, quantile

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.experiments.comparison.cells import Fate

SHARES = {"half": 0.5, "nine in ten": 0.9}
"""Shares of the initial conditions that survive, or settle, up to the limit"""


@dataclass(frozen=True, kw_only=True)
class GridLimit(Case):
    """The value of the axis up to which a share of the initial conditions survives, or settles, at all values below."""

    fate: str
    """survive, or settle"""
    share: str
    value: float
    """the last value of the axis up to which it does; 0 if not at the first"""
    low: float
    high: float | None
    """interval of two order statistics, at 95 % or more, extended to the next value; None: beyond the last value"""
    bandwidth: float | None
    """Bandwidth of the attitude loop at that value [rad/s]"""


def limits(comparison: Comparison, table: "pd.DataFrame", bandwidths: Bandwidths) -> list[GridLimit]:
    """The limits of each controller on each vehicle under each condition whose runs are all in the table."""
    listed = []
    done = table[table["status"] == "done"]
    for (vehicle, condition, controller), rows in done.groupby([VEHICLE, CONDITION, CONTROLLER], sort=False):
        if len(rows) < len(comparison.values) * len(comparison.initial_conditions):
            continue
        for fate, has in FATES.items():
            ends = first_ends(comparison, rows, has)
            for name, share in SHARES.items():
                value = _reached(ends, share)
                listed.append(
                    GridLimit(
                        vehicle=vehicle,
                        condition=condition,
                        controller=controller,
                        fate=fate,
                        share=name,
                        value=value,
                        **_interval(quantile(ends, 1.0 - share), comparison),
                        bandwidth=_at(bandwidths, controller, vehicle, value, comparison),
                    )
                )
    return listed


def first_ends(comparison: Comparison, rows: "pd.DataFrame", has: "Fate") -> Sequence[float]:
    """For each initial condition the last value of the axis before its first failure; 0: it fails at the first."""
    cube = rows.assign(has=has(rows)).pivot(index=START, columns=comparison.axis.name, values="has")
    values = [float(value) for value in cube.columns]
    return [first_end(values, row) or 0.0 for row in cube.to_numpy()]


def _at(bandwidths: Bandwidths, controller: str, vehicle: str, value: float, comparison: Comparison) -> float | None:
    """The bandwidth at the value of the axis nearest to a limit."""
    nearest = min(comparison.values, key=lambda one: abs(float(one) - value))
    return bandwidths.get((controller, vehicle, nearest))


def _reached(ends: Sequence[float], share: float) -> float:
    """The largest value that this share of the initial conditions reaches."""
    return sorted(ends, reverse=True)[math.ceil(share * len(ends) - 1e-9) - 1]


def _interval(estimate: Estimate, comparison: Comparison) -> dict[str, Any]:
    """The interval on the grid of the axis: a limit lies between the last good value and the next."""
    beyond = (float(value) for value in comparison.values if float(value) > estimate.high)
    return {"low": max(estimate.low, 0.0), "high": next(beyond, None)}
