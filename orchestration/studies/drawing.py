"""Which figures a study gets: decides by its axes, reads the store, writes beside it."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orchestration.drawing.style import SCREEN, Style
from orchestration.errors import UsageError
from orchestration.expressions.syntax import Name, Number, Operation, names, parse
from orchestration.quadrotor.scenario import Scenario
from orchestration.request import Request
from orchestration.simulator import Floats
from orchestration.studies import figures, sensitivity
from orchestration.studies.axes import Axis, unit_points
from orchestration.studies.limit import Limit
from orchestration.studies.linear import HoverLoop
from orchestration.studies.local import radius
from orchestration.studies.maps import heat_map
from orchestration.studies.store import TEXTS, metrics_with
from orchestration.studies.study import Study
from orchestration.studies.sweep import store_path
from orchestration.studies.table import frame, units_in
from orchestration.system.model import System

if TYPE_CHECKING:
    import pandas as pd


def metric_of(study: Study, metric: str | None) -> str:
    """The metric that was asked for, else the one that the criterion is about; raises `UsageError` for none."""
    system = study.origin
    known = [name for name in metrics_with(system.objectives) if name not in TEXTS or _is_screened(study)]
    chosen = judged(system) if metric is None else metric
    if chosen not in known:
        raise UsageError(f"--metric {chosen}: expected one of {', '.join(known)}; every figure shows the outcome")
    return chosen


def draw_study(study: Study, folder: Path | None, metric: str | None = None, style: Style = SCREEN) -> list[Path]:
    """Draw what is in the store of `study`, by default what its criterion is about; the paths of figures and tables.

    Raises `UsageError` for a metric that does not exist, or axes that no figure here is for.
    """
    metric, system = metric_of(study, metric), study.origin
    path = store_path(study.name, folder)
    table, unit = frame(path), units_in(path).get(metric)
    if _is_screened(study):
        indices = indices_of(study, numbers(table, metric), metric)
        listed = sensitivity.write(indices, path.parent / f"sensitivity_{metric}.csv")
        bars = figures.save(lambda how: figures.sensitivity_bars(indices, metric, how), listed.with_suffix(""), style)
        return [listed, *bars]
    axes = tuple(axis for axis in study.axes if _is_numeric(axis))
    if len(axes) != len(study.axes):
        raise UsageError(f"{study.name}: expected axes of numbers to draw")
    words, plain, mapped = system.criterion.outcomes, path.parent / metric, path.parent / f"{metric}_map"
    if len(axes) > 2:
        return figures.save(lambda how: figures.scatter(table, axes, metric, words, unit=unit, style=how), plain, style)
    bound = edge(system, metric)
    written = figures.save(
        lambda how: figures.lines(table, axes, metric, words, bound, unit=unit, style=how), plain, style
    )
    if len(axes) == 2 and all(axis.values is not None for axis in axes):
        written += figures.save(lambda how: heat_map(table, axes, metric, words, unit=unit, style=how), mapped, style)
    return written


def judged(system: System) -> str:
    """The objective that the criterion is about, or the first one; `horizon` where there is none."""
    named = names(parse(system.criterion.good)) if system.criterion.good is not None else ()
    return next((name for name in named if name in system.objectives), next(iter(system.objectives), "horizon"))


def edge(system: System, metric: str) -> float | None:
    """The bound of a criterion that is `metric < number` and no more, or with another comparison."""
    if system.criterion.good is None:
        return None
    match parse(system.criterion.good):
        case Operation("<" | "<=" | ">" | ">=", (Name(name), Number(bound))) if name == metric:
            return bound
    return None


def draw_limit(request: Request, found: Limit, folder: Path, style: Style = SCREEN) -> list[Path]:
    """Draw the spectral radius over the period or the delay, with both limits; the paths of the figure.

    Raises `UsageError` if linear theory does not apply.
    """
    if not isinstance(request, Scenario):
        raise UsageError("--out: the spectral radius is drawn of the quadrotor only")
    if found.of not in ("period", "delay"):
        raise UsageError(f"--out: expected --of period or delay to draw the spectral radius over, got {found.of}")
    ends = [limit for limit in (found.local_limit, found.large_signal_limit) if limit is not None]
    last = 1.3 * max(ends, default=0.1)
    values = np.array([0.001 + i / 199.0 * (last - 0.001) for i in range(200)])
    loop = HoverLoop.of(request)
    radii = np.array([radius(loop, request, found.of, value) for value in values])
    return figures.save(
        lambda how: figures.spectral_radius(
            found.of,
            values,
            radii,
            local_limit=found.local_limit,
            large_signal_limit=found.large_signal_limit,
            style=how,
        ),
        folder / f"spectral_radius_{found.of}",
        style,
    )


def indices_of(study: Study, values: Floats, metric: str) -> list[sensitivity.Index]:
    """The sensitivity indices of a metric, with a value for each run of `study`, shape (n,)."""
    sampled = [axis for axis in study.axes if axis.values is None]
    if len(sampled) != len(study.axes):
        raise UsageError(f"{study.name}: expected every axis to be a range, for sensitivity")
    if study.method not in sensitivity.METHODS:
        raise UsageError(f"{study.name}: design.method = {study.method}, expected morris or saltelli")
    design = unit_points(study.method, len(sampled), study.samples, study.design_seed)
    if len(values) != len(design):
        raise UsageError(f"{study.name}: {len(values)} of {len(design)} runs are there, expected all")
    return sensitivity.analyse(study.method, [axis.name for axis in sampled], design, values, metric)


def numbers(table: "pd.DataFrame", metric: str) -> Floats:
    """A metric run by run, shape (n,); of the outcome, 1 for a run that is good, 0 for one that is not."""
    values = figures.flew(table).astype(float).where(table["outcome"].notna()) if metric == "outcome" else table[metric]
    return np.asarray(values.to_numpy(float, na_value=np.nan))


def _is_screened(study: Study) -> bool:
    return study.method in sensitivity.METHODS and any(axis.values is None for axis in study.axes)


def _is_numeric(axis: Axis) -> bool:
    return axis.values is None or all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in axis.values)
