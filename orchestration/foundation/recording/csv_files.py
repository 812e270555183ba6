"""A recording as CSV: a head of names with units in brackets, as in `plant.position.x [m]`, then numbers."""

from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import csv

from fmu_kit.new_files import new_files
from orchestration.foundation.basics.unit_algebra import in_brackets
from orchestration.foundation.recording import tables
from orchestration.foundation.recording.frames import units_of
from orchestration.foundation.recording.recording import About, Recording

SIGNALS, EVENTS = "signals.csv", "events.csv"


def write(recording: Recording, about: About, folder: Path) -> list[Path]:
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
