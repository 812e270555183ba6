"""A batch: as many runs of one shape as there are SIMD lanes, from their start values to their results."""

import ctypes
from collections import OrderedDict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.components.fmi.values import convert_value, number_of
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.foundation.basics.times import nanoseconds, seconds
from orchestration.simulation.engines import initial
from orchestration.simulation.engines.batch.memory import Memory
from orchestration.simulation.engines.batch.shape import Ends, Shape, changes_of, ends_of
from orchestration.simulation.engines.job_numbers import job_numbers
from orchestration.simulation.engines.sources import SourceValues
from orchestration.simulation.engines.structures import address, structures
from orchestration.simulation.engines.wires import clock_of
from orchestration.simulation.engines.wiring import source_values
from orchestration.systems.expressions.over_span import STOP_TIME
from orchestration.systems.expressions.syntax import Call, names_job_measure
from orchestration.systems.schedule.schedule_cache import RunSchedule, ScheduleCache, ScheduleKey
from orchestration.systems.schedule.spans import Instants, Span
from orchestration.systems.schedule.streams import NOISE, Streams
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System

MAX_ROWS = 2**20
"""Largest number of rows of a run that are recorded"""
ParameterColumns = Mapping[str, Floats]
"""Real parameters by COMPONENT.NAME, a value for each run"""
NO_COLUMNS: ParameterColumns = MappingProxyType({})
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
    """Runs in which a value was not a number: they are repeated by another engine"""
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

    system: System
    streams: Streams
    numbers: Mapping[str, float]
    """Numbers as in `Batch.parameters`"""
    seen: list[SourceValues]
    given: list[SourceValues]
    source_key: Hashable
    """everything that determines the values of its sources"""
    noise: dict[int, np.random.Generator] = field(default_factory=dict)
    arrays: list[Any] = field(default_factory=list)
    """whose addresses C has"""


@dataclass(kw_only=True)
class Track:
    """Runs that share a schedule."""

    lanes: list[int]
    spans: Iterator[Span]
    ahead: Span | None
    now: Integers
    """Present time of each component [ns]"""
    same_sources: bool
    """whether the sources of all of them have the same values"""
    span: Span | None = None


