"""The scheduler in C, with the same notes as the one in Python, to the bit; compiled once, and cached."""

import ctypes
import functools
import weakref
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.foundation.basics.c_structures import compiled_library
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import Constant
from orchestration.systems.computers import note
from orchestration.systems.computers import parts as constants
from orchestration.systems.computers.parts import (
    AT_ONCE,
    IS_CONSTANT,
    LATER,
    Carrier,
    Leg,
    NetworkLink,
    Parts,
    Processor,
    ScheduledFrame,
    ScheduledTask,
    Stream,
)
from orchestration.systems.computers.scheduler import Scheduler

SOURCE = Path(__file__).with_name("scheduler.c")
_NO_MEMORY = -1
"""The result of C in place of a number of notes"""
_ROOM = 4096
"""Notes that C collects until Python takes them"""
_TABLES: dict[str, tuple[str, ...]] = {
    "PROCESSOR": Processor._fields,
    "TASK": ScheduledTask._fields,
    "CARRIER": (*Carrier._fields, "releases_end"),
    "MESSAGE": ScheduledFrame._fields,
    "LEG": ("message", "place", "is_last", *Leg._fields),
    "LINK": NetworkLink._fields,
}
"""The columns of each table; nested parts are replaced by the index of the first"""
_KINDS = ("PROCESSORS", "TASKS", "CARRIERS", "MESSAGES", "LEGS", "LINKS")
_DRAW, _TAKE = (ctypes.CFUNCTYPE(None, ctypes.c_int64) for _ in range(2))


class _Arguments(ctypes.Structure):
    _fields_ = (
        ("stop", ctypes.c_int64),
        ("counts", ctypes.c_int64 * len(_KINDS)),
        *(
            (name, ctypes.c_void_p)
            for name in ("processors", "tasks", "carriers", "releases", "messages", "legs", "links")
        ),
        ("numbers", ctypes.c_void_p),
        ("used", ctypes.c_void_p),
        ("notes", ctypes.c_void_p),
        ("room", ctypes.c_int64),
        ("note_count", ctypes.c_int64),
        ("kept", ctypes.c_void_p),
        ("draw", _DRAW),
        ("take", _TAKE),
    )


def scheduler(parts: Parts, kinds: Collection[int] = note.ALL_KINDS) -> "Scheduler | CompiledScheduler":
    """A scheduler of `parts` that keeps notes of these `kinds`; in C where there is a compiler."""
    try:
        _library()
    except QuadcosimError:
        return Scheduler(parts, kinds)
    return CompiledScheduler(parts, kinds)


class CompiledScheduler:
    """The scheduler in C; raises `QuadcosimError` without a compiler."""

    def __init__(self, parts: Parts, kinds: Collection[int] = note.ALL_KINDS) -> None:
        self._library, self._parts = _library(), parts
        self._tables = tables = _tables(
            tuple(parts.processors),
            tuple(parts.tasks),
            tuple(parts.carriers),
            tuple(parts.messages),
            tuple(parts.links),
        )
        self._numbers, self._notes = _Numbers(parts.streams), _Notes()
        self._kept = np.array([kind in kinds for kind in range(len(note.ALL_KINDS))], dtype=np.uint8)
        self._draw, self._take = _DRAW(self._numbers.draw), _TAKE(self._notes.collect)
        arguments = _Arguments(
            stop=parts.stop,
            counts=tuple(len(tables[name.lower()]) for name in _KINDS),
            **{name: table.ctypes.data for name, table in self._tables.items()},
            numbers=self._numbers.rows.ctypes.data,
            used=self._numbers.used.ctypes.data,
            kept=self._kept.ctypes.data,
            notes=self._notes.room.ctypes.data,
            room=_ROOM,
            draw=self._draw,
            take=self._take,
        )
        self._handle = self._library.scheduler_new(ctypes.byref(arguments))
        self._expect(bool(self._handle))
        weakref.finalize(self, self._library.scheduler_free, self._handle)

    @property
    def next_instant(self) -> int:
        """As in Python."""
        return int(self._library.scheduler_next_instant(self._handle))

    def run(self, until: int) -> None:
        """As in Python."""
        count = int(self._library.scheduler_run(self._handle, until))
        self._expect(count != _NO_MEMORY)
        if count < _NO_MEMORY:
            raise self._parts.queue_overflow(-2 - count)
        self._notes.collect(count)

    def take_notes(self) -> Integers:
        """As in Python."""
        return self._notes.take_notes()

    def _expect(self, has_memory: bool) -> None:
        if self._numbers.failure is not None:
            raise self._numbers.failure
        if not has_memory:
            raise MemoryError("no memory for the jobs and frames that wait")


