"""The loop of a run in C: the same rows, events and endings as those of the loop in Python to the byte, but faster.

The data of a run is in arrays that C and Python share; `Master` begins, pauses and ends a run and reports errors.
C processes some instants at a time, so that interruptions are noticed in between.
"""

import ctypes
import functools
import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.compiler.runtime import FOLDER
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.surroundings import ROUNDING
from orchestration.foundation.basics.c_structures import address, compiled_library, declared, expect_same_sizes
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.recording.recording import Recorder
from orchestration.simulation.engines import condition
from orchestration.simulation.engines.backlog import Backlog
from orchestration.simulation.engines.memory import Allocator, SharedTables, allocated_loop
from orchestration.simulation.engines.running_system import RunningSystem, Terminated
from orchestration.simulation.engines.structures import HEADER, ONE_LANE, RunStructures, shared
from orchestration.systems.schedule.instant_arrays import Schedule

INSTANTS = Path(__file__).with_name("instants.h")
"""C of what happens at an instant, for runs of FMUs and of kernels in SIMD lanes"""
FILES = (Path(__file__).with_name("loop.c"), condition.HEADER, INSTANTS, HEADER, FOLDER / "lanes.h")
"""Its sources, beside the generated operators.h"""
Operation: Any = declared(condition.HEADER.read_text(encoding="utf-8"))["Operation"]
"""One step of a condition"""


@functools.cache
def library() -> Any:
    """The function `run` of loop.c; raises `QuadcosimError` with the reason if it is not available."""
    sources = {path.name: path.read_bytes() for path in FILES}
    sources["operators.h"] = condition.operators().encode()
    loaded = compiled_library("loop", sources, mathematics="libm")
    expect_same_sizes(loaded, {**shared(1), "Operation": Operation})
    run = loaded.run
    run.restype = ctypes.c_int
    run.argtypes = (ctypes.c_void_p,)
    return run


SLICE = 0.05
"""Time after which C returns, about [s]"""
_Look, _Stopped, _Collect = (dict(ONE_LANE.Loop._fields_)[name] for name in ("look", "stopped", "collect"))
_EXACT = 2**53
"""Up to here a float represents every integer"""


def operations_of(running: RunningSystem) -> list[int] | None:
    """What ends an instant, for C; None where loops are to be closed then."""
    wires = running.wires
    return running.closing.operations([wires.names.index(x.sender) for x in wires.system.connections])


def reason_unavailable(running: RunningSystem) -> str | None:
    """Why the compiled loop is not available for a run, in a line; None: it is."""
    if operations_of(running) is None:
        return "its FMUs form a loop that is closed at each instant"
    stop = running.stop
    for name, simulator in running.simulators.items():
        if not isinstance(simulator, NativeInstance):
            return f"components.{name} is not called in this process"
        if "only_calls" not in vars(type(simulator)):
            return f"components.{name} does more than call its FMU"
        if simulator.model.access.solver == "cvode":
            return f"components.{name} is solved by CVODE, which is called from Python"
    if stop >= _EXACT:
        return f"stop_time is longer than {seconds(_EXACT):.0f} s"
    try:
        library()
    except QuadcosimError as error:
        return str(error)
    return None


