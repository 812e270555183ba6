"""Which figures a study gets: decides by its axes, reads the store, writes beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.basics.terminal import Share
from orchestration.figures.style import SCREEN, Style, save
from orchestration.results.criterion import bound_of, judged_objective
from orchestration.studies import figures, sensitivity
from orchestration.studies.axes import Axis, unit_points
from orchestration.studies.maps import heat_map
from orchestration.studies.shown_first import shown_first
from orchestration.studies.store import store_path
from orchestration.studies.store_columns import TEXTS, metrics_with
from orchestration.studies.study import Study
from orchestration.studies.table import frame, units_in

if TYPE_CHECKING:
    import pandas as pd


def expect_metric(study: Study, metric: str | None) -> None:
    """Raise `UsageError` for a metric that was asked for and is none."""
    known = [name for name in metrics_with(study.judged) if name not in TEXTS or _is_screened(study)]
    if metric is not None and metric not in known:
        raise UsageError(f"metric {metric}: expected one of {', '.join(known)}; every figure shows the outcome")


def draw_study(
    study: Study,
    folder: Path | None,
    metric: str | None = None,
    style: Style = SCREEN,
    progress: Share = lambda share: None,
) -> list[Path]:
    """Draw what is in the store of `study`, by default the first objective that varies; the paths.

    Raises `UsageError` for a metric that does not exist, or axes that no figure here is for.
    """
    path = store_path(study.name, folder)
    made, indices = study_figures(study, path, metric, style)
    listed = [sensitivity.write(indices, (path.parent / next(iter(made))).with_suffix(".csv"))] if indices else []
    return listed + save(made, path.parent, style, progress)


def study_figures(
    study: Study, store: Path, metric: str | None = None, style: Style = SCREEN
) -> tuple[dict[str, Figure], list[sensitivity.Index]]:
    """The figures of a metric over the axes of `study` by name, and the sensitivity indices that they show, if any.

    Raises `UsageError` as `draw_study` does.
    """
    expect_metric(study, metric)
    table, units = frame(store), units_in(store)
    if metric is None:
        metric = _shown_first(study, table)
    indices = indices_of(study, numbers(table, metric), metric) if _is_screened(study) else []
    with style.applied():
        if indices:
            return {f"sensitivity_{metric}": figures.sensitivity_bars(indices, metric, style)}, indices
        return _over_axes(study, table, metric, units, style), []


def _over_axes(
    study: Study, table: "pd.DataFrame", metric: str, units: Mapping[str, str], style: Style
) -> dict[str, Figure]:
    axes = tuple(axis for axis in study.axes if _is_numeric(axis))
    if len(axes) != len(study.axes):
        raise UsageError(f"{study.name}: expected axes of numbers to draw")
    system = study.origin
    words = system.criterion.outcomes
    if len(axes) > 2:
        return {metric: figures.scatter(table, axes, metric, words, units=units, style=style)}
    made = {metric: figures.lines(table, axes, metric, words, bound_of(system, metric), units=units, style=style)}
    if len(axes) == 2 and all(axis.values is not None for axis in axes):
        made[f"{metric}_map"] = heat_map(table, axes, metric, words, units=units, style=style)
    return made


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


def _shown_first(study: Study, table: "pd.DataFrame") -> str:
    good = figures.flew(table)
    return shown_first(
        study.judged,
        lambda name: table[name].where(good).to_numpy(float, na_value=np.nan),
        judged_objective(study.origin),
    )


def _is_screened(study: Study) -> bool:
    return study.method in sensitivity.METHODS and any(axis.values is None for axis in study.axes)


def _is_numeric(axis: Axis) -> bool:
    return axis.values is None or all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in axis.values)
