"""Many batches of one shape on a GPU: each of their lanes in a thread."""

import ctypes
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from orchestration.basics.errors import QuadcosimError
from orchestration.basics.simulator import Floats
from orchestration.engines.batch.batch import Batch, BatchResult, Going, Group, Run, Track
from orchestration.engines.batch.batches import Batches
from orchestration.engines.batch.shape import Shape
from orchestration.engines.cuda.compiler import compiled, expect_compiler
from orchestration.engines.cuda.driver import Gpu
from orchestration.engines.cuda.memory import SharedMemory
from orchestration.engines.cuda.program import Code, Known, program
from orchestration.engines.structures import address
from orchestration.expressions.syntax import Call
from orchestration.schedule.schedule_cache import RunSchedule, ScheduleCache, Timing
from orchestration.system.model import System

_MESSAGES, _VALUES = 16, 1024
"""On their way over a connection, and kept of an expression: what there is room for at first"""
_MORE = 8
"""times as much, where there is too little: its runs begin again"""
_MOST = 2**12
"""Groups at once"""


def expect_gpu() -> None:
    """Raise `QuadcosimError` if nothing can be flown on a GPU here, saying what is missing."""
    try:
        expect_compiler()
        Gpu()
    except QuadcosimError as error:
        raise QuadcosimError(f"--engine cuda: {error}") from error


def batches() -> Batches:
    """Batches that fly on a GPU; raises `QuadcosimError` without one."""
    return Batches(partial(Fleet, gpu=Gpu()))


class Fleet:
    """Flies groups of runs of a shape, all at once."""

    def __init__(self, shape: Shape, schedules: ScheduleCache, gpu: Gpu) -> None:
        self._shape, self._schedules, self._gpu = shape, schedules, gpu
        self._codes = {name: Code.of(name, model) for name, model in shape.models.items()}
        self._known: Mapping[str, Known] | None = None
        self._memory = SharedMemory(gpu)
        self._batches: list[_Threads] = []

    def run(self, groups: Sequence[Group], record: Sequence[str] | None = None) -> list[tuple[Batch, BatchResult]]:
        """The groups in their order, each with the batch that has flown it."""
        while len(self._batches) < len(groups):
            self._batches.append(_Threads(self._shape, self._schedules, self._memory))
        try:
            found = self._results(groups, record)
        finally:
            self._memory.forget()
        return [(self._batches[i], found[i]) for i in range(len(groups))]

    def each(self, groups: Sequence[Group], record: Sequence[str] | None) -> Iterator[tuple[Batch, BatchResult]]:
        """The same of any number of groups, some thousands at once."""
        for first in range(0, len(groups), _MOST):
            yield from self.run(groups[first : first + _MOST], record)

    def _results(self, groups: Sequence[Group], record: Sequence[str] | None) -> Mapping[int, BatchResult]:
        found: dict[int, BatchResult] = {}
        going: dict[int, Going] = {}
        begin = [*range(len(groups))]
        while begin or going:
            for i in begin:
                going[i] = self._batches[i].going(groups[i], record)
                next(going[i])
            flying = [self._batches[i] for i in going if self._batches[i].flying]
            if flying:
                self._expect_known(flying)
                self._go_on(flying)
            begin = [i for i in going if self._batches[i].makes_room()]
            for i in sorted({*going} - {*begin}):
                try:
                    going[i].send(self._batches[i].waiting())
                except StopIteration as end:
                    found[i] = end.value
                    del going[i]
        return found

    def _expect_known(self, batches: Sequence["_Threads"]) -> None:
        """Have what flies them know no other numbers than those that are the same in all runs, now and before."""
        found = {
            name: _the_same(code, np.hstack([batch.begins_with(i) for batch in batches]))
            for i, (name, code) in enumerate(self._codes.items())
        }
        if self._known is not None:
            found = {
                name: {place: x for place, x in known.items() if found[name].get(place, np.nan).hex() == x.hex()}
                for name, known in self._known.items()
            }
        if found != self._known:
            self._known = found
            text = program(self._shape, self._codes, found)
            self._fly = self._gpu.kernel(compiled(text, self._gpu.architecture), "fly")

    def _go_on(self, batches: Sequence["_Threads"]) -> None:
        addresses = np.array([batch.address for batch in batches], dtype=np.int64)
        self._gpu.launch(self._fly, len(batches) * self._shape.lanes, self._memory.passing(addresses), len(batches))