class CompiledLoop:
    """Processes the instants of a run for which there is no `reason_unavailable`."""

    engine = "compiled"

    def __init__(self, running: RunningSystem, recorder: Recorder, *, allocate: Allocator) -> None:
        self._running = running
        self._slice_length = 4  # instants of a slice
        self._shared: list[_MessagesInFlight] = []
        self._run = library()
        self._failure: BaseException | None = None
        self._structures = structures = RunStructures(running)
        self._channels, self._components = structures.channels, structures.components
        self._loop = loop = allocated_loop(allocate)
        self._tables = SharedTables(running, loop, allocate)
        self.backlog = Backlog(running, self._tables, recorder)
        program, watched = running.condition.program(running.board)
        self._watched = list(watched)
        if self._watched == [values for _, values in running.sources]:
            loop.in_rows = sum(len(signals) for signals, _ in running.sources)
        self._reached: Integers = np.zeros(len(structures.instances), dtype=np.int64)
        self._track = ONE_LANE.Track(lanes=1, stop=running.stop, now=address(self._reached))
        structures.fill(
            loop,
            components=self._components,
            channels=self._channels,
            feeds=ctypes.addressof(structures.feeds),
            tracks=self._track,
            track_count=1,
            alive=1,
            settles=running.settles,
            closing=structures.indices(operations_of(running) or ()),
            look=_Look(self._look_for_c),
            stopped=_Stopped(self._stopped_for_c),
            collect=_Collect(lambda index: structures.instances[index].collect_warnings()),
            calling=-1,
        )
        if program is not None:
            self._program = (Operation * len(program))(*(Operation(*step) for step in program))
            loop.condition, loop.condition_length = ctypes.addressof(self._program), len(program)

    def run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        """As `PythonLoop.run`."""
        running = self._running
        self._loop.pause_at = running.stop if pause_at is None else pause_at
        while (schedule := running.cursor.schedule()) is not None:
            self._share(schedule)
            try:
                over = self._run_schedule(schedule, progress)
            finally:
                self._take_back()
            if over is not None:
                return over
        return True

    def _run_schedule(self, schedule: Schedule, progress: Callable[[float], None] | None) -> bool | None:
        """Process the rest of a schedule; whether the run is over if it stops before its end, else None."""
        running = self._running
        while running.cursor.at < len(schedule):
            code = self._slice(schedule)
            if code == ONE_LANE.FULL:
                self.backlog.hand_over()
            elif code not in (ONE_LANE.AT_END, ONE_LANE.PAUSED):
                self._raise(code)
            if running.interrupted() and running.now < running.stop:
                running.interrupted_at = running.now
                return True
            if code == ONE_LANE.PAUSED:
                return False
            if progress is not None:
                progress(running.now / running.stop)
        return None

    def _slice(self, schedule: Schedule) -> int:
        """Have C process instants for about `SLICE`, or one at its pace; returns the code of why it has returned."""
        running, loop = self._running, self._loop
        if running.pace is not None:
            running.pace.wait(int(schedule.times[self._track.at]), running.interrupted)
        begin = clock.perf_counter()
        self._track.count = min(len(schedule), self._track.at + (self._slice_length if running.pace is None else 1))
        code = int(self._run(ctypes.addressof(loop)))
        share = SLICE / max(clock.perf_counter() - begin, 1e-9)
        self._slice_length = min(max(1, int(self._slice_length * min(share, 8.0))), len(schedule))
        running.now, running.steps, running.cursor.at = loop.now, loop.steps[0], self._track.at
        self._collect_rounding_changes()
        return code

    def _collect_rounding_changes(self) -> None:
        """Add warnings of FMUs that have changed the rounding mode, which C has restored."""
        for instance, component in zip(self._structures.instances, self._components):
            if component.moved:
                component.moved = 0
                instance.warn_of_change(ROUNDING)

    def _raise(self, code: int) -> None:
        """Raise the error for the code that C has returned."""
        index, part = self._loop.outcome_component[0], self._loop.failed
        if code in (ONE_LANE.FAILED, ONE_LANE.REFUSED):
            function, transfer = self._structures.calls[part]
            if code == ONE_LANE.FAILED:
                raise self._structures.instances[index].failure(function, self._loop.failed_status)
            transfer()
        elif code == ONE_LANE.NOT_FINITE:
            self._running.component(index).expect_finite(seconds(self._running.now))
        elif code == ONE_LANE.OVER:
            raise Terminated(self._running.termination)
        elif self._failure is not None:  # of a Python function that C has called
            raise self._failure
        raise AssertionError(f"the compiled loop has ended with {code}, and Python finds no reason")

    def _look_for_c(self, t: float) -> int:
        """Whether the run has diverged; no exception goes through C."""
        try:
            self._running.check_divergence(t)
        except BaseException as error:
            self._failure = error
            return 1
        return 0

    def _stopped_for_c(self, status: int, until: int) -> int:
        """Whether a step to `until` [ns] failed and was not completed; no exception goes through C."""
        try:
            error = self._structures.instances[self._loop.component].step_error(status, self._loop.end)
            self._running.handle_failed_step(error, until)
        except BaseException as error:
            self._failure = error
            return 1
        return 0

    # -- between Python and C ------------------------------------------------------------------------------------

    def _share(self, schedule: Schedule) -> None:
        """Copy what a schedule needs to the structures of C, from the next instant on."""
        running, loop, track = self._running, self._loop, self._track
        track.at = running.cursor.at
        for name, _ in ONE_LANE.Schedule._fields_:
            setattr(track.schedule, name, address(getattr(schedule, name)))
        self._tables.make_room(schedule)
        self._share_sources(seconds(schedule.times[:-1]))
        for index, component in running.continuous.items():
            self._reached[index] = component.now
        loop.now, loop.steps[0] = running.now, running.steps
        rest = schedule.part(track.at)
        self._shared = [
            _MessagesInFlight(channel, self._channels[i], *rest.of(i, running.wires.table(i)))
            for i, channel in enumerate(running.channels)
        ]

    def _take_back(self) -> None:
        """Copy the state that C has left back to the objects of Python."""
        for each in self._shared:
            each.take_back()
        self._shared = []
        for index, component in self._running.continuous.items():
            component.now = int(self._reached[index])

    def _share_sources(self, t: Floats) -> None:
        self._fed = [np.ascontiguousarray(feed.at_each(t), dtype=np.float64) for feed in self._running.feeds]
        for place, values in enumerate(self._fed):
            self._structures.feeds[place].values = address(values)
        if self._watched:
            self._seen = np.ascontiguousarray(np.column_stack([values.over(t) for values in self._watched]))
            self._loop.watched, self._loop.watched_size = address(self._seen), self._seen.shape[1]


