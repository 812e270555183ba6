"""A recording as pandas tables, and as CSV with units in brackets, as in `plant.position.x [m]`, and as a MAT-file."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from fmu_kit.new_files import new_files
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.basics.unit_algebra import in_brackets
from orchestration.foundation.recording import mat_file, tables
from orchestration.foundation.recording.recording import KINDS, About, Events, Recording, events_of, rows_of

if TYPE_CHECKING:
    import pandas as pd


def units_of(about: About) -> dict[str, str]:
    """The units of the columns that have one."""
    return {name: words["unit"] for name, words in about.items() if "unit" in words}


def signals(recording: Recording, about: About) -> "pd.DataFrame":
    """A row for each instant, indexed by `time` [s]; the units are in `attrs["units"]`, by column."""
    import pandas as pd

    table = pd.DataFrame(rows_of(recording), columns=list(recording.columns)).set_index("time")
    table.attrs["units"] = units_of(about)
    return table


def events(recording: Recording) -> "pd.DataFrame":
    """A row for each event in order of time: `time` [s], `event`, its object (`what`) and the index `sample`."""
    import pandas as pd

    events = events_of(recording)
    time, kind, what, sample = events.table.T
    words, names = np.array(KINDS, dtype=object), np.array([*events.names], dtype=object)
    table = pd.DataFrame({"time": seconds(time), "event": words[kind], "what": names[what], "sample": sample})
    table.attrs["units"] = {"time": "s"}
    return table


SIGNALS, EVENTS = "signals.csv", "events.csv"


def as_csv(recording: Recording, about: About, folder: Path) -> list[Path]:
    """Write `signals.csv` and `events.csv` into a folder, chunk by chunk; returns their paths.

    Numbers have as many digits as are needed to read back the same values.
    """
    units = [units_of(about), {"time": "s"}]
    schemas = [_with_units(schema, of) for schema, of in zip(tables.schemas(recording.columns), units)]
    with (
        new_files(folder) as new,
        csv.CSVWriter(new / SIGNALS, schemas[0]) as signals,
        csv.CSVWriter(new / EVENTS, schemas[1]) as events,
    ):
        for chunk in recording.chunks():
            for writer, schema, table in zip((signals, events), schemas, tables.both(chunk)):
                writer.write_table(table.rename_columns(schema.names))
    return [folder / SIGNALS, folder / EVENTS]


def _with_units(schema: Any, units: dict[str, str]) -> Any:
    return pa.schema([(in_brackets(field.name, units.get(field.name)), field.type) for field in schema])


def to_mat(
    path: Path, recording: Recording, about: About, metrics: Mapping[str, Any], units: Mapping[str, str]
) -> Path:
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
