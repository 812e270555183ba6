"""The answers of commands whose results are no objects with a `verdict`, a sentence each: what was found.

A sentence is the first line that a command prints, and `verdict` of its document.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from orchestration.foundation.basics.unit_algebra import some

if TYPE_CHECKING:
    from orchestration.components.checks.doctor.report import DoctorReport
    from orchestration.components.checks.doctor.verdict import UnexaminedFmu, Verdict
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
    """How many FMUs load on this machine with all that they require, and what hinders the others."""
    count, bad = len(report.verdicts), [each for each in report.verdicts if not each.good]
    parts = [some(map(_hindrance, bad), "; ")] if bad else []
    if len(bad) < count or not bad:
        many = " loads" if count == 1 else "s load"
        parts.insert(0, f"{count - len(bad)} of {count} FMU{many} here, with nothing missing")
    return "; ".join(parts)


def _hindrance(bad: Verdict | UnexaminedFmu) -> str:
    """Why an FMU does not load here, or what is missing although it does."""
    from orchestration.components.checks.doctor.verdict import UnexaminedFmu

    path = bad.path if isinstance(bad, UnexaminedFmu) else bad.fmu.path
    if isinstance(bad, UnexaminedFmu) or bad.failure is not None:
        return f"{path.name} does not load: {bad.failure}"
    missing = dict.fromkeys((*bad.problems, *bad.python_host.needs, *bad.other_host.needs))
    return f"{path.name} loads, but something is missing: {some(missing)}"
