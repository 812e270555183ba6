"""The cells of a comparison as a table of CSV, Markdown or LaTeX, with intervals at 95 %."""

import csv
import io
from collections.abc import Iterator, Sequence

from orchestration.command.comparison_text import median_text, share_text
from orchestration.experiments.comparison.cells import CellSummary
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.outcome import Outcome
from orchestration.experiments.studies.axis_labels import quantity_of
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.requirements import is_number

FORMATS = ("csv", "markdown", "latex")
_UNITS = {"settling_time": "s", "residual": "m"}


def expect_format(table: str) -> None:
    """Raise `UsageError` for an unknown format."""
    if table not in FORMATS:
        raise UsageError(f"--table {table}: expected {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")


def lines(comparison: Comparison, outcome: Outcome, table: str) -> Iterator[str]:
    """A row for each cell; columns that are the same in all cells are left out.

    CSV has the numbers of the cells as in `cells.csv`; Markdown and LaTeX (with the package booktabs) the shares that
    survive and settle, the median settling time [s] and residual [m], with their intervals.
    """
    if table == "csv":
        yield from _csv(outcome)
        return
    heads, rows = _columns(comparison, outcome.cells)
    if table == "markdown":
        yield from ("| " + " | ".join(row) + " |" for row in (heads, ["---"] * len(heads), *rows))
        return
    yield r"\begin{tabular}{" + "l" * len(heads) + "}"
    yield r"\toprule"
    yield _latex(heads)
    yield r"\midrule"
    yield from map(_latex, rows)
    yield r"\bottomrule"
    yield r"\end{tabular}"


def _csv(outcome: Outcome) -> Iterator[str]:
    text = io.StringIO()
    rows = [cell.row() for cell in outcome.cells]
    writer = csv.DictWriter(text, fieldnames=[*rows[0]] if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    yield from text.getvalue().splitlines()


def _columns(comparison: Comparison, cells: Sequence[CellSummary]) -> tuple[list[str], list[list[str]]]:
    if comparison.second is not None:  # as the columns are: all of one controller together
        names, conditions = ([one.name for one in ones] for ones in (comparison.controllers, comparison.conditions))
        of_file = [*dict.fromkeys(comparison.on_second[name].condition for name in conditions)]
        cells = sorted(
            cells,
            key=lambda cell: (
                [one.name for one in comparison.vehicles].index(cell.vehicle),
                of_file.index(comparison.on_second[cell.condition].condition),
                names.index(cell.controller),
                cell.value,
                conditions.index(cell.condition),
            ),
        )
    columns = {key: [getattr(cell, key) for cell in cells] for key in ("vehicle", "condition", "controller")}
    if comparison.second is not None:
        columns["condition"] = [comparison.on_second[cell.condition].condition for cell in cells]
    columns = {key: values for key, values in columns.items() if len({*values}) > 1}
    for axis in filter(None, (comparison.axis, comparison.second)):
        quantity, values = quantity_of(axis, {}), [cell.values[axis.name] for cell in cells]
        columns[quantity.title] = [f"{quantity.factor * v:g}" if is_number(v) else str(v) for v in values]
    columns |= {
        "survives": [share_text(cell.survives) for cell in cells],
        "settles": [share_text(cell.settles) for cell in cells],
        **{
            f"{name.replace('_', ' ')} [{unit}]": [median_text(c.medians[name]) for c in cells]
            for name, unit in _UNITS.items()
        },
    }
    return [*columns], [list(row) for row in zip(*columns.values())]


def _latex(row: Sequence[str]) -> str:
    escaped = (cell.replace("_", r"\_").replace("%", r"\%").replace("&", r"\&").replace("#", r"\#") for cell in row)
    return " & ".join(escaped) + r" \\"
