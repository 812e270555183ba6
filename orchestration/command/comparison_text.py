"""A comparison as tables of text."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from orchestration.comparison.cells import PEAK, VARIATION, Median, Result
from orchestration.comparison.design import Comparison
from orchestration.comparison.limits import Limit
from orchestration.comparison.outcome import Outcome


def lines(comparison: Comparison, outcome: Outcome) -> Iterator[str]:
    """For each vehicle and condition the share that flies by value of the axis; then how far each controller flies."""
    names = [one.name for one in comparison.controllers]
    axis = comparison.axis.name
    for (vehicle, condition), group in groupby(outcome.cells, lambda cell: (cell.vehicle, cell.condition)):
        cells = [*group]
        yield f"{vehicle}, {condition}: share of {len(comparison.drawn)} starts that flies, with its 95 % interval"
        rows = [[axis, *names]]
        for value in comparison.values:
            here = {cell.controller: cell for cell in cells if cell.value == value}
            rows.append([f"{value:g}", *(_share(here[name]) if name in here else "-" for name in names)])
        yield from _table(rows)
        yield ""
    if outcome.limits:
        yield f"up to which {axis} half of the starts, and nine in ten, fly, with 95 % intervals"
        yield from _table([["controller", "vehicle", "condition", "half", "nine in ten", "rad/s"], *_limits(outcome)])


def cell_lines(comparison: Comparison, cell: Result) -> Iterator[str]:
    """One cell, a quantity a line."""
    place = f"{cell.controller}, {cell.vehicle}, {cell.condition}, {comparison.axis.name} {cell.value:g}"
    yield f"cell {cell.cell}: {place}"
    yield f"{'flies':<22}  {cell.flown} of {cell.runs}: {_share(cell)}"
    units = {PEAK: " N.m", VARIATION: " N.m"}
    for name, median in cell.medians.items():
        yield f"{name:<22}  {_median(median)}{units.get(name, '')}, median of those that fly"


def _limits(outcome: Outcome) -> Iterator[list[str]]:
    for (vehicle, condition, controller), group in groupby(
        outcome.limits, lambda one: (one.vehicle, one.condition, one.controller)
    ):
        half, most = group
        bandwidth = "-" if half.bandwidth is None else f"{half.bandwidth:.3g}"
        yield [controller, vehicle, condition, _limit(half), _limit(most), bandwidth]


def _limit(limit: Limit) -> str:
    return f"{limit.value:.4g} [{limit.low:.4g}, {'...' if limit.high is None else f'{limit.high:.4g}'}]"


def _share(cell: Result) -> str:
    return f"{cell.share:.3f} [{cell.low:.3f}, {cell.high:.3f}]"


def _median(median: Median) -> str:
    if median.value is None:
        return "-"
    low, high = ("?" if end is None else f"{end:.4g}" for end in (median.low, median.high))
    return f"{median.value:.4g} [{low}, {high}]"


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        yield "  ".join(text.ljust(width) for text, width in zip(row, widths)).rstrip()
