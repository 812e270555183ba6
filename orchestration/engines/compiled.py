"""The master with its loop in C: the same rows, events and ends to the byte, many times as fast.

All that a run needs lies in arrays that C and Python share; what begins, ends, pauses and explains a run is `Master`.
C passes through some instants at a time, so that an interruption is heard in between.
"""

import ctypes
import time as clock
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from orchestration.basics.errors import QuadcosimError, SimulatorError
from orchestration.basics.simulator import Floats, Integers, Simulator
from orchestration.engines.board import Board
from orchestration.engines.condition import Step
from orchestration.engines.loop import Operation, library
from orchestration.engines.master import Diverged, Master, Terminated
from orchestration.engines.memory import Memory
from orchestration.engines.room import EVENTS, ROWS, Room, loop_in, private
from orchestration.engines.sources import Values
from orchestration.engines.structures import address, structures
from orchestration.fmi.fmi2 import Fmi2Instance
from orchestration.fmi.fmi3 import Fmi3Instance
from orchestration.fmi.native import NativeInstance
from orchestration.fmi.surroundings import ROUNDING
from orchestration.schedule.schedule import Schedule
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS

c = structures(1)
"""What C has of one run"""
SLICE = 0.05
"""[s] that C may be away for, about"""
_Look, _Stopped, _Collect = (dict(c.Loop._fields_)[name] for name in ("look", "stopped", "collect"))
_EXACT = 2**53
"""Up to here a float holds every whole number"""

Condition = Callable[[Board], tuple[Sequence[Step] | None, Sequence[Values]]]
"""The program of what is watched, None if there is none, and the sources in it"""


def obstacle(simulators: Mapping[str, Simulator], stop: int) -> str | None:
    """What stands in the way of the compiled loop for a run up to `stop` [ns], in a line; None: it can be had."""
    for name, simulator in simulators.items():
        if not isinstance(simulator, NativeInstance):
            return f"components.{name} is not called in this process"
        if type(simulator) not in (Fmi2Instance, Fmi3Instance):
            return f"components.{name} does more than call its FMU"
    if stop >= _EXACT:
        return f"stop_time is longer than {_EXACT / NANOSECONDS:.0f} s"
    try:
        library()
    except QuadcosimError as error:
        return str(error)
    return None


