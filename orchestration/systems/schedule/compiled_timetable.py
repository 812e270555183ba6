"""The timetable in C (`timetable.h`), with the same instants as the one in Python, to the bit; compiled once."""

import ctypes
import functools
import weakref
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.c_structures import (
    address,
    compiled_library,
    constants,
    declared,
    expect_same_sizes,
)
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.times import nanoseconds
from orchestration.systems.schedule.common_timetable import CommonTimetable, Instants, Span
from orchestration.systems.schedule.instant_arrays import Schedule
from orchestration.systems.schedule.lateness_and_loss import whole
from orchestration.systems.schedule.plan import FixedStep
from orchestration.systems.schedule.streams import DELAY, DELAY_JITTER, HIGHEST, JITTER, LOSS, LOWEST, NORMAL, Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.choices import Spread
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution, Varying, highest
from orchestration.systems.system.model import System

HEADER = Path(__file__).with_name("timetable_structures.h")
FILES = (Path(__file__).with_name("timetable.c"), Path(__file__).with_name("timetable.h"), HEADER)
_MOST_CONTINUOUS = 64
"""Components in continuous time: C has a bit for each"""


@functools.cache
def _structures() -> Any:
    text = HEADER.read_text(encoding="utf-8")
    return SimpleNamespace(**constants(text), **declared(text))


@functools.cache
def library() -> Any:
    """timetable.c as a library; raises `QuadcosimError`, naming the reason, if there is none."""
    return loaded({path.name: path.read_bytes() for path in FILES})


def loaded(sources: dict[str, bytes]) -> Any:
    """Such a library from the texts of its files; raises as `library`."""
    made = compiled_library("timetable", sources, mathematics="libm")
    expect_same_sizes(made, declared(HEADER.read_text(encoding="utf-8")))
    pointer, number = ctypes.c_void_p, ctypes.c_int64
    made.timetable_new.restype, made.timetable_new.argtypes = pointer, (pointer, pointer, number, pointer)
    made.timetable_draw.argtypes = (pointer, number, pointer)
    made.timetable_lay_out.restype, made.timetable_lay_out.argtypes = number, (pointer, pointer, pointer)
    made.timetable_schedule.restype, made.timetable_schedule.argtypes = number, (pointer,)
    made.timetable_free.restype, made.timetable_free.argtypes = None, (pointer,)
    return made


def timetable(
    system: System,
    streams: Streams,
    fixed: Mapping[str, FixedStep] | None = None,
    common: CommonTimetable | None = None,
) -> Timetable:
    """As `Timetable`, in C where there is no `reason_unavailable`."""
    common = common or CommonTimetable(system, fixed or {})
    kind = Timetable if reason_unavailable(common) else CompiledTimetable
    return kind(system, streams, common=common)


def reason_unavailable(common: CommonTimetable) -> str | None:
    """Why a timetable is drawn in Python, in a line; None: it is drawn in C."""
    if common not in _reasons:
        _reasons[common] = _reason(common)
    return _reasons[common]


_reasons: weakref.WeakKeyDictionary[CommonTimetable, str | None] = weakref.WeakKeyDictionary()


def _reason(common: CommonTimetable) -> str | None:
    system = common.system
    if system.uses_scheduler:
        return "the scheduler computes instants of computers and networks"
    if common.fixed:
        return f"components.{next(iter(common.fixed))} takes steps of one length only"
    if len(common.continuous) > _MOST_CONTINUOUS:
        return f"more than {_MOST_CONTINUOUS} components are in continuous time"
    for name, grid in common.grids.items():
        if grid.in_parts() is None:
            return f"components.{name}: its instants are no fractions of a nanosecond that fit into 62 bits"
    try:
        library()
    except QuadcosimError as error:
        return str(error)
    return None


