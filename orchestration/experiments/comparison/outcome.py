"""The conclusions of a comparison, as one value and as the files in its folder."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmu_kit.new_files import new_files, write_atomically
from orchestration.experiments.comparison import equal_terms, fronts
from orchestration.experiments.comparison.bandwidth import Bandwidths
from orchestration.experiments.comparison.cells import CellSummary, cell_summaries
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.limits import GridLimit, limits
from orchestration.experiments.comparison.pairs import Pair, pairs
from orchestration.foundation.basics.documents import plain

if TYPE_CHECKING:
    import pandas as pd

CELLS, OUTCOME = "cells", "comparison.json"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """All that is concluded from the runs of a comparison."""

    cells: list[CellSummary]
    limits: list[GridLimit]
    fronts: list[fronts.Point]
    pairs: list[Pair]
    at_equal_bandwidth: list[equal_terms.AtPhase]
    at_equal_torque: list[equal_terms.WithinTorque]


def outcome_of(comparison: Comparison, table: "pd.DataFrame", bandwidths: Bandwidths) -> Outcome:
    """The conclusions from the runs of a comparison and the bandwidths of its controllers."""
    cells = cell_summaries(comparison, table)
    return Outcome(
        cells=cells,
        limits=limits(comparison, table, bandwidths),
        fronts=[*fronts.points(comparison, table)],
        pairs=[*pairs(comparison, table)],
        at_equal_bandwidth=[*equal_terms.at_equal_bandwidth(cells, bandwidths)] if comparison.is_in_seconds else [],
        at_equal_torque=[*equal_terms.at_equal_torque(comparison, table)],
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
