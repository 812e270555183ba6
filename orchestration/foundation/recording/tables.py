"""Signals and events as Parquet files, a row group for each chunk."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import instants_of, seconds
from orchestration.foundation.recording.recording import KINDS, About, Chunk, Events, Recording

SIGNALS, EVENTS = "signals.parquet", "events.parquet"
_EVENT = pa.schema(
    [
        pa.field("time", pa.float64(), metadata={"unit": "s"}),
        ("event", pa.string()),
        ("what", pa.string()),
        ("sample", pa.int64()),
    ]
)


class ToFolder:
    """A recorder that writes each chunk to the files of a folder when it is received."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._about: About = {}
        self._writers: tuple[Any, Any] | None = None

    def describe(self, about: About) -> None:
        """As `Recorder`; it goes into the metadata of the columns."""
        self._about = about

    def begin(self, columns: tuple[str, ...]) -> None:
        """As `Recorder`."""
        self._writers = (
            pq.ParquetWriter(self.folder / SIGNALS, _signals_schema(columns, self._about), write_page_checksum=True),
            pq.ParquetWriter(self.folder / EVENTS, _EVENT, write_page_checksum=True),
        )

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""
        assert self._writers is not None
        signals, events = self._writers
        signals.write_table(_signals_table(chunk))
        events.write_table(_events_table(chunk.events))

    def finish(self) -> "InFolder":
        """As `Recorder`; the files are complete then."""
        for writer in self._writers or ():
            writer.close()
        self._writers = None
        return InFolder(self.folder)


class InFolder:
    """A recording in the files of a folder, read a chunk at a time.

    Raises `UsageError` for files that are not as they were written; damage within a chunk is found when it is read.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with _open(folder / SIGNALS) as signals, _open(folder / EVENTS) as events:
            names = signals.schema_arrow.names
            if "time" not in names:
                raise UsageError(f"{folder / SIGNALS}: no column time; expected those of a run")
            _expect_schema(folder / SIGNALS, signals, _signals_schema(names, {}))
            _expect_schema(folder / EVENTS, events, _EVENT)
            self._count: int = signals.metadata.num_rows
            if signals.num_row_groups != events.num_row_groups:
                raise UsageError(f"{folder}: expected as many groups of events as of rows")
            self.columns = tuple(names)

    def __len__(self) -> int:
        return self._count

    def chunks(self, columns: Collection[str] | None = None) -> Iterator[Chunk]:
        """As `Recording`."""
        names = tuple(name for name in self.columns if columns is None or name in columns)
        with _open(self._folder / SIGNALS) as signals, _open(self._folder / EVENTS) as events:
            for group in range(signals.num_row_groups):
                table = _group(self._folder / SIGNALS, signals, group, [*names])
                yield Chunk(
                    columns=names,
                    rows=np.column_stack([_values(table[name]) for name in names]),
                    events=_events(self._folder / EVENTS, _group(self._folder / EVENTS, events, group, _EVENT.names)),
                )


def _open(path: Path) -> Any:
    """A Parquet file whose pages are checked against their checksums."""
    try:
        return pq.ParquetFile(path, page_checksum_verification=True)
    except Exception as error:  # of several undocumented types
        raise UsageError(f"{path}: expected a Parquet file, as it was written: {error}") from error


def _group(path: Path, file: Any, group: int, names: Collection[str]) -> Any:
    """The columns `names` of one row group, without gaps."""
    try:
        table = file.read_row_group(group, names)
        table.validate(full=True)
    except Exception as error:
        raise UsageError(f"{path}: expected a Parquet file, as it was written: {error}") from error
    if any(column.null_count for column in table.columns):
        raise UsageError(f"{path}: expected columns without gaps")
    if "time" in names and not np.isfinite(_values(table["time"])).all():
        raise UsageError(f"{path}: expected finite times")
    return table


def _expect_schema(path: Path, file: Any, schema: Any) -> None:
    if not file.schema_arrow.equals(schema):
        expected = ", ".join(f"{field.name} ({field.type})" for field in schema)
        raise UsageError(f"{path}: expected the columns {expected}, in this order")


def copy(recording: Recording, folder: Path, about: About) -> None:
    """Write the files of `folder`, with units and descriptions in the metadata of the columns."""
    recorder = ToFolder(folder)
    recorder.describe(about)
    recorder.begin(recording.columns)
    for chunk in recording.chunks():
        recorder.take(chunk)
    recorder.finish()


def write_signals(file: BinaryIO, recording: Recording, about: About) -> None:
    """Write all signals, a float64 column each, with unit and description in its metadata."""
    with pq.ParquetWriter(file, _signals_schema(recording.columns, about), write_page_checksum=True) as writer:
        for chunk in recording.chunks():
            writer.write_table(_signals_table(chunk))


def schemas(columns: Iterable[str]) -> tuple[Any, Any]:
    """The Arrow schemas of signals with these columns and of events."""
    return _signals_schema(columns, {}), _EVENT


def both(chunk: Chunk) -> tuple[Any, Any]:
    """A chunk as Arrow tables: its signals, and its events."""
    return _signals_table(chunk), _events_table(chunk.events)


def _signals_schema(columns: Iterable[str], about: About) -> Any:
    return pa.schema([pa.field(name, pa.float64(), metadata=dict(about.get(name, {}))) for name in columns])


def _signals_table(chunk: Chunk) -> Any:
    columns = [_numbers(values) for values in chunk.signals.values()]
    return pa.Table.from_arrays(columns, schema=_signals_schema(chunk.columns, {}))


def _events_table(events: Events) -> Any:
    """`time` [s], `event`, `what` and `sample`, in order of time."""
    time, kind, what, sample = events.table.T
    columns = (_numbers(seconds(time)), _texts(KINDS, kind), _texts(events.names, what), _numbers(sample))
    return pa.Table.from_arrays(list(columns), schema=_EVENT)


def _numbers(values: npt.NDArray[Any]) -> Any:
    """An Arrow array over the same memory; `pa.array` would load pandas to check for its types."""
    values = np.ascontiguousarray(values)
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(values)])


def _texts(words: Sequence[str], places: Integers) -> Any:
    """An Arrow array of the words at `places`."""
    encoded = [word.encode() for word in words]
    ends = np.cumsum(np.array([0, *map(len, encoded)])[places + 1], dtype=np.int32)
    content = b"".join([encoded[place] for place in places.tolist()])
    offsets = np.concatenate([np.zeros(1, np.int32), ends])
    return pa.Array.from_buffers(pa.string(), len(places), [None, pa.py_buffer(offsets), pa.py_buffer(content)])


def _events(path: Path, table: Any) -> Events:
    kinds, kind = _places(table["event"])
    if not set(kinds) <= set(KINDS):
        raise UsageError(f"{path}: expected events that are one of {', '.join(KINDS)}")
    names, what = _places(table["what"])
    time = instants_of(_values(table["time"]))
    kind = np.array([KINDS.index(word) for word in kinds], dtype=np.int64)[kind]
    return Events(names, np.column_stack([time, kind, what, _values(table["sample"])]))


def _values(column: Any) -> npt.NDArray[Any]:
    """The numbers of a column without gaps; its own `to_numpy` would load pandas."""
    return np.from_dlpack(column.combine_chunks())


def _places(texts: Any) -> tuple[tuple[str, ...], Integers]:
    """The distinct texts of a column, and the index of each row in them."""
    encoded = texts.combine_chunks().dictionary_encode()
    return tuple(encoded.dictionary.to_pylist()), np.from_dlpack(encoded.indices).astype(np.int64)
