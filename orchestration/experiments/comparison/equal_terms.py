"""Controllers compared at equal bandwidth and at equal peak torque, from existing runs and cells."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from orchestration.experiments.comparison.bandwidth import Bandwidths
from orchestration.experiments.comparison.cells import PEAK, CellSummary, Share
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, VEHICLE, Case, Comparison
from orchestration.experiments.comparison.survival import survived
from orchestration.experiments.studies.axes import Value

if TYPE_CHECKING:
    import pandas as pd

PHASES = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0)
"""Values of the axis [s] times the bandwidth of the attitude loop [rad/s] at which controllers are compared"""
BUDGETS = 8
"""Number of peak torques at which controllers are compared"""


@dataclass(frozen=True, kw_only=True)
class AtPhase(Case):
    """The shares that survive and settle at a fixed ratio of the axis to the time scale of the attitude loop."""

    phase: float
    """axis times bandwidth [rad]"""
    survives: float
    settles: float
    """interpolated between the two neighbouring cells over the logarithm of the axis"""


@dataclass(frozen=True, kw_only=True)
class WithinTorque(Case):
    """The share of the initial conditions that survive within a peak torque."""

    value: Value
    torque: float
    """Torque [N.m]"""
    share: float
    low: float
    high: float
    """Wilson interval at 95 %"""


def at_equal_bandwidth(cells: Sequence[CellSummary], bandwidths: Bandwidths) -> Iterator[AtPhase]:
    """For an axis in seconds: each controller at the same values of axis times bandwidth."""
    groups: dict[tuple[str, str, str], list[CellSummary]] = {}
    for cell in cells:
        groups.setdefault((cell.vehicle, cell.condition, cell.controller), []).append(cell)
    for (vehicle, condition, controller), group in groups.items():
        phases = [(cell, bandwidths[controller, vehicle, cell.value] * float(cell.value)) for cell in group]
        known = [cell for cell, phase in phases if 0.0 < phase < math.inf]
        at = np.log([phase for _, phase in phases if 0.0 < phase < math.inf])
        if not (np.diff(at) > 0.0).all():  # tuned at each value: its bandwidth falls faster than the axis grows
            continue
        for phase in PHASES:
            if len(at) and at[0] <= math.log(phase) <= at[-1]:
                survives, settles = (
                    float(np.interp(math.log(phase), at, [share.value for share in shares]))
                    for shares in ([cell.survives for cell in known], [cell.settles for cell in known])
                )
                yield AtPhase(
                    vehicle=vehicle, condition=condition, controller=controller,
                    phase=phase, survives=survives, settles=settles,
                )  # fmt: skip


def at_equal_torque(comparison: Comparison, table: "pd.DataFrame") -> Iterator[WithinTorque]:
    """Each cell at the same peak torques, quantiles of those of all runs of its vehicle under its condition."""
    done = table[table["status"] == "done"]
    for (vehicle, condition), group in done.groupby([VEHICLE, CONDITION], sort=False):
        peaks = group.loc[survived(group), PEAK].dropna().to_numpy(float)
        if not len(peaks):
            continue
        budgets = [float(f"{q:.2g}") for q in np.quantile(peaks, np.linspace(0.1, 1.0, BUDGETS))]
        for (controller, value), rows in group.groupby([CONTROLLER, comparison.axis.name], sort=False):
            within = rows.loc[survived(rows), PEAK].to_numpy(float)
            for torque in dict.fromkeys(budgets):
                count = int((within <= torque).sum())
                share = Share.of(count, len(rows))
                yield WithinTorque(
                    vehicle=vehicle, condition=condition, controller=controller, value=value,
                    torque=torque, share=share.value, low=share.low, high=share.high,
                )  # fmt: skip
