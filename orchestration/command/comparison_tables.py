"""A comparison as tables of text, and its cells as a table for a paper, with intervals at 95 %."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from orchestration.command.printed_tables import PrintedTable, decimals_of, to_digits, with_interval
from orchestration.experiments.comparison.cells import FATES, PEAK, SETTLING, VARIATION, CellSummary, Median, Share
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.fronts import Difference, Pair
from orchestration.experiments.comparison.limits import GridLimit
from orchestration.experiments.comparison.outcome import Outcome
from orchestration.experiments.studies.axes import quantity_of
from orchestration.foundation.basics.terminal import in_columns
from orchestration.systems.system.requirements import is_number


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


def median_text(median: Median, digits: int = 4) -> str:
    """A median with its interval; a dash where no run has the value, no interval where too few have."""
    return to_digits(median.value, median.low, median.high, digits)


_UNITS = {"settling_time": ("s", 1.0), "residual": ("mm", 1e3)}
"""Units of medians, and the factors by which those in the store are multiplied"""


def comparison_table(comparison: Comparison, outcome: Outcome) -> PrintedTable:
    """A row for each cell: shares that survive and settle, median settling time and residual, with their intervals.

    Columns that are the same in all cells are left out. Shares of other controllers are followed by their differences
    to those of the first. The numbers are those of `cells.csv`, with these differences.
    """
    several, first = len(comparison.controllers) > 1, comparison.controllers[0].name
    by = f"; minus {first}: of pairs from the same one, with 95 % intervals by Newcombe's method" if several else ""
    pairs = {(one.vehicle, one.condition, one.controller, one.value): one for one in outcome.pairs}
    found = [(cell, pairs.get((cell.vehicle, cell.condition, cell.controller, cell.value))) for cell in outcome.cells]
    columns, none = _columns(comparison, found), dict.fromkeys(outcome.pairs[0].differences() if outcome.pairs else ())
    return PrintedTable(
        caption=(
            f"Shares of {len(comparison.initial_conditions)} initial conditions that survive and settle, with 95 % "
            f"Wilson intervals{by}; medians are of those alone that settle (settling time) or survive (residual), with "
            "intervals of order statistics at 95 % and, in parentheses, their number"
        ),
        heads=[*columns],
        rows=[*zip(*columns.values())],
        numbers=[cell.row() | (pair.differences() if pair else none) for cell, pair in found],
    )


def _columns(comparison: Comparison, found: Sequence[tuple[CellSummary, Pair | None]]) -> dict[str, list[str]]:
    if comparison.second is not None:  # as the columns are: all of one controller together
        names, conditions = ([one.name for one in ones] for ones in (comparison.controllers, comparison.conditions))
        of_file = [*dict.fromkeys(comparison.on_second[name].condition for name in conditions)]
        found = sorted(
            found,
            key=lambda each: (
                [one.name for one in comparison.vehicles].index(each[0].vehicle),
                of_file.index(comparison.on_second[each[0].condition].condition),
                names.index(each[0].controller),
                each[0].value,
                conditions.index(each[0].condition),
            ),
        )
    cells = [cell for cell, _ in found]
    columns = {key: [getattr(cell, key) for cell in cells] for key in ("vehicle", "condition", "controller")}
    if comparison.second is not None:
        columns["condition"] = [comparison.on_second[cell.condition].condition for cell in cells]
    columns = {key: values for key, values in columns.items() if len({*values}) > 1}
    for axis in filter(None, (comparison.axis, comparison.second)):
        quantity, values = quantity_of(axis, {}), [cell.values[axis.name] for cell in cells]
        columns[quantity.title] = [f"{quantity.factor * v:g}" if is_number(v) else str(v) for v in values]
    for fate in FATES:
        columns[f"{fate}s"] = [_share(getattr(cell, f"{fate}s"), cell.count) for cell in cells]
        if any(pair for _, pair in found):
            minus = f"minus {comparison.controllers[0].name}"
            columns[f"{fate}s, {minus}"] = [_share(pair.shares[fate], c.count) if pair else "" for c, pair in found]
    columns |= {
        f"median {name.replace('_', ' ')} [{unit}]": [
            f"{_median(c.medians[name], factor)} ({(c.settles if name == SETTLING else c.survives).count})"
            for c in cells
        ]
        for name, (unit, factor) in _UNITS.items()
    }
    return columns


def _share(share: Share | Difference, count: int) -> str:
    return with_interval(share.value, share.low, share.high, decimals_of(count))


def _median(median: Median, factor: float) -> str:
    ends = (None if end is None else factor * end for end in (median.value, median.low, median.high))
    return median_text(Median(**dict(zip(("value", "low", "high"), ends))), digits=3)
