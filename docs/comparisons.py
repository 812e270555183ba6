"""Flies the comparisons of `findings/` in lanes, and keeps what their cells come to beside the page.

`quadcosim compare studies/comparisons/NAME.toml` flies the same runs one store after the other; here a run leaves no
row, only the cell that it belongs to: `docs/data/NAME.json`.
"""

import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from docs import comparison_charts as charts
from orchestration.basics.statistics import wilson
from orchestration.comparison.bandwidth import bandwidths
from orchestration.comparison.cells import frame_of
from orchestration.comparison.design import Comparison
from orchestration.comparison.file import load_comparison
from orchestration.comparison.outcome import as_json, concluded
from orchestration.engines.batch import batches
from orchestration.fmi.model import read_model
from orchestration.runs.simulation import run
from orchestration.system.model import System
from orchestration.system.request import Start

ROOT = Path(__file__).parent.parent
FILES = ROOT / "studies" / "comparisons"
DATA = Path(__file__).parent / "data"
NAMES = (
    "periods", "fast_inner", "tuned", "tuned_mean", "delays", "inertias", "mismatches", "losses", "jitters", "vehicles",
)  # fmt: skip
FAST_INNER = "cascade, fast inner loops"
TOLD = ("settling_time", "residual", "position_rmse", "torque_max", "total_variation.torque")
WORKERS = 2
HORIZONS = (20.0, 30.0, 40.0, 60.0)
"""[s] by which runs are counted, to see whether the shares still move"""
BINS = 8
"""of the size of the initial error"""


@cache
def loaded(name: str) -> Comparison:
    """The comparison of a file."""
    return load_comparison(FILES / f"{name}.toml")


def kept(name: str) -> Any:
    """What the page has of a comparison: its cells, limits and fronts."""
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def fly_all(name: str) -> Any:
    """Fly a comparison whole, and keep what comes of it."""
    import pandas as pd

    began, comparison = time.perf_counter(), loaded(name)
    paths = {fmu: str(path) for fmu, path in comparison.study.files().fmus.items()}  # built here, once
    cells = [cell.index for cell in comparison.cells()]
    parts = []
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        for done, part in enumerate(pool.map(cell_flown, [name] * len(cells), cells, [paths] * len(cells)), 1):
            parts.append(part)
            print(f"\r{name}: {done} of {len(cells)} cells", end="", file=sys.stderr)
    table = frame_of(comparison, [run for part in parts for run in part])
    known = bandwidths(comparison)
    found = as_json(comparison, concluded(comparison, table, known), known)
    content = {
        "flights": len(table),
        "minutes": round((time.perf_counter() - began) / 60.0, 1),
        "cells": [_short(cell, table[table["design_index"].isin(comparison.runs_of(comparison.cell(cell["cell"])))],
                         comparison) for cell in found["cells"]],
        "limits": found["limits"],
        "fronts": [_point(point) for point in found["fronts"]],
    }  # fmt: skip
    assert isinstance(table, pd.DataFrame)
    DATA.mkdir(exist_ok=True)
    (DATA / f"{name}.json").write_text(_compact(content), encoding="utf-8")
    return kept(name)


def cell_flown(name: str, index: int, paths: dict[str, str]) -> list[tuple[int, Any]]:
    """All runs of a cell, by their number in the study."""
    comparison = loaded(name)
    runs = comparison.runs_of(comparison.cell(index))
    return [*zip(runs, (_batches().metrics(systems_of(comparison, index, paths))), strict=True)]


def systems_of(comparison: Comparison, index: int, paths: dict[str, str]) -> list[System]:
    """Its systems: that of the first run, from every start."""
    runs = comparison.runs_of(comparison.cell(index))
    first = comparison.study.system(runs[0], _starts(tuple(paths.items())))
    components = {key: replace(each, fmu=paths[each.fmu]) for key, each in first.components.items()}
    plant = components["plant"]
    return [
        replace(
            first,
            seed=comparison.base.seed + comparison.starts.first + i,
            components={**components, "plant": replace(plant, parameters={**plant.parameters, **_of_plant(start)})},
        )
        for i, start in enumerate(comparison.drawn)
    ]


def _of_plant(start: Start) -> dict[str, Any]:
    return {target.removeprefix("plant."): value for target, value in start.values.items()}


@cache
def _starts(paths: tuple[tuple[str, str], ...]) -> dict[str, float]:
    """Start values of the plant's parameters, which conditions multiply."""
    (plant,) = (path for name, path in paths if name.endswith("QuadrotorPlant"))
    return {
        f"plant.{variable.name}": float(variable.start)
        for variable in read_model(Path(plant)).variables.values()
        if variable.kind == "Real" and variable.causality == "parameter" and variable.start is not None
    }


class _Lanes:
    """The batches of this process."""

    def __init__(self) -> None:
        self._batches = batches.Batches()

    def metrics(self, systems: list[System]) -> Iterator[Any]:
        """Of systems whose FMUs are files; what lanes leave is flown alone."""
        for system, flown in zip(systems, self._batches.run(systems), strict=True):
            yield run(system).metrics if flown is None else flown.metrics


@cache
def _batches() -> _Lanes:
    return _Lanes()


