"""The figures of a study: chosen by its axes, drawn from its store, written beside it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from fmu_kit.new_files import new_files
from orchestration.experiments.studies import figures, sensitivity
from orchestration.experiments.studies.axes import Axis, Value, picked, place_of, unit_points
from orchestration.experiments.studies.cell_lines import cell_lines
from orchestration.experiments.studies.cell_maps import MAX_PANELS, cell_maps
from orchestration.experiments.studies.default_metric import default_metric
from orchestration.experiments.studies.figures import heat_map
from orchestration.experiments.studies.infinite_means import InfiniteMeans
from orchestration.experiments.studies.shares import BOOLEAN, GOOD, MEAN, MEDIAN, expect_mean, judged_by, with_chance
from orchestration.experiments.studies.store import store_path
from orchestration.experiments.studies.store_columns import TEXTS, metrics_with
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.table import frame, meaning_of, rows_at, units_in
from orchestration.foundation.basics.errors import UsageError, did_you_mean
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import Share
from orchestration.simulation.figures.style import SCREEN, Style, save
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.objectives import bound_of, how_runs_ended, judged_objective

if TYPE_CHECKING:
    import pandas as pd


def expect_metric(study: Study, metric: str | None) -> None:
    """Raise `UsageError` for an unknown metric."""
    known = [name for name in metrics_with(study.metric_names) if name not in TEXTS or _is_screened(study)]
    if metric is not None and metric not in known:
        near = did_you_mean(metric, known)
        raise UsageError(f"metric {metric}: expected one of {', '.join(known)}; every figure shows the outcome{near}")


def draw_study(
    study: Study,
    folder: Path | None,
    metric: str | None = None,
    style: Style = SCREEN,
    progress: Share = lambda share: None,
    *,
    out: Path | None = None,
    at: Sequence[str] = (),
    mean: bool = False,
) -> list[Path]:
    """Draw a metric from the store of `study` in a folder, default: the first objective that varies; the paths.

    The figures are written to `out`, by default beside the store. With `design.repeat` the default is the share of good
    runs. `at` chooses values of axes, as `delay=0.02`, for a figure over the others; with `mean` cells have the mean of
    a metric over all runs that have it, in place of the median over the good ones. Raises `UsageError` for an unknown
    metric or value, or axes for which there is no figure.
    """
    path = store_path(study.name, folder)
    drawn, indices = study_figures(study, path, metric, style, picked(study.cell_axes, at), mean=mean)
    drawn = {f"mean_{name}" if mean else name: figure for name, figure in drawn.items()}
    drawn = {"_".join((name, *at)).replace("/", "_"): figure for name, figure in drawn.items()}
    place = path.parent if out is None else out
    with new_files(place) as new:
        tables = [sensitivity.write(indices, new / f"{next(iter(drawn))}.csv")] if indices else []
        written = [*tables, *save(drawn, new, style, progress)]
    return [place / each.name for each in written]


def study_figures(
    study: Study,
    store: Path,
    metric: str | None,
    style: Style = SCREEN,
    at: Mapping[str, Value] = {},
    *,
    mean: bool = False,
) -> tuple[dict[str, Figure], list[sensitivity.Index]]:
    """The figures of a metric over the axes of `study` by name, and the sensitivity indices that they show, if any.

    They are of the runs with the values `at` of some axes, over the others.

    Raises `UsageError` as `draw_study` does.
    """
    expect_metric(study, metric)
    if mean:
        expect_mean(metric, study.repeat)
    table, units = rows_at(frame(store), at), units_in(store)
    if not (table["status"] == "done").any():
        raise UsageError(f"{store}: expected at least one finished run, as sweep makes them")
    if metric is None and study.repeat is not None:
        metric = GOOD
    if metric is None:
        metric = _default_metric_of(study, table)
    indices = indices_of(study, numbers(table, metric), metric) if _is_screened(study) else []
    with style.applied():
        if indices:
            drawn = {f"sensitivity_{metric}": figures.sensitivity_bars(indices, metric, style)}
        else:
            axes = tuple(axis for axis in study.cell_axes if axis.name not in at)
            infinite = InfiniteMeans.in_store(store, study) if mean else None
            drawn = _over_axes(study, axes, table, metric, units, style, MEAN if mean else MEDIAN, infinite)
        meaning = "" if study.repeat is None or mean else meaning_of(study, metric, units)
        notes = [place_of(study.axes, at, units), meaning]
        for figure in drawn.values():
            figures.add_note(figure, "; ".join(filter(None, notes)), style)
    return drawn, indices


def _over_axes(
    study: Study,
    cell_axes: Sequence[Axis],
    table: "pd.DataFrame",
    metric: str,
    units: Mapping[str, str],
    style: Style,
    average: str,
    infinite: InfiniteMeans | None,
) -> dict[str, Figure]:
    system = study.origin
    words = system.criterion.outcomes
    axes = tuple(axis for axis in cell_axes if axis.is_numeric)
    named = [axis for axis in cell_axes if not axis.is_numeric]
    third = (*named, *axes[2:])
    fits = all(axis.values is not None for axis in axes) and all(len(a.values or ()) <= MAX_PANELS for a in axes[2:])
    if study.repeat is not None or named or metric == GOOD:
        if not axes or not fits or len(third) > 1:
            raise UsageError(
                f"{study.name}: expected one or two axes of numbers with values, at most one of names or a third of "
                f"numbers (up to {MAX_PANELS}, a map for each: it is the one listed last), "
                "and design.repeat for the axis of repetitions, to draw; --at NAME=VALUE draws the cells at one value "
                "of an axis, export --table prints them over any axes with values, report shows all runs, and compare "
                "draws shares over random initial conditions"
            )
        panels, table, of = third[0] if third else None, with_chance(table, study, infinite), metric
        if metric in BOOLEAN:
            table, of = judged_by(table, metric), GOOD
            words = words if metric == GOOD else (labels.metric(metric), f"not {labels.metric(metric)}")
        elif average == MEDIAN:
            _expect_value(study, table, metric)
        look: dict[str, Any] = {"units": units, "style": style, "average": average}
        if len(axes) == 1:
            return {metric: cell_lines(table, axes[0], panels, of, words, **look)}
        return {f"{metric}_map": cell_maps(table, (axes[0], axes[1]), panels, of, words, **look)}
    if len(axes) > 2:
        drawn = {metric: figures.scatter(table, axes, metric, words, units=units, style=style)}
        if len(axes) == 3 and fits and system.criterion.good is not None:
            cells = with_chance(table, study)
            drawn[f"{metric}_map"] = cell_maps(
                cells, (axes[0], axes[1]), axes[2], metric, words, units=units, style=style
            )
        return drawn
    drawn = {metric: figures.lines(table, axes, metric, words, bound_of(system, metric), units=units, style=style)}
    if len(axes) == 2 and all(axis.values is not None for axis in axes):
        drawn[f"{metric}_map"] = heat_map(table, axes, metric, words, units=units, style=style)
    return drawn


def _expect_value(study: Study, table: "pd.DataFrame", metric: str) -> None:
    """Raise `UsageError` if no good run has the metric, over which the medians of cells are."""
    if study.origin.criterion.good is None or table.loc[figures.good_runs(table), metric].notna().any():
        return
    outcomes = table["outcome"].value_counts().to_dict()
    word = study.origin.criterion.outcomes[0]
    raise UsageError(
        f"metric {metric}: expected a {word} run with a value of it, over which cells have medians; there are "
        f"{how_runs_ended(outcomes, len(table))} by {study.origin.stop_time:g} s: try the shares (--metric good, "
        "--metric diverged), the mean over all runs with a value (--mean), or a longer stop_time"
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
    """A metric by run, shape (n,); for the outcome, 1 for a good run and 0 for another."""
    values = (
        figures.good_runs(table).astype(float).where(table["outcome"].notna()) if metric == "outcome" else table[metric]
    )
    return np.asarray(values.to_numpy(float, na_value=np.nan))


def _default_metric_of(study: Study, table: "pd.DataFrame") -> str:
    good = figures.good_runs(table)
    return default_metric(
        study.metric_names,
        lambda name: table[name].where(good).to_numpy(float, na_value=np.nan),
        judged_objective(study.origin),
    )


def _is_screened(study: Study) -> bool:
    return study.method in sensitivity.METHODS and any(axis.values is None for axis in study.axes)