class CompiledMaster(Master):
    """One run of a system in whose way there is no `obstacle`."""

    engine = "compiled"

    def __init__(
        self,
        system: System,
        simulators: Mapping[str, NativeInstance],
        *,
        condition: Condition,
        room: Room = private,
        **others: Any,
    ) -> None:
        self._room = room
        super().__init__(system, simulators, **others)
        self._pace = 4  # instants of a slice
        self._shared: list[_OnTheirWay] = []
        self._fly = library()
        self._failure: BaseException | None = None
        self._memory = memory = Memory(list(simulators.values()))
        self._row_table: Floats = self._new_row_table()
        self._event_table: Integers = self._new_event_table(0)
        program, watched = condition(self.board)
        self._watched = list(watched)
        self._feed_table = (c.Feed * len(self._feeds))(
            *(memory.feed(self._names.index(feed.component), feed) for feed in self._feeds)
        )
        self._channel_table = (c.Channel * len(self._channels))(*map(self._channel_of, range(len(self._channels))))
        self._components = (c.Component * len(self._names))(*map(self._component_of, range(len(self._names))))
        begun: dict[str, Any] = {
            "components": ctypes.addressof(self._components),
            "channels": ctypes.addressof(self._channel_table),
            "feeds": ctypes.addressof(self._feed_table),
            "tasks": memory.indices(list(self._tasks)),
            "some_by_themselves": self._some_by_themselves,
            "settles": self._settling,
            "stop": self._stop,
            "row": address(self.board.row),
            "rows": address(self._row_table),
            "width": len(self.board.columns),
            "stride": len(self.columns),
            "row_limit": len(self._row_table),
            "event_limit": self._most_events,
            "look": _Look(self._look_for_c),
            "stopped": _Stopped(self._stopped_for_c),
            "collect": _Collect(lambda index: memory.instances[index].collect_warnings()),
            "calling": -1,
        }
        self._loop = loop_in(room)
        for name, value in begun.items():
            setattr(self._loop, name, value)
        if program is not None:
            self._program = (Operation * len(program))(*(Operation(*step) for step in program))
            self._loop.condition, self._loop.condition_length = ctypes.addressof(self._program), len(program)

    # -- a run ---------------------------------------------------------------------------------------------------

    def _run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        self._loop.pause_at = self._stop if pause_at is None else pause_at
        try:
            while (schedule := self._position.schedule()) is not None:
                self._share(schedule)
                try:
                    over = self._through(schedule, progress)
                finally:
                    self._take_back()
                if over is not None:
                    return over
        except (Diverged, Terminated, SimulatorError) as error:
            self._ended(error)
        if progress is not None:
            progress(1.0)
        return True

    def _through(self, schedule: Schedule, progress: Callable[[float], None] | None) -> bool | None:
        """Go through what is left of a schedule; whether the run is over if it stops before."""
        while self._position.at < len(schedule):
            code = self._slice(schedule)
            if code == c.FULL:
                self._hand_over()
            elif code not in (c.AT_END, c.PAUSED):
                self._fail(code)
            if self._interrupted() and self.now < self._stop:
                self.interrupted_at = self.now
                self._drop_later_events()
                return True
            if code == c.PAUSED:
                return False
            if progress is not None:
                progress(self.now / self._stop)
        return None

    def _slice(self, schedule: Schedule) -> int:
        """Have C pass through instants for about `SLICE`; the code says why it has come back."""
        loop, begin = self._loop, clock.perf_counter()
        code = int(self._fly(ctypes.addressof(loop), min(len(schedule), loop.at + self._pace)))
        share = SLICE / max(clock.perf_counter() - begin, 1e-9)
        self._pace = min(max(1, int(self._pace * min(share, 8.0))), len(schedule))
        self.now, self.steps, self._position.at = loop.now, loop.steps, loop.at
        self._hear_of_moves()
        return code

    def _hear_of_moves(self) -> None:
        """Instances whose FMUs have changed how numbers are rounded, which C has put back."""
        for instance, component in zip(self._memory.instances, self._components):
            if component.moved:
                component.moved = 0
                instance.has_changed(ROUNDING)

    def _fail(self, code: int) -> None:
        """Raise what C has come back with."""
        index, part = self._loop.component, self._loop.failed
        if code in (c.FAILED, c.REFUSED):
            function, transfer = self._memory.calls[part]
            if code == c.FAILED:
                raise self._memory.instances[index].failure(function)
            transfer()
        elif code == c.NOT_FINITE:
            worked = self._bodies[index] if index in self._bodies else self._tasks[index]
            worked.expect_finite(self.now / NANOSECONDS)
        elif code == c.OVER:
            raise Terminated(self.termination)
        elif self._failure is not None:  # of what C has called in Python
            raise self._failure
        raise AssertionError(f"the compiled loop has ended with {code}, and Python sees no reason")

    def _look_for_c(self, t: float) -> int:
        """Whether the run has diverged; no exception goes through C."""
        try:
            self._look(t)
        except BaseException as error:
            self._failure = error
            return 1
        return 0

    def _stopped_for_c(self, status: int, until: int) -> int:
        """Whether a step to `until` [ns] that was not simply done is not whole either; no exception goes through C."""
        try:
            self._stopped(self._memory.instances[self._loop.component].step_error(status, self._loop.end), until)
        except BaseException as error:
            self._failure = error
            return 1
        return 0

    # -- what is not handed over yet -----------------------------------------------------------------------------

    def _is_pending(self) -> bool:
        return bool(self._loop.row_count or self._loop.event_count)

    def _pending_rows(self) -> Floats:
        return self._row_table[: self._loop.row_count, : len(self.board.columns)]

    def _rows_with_sources(self) -> Floats:
        rows, first = self._row_table[: self._loop.row_count], len(self.board.columns)
        for signals, values in self._sources:
            rows[:, first : first + len(signals)] = values.over(rows[:, 0])
            first += len(signals)
        return rows

    def _new_row_table(self) -> Floats:
        """Room for a chunk, in which the columns of sources are filled in when it is handed over as it is."""
        shape = (self._chunk // self.board.row.nbytes, len(self.columns))
        return self._room(ROWS, 8 * shape[0] * shape[1]).view(np.float64).reshape(shape)

    def _new_event_table(self, count: int) -> Integers:
        return self._room(EVENTS, 32 * count).view(np.int64).reshape(count, 4)

    def _pending_events(self) -> Integers:
        return self._event_table[: self._loop.event_count]

    def _keep_rows(self, rows: bytes) -> None:
        table = np.frombuffer(rows, dtype=np.float64).reshape(-1, len(self.board.columns))
        self._row_table = self._new_row_table()
        self._row_table[: len(table), : table.shape[1]] = table
        self._loop.rows, self._loop.row_count = address(self._row_table), len(table)

    def _keep_events(self, events: Integers) -> None:
        if len(events) > len(self._event_table):
            self._event_table = self._new_event_table(len(events))
        self._event_table[: len(events)] = events
        self._loop.event_count = len(events)

    def _record(self, time: int) -> None:
        self.board.row[0] = time / NANOSECONDS
        self._keep_rows(self.board.row.tobytes())

    # -- between Python and C ------------------------------------------------------------------------------------

    def _share(self, schedule: Schedule) -> None:
        """All that a schedule needs goes to where C has it, from the next instant on."""
        loop, loop.at = self._loop, self._position.at
        for name, _ in c.Schedule._fields_:
            setattr(loop.schedule, name, address(getattr(schedule, name)))
        self._make_room(schedule)
        self._share_sources(schedule.times[:-1] / NANOSECONDS)
        for index, body in self._bodies.items():
            self._components[index].now = body.now
        loop.now, loop.steps = self.now, self.steps
        rest = schedule.part(loop.at)
        self._shared = [
            _OnTheirWay(channel, self._channel_table[i], *rest.of(i, self._wires.table(i)))
            for i, channel in enumerate(self._channels)
        ]

    def _take_back(self) -> None:
        """What Python keeps of a run is as C has left it."""
        for each in self._shared:
            each.take_back()
        self._shared = []
        for index, body in self._bodies.items():
            body.now = self._components[index].now

    def _make_room(self, schedule: Schedule) -> None:
        """For the events of any instant beside those that make a chunk whole."""
        most = schedule.most_events()
        loop, count = self._loop, self._loop.event_count
        if len(self._event_table) < max(self._most_events, count) + most:
            table = self._new_event_table(max(self._most_events, count) + 2 * most)
            table[:count] = self._event_table[:count]
            self._event_table = table
        self._arrived_table: Integers = np.empty((most, 4), dtype=np.int64)
        loop.events, loop.arrived = address(self._event_table), address(self._arrived_table)

    def _share_sources(self, t: Floats) -> None:
        self._fed = [np.ascontiguousarray(feed.each(t), dtype=np.float64) for feed in self._feeds]
        for place, values in enumerate(self._fed):
            self._feed_table[place].values = address(values)
        if self._watched:
            self._seen = np.ascontiguousarray(np.column_stack([values.over(t) for values in self._watched]))
            self._loop.watched, self._loop.watched_size = address(self._seen), self._seen.shape[1]

    # -- how it is made ------------------------------------------------------------------------------------------

    def _channel_of(self, index: int) -> Any:
        x = self._system.connections[index]
        places = [self.board.place[start] for start in x.start]
        receiver = self._names.index(x.receiver)
        made = self._memory.channel(x, self._channels[index], receiver, self.board.row, places)
        made.read_ahead = index in self._read_ahead
        return made

    def _component_of(self, index: int) -> Any:
        name, memory = self._names[index], self._memory
        body, task = self._bodies.get(index), self._tasks.get(index)
        worked = body or task
        assert worked is not None
        made = memory.component(index, worked.read, self._outputs(name), len(worked.outputs))
        made.feeds = memory.indices([self._feeds.index(feed) for feed in worked.feeds])
        made.held = memory.indices([self._channels.index(channel) for channel in worked.held])
        if body is not None:
            made.ahead = memory.indices([self._channels.index(channel) for channel in body.ahead])
            made.behind = memory.indices([self._channels.index(channel) for channel in body.behind])
        if task is not None:
            made.ratio, made.by_itself = memory.address(np.array([task.ratio])), task.by_itself
        return made


class _OnTheirWay:
    """Messages and noise of one connection while C has them."""

    def __init__(self, channel: Any, into: Any, count: int, keys: list[int]) -> None:
        """`count` messages take values, of which those with `keys` are kept until they arrive."""
        self._channel, self._into, self._size = channel, into, into.size
        self._keys = [*channel.in_flight, *keys]
        self._flight: Floats = np.empty((len(self._keys), self._size))
        for i, value in enumerate(channel.in_flight.values()):
            self._flight[i] = value
        into.flight, into.first[0], into.last[0] = address(self._flight), 0, len(channel.in_flight)
        self._applied: Floats = np.zeros((2, self._size))
        into.applied, into.applied_count[0] = address(self._applied), len(channel.applied)
        for i, (time, value) in enumerate(channel.applied):
            self._applied[i], into.applied_time[i] = value, time
        self._before = channel.stream.bit_generator.state if into.noisy else None
        self._noise: Floats = channel.stream.standard_normal((count if into.noisy else 0, self._size))
        into.noise[0] = address(self._noise)

    def take_back(self) -> None:
        """As if Python had done it."""
        channel, into = self._channel, self._into
        channel.in_flight = {self._keys[i]: self._flight[i].copy() for i in range(into.first[0], into.last[0])}
        if into.extrapolates:
            channel.applied = [(into.applied_time[i], self._applied[i].copy()) for i in range(into.applied_count[0])]
        if self._before is not None:
            used = (into.noise[0] - address(self._noise)) // (self._noise.itemsize * self._size)
            if used < len(self._noise):
                channel.stream.bit_generator.state = self._before
                channel.stream.standard_normal((used, self._size))
