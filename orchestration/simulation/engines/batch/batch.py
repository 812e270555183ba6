"""A batch: as many runs of one shape as there are SIMD lanes, from their start values to their results."""

import ctypes
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from orchestration.foundation.basics.c_structures import address
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.foundation.basics.times import nanoseconds, seconds
from orchestration.simulation.engines.batch.arrays import BatchArrays, BatchStructures, aligned
from orchestration.simulation.engines.batch.folds import combined
from orchestration.simulation.engines.batch.initialisation import Initialisation
from orchestration.simulation.engines.batch.run_numbers import NO_COLUMNS, ParameterColumns, RunNumbers
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import source_values
from orchestration.simulation.engines.sources import SourceValues
from orchestration.simulation.engines.structures import structures
from orchestration.systems.expressions.over_run import STOP_TIME
from orchestration.systems.expressions.syntax import Call
from orchestration.systems.schedule.common_timetable import Instants, Span
from orchestration.systems.schedule.schedule_cache import RunSchedule, ScheduleCache, ScheduleKey
from orchestration.systems.schedule.streams import NOISE, Streams
from orchestration.systems.system.model import System

MAX_ROWS = 2**20
"""Largest number of rows of a run that are recorded"""
_CACHED_SOURCE_VALUES = 64
"""Largest number of spans of which the values of sources are cached"""


@dataclass(frozen=True, kw_only=True)
class BatchResult:
    """The results of the runs of a batch, lane by lane."""

    outcome: Integers
    time: Integers
    """Time of divergence [ns]"""
    component: Integers
    steps: Integers
    doubtful: Booleans
    """Whether a value was not a number, or one of a component between its points: another engine repeats such a run"""
    reductions: Mapping[Call, Floats]
    """NaN where there is no value"""
    signals: Sequence[Floats]
    """the recorded rows of each run, the time [s] first; empty if nothing is recorded"""


@dataclass(frozen=True, kw_only=True)
class Group:
    """Runs that are simulated together, at most as many as there are lanes."""

    systems: Sequence[System]
    timings: Sequence[ScheduleKey]
    parameters: ParameterColumns = field(default_factory=lambda: NO_COLUMNS)
    """Parameters of each run, overriding those of its system"""


@dataclass(kw_only=True)
class LaneRun:
    """The state of one lane during a run."""

    seen: list[SourceValues]
    given: list[SourceValues]
    source_key: Hashable
    """Everything that determines the values of its sources"""
    noise: Mapping[int, np.random.Generator]
    """Streams of the connections that have some"""
    arrays: list[Any] = field(default_factory=list)
    """Arrays whose addresses C has"""


@dataclass(kw_only=True)
class Track:
    """Runs that share a schedule."""

    lanes: list[int]
    spans: Iterator[Span]
    ahead: Span | None
    now: Integers
    """Time that each component has reached [ns]"""
    same_sources: bool
    """Whether the sources of all of them have the same values"""
    span: Span | None = None


_SourceTables = tuple[tuple[Floats, Floats], tuple[int, int]]
"""Values of sources for expressions and for inputs at some instants, and their addresses"""


