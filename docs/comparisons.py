"""Runs the comparisons of the findings, and stores the results of their cells: `docs/data/NAME.json`.

`python -m docs.comparisons NAME …` runs the same flights as `quadcosim compare studies/comparisons/NAME.toml`, with the
store in `results/comparisons/NAME`, and continues where it was stopped.
"""

import json
import math
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from orchestration.experiments.comparison import figures as plots
from orchestration.experiments.comparison.cells import (
    FATES,
    RESIDUAL,
    SETTLING,
    CellSummary,
    Median,
    Share,
    sizes,
    survived,
)
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.figures import BINS, Reach
from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.comparison.fronts import Point
from orchestration.experiments.comparison.limits import GridLimit
from orchestration.experiments.comparison.outcome import as_json
from orchestration.experiments.comparison.run import compare
from orchestration.experiments.studies.axes import quantity_of
from orchestration.experiments.studies.sweep import sweep
from orchestration.foundation.basics.statistics import first_end, wilson
from orchestration.simulation.figures.palette import (
    BLUE,
    BROWN,
    CHARCOAL,
    GREEN,
    GREY,
    ORANGE,
    PALE_GREEN,
    PURPLE,
    RED,
    SAND,
    SILVER,
    UMBER,
    VIOLET,
)
from orchestration.simulation.figures.style import DOCS
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity
from orchestration.systems.system.starts import Starts

ROOT = Path(__file__).parent.parent
FILES = ROOT / "studies" / "comparisons"
DATA = Path(__file__).parent / "data"
RESULTS = ROOT / "results" / "comparisons"
NAMES = (
    "periods", "fast_inner", "tuned", "tuned_mean", "delays", "inertias", "mismatches", "losses", "jitters", "vehicles",
    "positions", "negative_thrust", "motors", "cascade_ratios", "tuned_alike", "tuned_settling", "predictor_errors",
    "predictor_jitter", "separation", "separation_rates", "vehicles_tuned",
)  # fmt: skip
RANDOM = ("losses", "predictor_jitter")
RATES = 20.0
"""Ratio of the periods of outer and inner loops, where the inner ones are fast"""
WIDE = replace(DOCS, width=254.0)
REPORTED = ("settling_time", "residual", "position_rmse", "torque_max", "total_variation.torque")
WORKERS = 2
HORIZONS = (20.0, 30.0, 40.0, 60.0)
"""Times up to which runs are counted [s], to see whether the shares still change"""
COLORS = {
    "unified": RED,
    "unified, no coupling": BLUE,
    "unified, mean": ORANGE,
    "no coupling, mean": VIOLET,
    "geometric": GREEN,
    "geometric, published gains": PALE_GREEN,
    "geometric, mean": BROWN,
    "cascade, one rate": GREY,
    "cascade, no rate derivative": CHARCOAL,
    "cascade, filter of 5 ms scaled": UMBER,
    "cascade, filter of 1 ms scaled": SAND,
    "cascade, no velocity integral": SILVER,
    "unified, predictor": PURPLE,
    "no coupling, predictor": BROWN,
    "mean, predictor": GREEN,
    "unified, paper's gains": RED,
    "unified, tuned for 10 ms": ORANGE,
    "unified, tuned for its period": BLUE,
    "unified, mean, tuned for 10 ms": PURPLE,
    "unified, mean, tuned for its period": BROWN,
    "geometric, tuned for 10 ms": VIOLET,
    "geometric, tuned for its period": GREEN,
    "cascade, one rate, tuned for 10 ms": SILVER,
    "cascade, one rate, tuned for its period": GREY,
}
"""Colours of controllers, the same in every figure"""


@cache
def load(name: str) -> Comparison:
    """The comparison of a file."""
    return load_comparison(FILES / f"{name}.toml")


