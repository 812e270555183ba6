"""Signals and events as Parquet files."""

from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from orchestration.master import Event
from orchestration.simulator import Floats
from orchestration.wiring import POSITION_REFERENCE


def write_signals(path: Path | BinaryIO, columns: tuple[str, ...], rows: Floats, desired: Floats) -> None:
    """One column each for the recorded values (n, m) and for P_d (n, 3), all float64."""
    arrays = {name: rows[:, i] for i, name in enumerate(columns)}
    arrays |= {name: desired[:, i] for i, name in enumerate(POSITION_REFERENCE)}
    pq.write_table(pa.table(arrays), path)


def read_signals(path: Path) -> tuple[tuple[str, ...], Floats, Floats]:
    """Columns, rows (n, m) and P_d (n, 3) as they were written."""
    table = pq.read_table(path)
    columns = tuple(name for name in table.column_names if name not in POSITION_REFERENCE)
    return columns, _matrix(table, columns), _matrix(table, POSITION_REFERENCE)


def _matrix(table: pa.Table, names: tuple[str, ...]) -> Floats:
    return np.column_stack([table[name].to_numpy() for name in names])


def write_events(path: Path, events: tuple[Event, ...]) -> None:
    """`time` [s], `event`, `what` and `sample`, in order of time."""
    table = {
        "time": pa.array([event.time / 1e9 for event in events], pa.float64()),
        "event": pa.array([event.kind for event in events], pa.string()),
        "what": pa.array([event.what for event in events], pa.string()),
        "sample": pa.array([event.sample for event in events], pa.int64()),
    }
    pq.write_table(pa.table(table), path)


def read_events(path: Path) -> tuple[Event, ...]:
    """The events as they were written."""
    table = pq.read_table(path).to_pylist()
    return tuple(Event(round(row["time"] * 1e9), row["event"], row["what"], row["sample"]) for row in table)