class Batch:
    """Memory for the runs of a shape, used for one group of runs after another."""

    def __init__(self, shape: Shape, schedules: ScheduleCache, memory: Memory | None = None) -> None:
        self._shape, self._schedules, self._lanes = shape, schedules, shape.lanes
        self._memory = Memory() if memory is None else memory
        kernels = list(shape.kernels.values())  # before the loop is compiled: they refuse what has none
        self._library = shape.library
        self._source_values: OrderedDict[Hashable, tuple[Floats, Floats]] = OrderedDict()
        self._parameters = NO_COLUMNS
        self._known_job_numbers: tuple[System, Mapping[str, float]] | None = None
        self._expressions = shape.expressions
        owners = [source.trajectory for source in shape.system.sources.values() if source.trajectory is not None]
        self._trajectories = {owner: self._trajectory_parameters(owner) for owner in owners}
        self._starts = {
            name: (component_of(name), variable_of(name), variable, number_of(variable, variable.start))
            for name in (*shape.numbers, *(each for names in self._trajectories.values() for each in names))
            if not names_job_measure(name)
            for variable in [shape.variable(name)]
        }
        self.memories = [self._array(kernel.lanes.places) for kernel in kernels]
        """Memories of the components, shape (places, lanes)"""
        self._read = [shape.read(name) for name in shape.names]
        self._wanted = [read.copy() for read in self._read]
        """the same, including what is recorded in the current runs"""
        self._ends: list[Ends] = [ends_of(shape, x) for x in shape.system.connections]
        self._c = c = structures(self._lanes)
        connections = shape.system.connections
        self._of_channels = [self._arrays_of(len(x.start)) for x in connections]
        self._channels = self._structures(c.Channel, map(self._channel, range(len(connections))))
        self._ratios = [self._array(1) for _ in kernels]
        self._begins: list[Floats] = [np.zeros(self._lanes) for _ in kernels]
        self._components = self._structures(c.Component, map(self._component, range(len(kernels))))
        self._moving = self._memory.integers(self._lanes, max(1, len(shape.wires.continuous)))
        self._tracks = self._structures(c.Track, (c.Track(moving=address(each)) for each in self._moving))
        seen, fed = sum(map(len, shape.seen.values())), sum(len(s.to) for s in shape.system.sources.values())
        self._given_count = fed if shape.fed_changes else 0
        self._state = self._array(len(self._expressions.states))
        self._numbers = self._array(len(shape.numbers) + 1 + len(shape.inner))
        self._floor, self._grown = self._array(1), self._array(1)
        self._status = np.zeros(self._lanes, dtype=np.int32)
        settles = any(x.held.count or x.behind.count or x.fed_count for x in self._components)
        stays = not (settles or any(x.ahead.count for x in self._components))  # a source that jumps is fed
        self._rows: Floats | None = None
        self._kept = self._memory.structures(c.Kept, len(self._expressions.folds.kept))
        (self._batch,) = self._structures(c.Loop, [c.Loop(
            components=ctypes.addressof(self._components), channels=ctypes.addressof(self._channels),
            channel_count=len(connections),
            some_by_themselves=any(map(shape.wires.is_by_itself, shape.names)),
            settles=settles, stays=stays,
            continuous=self._indices(shape.wires.continuous), sampled=self._indices(shape.wires.sampled),
            tracks=ctypes.addressof(self._tracks), seen_count=seen, given_count=self._given_count,
            seen=address(self._array(seen)), given=address(self._array(self._given_count)),
            state=address(self._state), constants=address(self._array(len(self._expressions.folds.writer.constants))),
            numbers=address(self._numbers), kept=ctypes.addressof(self._kept),
            status=address(self._status),
        )])  # fmt: skip

        self._address = ctypes.addressof(self._batch)

    def __del__(self) -> None:
        if hasattr(self, "_address"):
            self._library.free_all(self._address)

    # -- a group of runs -------------------------------------------------------------------------------------------

    def run(self, group: Group, record: Sequence[str] | None = None) -> BatchResult:
        """Simulate a group of runs; `record` are the columns that are recorded, besides the time."""
        self._parameters = group.parameters
        reductions: Mapping[Call, Floats] = {}
        for _ in range(self._shape.passes):
            result = self._run_once(group.systems, group.timings, reductions, record)
            reductions = result.reductions
        return result

    def _run_once(
        self,
        systems: Sequence[System],
        timings: Sequence[ScheduleKey],
        known: Mapping[Call, Floats],
        record: Sequence[str] | None,
    ) -> BatchResult:
        batch, count = self._batch, len(systems)
        runs = [self._run(lane, system) for lane, system in enumerate(systems)]
        self._clear()
        batch.alive, batch.no_memory = (1 << count) - 1, 0
        schedules = {
            timing: self._schedules.of(id(self._shape), timing, systems[timings.index(timing)])
            for timing in dict.fromkeys(timings)
        }
        self._put_values(systems, known, [schedules[timing].first_samples for timing in timings])
        wrong = self._initialise(runs)
        for lane in np.flatnonzero(wrong[:count]).tolist():
            batch.outcome[lane] = self._c.REFUSED
            batch.alive &= ~(1 << lane)
        tracks = self._tracks_of(runs, timings, schedules)
        recorded = self._record(record, tracks)
        self._pass(runs, tracks)
        return self._result(systems, recorded)

    def _clear(self) -> None:
        """Reset the state to that before the first instant."""
        self._library.clear(self._address)
        self._state[:] = np.array(self._expressions.states)[:, None]
        self._batch.doubtful = 0
        for name in ("outcome", "outcome_component", "outcome_time", "steps", "record_counts"):
            getattr(self._batch, name)[:] = [0] * self._lanes

    def _pass(self, runs: Sequence[LaneRun], tracks: Sequence[Track]) -> None:
        batch = self._batch
        batch.track_count = len(tracks)
        for i, track in enumerate(tracks):
            into = self._tracks[i]
            into.now, into.lanes = self._memory.temporary_address(track.now), sum(1 << lane for lane in track.lanes)
            into.stop, into.one_for_all = nanoseconds(runs[track.lanes[0]].system.stop_time), track.same_sources
            self._next_span(i, track, runs)
        while (code := self._library.run(self._address)) == self._c.NEXT_WINDOW:
            self._next_span(batch.track, tracks[batch.track], runs)
        if code == self._c.NO_MEMORY:
            raise QuadcosimError("a batch of runs: expected memory for the messages that are on their way")

    def _result(self, systems: Sequence[System], recorded: Sequence[Floats]) -> BatchResult:
        batch, count = self._batch, len(systems)
        end = np.array([seconds(nanoseconds(system.stop_time)) for system in systems])
        states = self._state[:, :count]
        values = {call: self._expressions.folds.values[own](states, end) for call, own in self._shape.calls.items()}
        for call, own in self._shape.calls.items():
            if call.function == "growth_share":
                values[call] = self._growth(call, own, values)
        arrays = [
            np.array(getattr(batch, name)[:count]) for name in ("outcome", "outcome_time", "outcome_component", "steps")
        ]
        outcome, time, component, steps = arrays
        doubtful = np.array([batch.doubtful >> lane & 1 for lane in range(count)], dtype=np.bool_)
        return BatchResult(
            outcome=outcome, time=time, component=component, steps=steps, doubtful=doubtful,
            reductions={call: np.where(np.isfinite(value), value, np.nan) for call, value in values.items()},
            signals=[rows[: batch.record_counts[lane]] for lane, rows in enumerate(recorded)],
        )  # fmt: skip

    def _growth(self, call: Call, own: Call, values: Mapping[Call, Floats]) -> Floats:
        from orchestration.simulation.engines.batch.combining import combined

        folds = self._expressions.folds
        count = len(next(iter(values.values())))
        numbers = dict(zip((*self._shape.numbers, STOP_TIME), self._numbers[:, :count]))
        ((floor, none),) = combined([call.arguments[1]], values, numbers, count)
        self._floor[0, :count] = np.where(none, np.nan, floor)
        self._library.grown(self._address, folds.kept[own], address(self._floor), address(self._grown))
        steps = self._state[folds.steps[own], :count]
        share: Floats = np.where(
            (steps > 0) & ~none, self._grown[0, :count] / np.where(steps > 0, steps, np.nan), np.nan
        )
        return share

    # -- values at the start ---------------------------------------------------------------------------------------

    def _run(self, lane: int, system: System) -> LaneRun:
        shape = self._shape
        streams = Streams(system.seed, system.streams)
        parameters = self.parameters(lane, system)
        values_of = {name: source_values(system, name, parameters, streams) for name in system.sources}
        noisy = {
            i: streams.of(f"connections.{x.name}", NOISE)
            for i, x in enumerate(system.connections)
            if any(x.noise.values())
        }
        given = [values_of[name] for name, source in system.sources.items() if source.to]
        seen = [values_of[name] for name in shape.seen]
        return LaneRun(
            system=system, streams=streams, numbers=parameters, seen=seen, given=given,
            source_key=self._source_key(system, parameters), noise=noisy,
        )  # fmt: skip

    def numbers(self, systems: Sequence[System]) -> dict[str, Floats]:
        """Parameters and the stop time that expressions name, in each of the runs that were simulated last."""
        numbers = {
            name: np.array([self._number(lane, system, name) for lane, system in enumerate(systems)])
            for name in self._shape.numbers
        }
        return {**numbers, STOP_TIME: np.array([seconds(nanoseconds(system.stop_time)) for system in systems])}

    def parameters(self, lane: int, system: System) -> dict[str, float]:
        """The parameters that the divergence monitor and the sources of a run use."""
        names = [*self._shape.numbers, *(each for names in self._trajectories.values() for each in names)]
        return {name: self._number(lane, system, name) for name in names}

    def value(self, column: str, lane: int) -> float:
        """The value of a column at the end of a run."""
        index, place = self._shape.place(column)
        return float(self.memories[index][place, lane])

    def _trajectory_parameters(self, component: str) -> list[str]:
        variables = self._shape.models[component].variables
        return [f"{component}.{name}" for name in variables if name.startswith("trajectory.")]

    def _number(self, lane: int, system: System, name: str) -> float:
        if name in self._parameters:
            return float(self._parameters[name][lane])
        if name not in self._starts:
            return self._job_numbers(system)[name]
        owner, parameter, variable, start = self._starts[name]
        given = system.components[owner].parameters.get(parameter)
        return start if given is None else number_of(variable, given)

    def _job_numbers(self, system: System) -> Mapping[str, float]:
        """The measures of jobs that expressions name, computed once for each run."""
        if self._known_job_numbers is None or self._known_job_numbers[0] is not system:
            self._known_job_numbers = system, job_numbers(system)
        return self._known_job_numbers[1]

    def _put_values(
        self, systems: Sequence[System], known: Mapping[Call, Floats], first_samples: Sequence[Mapping[str, int]]
    ) -> None:
        """Set start values, parameters, and all that differs between lanes."""
        shape = self._shape
        for index, (name, kernel) in enumerate(shape.kernels.items()):
            memory, variables = self.memories[index], shape.models[name].variables
            has_clock = shape.models[name].has_clock
            kernel.lanes.begin(address(memory))
            for lane, system in enumerate(systems):
                component = system.components[name]
                for parameter, value in component.parameters.items():
                    variable = variables[parameter]
                    memory[variable.reference, lane] = number_of(variable, convert_value(variable, value, parameter))
                sampling = component.sampling
                if sampling is not None:
                    self._ratios[index][0, lane] = sampling.clock_ratio
                    if has_clock:
                        own = sampling.clock == "fmu"
                        memory[variables[SAMPLE_PERIOD].reference, lane] = sampling.period if own else 0.0
                        memory[variables[SAMPLE_OFFSET].reference, lane] = sampling.offset if own else 0.0
        for name, values in self._parameters.items():
            index, place = shape.place(name)
            self.memories[index][place, : len(values)] = values
        for i, arrays in enumerate(self._of_channels):
            for lane, system in enumerate(systems):
                x = system.connections[i]
                arrays["sigma"][:, lane], arrays["quantum"][:, lane] = changes_of(x)
                arrays["scale"][0, lane], arrays["offset"][0, lane] = x.scale, x.offset
        for lane, system in enumerate(systems):
            for i, name in enumerate(shape.numbers):
                self._numbers[i, lane] = self._number(lane, system, name)
            self._begin(lane, system, first_samples[lane])
            self._numbers[len(shape.numbers), lane] = seconds(nanoseconds(system.stop_time))
            for i, call in enumerate(shape.inner):
                self._numbers[len(shape.numbers) + 1 + i, lane] = known[call][lane] if known else 0.0

    def _initialise(self, runs: Sequence[LaneRun]) -> Booleans:
        """Do the first exchange as `Master` does; the lanes in which it fails."""
        shape, wrong = self._shape, np.zeros(self._lanes, dtype=np.bool_)
        for lane, run in enumerate(runs):
            values = [value for source in run.given for value in source.each(np.zeros(1))[0].tolist()]
            for index, name in enumerate(shape.names):
                for number, place in shape.fed[name]:
                    self.memories[index][place, lane] = values[number]
        received = [np.zeros((len(ends.end), self._lanes)) for ends in self._ends]
        for group in shape.first_exchange:
            wrong |= self._exchange(group, received)
        for index, name in enumerate(shape.names):
            wrong |= self._compute(index)
            wrong |= ~np.isfinite(self.memories[index][shape.connected[name]]).all(axis=0)
        for i, first in enumerate(received):
            if self._channels[i].extrapolates:
                self._of_channels[i]["applied"][: len(first)] = first
                self._channels[i].applied_count[:] = [1] * self._lanes
                self._channels[i].applied_time[:] = [0] * (2 * self._lanes)
        return wrong

    def _exchange(self, group: Sequence[int], received: Sequence[Floats]) -> Booleans:
        connections, names = self._shape.system.connections, self._shape.names
        wrong = np.zeros(self._lanes, dtype=np.bool_)

        def pass_on(i: int, open_: Booleans) -> tuple[Floats, Floats]:
            sender, receiver = (names.index(name) for name in (connections[i].sender, connections[i].receiver))
            wrong[:] |= self._compute(sender)
            before, after = received[i].copy(), self._sent_values(i, self.memories[sender])
            received[i][:, open_] = after[:, open_]
            taken = self._received_values(i, after)[:, open_]
            self.memories[receiver][self._ends[i].end[:, None], np.flatnonzero(open_)] = taken
            return before, received[i]

        return wrong | initial.exchange(group, pass_on, (self._lanes,))

    def _sent_values(self, i: int, sender: Floats) -> Floats:
        values, arrays = sender[self._ends[i].start], self._of_channels[i]
        if self._channels[i].converts:
            values = values * arrays["scale"] + arrays["offset"]
        return values

    def _received_values(self, i: int, values: Floats) -> Floats:
        c, kinds = self._c, self._ends[i].kinds[:, None]
        received: Floats = np.where(
            kinds == c.TRUTH, values != 0.0, np.where(kinds == c.WHOLE, np.rint(values), values)
        )
        return received

    def _begin(self, lane: int, system: System, first_samples: Mapping[str, int]) -> None:
        """Set when the own time of each component begins, as in `Master`: 0 unless it begins with a later sample."""
        for index, name in enumerate(self._shape.names):
            ratio, sample = clock_of(system, name, first_samples)
            self._begins[index][lane] = 0.0 if name in self._shape.waits else ratio * sample

    def _compute(self, index: int) -> Booleans:
        """Compute the outputs of a component in initialisation mode; the lanes in which that fails."""
        active, start = np.full(self._lanes, 2**64 - 1, dtype=np.uint64), self._begins[index]
        status = np.zeros(self._lanes, dtype=np.int32)
        kernel = self._shape.kernels[self._shape.names[index]]
        kernel.lanes.initialise(
            address(self.memories[index]), address(active), address(start), address(status)
        )  # fmt: skip
        failed: Booleans = status != 0
        return failed

    # -- schedules -------------------------------------------------------------------------------------------------

    def _tracks_of(
        self, runs: Sequence[LaneRun], timings: Sequence[ScheduleKey], schedules: Mapping[ScheduleKey, RunSchedule]
    ) -> list[Track]:
        lanes_of: dict[ScheduleKey, list[int]] = {}
        for lane, timing in enumerate(timings):
            lanes_of.setdefault(timing, []).append(lane)
        return [
            self._track(
                lanes, schedules[timing].spans, same_sources=len({runs[lane].source_key for lane in lanes}) == 1
            )
            for timing, lanes in lanes_of.items()
        ]

    def _track(self, lanes: list[int], spans: Iterator[Span], *, same_sources: bool) -> Track:
        now = np.zeros(len(self._shape.names), dtype=np.int64)
        return Track(lanes=lanes, spans=spans, ahead=next(spans, None), now=now, same_sources=same_sources)

    def _source_key(self, system: System, numbers: Mapping[str, float]) -> Hashable:
        """Everything besides the structure that determines the values of the sources of a run."""
        parts: list[Any] = []
        for name, source in system.sources.items():
            if name in self._shape.seen or source.to:
                parts += [vars(source), system.seed if source.is_random else None]
            if source.trajectory is not None:
                parts.append([numbers[each] for each in self._trajectories[source.trajectory]])
        return repr(parts)  # the repr of a source itself would be abbreviated

    def _next_span(self, number: int, track: Track, runs: Sequence[LaneRun]) -> None:
        """Hand the next span of a track to C."""
        into = self._tracks[number]
        span = track.span = track.ahead
        into.count, into.more = 0, 0
        track.ahead = None if span is None else next(track.spans, None)
        into.last_window = track.ahead is None
        if span is None:
            return
        c_span, address_of = self._c.Span(end=span.end), self._memory.temporary_address
        for name in ("regular", "own"):
            instants = getattr(span, name)
            places = self._c.Instants(
                times=address_of(instants.times), stepped=address_of(instants.stepped), count=len(instants)
            )
            setattr(c_span, name, places)
        for name in ("posted", "measured", "arrivals", "samples"):
            setattr(c_span, name, address_of(getattr(span, name)))
            setattr(c_span, f"{name}_count", len(getattr(span, name)))
        c_span.exchanged, c_span.sampled = address_of(span.exchanged), address_of(span.sampled)
        into.span = c_span
        for lane in track.lanes[:1] if track.same_sources else track.lanes:
            run = runs[lane]
            regular, own = (self._values_at(run, instants) for instants in (span.regular, span.own))
            run.arrays = [*regular, *own]
            into.seen[lane], into.given[lane], into.seen_own[lane], into.given_own[lane] = map(address_of, run.arrays)
        for lane in track.lanes:
            self._draw_noise(lane, runs[lane], span)

    def _values_at(self, run: LaneRun, instants: Instants) -> tuple[Floats, Floats]:
        """The values of sources at some instants; those that runs have in common are computed once."""
        key = instants, run.source_key
        if key not in self._source_values:
            t = seconds(instants.times)
            self._source_values[key] = (
                np.ascontiguousarray(np.column_stack([values.over(t) for values in run.seen] or [t[:, None]])),
                np.ascontiguousarray(np.column_stack([values.each(t) for values in run.given] or [t[:, None]])),
            )
            while len(self._source_values) > _CACHED_SOURCE_VALUES:
                self._source_values.popitem(last=False)
        self._source_values.move_to_end(key)
        return self._source_values[key]

    def _draw_noise(self, lane: int, run: LaneRun, span: Span) -> None:
        for i, stream in run.noise.items():
            count = span.count_of(i, self._shape.wires.table(i))
            noise = stream.standard_normal((count, len(self._ends[i].start)))
            run.arrays.append(noise)
            self._channels[i].noise[lane] = self._memory.temporary_address(noise)

    def _record(self, columns: Sequence[str] | None, tracks: Sequence[Track]) -> list[Floats]:
        """Memory for the rows of some columns; None: no rows are recorded."""
        batch = self._batch
        batch.recorded_count, batch.record_limit = len(columns or ()), 0 if columns is None else MAX_ROWS
        places = [self._shape.place(column) for column in columns or ()]
        for wanted, read in zip(self._wanted, self._read):
            wanted[:] = read
        for i, place in places:
            self._wanted[i][place] = True
        if columns is None:
            return []
        self._recorded = np.array(
            [address(self.memories[i]) + 8 * self._lanes * place for i, place in places], dtype=np.int64
        )
        batch.recorded = self._memory.temporary_address(self._recorded)
        if self._rows is None or self._rows.shape[2] != len(columns) + 1:
            self._rows = self._memory.numbers(self._lanes, MAX_ROWS, len(columns) + 1)
        rows = self._rows[: sum(len(track.lanes) for track in tracks)]
        for lane, table in enumerate(rows):
            batch.records[lane] = address(table)
        return [*rows]

    # -- construction ----------------------------------------------------------------------------------------------

    def _array(self, count: int) -> Floats:
        """Zeros of shape (count, lanes)."""
        return self._memory.numbers(max(count, 1), self._lanes)

    def _structures(self, kind: Any, items: Iterable[Any]) -> Any:
        values = [*items]
        array = self._memory.structures(kind, len(values))
        array[: len(values)] = values
        return array

    def _indices(self, indices: Sequence[int]) -> Any:
        return self._c.List(items=self._memory.permanent_address(np.array(indices, dtype=np.int64)), count=len(indices))

    def _arrays_of(self, size: int) -> dict[str, Floats]:
        arrays = {name: self._array(size) for name in ("sigma", "quantum", "value")}
        return {**arrays, "scale": self._array(1), "offset": self._array(1), "applied": self._array(2 * size)}

    def _channel(self, i: int) -> Any:
        x, ends, arrays = self._shape.system.connections[i], self._ends[i], self._of_channels[i]
        sigma, quantum = changes_of(x)
        names, converts, address_of = self._shape.names, x.converts, self._memory.permanent_address
        return self._c.Channel(
            sender=address(self.memories[names.index(x.sender)]),
            into=self._c.Inputs(
                memory=address(self.memories[names.index(x.receiver)]), places=address_of(ends.end),
                kinds=address_of(ends.kinds), low=address_of(ends.low), high=address_of(ends.high),
                plain=not converts and x.hold == "zero",
                as_they_are=not converts and x.hold == "zero" and not ends.kinds.any(),
            ),
            places=address_of(ends.start), size=len(ends.start), noisy=bool(sigma.any()), rounds=bool(quantum.any()),
            converts=converts, extrapolates=x.hold == "first", read_ahead=i in self._shape.wires.plan.read_ahead,
            **{name: address(arrays[name]) for name in ("sigma", "quantum", "scale", "offset", "value", "applied")},
        )  # fmt: skip

    def _component(self, index: int) -> Any:
        shape, name = self._shape, self._shape.names[index]
        into, places, address_of = shape.wires.into(name), shape.connected[name], self._memory.permanent_address
        changing = shape.fed[name] if shape.fed_changes else []
        fed = self._structures(self._c.Fed, (self._c.Fed(source=s, place=p) for s, p in changing))
        return self._c.Component(
            step=shape.kernels[name].step, memory=address(self.memories[index]), places=address_of(places),
            connected=len(places), wanted=address(self._wanted[index]), fed=ctypes.addressof(fed),
            fed_count=len(changing), held=self._indices(into.held), ahead=self._indices(into.ahead),
            behind=self._indices(into.behind), ratio=address(self._ratios[index]),
            by_itself=shape.wires.is_by_itself(name), rank=shape.wires.rank(index),
        )  # fmt: skip