class _Numbers:
    """The streams as C reads them: a row of each, and the number of its used values.

    It does not refer to its scheduler, so that both are freed at once.
    """

    def __init__(self, streams: Sequence[Stream]) -> None:
        self._streams = streams
        self._table = np.empty((len(streams), AT_ONCE), dtype=np.int64)
        self.rows = self._table.ctypes.data + self._table.strides[0] * np.arange(len(streams))
        self.used = np.full(len(streams), AT_ONCE, dtype=np.int64)
        for i, stream in enumerate(streams):
            if isinstance(stream, Constant):
                self._table[i, 0], self.used[i] = stream.value, IS_CONSTANT
        self.failure: BaseException | None = None

    def draw(self, stream: int) -> None:
        """Draw more numbers of a stream; an exception is kept, as none can pass through C."""
        try:
            self._table[stream] = self._streams[stream](AT_ONCE)
        except BaseException as error:
            self.failure = error
            self._table[stream] = LATER // 2  # nothing happens any more


class _Notes:
    """The notes from C, likewise."""

    def __init__(self) -> None:
        self.room = np.empty((_ROOM, note.COLUMNS), dtype=np.int64)
        self._batches: list[Integers] = []

    def collect(self, count: int) -> None:
        """Copy the notes that C has made."""
        self._batches.append(self.room[:count].copy())

    def take_notes(self) -> Integers:
        """All notes since the last call."""
        found = self._batches[0] if len(self._batches) == 1 else np.concatenate([self.room[:0], *self._batches])
        self._batches.clear()
        return found


@functools.lru_cache(8)
def _tables(
    processors: tuple[Processor, ...], tasks: tuple[ScheduledTask, ...], carriers: tuple[Carrier, ...],
    messages: tuple[ScheduledFrame, ...], links: tuple[NetworkLink, ...],
) -> dict[str, Integers]:  # fmt: skip
    """The tables of parts by name; cached, as many runs share them."""
    ends = np.cumsum([0, *(len(each.releases) for each in carriers)])
    tables = {
        "processors": processors,
        "tasks": tasks,
        "carriers": [(*each._replace(releases=ends[i]), ends[i + 1]) for i, each in enumerate(carriers)],
        "releases": [i for each in carriers for i in each.releases],
        "messages": [each._replace(legs=0) for each in messages],  # type: ignore[arg-type]
        "legs": [
            (m, place, place == len(of.legs) - 1, *leg)
            for m, of in enumerate(messages)
            for place, leg in enumerate(of.legs)
        ],
        "links": links,
    }
    return {name: np.array(rows, dtype=np.int64) for name, rows in tables.items()}


@functools.cache
def _library() -> Any:
    """scheduler.c as a library; raises `QuadcosimError`, naming the reason, if there is none."""
    sources = {"scheduler.c": SOURCE.read_bytes(), "constants.h": _constants().encode()}
    library = compiled_library("scheduler", sources, options=("-O3",))
    for name in ("size_of_arguments", "scheduler_next_instant", "scheduler_run"):
        getattr(library, name).restype = ctypes.c_int64
    library.scheduler_new.restype = ctypes.c_void_p
    library.scheduler_new.argtypes = (ctypes.c_void_p,)
    library.scheduler_free.restype, library.scheduler_free.argtypes = None, (ctypes.c_void_p,)
    library.scheduler_next_instant.argtypes = (ctypes.c_void_p,)
    library.scheduler_run.argtypes = (ctypes.c_void_p, ctypes.c_int64)
    assert library.size_of_arguments() == ctypes.sizeof(_Arguments)
    return library


def _constants() -> str:
    """The constants and columns of parts.py and note.py as a C header."""
    defined = {**vars(constants), **vars(note)}
    found = {name: value for name, value in defined.items() if name.isupper() and isinstance(value, int)}
    found |= {name: i for i, name in enumerate(_KINDS)} | {"PART_KINDS": len(_KINDS)}
    for table, columns in _TABLES.items():
        found |= {f"{table}_{column.upper()}": i for i, column in enumerate(columns)}
        found[f"{table}_COLUMNS"] = len(columns)
    return "".join(f"#define {name} (INT64_C({value}))\n" for name, value in found.items())
