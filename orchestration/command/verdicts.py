"""The answers of commands, a sentence each: what was found, with units, and under which clock.

A sentence is the first line that a command prints, and `verdict` of its document.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from orchestration.foundation.basics.number_text import quantity, some

if TYPE_CHECKING:
    from orchestration.components.checks.doctor.report import DoctorReport
    from orchestration.experiments.comparison.cells import CellSummary
    from orchestration.experiments.comparison.design import Comparison
    from orchestration.experiments.comparison.outcome import Outcome
    from orchestration.experiments.tuning.tune import Tuned


def of_counts(outcomes: Mapping[str | None, int], total: int) -> str:
    """How the runs of a study ended, the most frequent outcome first; those without an outcome are not counted here."""
    counts = sorted(((count, name) for name, count in outcomes.items() if name), reverse=True)
    ended = ", ".join(f"{count} {name}" for count, name in counts)
    return f"{ended or 'no outcome'} of {total} runs"


def of_comparison(comparison: Comparison, outcome: Outcome) -> str:
    """Up to which value of the axis half of the runs survive, by controller, where first it was measured."""
    half = [one for one in outcome.limits if (one.fate, one.share) == ("survive", "half")]
    unit = "s" if comparison.is_in_seconds else None
    if not half:
        counts = [f"{cell.controller} {cell.survives.count} of {cell.count}" for cell in outcome.cells]
        return f"no limits, as cells are missing; survive: {some(counts)}" if counts else "no cell has runs"
    places = dict.fromkeys((one.vehicle, one.condition) for one in half)
    first = next(iter(places))
    reached = [
        f"{one.controller} to {quantity(one.value, unit)}" for one in half if (one.vehicle, one.condition) == first
    ]
    others = f" ({len(places) - 1} more below)" if len(places) > 1 else ""
    where = f"{first[0]}, {first[1]}"
    return f"half of the runs survive over {comparison.axis.name}: {some(reached)}; {where}{others}"


def of_cell(cell: CellSummary) -> str:
    """How many runs of a cell survive and settle."""
    return f"{cell.survives.count} of {cell.count} runs survive, {cell.settles.count} settle"


def of_tuning(tuned: Tuned) -> str:
    """The lowest cost for each period."""
    costs = [f"{quantity(period, 's')} cost {one.cost:.4g}, {one.judgement}" for period, one in tuned.best.items()]
    return f"best of {len(tuned.searches)} searches: {some(costs, '; ')}"


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
