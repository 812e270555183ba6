"""A comparison as tables of text."""

from collections.abc import Iterator
from itertools import groupby

from orchestration.experiments.comparison.cells import PEAK, VARIATION, CellSummary, Median, Share
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.limits import GridLimit
from orchestration.experiments.comparison.outcome import Outcome
from orchestration.foundation.basics.terminal import in_columns


def lines(comparison: Comparison, outcome: Outcome) -> Iterator[str]:
    """For each vehicle and condition, counts that survive and settle by value of the axis; then the limits."""
    names = [one.name for one in comparison.controllers]
    axis = comparison.axis.name
    for (vehicle, condition), group in groupby(outcome.cells, lambda cell: (cell.vehicle, cell.condition)):
        cells = [*group]
        yield (
            f"{vehicle}, {condition}: of {len(comparison.initial_conditions)} runs of "
            f"{comparison.study.origin.stop_time:g} s, those that survive / settle, "
            "and the share that survives with its 95 % interval"
        )
        rows = [[axis, *names]]
        for value in comparison.values:
            here = {cell.controller: cell for cell in cells if cell.value == value}
            rows.append([f"{value:g}", *(_counts(here[name]) if name in here else "-" for name in names)])
        yield from in_columns(rows)
        yield ""
    if outcome.limits:
        yield f"{axis} up to which half and nine in ten of the runs survive, and settle, with 95 % intervals"
        heads = ["controller", "vehicle", "condition", "runs", "half", "nine in ten", "rad/s"]
        yield from in_columns([heads, *_limits(outcome)])


def cell_lines(comparison: Comparison, cell: CellSummary) -> Iterator[str]:
    """One cell, a quantity per line."""
    place = f"{cell.controller}, {cell.vehicle}, {cell.condition}, {comparison.axis.name} {cell.value:g}"
    yield f"cell {cell.cell}: {place}"
    yield f"{'survives':<22}  {cell.survives.count} of {cell.count}: {share_text(cell.survives)}"
    late = f", {cell.diverged_late} of them in the second half of the horizon" if cell.diverged_late else ""
    yield f"{'diverged':<22}  {cell.diverged}{late}"
    yield f"{'settles':<22}  {cell.settles.count} of {cell.count}: {share_text(cell.settles)}"
    units = {PEAK: " N.m", VARIATION: " N.m", "settling_time": " s", "residual": " m"}
    for name, median in cell.medians.items():
        fate = "settle" if name == "settling_time" else "survive"
        yield f"{name:<22}  {median_text(median)}{units.get(name, '')}, median of those that {fate}"


def _limits(outcome: Outcome) -> Iterator[list[str]]:
    for (vehicle, condition, controller, fate), group in groupby(
        outcome.limits, lambda one: (one.vehicle, one.condition, one.controller, one.fate)
    ):
        half, most = group
        bandwidth = "-" if half.bandwidth is None else f"{half.bandwidth:.3g}"
        yield [controller, vehicle, condition, fate, _limit(half), _limit(most), bandwidth]


def _limit(limit: GridLimit) -> str:
    return f"{limit.value:.4g} [{limit.low:.4g}, {'...' if limit.high is None else f'{limit.high:.4g}'}]"


def _counts(cell: CellSummary) -> str:
    return f"{cell.survives.count} / {cell.settles.count}  {share_text(cell.survives)}"


def share_text(share: Share) -> str:
    """A share with its interval."""
    return f"{share.value:.3f} [{share.low:.3f}, {share.high:.3f}]"


def median_text(median: Median) -> str:
    """A median with its interval; a dash where no run has the value, no interval where too few have."""
    if median.value is None:
        return "-"
    if median.low is None and median.high is None:
        return f"{median.value:.4g}"
    low, high = ("?" if end is None else f"{end:.4g}" for end in (median.low, median.high))
    return f"{median.value:.4g} [{low}, {high}]"
