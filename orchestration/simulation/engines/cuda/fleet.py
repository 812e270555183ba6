"""Runs many batches of one shape on a GPU, each of their lanes in a thread."""

import ctypes
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.batch.batch import Batch, BatchResult, Group, LaneRun, Stepwise, Track
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.cuda.compiler import compiled, expect_compiler
from orchestration.simulation.engines.cuda.driver import Gpu
from orchestration.simulation.engines.cuda.memory import SharedMemory
from orchestration.simulation.engines.cuda.program import Code, Known, program
from orchestration.simulation.engines.structures import address
from orchestration.systems.expressions.syntax import Call
from orchestration.systems.schedule.schedule_cache import RunSchedule, ScheduleCache, ScheduleKey
from orchestration.systems.system.model import System

_MESSAGES, _VALUES = 16, 1024
"""Initial capacities: messages on their way over a connection, and values kept of an expression"""
_GROWTH = 8
"""Factor by which a capacity grows if it is exceeded; the runs of the batch are repeated"""
_MOST_GROUPS = 2**12
"""Largest number of groups that are run at once"""


def expect_gpu() -> None:
    """Raise `QuadcosimError` if runs on a GPU are not possible here, naming what is missing."""
    try:
        expect_compiler()
        Gpu()
    except QuadcosimError as error:
        raise QuadcosimError(f"--engine cuda: {error}") from error


def batches() -> Batches:
    """Batches that run on a GPU; raises `QuadcosimError` without one."""
    return Batches(partial(Fleet, gpu=Gpu()))


class Fleet:
    """Runs groups of runs of a shape, all at once."""

    def __init__(self, shape: Shape, schedules: ScheduleCache, gpu: Gpu) -> None:
        self._shape, self._schedules, self._gpu = shape, schedules, gpu
        self._codes = {name: Code.of(name, model) for name, model in shape.models.items()}
        self._known: Mapping[str, Known] | None = None
        self._memory = SharedMemory(gpu)
        self._batches: list[_Threads] = []

    def run(self, groups: Sequence[Group], record: Sequence[str] | None = None) -> list[tuple[Batch, BatchResult]]:
        """The results of groups in their order, each with the batch that has run it."""
        while len(self._batches) < len(groups):
            self._batches.append(_Threads(self._shape, self._schedules, self._memory))
        try:
            results = self._results(groups, record)
        finally:
            self._memory.release_temporary()
        return [(self._batches[i], results[i]) for i in range(len(groups))]

    def each(self, groups: Sequence[Group], record: Sequence[str] | None) -> Iterator[tuple[Batch, BatchResult]]:
        """The same for any number of groups, some thousands at once."""
        for first in range(0, len(groups), _MOST_GROUPS):
            yield from self.run(groups[first : first + _MOST_GROUPS], record)

    def _results(self, groups: Sequence[Group], record: Sequence[str] | None) -> Mapping[int, BatchResult]:
        results: dict[int, BatchResult] = {}
        running: dict[int, Stepwise] = {}
        to_begin = [*range(len(groups))]
        while to_begin or running:
            for i in to_begin:
                running[i] = self._batches[i].stepwise(groups[i], record)
                next(running[i])
            alive = [self._batches[i] for i in running if self._batches[i].lanes_alive]
            if alive:
                self._update_kernel(alive)
                self._launch(alive)
            to_begin = [i for i in running if self._batches[i].grow_if_full()]
            for i in sorted({*running} - {*to_begin}):
                try:
                    running[i].send(self._batches[i].waiting_tracks())
                except StopIteration as end:
                    results[i] = end.value
                    del running[i]
        return results

    def _update_kernel(self, batches: Sequence["_Threads"]) -> None:
        """Compile a kernel whose constants are the numbers that are the same in all runs, now and before."""
        common = {
            name: _common_numbers(code, np.hstack([batch.memory_alive(i) for batch in batches]))
            for i, (name, code) in enumerate(self._codes.items())
        }
        if self._known is not None:
            common = {
                name: {place: x for place, x in known.items() if common[name].get(place, np.nan).hex() == x.hex()}
                for name, known in self._known.items()
            }
        if common != self._known:
            self._known = common
            text = program(self._shape, self._codes, common)
            self._kernel = self._gpu.kernel(compiled(text, self._gpu.architecture), "fly")

    def _launch(self, batches: Sequence["_Threads"]) -> None:
        addresses = np.array([batch.address for batch in batches], dtype=np.int64)
        self._gpu.launch(
            self._kernel, len(batches) * self._shape.lanes, self._memory.temporary_address(addresses), len(batches)
        )