def _the_same(code: Code, memory: Floats) -> Known:
    """What is the same in all runs, of numbers that may be known."""
    numbers = memory[[*code.constant.values()]]
    bits = numbers.view(np.int64)
    alike = (bits == bits[:, :1]).all(axis=1) & np.isfinite(numbers).all(axis=1)
    return {name: float(row[0]) for name, row, same in zip(code.constant, numbers, alike) if same}


class _Threads(Batch):
    """A batch whose lanes go on by themselves: each has a track, and values that it keeps, of its own."""

    def __init__(self, shape: Shape, schedules: ScheduleCache, memory: SharedMemory) -> None:
        super().__init__(shape, schedules, memory)
        self._kept_count = len(self._written.folds.kept)
        self._kept = memory.structures(self._c.Kept, self._kept_count * self._lanes)
        self._batch.kept = ctypes.addressof(self._kept)
        self._values: dict[int, Floats] = {}
        """that are kept of an expression, shape (rows, lanes)"""
        for i in range(self._kept_count):
            self._make_room_to_keep(i, _VALUES)
        for channel in self._channels:
            self._make_room(channel, _MESSAGES)

    def __del__(self) -> None:
        """What there is room for belongs to the memory."""

    def waiting(self) -> list[int]:
        """The tracks that ask for their next window."""
        return [lane for lane in self.flying if self._batch.returned[lane] == self._c.NEXT_WINDOW]

    @property
    def flying(self) -> list[int]:
        """The lanes that go on."""
        return [lane for lane in range(self._lanes) if self._batch.alive >> lane & 1]

    def begins_with(self, component: int) -> Floats:
        """The memory of a component in the runs that go on."""
        return self.memories[component][:, self.flying]

    def makes_room(self) -> bool:
        """Whether there was too little room for some lane: there is more now, to begin again."""
        if self._c.NO_MEMORY not in self._batch.returned[:]:
            return False
        for i, values in self._values.items():
            self._make_room_to_keep(i, _MORE * len(values))
        for channel in self._channels:
            self._make_room(channel, _MORE * channel.capacity)
        return True

    def _make_room_to_keep(self, i: int, count: int) -> None:
        values = self._values[i] = self._array(count)
        for lane in range(self._lanes):
            kept = self._kept[lane * self._kept_count + i]
            kept.values, kept.capacity = address(values), count

    def _make_room(self, channel: Any, count: int) -> None:
        channel.flight, channel.capacity = address(self._array(count * channel.size)), count

    def _result(self, systems: Sequence[System], recorded: Sequence[Floats]) -> BatchResult:
        """Its rows are no longer in memory that is given back."""
        result = super()._result(systems, recorded)
        return replace(result, signals=[rows.copy() for rows in result.signals])

    # -- what is each lane's own -------------------------------------------------------------------------------------

    def _clear(self) -> None:
        super()._clear()
        self._batch.returned[:] = [self._c.AT_END] * self._lanes
        for kept in self._kept:
            kept.count = 0

    def _tracks_of(
        self, runs: Sequence[Run], timings: Sequence[Timing], courses: Mapping[Timing, RunSchedule]
    ) -> list[Track]:
        found: dict[int, Track] = {}
        for timing, course in courses.items():
            lanes = [lane for lane, own in enumerate(timings) if own == timing]
            for lane, spans in zip(lanes, itertools.tee(course.spans, len(lanes))):
                found[lane] = self._track([lane], spans, alike=True)
        return [found[lane] for lane in sorted(found)]

    def _growth(self, call: Call, own: Call, values: Mapping[Call, Floats]) -> Floats:
        """A lane may have kept fewer values than others; what is not a number does not grow."""
        i = self._written.folds.kept[own]
        kept = self._kept[i :: self._kept_count]
        for lane, each in enumerate(kept):
            self._values[i][each.count :, lane] = np.nan
        self._kept[i].count = max(each.count for each in kept)
        return super()._growth(call, own, values)