class Batch:
    """Memory for the runs of a shape, used for one group of runs after another."""

    def __init__(self, shape: Shape, schedules: ScheduleCache) -> None:
        self._shape, self._schedules, self._c = shape, schedules, structures(shape.lanes)
        self.arrays = BatchArrays.of(shape)  # before the loop is compiled: it refuses what has no kernel
        self.numbers = RunNumbers(shape)
        self._library = shape.library
        self._structures = BatchStructures(shape, self.arrays)
        self._loop, self._address = self._structures.loop, ctypes.addressof(self._structures.loop)
        self._initialisation = Initialisation(shape, self.arrays, self._structures, self.numbers)
        self._read = [wanted.copy() for wanted in self.arrays.wanted]
        self._source_values: OrderedDict[Hashable, _SourceTables] = OrderedDict()
        self._rows: Floats | None = None
        self._runs: Sequence[LaneRun] = ()
        self._tracks: Sequence[Track] = ()

    def __del__(self) -> None:
        if hasattr(self, "_address"):
            self._library.free_all(self._address)

    # -- a group of runs -------------------------------------------------------------------------------------------

    def run(self, group: Group, record: Sequence[str] | None = None) -> BatchResult:
        """Simulate a group of runs; `record` are the columns that are recorded, besides the time."""
        self.numbers.columns = group.parameters
        reductions: Mapping[Call, Floats] = {}
        for _ in range(self._shape.passes):
            result = self._run_once(group, reductions, record)
            reductions = result.reductions
        return result

    def _run_once(self, group: Group, known: Mapping[Call, Floats], record: Sequence[str] | None) -> BatchResult:
        self._set_out(group, known)
        recorded = self._record(record, len(group.systems))
        self._call(self._library.run)
        return self._result(group.systems, recorded)

    def _set_out(self, group: Group, known: Mapping[Call, Floats]) -> None:
        """Set everything to the start of a group of runs; `known` are reductions of a pass before."""
        systems, timings = group.systems, group.timings
        loop, count = self._loop, len(systems)
        runs = [self._run(lane, system) for lane, system in enumerate(systems)]
        self._clear()
        loop.alive, loop.no_memory = (1 << count) - 1, 0
        schedules = {
            timing: self._schedules.of(id(self._shape), timing, systems[timings.index(timing)])
            for timing in dict.fromkeys(timings)
        }
        self._initialisation.put_values(systems, known, [schedules[timing].first_samples for timing in timings])
        wrong = self._initialisation.exchange([run.given for run in runs])
        for lane in np.flatnonzero(wrong[:count]).tolist():
            loop.outcome[lane] = self._c.REFUSED
            loop.alive &= ~(1 << lane)
        self._runs, self._tracks = runs, self._tracks_of(runs, timings, schedules)
        loop.track_count = len(self._tracks)
        for i, track in enumerate(self._tracks):
            into = self._structures.tracks[i]
            into.now, into.lanes = address(track.now), sum(1 << lane for lane in track.lanes)
            into.stop, into.one_for_all = nanoseconds(systems[track.lanes[0]].stop_time), track.same_sources
            self._next_span(i)

    def _clear(self) -> None:
        """Reset the state to that before the first instant."""
        self._library.clear(self._address)
        self.arrays.state[:] = np.array(self._shape.expressions.states)[:, None]
        self._loop.doubtful = 0
        for name in ("outcome", "outcome_component", "outcome_time", "steps", "record_counts"):
            getattr(self._loop, name)[:] = [0] * self._shape.lanes

    def _call(self, run: Callable[[int], int]) -> int:
        """What C returns, once it needs no more spans."""
        while (code := run(self._address)) == self._c.NEXT_WINDOW:
            self._next_span(self._loop.track)
        if code == self._c.NO_MEMORY:
            raise QuadcosimError("a batch of runs: expected memory for the messages that are on their way")
        return code

    def _result(self, systems: Sequence[System], recorded: Sequence[Floats]) -> BatchResult:
        loop, count, table = self._loop, len(systems), self.arrays.reductions
        self._library.values_of_reductions(self._address, address(table))
        places = {own: i for i, own in enumerate(self._shape.expressions.folds.values)}
        values = {call: table[places[own], :count].copy() for call, own in self._shape.calls.items()}
        for call, own in self._shape.calls.items():
            if call.function == "growth_share":
                values[call] = self._growth(call, own, values)
        outcome, time, component, steps = (
            np.array(getattr(loop, name)[:count]) for name in ("outcome", "outcome_time", "outcome_component", "steps")
        )
        doubtful = np.array([loop.doubtful >> lane & 1 for lane in range(count)], dtype=np.bool_)
        return BatchResult(
            outcome=outcome, time=time, component=component, steps=steps, doubtful=doubtful,
            reductions={call: np.where(np.isfinite(value), value, np.nan) for call, value in values.items()},
            signals=[rows[: loop.record_counts[lane]] for lane, rows in enumerate(recorded)],
        )  # fmt: skip

    def _growth(self, call: Call, own: Call, values: Mapping[Call, Floats]) -> Floats:
        folds, count = self._shape.expressions.folds, len(next(iter(values.values())))
        numbers = dict(zip((*self._shape.numbers, STOP_TIME), self.arrays.numbers[:, :count]))
        ((least, none),) = combined([call.arguments[1]], values, numbers, count)
        floor, grown = aligned(1, self._shape.lanes), aligned(1, self._shape.lanes)
        floor[0, :count] = np.where(none, np.nan, least)
        self._library.grown(self._address, folds.kept[own], address(floor), address(grown))
        steps = self.arrays.state[folds.steps[own], :count]
        return np.where((steps > 0) & ~none, grown[0, :count] / np.where(steps > 0, steps, np.nan), np.nan)

    def _run(self, lane: int, system: System) -> LaneRun:
        streams, parameters = Streams(system.seed, system.streams), self.numbers.parameters(lane, system)
        values_of = {name: source_values(system, name, parameters, streams) for name in system.sources}
        return LaneRun(
            seen=[values_of[name] for name in self._shape.seen],
            given=[values_of[name] for name, source in system.sources.items() if source.to],
            source_key=self.numbers.source_key(lane, system),
            noise={
                i: streams.of(f"connections.{x.name}", NOISE)
                for i, x in enumerate(system.connections)
                if any(x.noise.values())
            },
        )

    # -- schedules -------------------------------------------------------------------------------------------------

    def _tracks_of(
        self, runs: Sequence[LaneRun], timings: Sequence[ScheduleKey], schedules: Mapping[ScheduleKey, RunSchedule]
    ) -> list[Track]:
        tracks = []
        for timing, schedule in schedules.items():
            lanes = [lane for lane, own in enumerate(timings) if own == timing]
            tracks.append(Track(
                lanes=lanes, spans=schedule.spans, ahead=next(schedule.spans, None),
                now=np.zeros(len(self._shape.names), dtype=np.int64),
                same_sources=len({runs[lane].source_key for lane in lanes}) == 1,
            ))  # fmt: skip
        return tracks

    def _next_span(self, number: int) -> None:
        """Hand the next span of a track to C."""
        track, runs, into = self._tracks[number], self._runs, self._structures.tracks[number]
        span = track.span = track.ahead
        into.count, into.more = 0, 0
        track.ahead = None if span is None else next(track.spans, None)
        into.last_window = track.ahead is None
        if span is None:
            return
        c_span = self._c.Span(end=span.end)
        for name in ("regular", "own"):
            instants: Instants = getattr(span, name)
            times, stepped = instants.addresses
            setattr(c_span, name, self._c.Instants(times=times, stepped=stepped, count=len(instants)))
        for name in ("posted", "measured", "arrivals", "samples"):
            setattr(c_span, name, span.address_of(name))
            setattr(c_span, f"{name}_count", len(getattr(span, name)))
        c_span.exchanged, c_span.sampled = span.address_of("exchanged"), span.address_of("sampled")
        into.span = c_span
        for lane in track.lanes[:1] if track.same_sources else track.lanes:
            run = runs[lane]
            regular, own = (self._values_at(run, instants) for instants in (span.regular, span.own))
            run.arrays = [regular, own]
            (into.seen[lane], into.given[lane]), (into.seen_own[lane], into.given_own[lane]) = regular[1], own[1]
        for lane in track.lanes:
            self._draw_noise(lane, runs[lane], span)

    def _values_at(self, run: LaneRun, instants: Instants) -> _SourceTables:
        """The values of sources at some instants; those that runs have in common are computed once."""
        key = instants, run.source_key
        if key not in self._source_values:
            t = seconds(instants.times)
            tables = (
                np.ascontiguousarray(np.column_stack([values.over(t) for values in run.seen] or [t[:, None]])),
                np.ascontiguousarray(np.column_stack([values.at_each(t) for values in run.given] or [t[:, None]])),
            )
            self._source_values[key] = tables, (address(tables[0]), address(tables[1]))
            while len(self._source_values) > _CACHED_SOURCE_VALUES:
                self._source_values.popitem(last=False)
        self._source_values.move_to_end(key)
        return self._source_values[key]

    def _draw_noise(self, lane: int, run: LaneRun, span: Span) -> None:
        for i, stream in run.noise.items():
            count = span.count_of(i, self._shape.wires.table(i))
            noise = stream.standard_normal((count, len(self._shape.ends[i].start)))
            run.arrays.append(noise)
            self._structures.channels[i].noise[lane] = address(noise)

    def _record(self, columns: Sequence[str] | None, count: int) -> list[Floats]:
        """Memory for the rows of some columns of `count` runs; None: no rows are recorded."""
        loop, arrays = self._loop, self.arrays
        loop.recorded_count, loop.record_limit = len(columns or ()), 0 if columns is None else MAX_ROWS
        places = [self._shape.place(column) for column in columns or ()]
        for wanted, read in zip(arrays.wanted, self._read):
            wanted[:] = read
        for i, place in places:
            arrays.wanted[i][place] = True
        if columns is None:
            return []
        self._recorded = np.array([address(arrays.memories[i][place]) for i, place in places], dtype=np.int64)
        loop.recorded = address(self._recorded)
        if self._rows is None or self._rows.shape[2] != len(columns) + 1:
            self._rows = aligned(self._shape.lanes, MAX_ROWS, len(columns) + 1)
        rows = [*self._rows[:count]]
        for lane, table in enumerate(rows):
            loop.records[lane] = address(table)
        return rows