class CompiledTimetable(Timetable):
    """A timetable that C draws."""

    def _set_out(self, streams: Streams) -> Mapping[str, int]:
        self._library, self._outline = library(), _outline_of(self._common, streams)
        self._counts = _structures().Counts()
        seed, names = np.array(_words(streams.seed), dtype=np.uint32), self._plan.sampled
        first = np.empty(len(names), dtype=np.int64)
        self._handle = self._library.timetable_new(self._outline.address, address(seed), len(seed), address(first))
        self._expect(bool(self._handle))
        return dict(zip(names, first.tolist(), strict=True))

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.timetable_free(self._handle)

    def _drawn(self, begin: int, end: int) -> Span:
        counts, continuous = self._counts, len(self._common.continuous)
        self._expect(self._library.timetable_draw(self._handle, end, ctypes.byref(counts)))
        sizes = [getattr(counts, name) * columns for name, columns in _COLUMNS.items()]
        steps = counts.own * continuous
        memory = np.empty(sum(sizes) + -(-steps // 8), dtype=np.int64)
        where = address(memory)
        rows = self._library.timetable_lay_out(self._handle, where, ctypes.byref(counts))
        self._expect(rows >= 0)
        tables, addresses, place = {}, {}, 0
        for (name, columns), size in zip(_COLUMNS.items(), sizes):
            table = memory[place : place + size]
            tables[name] = table if columns == 1 else table.reshape(-1, columns)
            addresses[name] = where + place * memory.itemsize
            place += size
        stepped = memory[place:].view(np.bool_)[: rows * continuous].reshape(rows, continuous)
        own = Instants(times=tables.pop("own")[:rows], stepped=stepped)
        return Span(end=end, regular=self._common.regular(begin, end), own=own, addresses=addresses, **tables)

    def _scheduled(self, span: Span) -> Schedule:
        continuous, most = self._common.continuous, len(span.regular) + len(span.own) + 1
        table, stepped = np.empty((6, most), dtype=np.int64), np.empty(most * len(continuous), dtype=np.int64)
        columns = ("times", "stepped_at", "posted_at", "measured_at", "arrivals_at", "samples_at")
        window = _structures().Window(
            continuous=address(continuous), continuous_count=len(continuous), stepped=address(stepped),
            **{name: address(table) + i * table.strides[0] for i, name in enumerate(columns)},
        )  # fmt: skip
        for name in ("regular", "own"):
            instants: Instants = getattr(span, name)
            times, steps = instants.addresses
            setattr(window, name, times)
            setattr(window, f"{name}_stepped", steps)
            setattr(window, f"{name}_count", len(instants))
        for name in ("posted", "measured", "arrivals", "samples"):
            setattr(window, f"{name}_count", len(getattr(span, name)))
        for name in ("posted", "measured", "arrivals", "sampled"):
            setattr(window, name, span.address_of(name))
        count = self._library.timetable_schedule(ctypes.byref(window))
        table[0, count] = span.end
        return Schedule(
            **{name: table[i, : count + 1] for i, name in enumerate(columns)},
            stepped=stepped[: table[1, count]], posted=span.posted, measured=span.measured, arrivals=span.arrivals,
            samples=span.samples, exchanged=span.exchanged,
        )  # fmt: skip

    def _expect(self, has_memory: bool) -> None:
        if not has_memory:
            raise MemoryError("no memory for the samples and messages of a timetable")


_COLUMNS = {"own": 1, "sampled": 1, "samples": 5, "exchanged": 4, "posted": 4, "measured": 4, "arrivals": 4}
"""The tables of a span, of 64-bit integers"""


class _Outline:
    """All that the timetables of some runs have in common, as C reads it."""

    def __init__(self, common: CommonTimetable, streams: Streams) -> None:
        self._c, self._common, self._streams, self._kept = _structures(), common, streams, list[Any]()
        plan, connections, sender = common.plan, common.system.connections, common.sender
        routes = [self._route(i, x) for i, x in enumerate(connections)]
        clocks = [self._clock(name) for name in plan.sampled]
        names = [*common.system.components]
        posts = [
            self._c.Post(connection=j, grid=self._grid(names[i]))
            for i in common.points
            for j in plan.posted
            if sender[j] == i
        ]
        outline = self._c.Outline(
            routes=self._table(self._c.Route, routes), clocks=self._table(self._c.Clock, clocks),
            posts=self._table(self._c.Post, posts), route_count=len(routes), clock_count=len(clocks),
            post_count=len(posts), continuous_count=len(common.continuous), stop=common.stop,
        )  # fmt: skip
        self._kept.append(outline)
        self.address = ctypes.addressof(outline)

    def _route(self, i: int, x: Connection) -> Any:
        common, owner = self._common, f"connections.{x.name}"
        return self._c.Route(
            sender=common.place[common.sender[i]], receiver=common.place[common.receiver[i]],
            jacobi=x.order == "jacobi", read_ahead=i in common.plan.read_ahead,
            delay=self._times(x.delay, self._streams.key(owner, DELAY)),
            late=self._lateness(x.delay_jitter, x.jitter_distribution, self._streams.key(owner, DELAY_JITTER)),
            loss=self._losses(x.loss, x.burst_length, self._streams.key(owner, LOSS)),
        )  # fmt: skip

    def _clock(self, name: str) -> Any:
        common, connections = self._common, self._common.system.connections
        sampling = common.system.components[name].sampling
        assert sampling is not None
        incoming = [i for i in common.plan.measured if connections[i].receiver == name]
        outgoing = [i for i in common.plan.commanded if connections[i].sender == name]
        late = (connections[i] for i in incoming)
        longest = (nanoseconds(highest(x.delay)) + nanoseconds(highest(x.delay_jitter)) for x in late)
        return self._c.Clock(
            component=[*common.system.components].index(name),
            ahead=max(longest, default=0), grid=self._grid(name),
            late=self._lateness(
                sampling.jitter, sampling.jitter_distribution, self._streams.key(f"components.{name}", JITTER)
            ),
            incoming=self._array(incoming, np.int64), incoming_count=len(incoming),
            outgoing=self._array(outgoing, np.int64), outgoing_count=len(outgoing),
        )  # fmt: skip

    def _grid(self, name: str) -> Any:
        parts = self._common.grids[name].in_parts()
        assert parts is not None
        return self._c.Grid(*parts)

    def _times(self, of: Varying, key: Sequence[int]) -> Any:
        """As `lateness_and_loss.times`."""
        if not isinstance(of, Distribution):
            return self._constant(nanoseconds(of))
        if of.uniform is not None:
            least, most = map(nanoseconds, of.uniform)
            return self._varying(self._c.UNIFORM, key, least=least, most=most)
        if of.normal is not None:
            assert of.range is not None
            (least, most), (low, high) = map(nanoseconds, of.range), map(of.share, of.range)
            mean, deviation = of.normal
            return self._varying(
                self._c.CUT_NORMAL, key, least=least, most=most, mean=mean, deviation=deviation, low=low,
                width=high - low,
            )  # fmt: skip
        return self._of_table(of, key, whole(of.table()))

    def _of_table(self, of: Distribution, key: Sequence[int], values: npt.NDArray[np.int64]) -> Any:
        kind = self._c.IN_ORDER if of.order == "as recorded" else self._c.VALUES
        more: dict[str, Any] = {"values": self._array(values, np.int64), "count": len(values)}
        if of.probabilities is not None:
            kind = self._c.WEIGHTED
            more["sums"] = self._array([*accumulate(of.probabilities)], np.float64)
            more["last"] = max(i for i, share in enumerate(of.probabilities) if share > 0.0)
        return self._varying(kind, key, **more)

    def _lateness(self, jitter: Varying, spread: Spread, key: Sequence[int]) -> object:
        """As `lateness_and_loss.lateness`."""
        if isinstance(jitter, Distribution):
            return self._times(jitter, key)
        largest = nanoseconds(jitter)
        if largest == 0:
            return self._constant(0)
        match spread:
            case "uniform":
                return self._varying(self._c.UNIFORM, key, most=largest)
            case "normal":
                return self._varying(
                    self._c.NORMAL, key, most=largest, mean=NORMAL.mean, deviation=NORMAL.stdev, low=LOWEST,
                    width=HIGHEST - LOWEST,
                )  # fmt: skip

    def _losses(self, loss: Varying, burst_length: float | None, key: Sequence[int]) -> Any:
        """As `lateness_and_loss.losses`."""
        if isinstance(loss, Distribution):
            return self._of_table(loss, key, (loss.table() != 0.0).astype(np.int64))
        if loss == 0.0:
            return self._constant(0)
        if burst_length is None or loss == 1.0:
            return self._varying(self._c.BELOW, key, mean=loss)
        to_end, to_begin = 1.0 / burst_length, loss / (burst_length * (1.0 - loss))
        return self._varying(self._c.BURSTS, key, mean=loss, low=to_end, width=to_begin)

    def _constant(self, value: int) -> Any:
        return self._c.Varying(kind=self._c.CONSTANT, least=value)

    def _varying(self, kind: int, key: Sequence[int], **numbers: Any) -> Any:
        words = [word for number in key for word in _words(number)]
        return self._c.Varying(kind=kind, key=self._array(words, np.uint32), key_size=len(words), **numbers)

    def _array(self, values: Any, kind: Any) -> int:
        array = np.array(values, dtype=kind)
        self._kept.append(array)
        return address(array)

    def _table(self, kind: Any, items: Iterable[Any]) -> int:
        values = [*items]
        table = (kind * len(values))(*values)
        self._kept.append(table)
        return ctypes.addressof(table)


def _outline_of(common: CommonTimetable, streams: Streams) -> _Outline:
    key = frozenset(streams.numbered.items())
    if key not in common.outlines:
        common.outlines[key] = _Outline(common, streams)
    found = common.outlines[key]
    assert isinstance(found, _Outline)
    return found


def _words(number: int) -> list[int]:
    """A whole number as `SeedSequence` takes it: words of 32 bits, the lowest first."""
    words = [number & 0xFFFFFFFF]
    while number := number >> 32:
        words.append(number & 0xFFFFFFFF)
    return words
