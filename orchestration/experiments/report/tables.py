"""The rows of a store as the table of a report, and the shares of good runs."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.model import Column, ReportShare, ReportTable, Shares
from orchestration.experiments.report.subset import evenly
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.statistics import wilson
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity
from orchestration.systems.system.requirements import is_number

MAX_ROWS = 50_000
"""Most rows of a table; a larger study is thinned evenly"""
MAX_VALUES = 40
"""Most values of an axis with a share for each value; other axes are divided into parts"""
PARTS = 8
OUTCOME = "outcome"

Row = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class ColumnAxis:
    """An axis as the page draws it."""

    name: str
    """Name of the column"""
    quantity: Quantity
    """Quantity with the unit in which its values are displayed"""
    logarithmic: bool = False


def report_table(
    rows: Sequence[Row],
    axes: Sequence[ColumnAxis],
    metrics: Sequence[str],
    units: Mapping[str, str],
    blobs: Blobs,
    *,
    tracks: Mapping[int, int],
    messages: Mapping[int, str],
    is_grid: bool,
) -> ReportTable:
    """The table of the rows of a store; `tracks` and `messages` are by index in the design."""
    kept = rows if len(rows) <= MAX_ROWS else [rows[i] for i in sorted(evenly(len(rows), MAX_ROWS))]
    places = {row["design_index"]: place for place, row in enumerate(kept)}
    columns = [
        Column(
            name="design_index", label="run", unit=None, kind="index",
            values=blobs.exact([row["design_index"] for row in kept]),
        ),
        *(_axis(axis, [row["settings"][axis.name] for row in kept], blobs) for axis in axes),
        _words(OUTCOME, [row[OUTCOME] for row in kept], blobs, "metric"),
        *_metrics(kept, metrics, units, blobs),
    ]  # fmt: skip
    return ReportTable(
        count=len(kept),
        total=len(rows),
        columns=tuple(columns),
        tracks={str(places[index]): run for index, run in tracks.items() if index in places},
        messages={str(places[index]): text for index, text in messages.items() if index in places},
        is_grid=is_grid,
    )


def _axis(axis: ColumnAxis, values: Sequence[Any], blobs: Blobs) -> Column:
    if any(isinstance(value, str | bool) for value in values):
        return _words(axis.name, values, blobs, "axis")
    return Column(
        name=axis.name, label=axis.quantity.name, unit=labels.unit(axis.quantity.unit), kind="axis",
        values=blobs.exact(axis.quantity.of(values)), logarithmic=axis.logarithmic,
    )  # fmt: skip


def _words(name: str, values: Sequence[Any], blobs: Blobs, kind: Any) -> Column:
    texts = ["failed" if value is None else str(value) for value in values]
    words = tuple(dict.fromkeys(texts))
    places = {word: place for place, word in enumerate(words)}
    return Column(
        name=name, label=labels.words(name), unit=None, kind=kind, words=words,
        values=blobs.exact([places[text] for text in texts]),
    )  # fmt: skip


def _metrics(rows: Sequence[Row], metrics: Sequence[str], units: Mapping[str, str], blobs: Blobs) -> Iterator[Column]:
    """Columns of the metrics that have a value in some run."""
    for name in metrics:
        values = np.array([math.nan if row[name] is None else float(row[name]) for row in rows])
        known = values[np.isfinite(values)]
        if len(known) and name not in ("good", "diverged"):
            yield Column(
                name=name, label=labels.metric(name), unit=labels.unit(units.get(name)), kind="metric",
                values=blobs.exact(values),
            )  # fmt: skip


def is_good(row: Row) -> bool:
    """Whether a run meets the criterion."""
    return bool(row["good"] == 1)


def share_of(label: str, value: float | None, rows: Sequence[Row], *, by_chance: bool) -> ReportShare:
    """The share of good runs in some rows; with its interval if the runs are a random sample."""
    good = sum(map(is_good, rows))
    low, high = wilson(good, len(rows)) if by_chance else (None, None)
    return ReportShare(label=label, value=value, good=good, runs=len(rows), low=low, high=high)


def shares_along(rows: Sequence[Row], axis: ColumnAxis, *, by_chance: bool) -> Shares | None:
    """The shares by value of an axis, or by part of its range; None for an axis of one value."""
    values = [row["settings"][axis.name] for row in rows]
    distinct = list(dict.fromkeys(values))
    if len(distinct) < 2:
        return None
    if len(distinct) <= MAX_VALUES:
        groups: dict[Any, list[Row]] = {value: [] for value in _ordered(distinct)}
        for row, value in zip(rows, values):
            groups[value].append(row)
        has_unit = axis.quantity.factor != 1.0
        shown = {value: float(axis.quantity.of(value)) if has_unit else value for value in groups}
        shares = [share_of(_text(shown[v]), _number(shown[v]), of, by_chance=by_chance) for v, of in groups.items()]
    else:
        shares = [*_by_part(rows, axis.quantity.of(values), axis, by_chance=by_chance)]
    unit = labels.unit(axis.quantity.unit)
    return Shares(axis=axis.quantity.name, unit=unit, logarithmic=axis.logarithmic, shares=tuple(shares))


def _by_part(rows: Sequence[Row], values: Floats, axis: ColumnAxis, *, by_chance: bool) -> Iterator[ReportShare]:
    scaled = np.log(values) if axis.logarithmic else values
    edges = np.linspace(scaled.min(), scaled.max(), PARTS + 1)
    part = np.clip(np.digitize(scaled, edges) - 1, 0, PARTS - 1)
    ends = np.exp(edges) if axis.logarithmic else edges
    for i in range(PARTS):
        of_part = [rows[k] for k in np.flatnonzero(part == i).tolist()]
        if of_part:
            middle = 0.5 * (edges[i] + edges[i + 1])
            label = f"{ends[i]:.3g} to {ends[i + 1]:.3g}"
            value = float(np.exp(middle) if axis.logarithmic else middle)
            yield share_of(label, value, of_part, by_chance=by_chance)


def _ordered(values: list[Any]) -> list[Any]:
    are_numbers = all(map(is_number, values))
    return sorted(values) if are_numbers else values


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _number(value: Any) -> float | None:
    return float(value) if is_number(value) else None