def _short(cell: dict[str, Any], rows: Any, comparison: Comparison) -> dict[str, Any]:
    """A cell as it is kept: counts, medians with their intervals, and counts by the size of the initial error."""
    from orchestration.comparison.cells import sizes
    from orchestration.comparison.fates import FATES, SETTLING, survived

    bins = (sizes(comparison, rows) * BINS).astype(int).clip(upper=BINS - 1)
    alive, settling = survived(rows), rows[SETTLING].to_numpy(float)
    counts = ("cell", "vehicle", "condition", "controller", "value", "count", "survives", "settles", "diverged")
    return {
        **{key: cell[key] for key in (*counts, "diverged_late")},
        **{name: [cell[f"{name}{end}"] for end in ("", ".low", ".high")] for name in TOLD},
        "diverged_by": {f"{t:g}": int((~alive & (rows["divergence_time"].astype(float) <= t)).sum()) for t in HORIZONS},
        "settled_by": {f"{t:g}": int((alive & (settling <= t)).sum()) for t in HORIZONS},
        "by_size": {
            fate: [[int((has(rows) & (bins == i)).sum()), int((bins == i).sum())] for i in range(BINS)]
            for fate, has in FATES.items()
        },
    }


def _point(point: dict[str, Any]) -> dict[str, Any]:
    return {**point, "error": [*point["error"].values()], "effort": [*point["effort"].values()]}


def _compact(content: dict[str, Any]) -> str:
    """One line for each cell, limit and point, numbers to five digits."""

    def rounded(value: Any) -> Any:
        if isinstance(value, float):
            return float(f"{value:.5g}")
        if isinstance(value, dict):
            return {key: rounded(one) for key, one in value.items()}
        return [rounded(one) for one in value] if isinstance(value, list) else value

    parts = []
    for key, value in content.items():
        if isinstance(value, list):
            lines = ",\n".join(json.dumps(rounded(one), ensure_ascii=False) for one in value)
            parts.append(f'"{key}": [\n{lines}\n]')
        else:
            parts.append(f'"{key}": {json.dumps(value)}')
    return "{\n" + ",\n".join(parts) + "\n}\n"


# -- what is printed and drawn ----------------------------------------------------------------------------


def lines(name: str, content: Any) -> Iterator[str]:
    """What the page tells of a comparison."""
    yield f"{name}: {content['flights']} flights in {content['minutes']} min"
    for one in content["limits"]:
        where = ", ".join(one[key] for key in ("vehicle", "condition", "controller"))
        rad = "" if one["bandwidth"] is None else f", {one['bandwidth']:.3g} rad/s"
        ends = f"[{one['low']:g}, {one['high'] or '...'}]"
        yield f"  {where}: {one['share']} {one['fate']} to {one['value']:g} {ends}{rad}"
    for cell in content["cells"]:
        shares = (wilson(cell[key], cell["count"]) for key in ("survives", "settles"))
        (low, high), (least, most) = shares
        told = ", ".join(f"{key} {_numbers(cell[key])}" for key in TOLD)
        where = ", ".join(cell[key] for key in ("vehicle", "condition", "controller"))
        by = "/".join(str(count) for count in cell["settled_by"].values())
        yield (f"  cell {cell['cell']}: {where}, {cell['value']:g}: of {cell['count']} {cell['survives']} survive "
               f"({low:.1%} to {high:.1%}, {cell['diverged_late']} lost late), {cell['settles']} settle "
               f"({least:.1%} to {most:.1%}; by 20/30/40/60 s {by}); {told}")  # fmt: skip


def _numbers(median: list[float | None]) -> str:
    value, low, high = ("-" if one is None else f"{one:.3g}" for one in median)
    return f"{value} [{low}, {high}]"


def figures() -> Iterator[tuple[str, Figure]]:
    """All figures of the comparisons that were flown, by their names."""
    at_one_rate, inner = kept("periods"), kept("fast_inner")
    yield "comparison_basins", charts.basins([*at_one_rate["cells"], *inner["cells"]], {FAST_INNER: 20.0})
    ends = [*_limits(at_one_rate), *_limits(inner, 20.0)]
    yield "comparison_limits", charts.limits(ends, 600.0, "period [ms], of the outer loops")
    tuned = kept("tuned")
    both = [*tuned["cells"], *kept("tuned_mean")["cells"]]
    yield "comparison_tuned", charts.shares({"paper's body": both}, "period [ms]")
    for name, content, values in (
        ("fronts", at_one_rate, (0.02, 0.05, 0.08)),
        ("tuned_fronts", tuned, (0.01, 0.05, 0.1)),
    ):
        names = list(dict.fromkeys(cell["controller"] for cell in content["cells"]))
        yield f"comparison_{name}", charts.fronts(content["fronts"], values, charts.colored(names))
    yield "comparison_delays", charts.shares({"period of 20 ms": kept("delays")["cells"]}, "delay [ms]")
    yield "comparison_mismatches", charts.shares(_by("condition", kept("mismatches")), "period [ms]")
    yield (
        "comparison_inertias",
        charts.shares(_by("condition", kept("inertias")), "inertia, times the one believed [1]", 1.0),
    )
    yield "comparison_vehicles", charts.shares(_by("vehicle", kept("vehicles")), "period [ms]")
    yield (
        "comparison_losses",
        charts.shares({"period of 20 ms": kept("losses")["cells"]}, "share of messages lost [1]", 1.0),
    )
    yield "comparison_jitters", charts.shares({"period of 50 ms": kept("jitters")["cells"]}, "jitter [ms]")


def _limits(content: Any, factor: float = 1.0) -> Iterator[tuple[str, Any, Any, float]]:
    """Half and nine in ten of each controller, with the factor on the axis."""
    settling = [one for one in content["limits"] if one["fate"] == "settle"]
    for half, most in zip(settling[::2], settling[1::2], strict=True):
        yield half["controller"], half, most, factor


def _by(key: str, content: Any) -> dict[str, Any]:
    titles = dict.fromkeys(cell[key] for cell in content["cells"])
    return {title: [cell for cell in content["cells"] if cell[key] == title] for title in titles}


if __name__ == "__main__":
    for asked in sys.argv[1:]:
        fly_all(asked)
