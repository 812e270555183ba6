"""How far each controller goes: the value of the axis up to which a start survives, or settles, and its quantiles."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orchestration.basics.statistics import Estimate, first_end, quantile
from orchestration.comparison.bandwidth import Bandwidths
from orchestration.comparison.design import CONDITION, CONTROLLER, START, VEHICLE, Comparison
from orchestration.comparison.fates import FATES

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.comparison.fates import Fate

SHARES = {"half": 0.5, "nine in ten": 0.9}
"""Of the starts that survive, or settle, up to the limit"""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Up to which value of the axis so many of the starts survive, or settle, at every value below too."""

    vehicle: str
    condition: str
    controller: str
    fate: str
    """survive, or settle"""
    share: str
    value: float
    """the last value of the axis up to which they do; 0 if not at the first"""
    low: float
    high: float | None
    """the interval of two order statistics, at 95 % or more, up to the value after it; None: beyond the last one"""
    bandwidth: float | None
    """of the attitude loop at that value [rad/s]"""


def limits(comparison: Comparison, table: "pd.DataFrame", bandwidths: Bandwidths) -> list[Limit]:
    """Of each controller on each vehicle under each condition, all of whose runs are in the table."""
    found = []
    done = table[table["status"] == "done"]
    for (vehicle, condition, controller), rows in done.groupby([VEHICLE, CONDITION, CONTROLLER], sort=False):
        if len(rows) < len(comparison.values) * len(comparison.drawn):
            continue
        for fate, has in FATES.items():
            ends = first_ends(comparison, rows, has)
            for name, share in SHARES.items():
                value = _reached(ends, share)
                found.append(
                    Limit(
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
    return found


def first_ends(comparison: Comparison, rows: "pd.DataFrame", has: "Fate") -> Sequence[float]:
    """For each start the last value before the first at which it has not that fate; 0 if it never has."""
    cube = rows.assign(has=has(rows)).pivot(index=START, columns=comparison.axis.name, values="has")
    values = [float(value) for value in cube.columns]
    return [first_end(values, row) or 0.0 for row in cube.to_numpy()]


def _at(bandwidths: Bandwidths, controller: str, vehicle: str, value: float, comparison: Comparison) -> float | None:
    """The bandwidth at the value of the axis next to a limit."""
    nearest = min(comparison.values, key=lambda one: abs(float(one) - value))
    return bandwidths.get((controller, vehicle, nearest))


def _reached(ends: Sequence[float], share: float) -> float:
    """The largest end that such a share of the starts reaches."""
    return sorted(ends, reverse=True)[math.ceil(share * len(ends) - 1e-9) - 1]


def _interval(estimate: Estimate, comparison: Comparison) -> dict[str, Any]:
    """On the grid of the axis: what flies at one value and not at the next has its limit between them."""
    beyond = (float(value) for value in comparison.values if float(value) > estimate.high)
    return {"low": max(estimate.low, 0.0), "high": next(beyond, None)}
