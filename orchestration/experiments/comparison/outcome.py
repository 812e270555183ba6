"""The conclusions of a comparison, as one value and as the files in its folder."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmu_kit.new_files import new_files, write_atomically
from orchestration.experiments.comparison import fronts
from orchestration.experiments.comparison.bandwidth import Bandwidths
from orchestration.experiments.comparison.cells import PEAK, CellSummary, Share, cell_summaries, survived
from orchestration.experiments.comparison.design import CONDITION, CONTROLLER, VEHICLE, Case, Comparison
from orchestration.experiments.comparison.fronts import Pair, pairs
from orchestration.experiments.comparison.limits import GridLimit, limits
from orchestration.experiments.studies.axes import Value
from orchestration.foundation.basics.documents import plain

if TYPE_CHECKING:
    import pandas as pd

CELLS, OUTCOME = "cells", "comparison.json"


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


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """All that is concluded from the runs of a comparison."""

    cells: list[CellSummary]
    limits: list[GridLimit]
    fronts: list[fronts.Point]
    pairs: list[Pair]
    at_equal_bandwidth: list[AtPhase]
    at_equal_torque: list[WithinTorque]


def outcome_of(comparison: Comparison, table: "pd.DataFrame", bandwidths: Bandwidths) -> Outcome:
    """The conclusions from the runs of a comparison and the bandwidths of its controllers."""
    cells = cell_summaries(comparison, table)
    return Outcome(
        cells=cells,
        limits=limits(comparison, table, bandwidths),
        fronts=[*fronts.points(comparison, table)],
        pairs=[*pairs(comparison, table)],
        at_equal_bandwidth=[*at_equal_bandwidth(cells, bandwidths)] if comparison.is_in_seconds else [],
        at_equal_torque=[*at_equal_torque(comparison, table)],
    )


def as_json(comparison: Comparison, outcome: Outcome, bandwidths: Bandwidths) -> dict[str, Any]:
    """The outcome in JSON types; values that are not finite or not known are null."""
    content = {
        "name": comparison.name,
        "axis": comparison.axis.name,
        "axes": [axis.name for axis in (comparison.axis, comparison.second) if axis is not None],
        "starts": len(comparison.initial_conditions),
        "bandwidths": [
            {"controller": controller, "vehicle": vehicle, "value": value, "bandwidth": bandwidth}
            for (controller, vehicle, value), bandwidth in bandwidths.items()
        ],
        **vars(outcome),
        "cells": [cell.as_json() for cell in outcome.cells],
    }
    document: dict[str, Any] = plain(content)
    return document


def write(comparison: Comparison, outcome: Outcome, bandwidths: Bandwidths, folder: Path) -> list[Path]:
    """Write the cells as Parquet and CSV, and everything as JSON; the paths."""
    import pandas as pd

    table = pd.DataFrame([cell.row() for cell in outcome.cells])
    medians = [name for cell in outcome.cells[:1] for name in cell.medians]
    table = table.astype({f"{name}{end}": float for name in medians for end in ("", ".low", ".high")})
    written = [folder / f"{CELLS}.parquet", folder / f"{CELLS}.csv", folder / OUTCOME]
    with new_files(folder) as new:
        table.to_parquet(new / written[0].name, index=False)
        table.to_csv(new / written[1].name, index=False)
        write_atomically(new / written[2].name, json.dumps(as_json(comparison, outcome, bandwidths), indent=2) + "\n")
    return written