def read_data(name: str) -> Any:
    """The stored results of a comparison: its cells, limits and fronts."""
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def run_missing(name: str) -> Any:
    """Run the missing flights of a comparison, and store its results."""
    began, comparison, steady = time.perf_counter(), load(name), on_path(load(name))
    outcome = compare(comparison, out=RESULTS / name, workers=WORKERS, engine="batch", figures=False)
    pushed = sweep(steady.study, out=RESULTS / steady.name, workers=WORKERS, engine="batch").to_pandas()[RESIDUAL]
    found, table = as_json(comparison, outcome.outcome, outcome.bandwidths), outcome.table
    minutes = round((time.perf_counter() - began) / 60.0, 1)
    content = {
        "flights": len(table),
        "minutes": read_data(name)["minutes"] if _is_kept(name) and not outcome.summary.flown else minutes,
        "cells": [{**_short(cell, table[table["design_index"].isin(comparison.runs_of(comparison.cell(cell["cell"])))],
                            comparison), "on_path": _known(pushed[cell["cell"]])} for cell in found["cells"]],
        "limits": found["limits"],
        "fronts": [_point(point) for point in found["fronts"]],
    }  # fmt: skip
    keep(name, content)
    return read_data(name)


def _is_kept(name: str) -> bool:
    return (DATA / f"{name}.json").is_file()


def keep(name: str, content: dict[str, Any]) -> None:
    """Store results beside the pages."""
    DATA.mkdir(exist_ok=True)
    (DATA / f"{name}.json").write_text(_compact(content), encoding="utf-8")


def on_path(comparison: Comparison) -> Comparison:
    """The same comparison from one start on the path: its residual is that of wind and path, without initial error."""
    once = Starts(count=1, position=0.0, velocity=0.0, angle=0.0, rate=0.0)
    return replace(comparison, name=f"{comparison.name}_on_path", starts=once)


def by_horizon(rows: Any) -> dict[str, dict[str, int]]:
    """The numbers of runs that have diverged by each of `HORIZONS`, and that stay within 5 cm from then to the end."""
    alive, settling, end = survived(rows), rows[SETTLING].to_numpy(float), rows["divergence_time"].astype(float)
    return {
        "diverged_by": {f"{t:g}": int((~alive & (end <= t)).sum()) for t in HORIZONS},
        "inside_from": {f"{t:g}": int((alive & (settling <= t)).sum()) for t in HORIZONS},
    }