class _MessagesInFlight:
    """Messages and noise of one connection while C runs."""

    def __init__(self, channel: Any, into: Any, count: int, keys: list[int]) -> None:
        """`count` messages are sent, of which those with `keys` are stored until they arrive."""
        self._channel, self._into, self._size = channel, into, into.size
        self._keys = [*channel.in_flight, *keys]
        self._flight: Floats = np.empty((1 << len(self._keys).bit_length(), self._size))
        for i, value in enumerate(channel.in_flight.values()):
            self._flight[i] = value
        into.flight, into.capacity = address(self._flight), len(self._flight)
        into.first[0], into.last[0] = 0, len(channel.in_flight)
        self._applied: Floats = np.zeros((2, self._size))
        into.applied, into.applied_count[0] = address(self._applied), len(channel.applied)
        for i, (time, value) in enumerate(channel.applied):
            self._applied[i], into.applied_time[i] = value, time
        self._before = channel.stream.bit_generator.state if into.noisy else None
        self._noise: Floats = channel.stream.standard_normal((count if into.noisy else 0, self._size))
        into.noise[0] = address(self._noise)

    def take_back(self) -> None:
        """Set the state of the channel to that which the loop in Python would have left."""
        channel, into = self._channel, self._into
        channel.in_flight = {self._keys[i]: self._flight[i].copy() for i in range(into.first[0], into.last[0])}
        if into.extrapolates:
            channel.applied = [(into.applied_time[i], self._applied[i].copy()) for i in range(into.applied_count[0])]
        if self._before is not None:
            used = (into.noise[0] - address(self._noise)) // (self._noise.itemsize * self._size)
            if used < len(self._noise):
                channel.stream.bit_generator.state = self._before
                channel.stream.standard_normal((used, self._size))
