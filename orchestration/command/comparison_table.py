"""The cells of a comparison as a table for a paper, with intervals at 95 %."""

from collections.abc import Sequence

from orchestration.command.comparison_text import median_text, share_text
from orchestration.command.printed_tables import PrintedTable
from orchestration.experiments.comparison.cells import CellSummary
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.outcome import Outcome
from orchestration.experiments.studies.axis_labels import quantity_of
from orchestration.systems.system.requirements import is_number

_UNITS = {"settling_time": "s", "residual": "m"}


def comparison_table(comparison: Comparison, outcome: Outcome) -> PrintedTable:
    """A row for each cell: shares that survive and settle, median settling time and residual, with their intervals.

    Columns that are the same in all cells are left out. The numbers are those of `cells.csv`.
    """
    columns = _columns(comparison, outcome.cells)
    return PrintedTable(
        caption=(
            f"Shares of {len(comparison.initial_conditions)} initial conditions that survive and settle, with 95 % "
            "Wilson intervals; medians, with intervals of order statistics at 95 %"
        ),
        heads=[*columns],
        rows=[*zip(*columns.values())],
        numbers=[cell.row() for cell in outcome.cells],
    )


def _columns(comparison: Comparison, cells: Sequence[CellSummary]) -> dict[str, list[str]]:
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
            f"median {name.replace('_', ' ')} [{unit}]": [median_text(c.medians[name]) for c in cells]
            for name, unit in _UNITS.items()
        },
    }
    return columns