def _short(cell: dict[str, Any], rows: Any, comparison: Comparison) -> dict[str, Any]:
    """A cell as stored: counts, medians with their intervals, and counts by the size of the initial error."""
    bins = (sizes(comparison, rows) * BINS).astype(int).clip(upper=BINS - 1)
    counts = ("cell", "vehicle", "condition", "controller", "value", "count", "survives", "settles", "diverged")
    return {
        **{key: cell[key] for key in (*counts, "diverged_late")},
        **{name: [cell[f"{name}{end}"] for end in ("", ".low", ".high")] for name in REPORTED},
        **by_horizon(rows),
        "by_size": {
            fate: [[int((has(rows) & (bins == i)).sum()), int((bins == i).sum())] for i in range(BINS)]
            for fate, has in FATES.items()
        },
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _point(point: dict[str, Any]) -> dict[str, Any]:
    return {**point, "error": [*point["error"].values()], "effort": [*point["effort"].values()]}


def _compact(content: dict[str, Any]) -> str:
    """One line for each cell, limit and point, numbers to five digits."""

    def rounded(value: Any) -> Any:
        if isinstance(value, float):
            return _known(float(f"{value:.5g}"))
        if isinstance(value, dict):
            return {key: rounded(one) for key, one in value.items()}
        return [rounded(one) for one in value] if isinstance(value, list) else value

    parts = []
    for key, value in content.items():
        if isinstance(value, list):
            lines = ",\n".join(json.dumps(rounded(one), ensure_ascii=False) for one in value)
            parts.append(f'"{key}": [\n{lines}\n]')
        else:
            parts.append(f'"{key}": {json.dumps(rounded(value), ensure_ascii=False)}')
    return "{\n" + ",\n".join(parts) + "\n}\n"


def from_the_path() -> dict[str, int]:
    """In how many cells the residual is that of a flight from the path, and in how many that flight comes to rest."""
    cells = [
        cell for name in NAMES if name not in RANDOM for cell in read_data(name)["cells"]
    ]  # one flight says nothing about random losses and delays
    settled = [cell for cell in cells if cell["settles"] == cell["count"]]
    alike = [one for one in settled if math.isclose(one["residual"][0], one["on_path"] or 0.0, rel_tol=0.02)]
    restless = [cell for cell in cells if cell["settles"] == 0 and 2 * cell["survives"] > cell["count"]]
    at_rest = [one for one in restless if (one["on_path"] or math.inf) < 0.05]
    return {"all_settle": len(settled), "as_from_the_path": len(alike), "survive_and_none_settles": len(restless),
            "at_rest_from_the_path": len(at_rest)}  # fmt: skip


# -- printed lines and figures ----------------------------------------------------------------------------


def lines(name: str, content: Any) -> Iterator[str]:
    """The results of a comparison as printed lines."""
    yield f"{name}: {content['flights']} flights in {content['minutes']} min"
    for one in content["limits"]:
        where = ", ".join(one[key] for key in ("vehicle", "condition", "controller"))
        rad = "" if one["bandwidth"] is None else f", {one['bandwidth']:.3g} rad/s"
        ends = f"[{one['low']:g}, {one['high'] or '...'}]"
        yield f"  {where}: {one['share']} {one['fate']} to {one['value']:g} {ends}{rad}"
    for cell in content["cells"]:
        shares = (wilson(cell[key], cell["count"]) for key in ("survives", "settles"))
        (low, high), (least, most) = shares
        values = ", ".join(f"{key} {_numbers(cell[key])}" for key in REPORTED)
        where = ", ".join(cell[key] for key in ("vehicle", "condition", "controller"))
        by = "/".join(str(count) for count in cell["inside_from"].values())
        yield (f"  cell {cell['cell']}: {where}, {cell['value']:g}: of {cell['count']} {cell['survives']} survive "
               f"({low:.1%} to {high:.1%}, {cell['diverged_late']} lost late), {cell['settles']} settle "
               f"({least:.1%} to {most:.1%}; inside from 20/30/40/60 s on {by}); {values}; from the path "
               f"{_number(cell['on_path'])}")  # fmt: skip
    for key, fate, by_size in _ends_by_size(name):
        yield f"  {', '.join(key)}: by size of the initial error half {fate} up to {', '.join(by_size)}"


def _ends_by_size(name: str) -> Iterator[tuple[tuple[str, ...], str, list[str]]]:
    """By controller, vehicle and condition, for each bin: the value up to which half of the runs have a fate."""
    where = ("vehicle", "condition", "controller")
    for key, group in groupby(read_data(name)["cells"], lambda cell: tuple(cell[one] for one in where)):
        cells = [*group]
        for fate in FATES:
            counts = np.array([cell["by_size"][fate] for cell in cells])
            half = 2 * counts[..., 0] >= counts[..., 1]
            yield key, fate, [_number(first_end([cell["value"] for cell in cells], bin)) for bin in half.T]


def _numbers(median: list[float | None]) -> str:
    value, low, high = map(_number, median)
    return f"{value} [{low}, {high}]"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def figures() -> Iterator[tuple[str, Figure]]:
    """All figures of the comparisons, by name."""
    outer = Quantity(name="period", unit="ms", factor=1e3)  # of the outer loops
    tall = replace(DOCS, width=280.0, height=260.0)
    yield "comparison_basins", plots.basins(dict(_by_size("periods")), outer, "survive", "paper's body", tall)
    yield (
        "comparison_positions",
        plots.basins(dict(_by_size("positions")), outer, "survive", "initial error of up to 8 m, at rest", WIDE),
    )
    reaches = [*_reaches("periods"), *_reaches("fast_inner", RATES)]
    yield "comparison_limits", plots.limits_of(reaches, outer, True, WIDE)
    yield "comparison_tuned", _shares({"paper's body": [*_cells("tuned"), *_cells("tuned_mean")]}, "tuned")
    yield "comparison_fronts", _fronts("periods", (0.02, 0.05, 0.08))
    yield "comparison_tuned_fronts", _fronts("tuned", (0.01, 0.05, 0.1))
    for name, title in (("delays", "period of 20 ms"), ("losses", "period of 20 ms"), ("jitters", "period of 50 ms")):
        yield f"comparison_{name}", _shares({title: _cells(name)}, name)
    for name, key in (("mismatches", "condition"), ("inertias", "condition"), ("vehicles", "vehicle")):
        cells = _cells(name)
        titles = dict.fromkeys(getattr(cell, key) for cell in cells)
        by = {title: [cell for cell in cells if getattr(cell, key) == title] for title in titles}
        yield f"comparison_{name}", _shares(by, name)


def _axis(name: str) -> Quantity:
    known = {"inertias": "inertia, times the one believed", "losses": "share of messages lost"}
    return Quantity(name=known[name], unit="1") if name in known else quantity_of(load(name).axis, {})


def _shares(found: Mapping[str, Sequence[CellSummary]], name: str) -> Figure:
    return plots.shares(found, _axis(name), COLORS, WIDE)


def _fronts(name: str, values: Sequence[float]) -> Figure:
    front, points = load(name).front, [*map(_read_point, read_data(name)["fronts"])]
    metrics = (labels.metric_with_unit(front.effort, "N.m"), labels.metric_with_unit(front.error, "m"))
    return plots.fronts_of(points, values, _axis(name), metrics, COLORS, "paper's body", WIDE)


def _cells(name: str) -> list[CellSummary]:
    """The stored cells, without medians."""
    return [
        CellSummary(
            **{key: cell[key] for key in ("cell", "vehicle", "condition", "controller", "value", "count")},
            **{key: cell[key] for key in ("diverged", "diverged_late")},
            survives=Share.of(cell["survives"], cell["count"]),
            settles=Share.of(cell["settles"], cell["count"]),
            medians={},
        )
        for cell in read_data(name)["cells"]
    ]


def _by_size(name: str, factor: float = 1.0) -> Iterator[tuple[str, plots.BySize]]:
    """By controller and condition: values of the axis, times a factor, and how many survive, of how many."""
    several = len(load(name).conditions) > 1
    for key, group in groupby(read_data(name)["cells"], lambda cell: (cell["controller"], cell["condition"])):
        cells, controller = [*group], ", ".join(key[: 1 + several])
        counts = np.array([cell["by_size"]["survive"] for cell in cells])
        yield controller, ([factor * cell["value"] for cell in cells], counts.swapaxes(0, 1))


def _reaches(name: str, factor: float = 1.0) -> Iterator[Reach]:
    """The limits of each controller; `factor` scales the axis, but not the period of the attitude loop."""
    last = factor * float(load(name).values[-1])
    for controller, group in groupby(read_data(name)["limits"], lambda one: one["controller"]):
        limits = [GridLimit(**{**one, **{key: one[key] and factor * one[key] for key in ("value", "low", "high")},
                           "bandwidth": one["bandwidth"] if factor == 1.0 else None}) for one in group]  # fmt: skip
        yield Reach(name=controller, limits=limits, last=last)


def _read_point(point: dict[str, Any]) -> Point:
    medians = {key: Median(**dict(zip(("value", "low", "high"), point[key]))) for key in ("error", "effort")}
    return Point(**{**point, **medians})


if __name__ == "__main__":
    for chosen in sys.argv[1:]:
        run_missing(chosen)
