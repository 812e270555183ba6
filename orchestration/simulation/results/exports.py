"""Exports of a run to the formats of other programs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.times import seconds
from orchestration.foundation.recording import mat_file
from orchestration.foundation.recording.frames import units_of
from orchestration.foundation.recording.recording import About, Events, Recording, events_of, rows_of
from orchestration.simulation.results.objectives import Metrics


def to_mat(path: Path, recording: Recording, about: About, metrics: Metrics, units: Mapping[str, str]) -> Path:
    """Write a run as the structure `run` of a MAT-file; returns its path.

    `run.time` [s] and `run.signals.plant.position.x` are columns of n rows; `run.units` has the same fields as
    `run.signals`, with the unit of each as text, empty where it has none. `run.events` has `time` [s], `event`, `what`
    and `sample`; `run.metrics` the metrics, `run.metric_units` their units. `run.columns` lists the signals by their
    usual names.
    """
    rows = rows_of(recording)
    columns = {name: rows[:, i] for i, name in enumerate(recording.columns)}
    time, known = columns.pop("time"), units_of(about)
    run = {
        "time": time,
        "columns": [*columns],
        "signals": mat_file.nested(columns),
        "units": mat_file.nested({name: known.get(name, "") for name in columns}),
        "events": _events(events_of(recording)),
        "metrics": mat_file.flat(metrics),
        "metric_units": mat_file.flat({name: units.get(name, "") for name in metrics}),
    }
    return mat_file.write(path, {"run": run})


def _events(events: Events) -> dict[str, Any]:
    return {
        "time": seconds(events.table[:, 0]),
        "event": [event.kind for event in events],
        "what": [event.what for event in events],
        "sample": events.table[:, 3].astype(float),
    }
