"""The computers and networks of a system in the form of the scheduler: whole numbers, and streams of them.

Everything but the streams is common to all runs of a timing, and made once for them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import TypeAlias

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import NANOSECONDS, Constant, Grid, exact_nanoseconds, nanoseconds
from orchestration.systems.computers.compiled import scheduler
from orchestration.systems.computers.parts import (
    ABORT,
    EARLIEST_DEADLINE,
    FIRST_COME,
    FIXED_PRIORITY,
    LATER,
    NONE,
    QUEUE,
    SKIP,
    Carrier,
    Leg,
    NetworkLink,
    Parts,
    Processor,
    ScheduledFrame,
    ScheduledTask,
    Stream,
)
from orchestration.systems.computers.scheduler_events import EventBuilder
from orchestration.systems.computers.timeline import NEEDED, Names, Timeline, timeline
from orchestration.systems.schedule.lateness_and_loss import lateness, losses, times
from orchestration.systems.schedule.plan import expect_no_longer
from orchestration.systems.schedule.streams import (
    ARRIVALS,
    DELAY,
    DELAY_JITTER,
    ERROR,
    EXECUTION,
    JITTER,
    LOSS,
    Streams,
)
from orchestration.systems.system import placement
from orchestration.systems.system.choices import Spread
from orchestration.systems.system.component import SamplingOnArrival, TaskSampling
from orchestration.systems.system.computers import Arrivals
from orchestration.systems.system.distribution import Distribution, Varying, spreads
from orchestration.systems.system.frames import ERROR_BITS, frame_nanoseconds
from orchestration.systems.system.model import System

_POLICIES = {
    "fixed-priority": FIXED_PRIORITY,
    "earliest-deadline-first": EARLIEST_DEADLINE,
    "first-come-first-served": FIRST_COME,
}
_OVERRUNS = {"queue": QUEUE, "skip": SKIP, "abort": ABORT}
_NO_DEADLINE = LATER // 2

OfRun: TypeAlias = Callable[[Streams], Stream]
"""Makes a stream of numbers from the generators of a run"""


class Resources:
    """The parts of the scheduler, with their names and their places in the system."""

    def __init__(self, system: System, stop: int) -> None:
        """Up to `stop` [ns]."""
        self._system, self._stop = system, stop
        self._streams: list[Constant | OfRun] = []
        self._links: list[NetworkLink] = []
        self._link_names: list[str] = []
        self._zero = self._stream(Constant(0))
        placed, self._placed_messages = (
            [*placement.placed_tasks(system.computers)],
            [*placement.placed_messages(system.networks)],
        )
        released = placement.released_by(system)
        self.tasks = {each.task.component: i for i, each in enumerate(placed) if each.task.component is not None}
        """the task whose jobs are the steps of a component, by component"""
        by_network = placement.messages_by_connection(system)
        sending = {x.sender for x in system.connections if x.name in by_network or x.name in released}
        for name, component in system.components.items():
            sampling = component.sampling
            on_its_own = isinstance(sampling, SamplingOnArrival) or (sampling is not None and name in sending)
            if on_its_own and not isinstance(sampling, TaskSampling):
                self.tasks[name] = len(placed) + len([x for x in self.tasks.values() if x >= len(placed)])
        self._without_computer = [name for name, i in self.tasks.items() if i >= len(placed)]
        messages = {x.message.connection: m for m, x in enumerate(self._placed_messages)}
        self.carriers = {
            x.name: i
            for i, x in enumerate(
                x
                for x in system.connections
                if x.name in by_network or (x.sender in self.tasks and x.order == "gauss-seidel")
            )
        }
        """the carriers of connections, by connection"""
        processors = [
            Processor(_POLICIES[each.scheduling], each.preemptive, nanoseconds(each.switch))
            for each in system.computers.values()
        ]
        tasks = [self._task(each) for each in placed]
        for i, name in enumerate(self._without_computer, len(processors)):
            tasks.append(self._task_without_computer(name, i))
        self.parts = Parts(
            stop=self._stop,
            processors=(*processors, *(Processor(FIRST_COME, False, 0) for _ in self._without_computer)),
            tasks=tuple(tasks),
            carriers=tuple(
                self._carrier(name, messages.get(name, NONE), self._indices(released.get(name, ())))
                for name in self.carriers
            ),
            messages=tuple(self._message(each) for each in self._placed_messages),
            links=tuple(self._links),
            streams=(),
            places=[*(each.place for each in placed), *(f"components.{name}" for name in self._without_computer),
                    *(each.place for each in self._placed_messages)],
        )  # fmt: skip
        """Parts without the streams, which belong to a run"""
        self._names = Names(
            processors=[*system.computers, *self._without_computer],
            tasks=[*(f"{each.computer_name}.{each.name}" for each in placed), *self._without_computer],
            messages=[f"{each.network_name}.{each.name}" for each in self._placed_messages],
            links=self._link_names,
        )

    def of_run(self, streams: Streams) -> Parts:
        """The parts of a run with these streams."""
        drawn = [each if isinstance(each, Constant) else each(streams) for each in self._streams]
        return replace(self.parts, streams=drawn)

    def timeline(self, streams: Streams) -> Timeline:
        """The timeline of all computers and networks in a run with these streams."""
        parts = self.of_run(streams)
        running = scheduler(parts, NEEDED)
        running.run(LATER)
        dues = [each.message.due for each in self._placed_messages]
        deadlines = [LATER if due is None else nanoseconds(due) for due in dues]
        return timeline(parts, self._names, deadlines, running.take_notes(), without=self._without_computer)

    def event_builder(self) -> EventBuilder:
        """The builder of events from notes of a scheduler of these parts."""
        return EventBuilder(self.parts, self._names.all, without=self._without_computer)

    # -- tasks -----------------------------------------------------------------------------------------------------

    def _task(self, of: placement.PlacedTask) -> ScheduledTask:
        task, ratio = of.task, Fraction(repr(float(of.computer.clock_ratio)))
        nominal = NONE
        if task.on is None:
            nominal = self._instants(of.place, task.offset, task.period, task.arrivals, ratio)
        return ScheduledTask(
            processor=list(self._system.computers).index(of.computer_name),
            priority=task.priority,
            deadline=nanoseconds(task.due),
            overrun=_OVERRUNS[task.overrun],
            reads_at_release=task.read == "release",
            writes_at_deadline=task.write == "deadline",
            nominal=nominal,
            late=self._late(task.jitter, "uniform", of.place),
            execution=self._times(task.execution, of.place, EXECUTION),
            reports_samples=task.component is not None,
        )

    def _task_without_computer(self, name: str, processor: int) -> ScheduledTask:
        """The task of a sampled component that is on no computer; its jobs take no time."""
        sampling = self._system.components[name].sampling
        assert sampling is not None
        ratio, nominal, late = Fraction(repr(float(sampling.clock_ratio))), NONE, self._zero
        if not isinstance(sampling, SamplingOnArrival):
            place = f"components.{name}"
            nominal = self._instants(place, sampling.offset, sampling.period, None, ratio)
            late = self._late(sampling.jitter, sampling.jitter_distribution, place)
        return ScheduledTask(
            processor=processor,
            priority=1,
            deadline=_NO_DEADLINE,
            overrun=QUEUE,
            reads_at_release=False,
            writes_at_deadline=False,
            nominal=nominal,
            late=late,
            execution=self._zero,
        )

    def _indices(self, released: tuple[str, ...]) -> tuple[int, ...]:
        """The indices of tasks, given by their paths or by components that messages release."""
        paths = {each.place: i for i, each in enumerate(placement.placed_tasks(self._system.computers))}
        return tuple(paths[one] if one in paths else self.tasks[one] for one in released)

    # -- messages --------------------------------------------------------------------------------------------------

    def _carrier(self, name: str, message: int, releases: tuple[int, ...]) -> Carrier:
        x = next(x for x in self._system.connections if x.name == name)
        owner = f"connections.{name}"

        def late(streams: Streams) -> Stream:
            delay = times(x.delay, partial(streams.of, owner, DELAY))
            more = lateness(x.delay_jitter, x.jitter_distribution, partial(streams.of, owner, DELAY_JITTER))
            return lambda count: delay(count) + more(count)

        is_late = (
            spreads(x.delay_jitter) or isinstance(x.delay, Distribution) or isinstance(x.delay_jitter, Distribution)
        )
        return Carrier(
            sender=self.tasks.get(x.sender, NONE),
            message=message,
            late=self._stream(late) if is_late else self._times(x.delay, owner, DELAY),
            lost=self._losses(x.loss, x.burst_length, owner, LOSS),
            releases=releases,
        )

    def _message(self, of: placement.PlacedMessage) -> ScheduledFrame:
        message, network = of.message, of.network
        nominal = NONE
        if message.period is not None or message.arrivals is not None:
            nominal = self._instants(of.place, message.offset, message.period, message.arrivals, Fraction(1))
        is_can = network.kind in ("can", "can-fd")
        ranked = {"ethernet": message.priority}
        return ScheduledFrame(
            rank=(message.identifier or 0) if is_can else ranked.get(network.kind, 0),
            legs=self._legs(of),
            pause=nanoseconds(network.latency),
            nominal=nominal,
            late=self._late(message.jitter, "uniform", of.place),
            corrupted=self._losses(network.error, None, of.place, ERROR),
            carrier=self.carriers.get(message.connection or "", NONE),
        )

    def _legs(self, of: placement.PlacedMessage) -> tuple[Leg, ...]:
        network, name = of.network, of.network_name
        length = frame_nanoseconds(network, of.message)
        corrupted = frame_nanoseconds(network, of.message, ERROR_BITS) if network.kind != "tdma" else length
        slot = of.message.slot if network.kind == "tdma" and of.message.slot is not None else NONE
        ways = [name]
        if network.kind == "ethernet":
            start, end = placement.nodes_of(self._system, of)
            ways = [f"{name}: {start} -> switch", f"{name}: switch -> {end}"]
        links = [self._link(way, network.slots) for way in ways]
        return tuple(Leg(link=link, slot=slot, length=length, corrupted_length=corrupted) for link in links)

    def _link(self, name: str, slots: tuple[float, ...]) -> int:
        if name not in self._link_names:
            begins = NONE
            if slots:
                lengths = [exact_nanoseconds(each) for each in slots]
                grids = [Grid(sum(lengths[:i], Fraction(0)), sum(lengths, Fraction(0))) for i in range(len(lengths))]
                begins = self._stream(_Interleaved(grids, self._stop).of_run)
            self._link_names.append(name)
            self._links.append(NetworkLink(slots=len(slots), begins=begins))
        return self._link_names.index(name)

    # -- numbers ---------------------------------------------------------------------------------------------------

    def _stream(self, stream: Constant | OfRun) -> int:
        self._streams.append(stream)
        return len(self._streams) - 1

    def _times(self, of: Varying, owner: str, cause: str) -> int:
        if not isinstance(of, Distribution):
            return self._stream(Constant(nanoseconds(of))) if of else self._zero
        return self._stream(lambda streams: times(of, partial(streams.of, owner, cause)))

    def _late(self, jitter: Varying, spread: Spread, owner: str) -> int:
        if jitter == 0.0:
            return self._zero
        return self._stream(lambda streams: lateness(jitter, spread, partial(streams.of, owner, JITTER)))

    def _losses(self, probability: Varying, burst_length: float | None, owner: str, cause: str) -> int:
        """The stream of losses: 1 with a probability, else 0."""
        if probability == 0.0:
            return self._zero

        def lost(streams: Streams) -> Stream:
            drawn = losses(probability, burst_length, partial(streams.of, owner, cause))
            return lambda count: drawn(count).astype(np.int64)

        return self._stream(lost)

    def _instants(
        self, place: str, offset: float, period: float | None, arrivals: Arrivals | None, ratio: Fraction
    ) -> int:
        start = exact_nanoseconds(offset) / ratio
        if arrivals is not None:
            rate, begin = arrivals.poisson, round(start)
            return self._stream(lambda streams: _poisson(begin, rate, streams.of(place, ARRIVALS)))
        assert period is not None
        return self._stream(_Interleaved([Grid(start, exact_nanoseconds(period) / ratio)], self._stop).of_run)


class _Interleaved:
    """The first instant of each grid, the second of each, and so on; LATER in place of those after the end."""

    def __init__(self, grids: Sequence[Grid], stop: int) -> None:
        self._grids, self._lasts = grids, [grid.index_from(stop) for grid in grids]
        self._kept = lru_cache(_KEPT)(self._between)

    def of_run(self, _streams: Streams) -> Stream:
        """The stream of a run; the same in each."""
        first = 0

        def following(count: int) -> Integers:
            nonlocal first
            first += count
            return self._kept(first - count, count)

        return following

    def _between(self, first: int, count: int) -> Integers:
        found, many = np.full(count, LATER, dtype=np.int64), len(self._grids)
        for i, grid in enumerate(self._grids):
            k = -(-(first - i) // many)  # of the grid's first instant among these
            places = found[k * many + i - first :: many]
            end = min(k + len(places), self._lasts[i] + 1)
            if end > k:
                places[: end - k] = grid.between(k, end)
        found.flags.writeable = False
        return found


_KEPT = 64
"""Cached parts of a grid; those of longer runs are computed again"""


def _poisson(start: int, rate: float, generator: np.random.Generator) -> Stream:
    """Instants of a Poisson process; numpy's logarithm of arrays would give other bits."""
    last = start

    def drawn(count: int) -> Integers:
        nonlocal last
        found = []
        for u in generator.random(count).tolist():
            gap = -math.log(1.0 - u) * NANOSECONDS / rate
            last = min(last + max(1, math.floor(gap)), LATER)
            found.append(last)
        return np.array(found, dtype=np.int64)

    return drawn


def timeline_of(system: System) -> Timeline:
    """The timeline of a system up to its end; raises `UsageError` for times beyond `MAX_TIME`."""
    expect_no_longer(system)
    return Resources(system, nanoseconds(system.stop_time)).timeline(Streams(system.seed, system.streams))
