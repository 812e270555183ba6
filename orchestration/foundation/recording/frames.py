"""A recording as pandas tables, and as CSV with units in brackets, as in `plant.position.x [m]`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from fmu_kit.new_files import new_files
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.basics.unit_algebra import in_brackets
from orchestration.foundation.recording import tables
from orchestration.foundation.recording.recording import KINDS, About, Recording, events_of, rows_of

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