def _common_numbers(code: Code, memory: Floats) -> Known:
    """The numbers that are the same in all runs, of those that may be constants."""
    numbers = memory[[*code.constant.values()]]
    bits = numbers.view(np.int64)
    same_in_all = (bits == bits[:, :1]).all(axis=1) & np.isfinite(numbers).all(axis=1)
    return {name: float(row[0]) for name, row, same in zip(code.constant, numbers, same_in_all) if same}


class _Threads(Batch):
    """A batch whose lanes are independent: each has its own track and its own kept values."""

    def __init__(self, shape: Shape, schedules: ScheduleCache, memory: SharedMemory) -> None:
        super().__init__(shape, schedules, memory)
        self._kept_count = len(self._expressions.folds.kept)
        self._kept = memory.structures(self._c.Kept, self._kept_count * self._lanes)
        self._batch.kept = ctypes.addressof(self._kept)
        self._values: dict[int, Floats] = {}
        """the kept values of expressions, shape (rows, lanes)"""
        for i in range(self._kept_count):
            self._make_room_to_keep(i, _VALUES)
        for channel in self._channels:
            self._make_room(channel, _MESSAGES)

    def __del__(self) -> None:
        """The buffers belong to the memory."""

    def waiting_tracks(self) -> list[int]:
        """The tracks that need their next window."""
        return [lane for lane in self.lanes_alive if self._batch.returned[lane] == self._c.NEXT_WINDOW]

    @property
    def lanes_alive(self) -> list[int]:
        """The lanes whose runs have not ended."""
        return [lane for lane in range(self._lanes) if self._batch.alive >> lane & 1]

    def memory_alive(self, component: int) -> Floats:
        """The memory of a component in the runs that have not ended."""
        return self.memories[component][:, self.lanes_alive]

    def grow_if_full(self) -> bool:
        """Enlarge the buffers if one was too small for some lane; whether the runs must be repeated."""
        if self._c.NO_MEMORY not in self._batch.returned[:]:
            return False
        for i, values in self._values.items():
            self._make_room_to_keep(i, _GROWTH * len(values))
        for channel in self._channels:
            self._make_room(channel, _GROWTH * channel.capacity)
        return True

    def _make_room_to_keep(self, i: int, count: int) -> None:
        values = self._values[i] = self._array(count)
        for lane in range(self._lanes):
            kept = self._kept[lane * self._kept_count + i]
            kept.values, kept.capacity = address(values), count

    def _make_room(self, channel: Any, count: int) -> None:
        channel.flight, channel.capacity = address(self._array(count * channel.size)), count

    def _result(self, systems: Sequence[System], recorded: Sequence[Floats]) -> BatchResult:
        """As in a batch, with copies of the rows, since their memory is reused."""
        result = super()._result(systems, recorded)
        return replace(result, signals=[rows.copy() for rows in result.signals])

    # -- separately for each lane ------------------------------------------------------------------------------------

    def _clear(self) -> None:
        super()._clear()
        self._batch.returned[:] = [self._c.AT_END] * self._lanes
        for kept in self._kept:
            kept.count = 0

    def _tracks_of(
        self, runs: Sequence[LaneRun], timings: Sequence[ScheduleKey], courses: Mapping[ScheduleKey, RunSchedule]
    ) -> list[Track]:
        tracks: dict[int, Track] = {}
        for timing, course in courses.items():
            lanes = [lane for lane, own in enumerate(timings) if own == timing]
            for lane, spans in zip(lanes, itertools.tee(course.spans, len(lanes))):
                tracks[lane] = self._track([lane], spans, same_sources=True)
        return [tracks[lane] for lane in sorted(tracks)]

    def _growth(self, call: Call, own: Call, values: Mapping[Call, Floats]) -> Floats:
        """As in a batch; a lane that has kept fewer values than others is filled with NaN, which does not grow."""
        i = self._expressions.folds.kept[own]
        kept = self._kept[i :: self._kept_count]
        for lane, each in enumerate(kept):
            self._values[i][each.count :, lane] = np.nan
        self._kept[i].count = max(each.count for each in kept)
        return super()._growth(call, own, values)
