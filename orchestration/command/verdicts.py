"""The answers of commands whose results are no objects with a `verdict`, a sentence each: what was found.

A sentence is the first line that a command prints, and `verdict` of its document.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from orchestration.foundation.basics.number_text import some

if TYPE_CHECKING:
    from orchestration.components.checks.doctor.report import DoctorReport
    from orchestration.experiments.comparison.cells import CellSummary


def of_cell(cell: CellSummary) -> str:
    """How many runs of a cell survive and settle."""
    return f"{cell.survives.count} of {cell.count} runs survive, {cell.settles.count} settle"


def of_agreements(far: Sequence[str], count: int, tolerance: float) -> str:
    """Whether other masters compute the same."""
    if far:
        return f"{len(far)} of {count} tools differ by more than {tolerance:g}: {some(far)}"
    tools = "1 tool agrees" if count == 1 else f"{count} tools agree"
    return f"{tools} with this project's master, within {tolerance:g}"


def of_problems(count: int, fmus: int) -> str:
    """How many problems FMUs have."""
    what = "the FMU" if fmus == 1 else f"{fmus} FMUs"
    return f"{count or 'no'} problem{'' if count == 1 else 's'} in {what}"


def of_doctor(report: DoctorReport) -> str:
    """How many FMUs load on this machine with all that they require."""
    count = len(report.verdicts)
    good = sum(each.good for each in report.verdicts)
    return (
        f"{good} of {count} FMU{'' if count == 1 else 's'} load{'s' if count == 1 else ''} here, with nothing missing"
    )
