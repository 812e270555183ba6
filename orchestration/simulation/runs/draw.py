"""The figures by name of one run, or of several runs overlaid and named by the settings in which they differ."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import PurePath
from typing import Any

from matplotlib.figure import Figure

from orchestration.foundation.basics.documents import tables_in
from orchestration.foundation.basics.errors import UsageError, did_you_mean, shown
from orchestration.foundation.recording.recording import thinned
from orchestration.simulation.figures.drawn_run import DrawnRun, Window
from orchestration.simulation.figures.signals import columns_of, of_name
from orchestration.simulation.figures.style import SCREEN, Figures, Style, style_named
from orchestration.simulation.figures.views import VIEWS, View, view_of
from orchestration.simulation.results import quantities
from orchestration.simulation.results.quantities import Quantity
from orchestration.simulation.runs.arguments import window_within
from orchestration.simulation.runs.result import Result
from orchestration.systems.system.component import flattened
from orchestration.systems.system.requirements import is_number

MAX_ROWS_OUTSIDE = 2**16
"""The most rows that are drawn of the whole of a run, beside all in the window"""


def draw(
    results: Result | Sequence[Result],
    which: Collection[str] | None = None,
    *,
    names: Sequence[str] | None = None,
    window: Window | None = None,
    style: Style = SCREEN,
) -> dict[str, Figure]:
    """Figures of a run, or of several runs overlaid, by name; default: all.

    `names` label the runs; default: the settings that differ between their scenarios. `window` is the span of time [s]
    that is shown. A figure that is not available, as the energy of a controller that has none, is left out. Beside
    figures, `which` may have recorded signals: `plant.tilt`, or `plant.acceleration` for its three parts.

    Raises `UsageError` for an unknown figure, and for runs of different systems.
    """
    listed = list(results) if isinstance(results, Sequence) else [results]
    views = [view_of(result.request.kind, result.recording.columns) for result in listed]
    components = {frozenset(result.system.components) for result in listed}
    if any(view is not views[0] for view in views) or len(components) != 1:
        raise UsageError("expected runs of one system to lay over each other")
    view = views[0]
    of_views = {name for each in VIEWS.values() for name in each.names}
    of_signals = {name: _columns(name, view, listed) for name in which or () if name not in of_views}
    drawing = view.load()
    labels = names or labels_of_runs(listed, [f"run {i + 1}" for i in range(len(listed))])
    columns = {*drawing.columns(listed[0].system, listed[0].described)}.union(*of_signals.values())
    runs = runs_of(listed, labels, columns, window)
    with style.applied():
        figures = {name: drawing.makers[name](runs, style) for name in view.names if which is None or name in which}
        figures |= {name: of_name(name, runs, style) for name in of_signals}
    return {name: figure for name, figure in figures.items() if figure is not None}


def _columns(name: str, view: View, runs: Sequence[Result]) -> list[str]:
    """The recorded columns of this name; raises `UsageError` if there are none."""
    found = columns_of(name, runs[0].recording.columns)
    if not found:
        raise UsageError(
            f"--figure {name}: expected one of {', '.join(view.names)}, or a recorded signal, as plant.position"
            + did_you_mean(name, runs[0].recording.columns)
        )
    return found


def figures_of(
    results: Sequence[Result], which: Collection[str] | None, *, window: Window | None, style: str
) -> Figures:
    """The figures of runs overlaid; raises `UsageError` for an unknown figure or style, or a window without rows."""
    chosen = style_named(style)
    for name in which or ():
        if not isinstance(name, str):
            raise UsageError(f"figure {shown(repr(name))}: expected names, as in plot('errors', 'path')")
    if not all(isinstance(result, Result) for result in results):
        raise UsageError(f"beside = {shown(repr([*results[1:]]))}: expected a list of results of runs")
    if window is not None:
        window = window_within(window, max(result.end for result in results), f"window = {shown(repr(window))}")
    return Figures(draw(results, which, window=window, style=chosen), chosen)


def runs_of(
    results: Sequence[Result], names: Sequence[str], columns: Collection[str] | None, window: Window | None
) -> list[DrawnRun]:
    """Runs ready to be drawn: at most `MAX_ROWS_OUTSIDE` rows, and all in the window; default: all columns."""
    return [
        DrawnRun(
            name=name,
            place=place,
            title=_title(result),
            system=result.system,
            recording=thinned(
                result.recording,
                set(result.recording.columns if columns is None else columns),
                window or (0.0, 1.0),
                MAX_ROWS_OUTSIDE,
            ),
            whole=result.recording,
            described=result.described,
            parameters=result.parameters,
            window=window,
        )
        for place, (result, name) in enumerate(zip(results, names, strict=True))
    ]


def _title(result: Result) -> str:
    parts = [headline] if (headline := result.request.headline()) else []
    if result.divergence is not None:
        parts.append(f"diverged at {result.metrics['divergence_time']:g} s")
    if result.termination is not None:
        parts.append(f"terminated at {result.metrics['horizon']:g} s")
    if result.interrupted_at is not None:
        parts.append(f"interrupted at {result.interrupted_at:g} s")
    return ", ".join(parts)


MAX_SETTINGS_IN_LABEL = 3
"""Most settings in a label"""
_ABSENT = object()


def labels_of_runs(results: Sequence[Result], otherwise: Sequence[str]) -> list[str]:
    """A label for each run, as in "period 10 ms, κ 0"; those of `otherwise` where settings do not distinguish them."""
    runs = [_settings(result) for result in results]
    every = dict.fromkeys(path for run in runs for path in run)
    paths = [path for path in every if _is_setting_that_differs(path, runs)]
    named = {path: quantities.setting(path, [run.get(path) for run in runs]) for path in paths}
    names = [", ".join(_setting_text(path, each, run.get(path)) for path, each in named.items()) for run in runs]
    if 0 < len(paths) <= MAX_SETTINGS_IN_LABEL and len(set(names)) == len(names):
        return names
    return list(otherwise)


def _settings(result: Result) -> dict[str, Any]:
    """The settings of its scenario or system file by path, and the parameters that it ran with."""
    return {**result.parameters, **dict(flattened(tables_in(result.request.to_toml())))}


def _is_setting_that_differs(path: str, runs: Sequence[Mapping[str, Any]]) -> bool:
    values = [run.get(path, _ABSENT) for run in runs]
    is_derived = path.endswith((".sample_period", ".sample_offset"))  # by the master, of other settings
    return any(value != values[0] for value in values) and not is_derived


def _setting_text(path: str, named: Quantity, value: Any) -> str:
    if value is None:
        return f"{named.name} as usual"
    if isinstance(value, str) and path.endswith((".fmu", ".file")):
        return PurePath(value).stem
    return f"{named.name} {named.text_of(value) if is_number(value) else value}"
