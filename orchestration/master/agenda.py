"""What happens when: the instants of one run, in integer nanoseconds. Nothing here knows an FMU.

All of it follows from the system, the stop time and the seed; no value of a signal is needed.
"""

import heapq
import itertools
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

from orchestration.errors import UsageError
from orchestration.master.chance import Lateness, Losses, lateness, losses
from orchestration.master.plan import Plan
from orchestration.master.streams import DELAY_JITTER, JITTER, LOSS, Streams
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS, Grid, exact_nanoseconds, nanoseconds


class Message(NamedTuple):
    """What travels over a connection."""

    connection: int
    """index of the connection"""
    k: int
    """which message of it"""
    sent: int
    """[ns]"""
    arrival: int | None
    """[ns]; None: lost on the way"""


class Due(NamedTuple):
    """One sampling instant of a component."""

    component: int
    k: int
    """its index"""
    time: int
    """true time [ns]"""
    next_time: int
    """true time of the sample after it [ns], also if that lies beyond the end"""
    received: tuple[Message, ...]
    """what it reads of components in continuous time, each `sent` when it was measured"""
    sent: tuple[Message, ...]
    """what it sends; a message whose arrival is this instant is delivered at once"""


_made = tuple.__new__
"""Makes a named tuple from a tuple, as its class does by way of a Python function: there is one for each message"""


class Instant:
    """A point at which something happens, in the order of the attributes."""

    __slots__ = ("arrivals", "due", "halts", "measured", "posted", "time")

    def __init__(self, time: int) -> None:
        self.time = time
        """[ns]"""
        self.halts: tuple[int, ...] = ()
        """components in continuous time that are stepped to this time, in this order"""
        self.posted: tuple[Message, ...] = ()
        """of components in continuous time to one another, where a message can be late or lost"""
        self.measured: tuple[Message, ...] = ()
        """values that are measured now for samples to come, in the order of the samples"""
        self.arrivals: tuple[Message, ...] = ()
        """messages on their way that arrive, in the order of sending"""
        self.due: tuple[Due, ...] = ()
        """samples, in the order in which they are processed"""


@dataclass(frozen=True, kw_only=True)
class FixedStep:
    """The grid of a component that takes no other step, and whether instants move to its next point."""

    name: str
    grid: Grid
    moves: bool

    def aligned(self, time: int, what: str) -> int:
        """`time` [ns] on the grid; raises `UsageError` naming the nearest points if it may not move."""
        point = self.grid.from_(time)
        if point != time and not self.moves:
            step = self.grid[1]
            raise UsageError(
                f"{what} at t = {_seconds(time)} s falls between two points of components.{self.name}, which takes "
                f"steps of {_seconds(step)} s only: expected {_seconds(max(point - step, 0))} s or {_seconds(point)} s"
                '; align = "next" moves it there'
            )
        return point

    def expect_end(self, stop: int) -> None:
        """Raise `UsageError` unless `stop` [ns] is on the grid: the end moves for nobody."""
        point = self.grid.from_(stop)
        if point != stop:
            step = self.grid[1]
            raise UsageError(
                f"stop_time = {_seconds(stop)}: falls between two points of components.{self.name}, which takes "
                f"steps of {_seconds(step)} s only: expected {_seconds(point - step)} or {_seconds(point)}"
            )


@dataclass(kw_only=True)
class _Link:
    """A connection as the agenda sees it."""

    index: int
    name: str
    delay: int
    late: Lateness | None
    lost: Losses | None
    jacobi: bool
    align: FixedStep | None
    longest: int
    """largest delay [ns]"""
    last: int = 0
    """of the message before: its arrival, or when it was measured; messages never overtake"""

    def message(self, k: int, sent: int) -> Message:
        """The next message, sent at `sent` [ns]."""
        lost = self.lost is not None and self.lost()
        arrival = sent + self.delay if self.late is None else sent + self.delay + self.late()
        if lost:
            return _made(Message, (self.index, k, sent, None))
        if arrival < self.last:
            arrival = self.last
        if self.align is not None:
            arrival = self.align.aligned(arrival, f"an arrival over connections.{self.name}")
        self.last = arrival
        return _made(Message, (self.index, k, sent, arrival))

    def measurement(self, k: int, sample: int) -> Message:
        """The message for a sample at `sample` [ns], `sent` when it is measured."""
        lost = self.lost is not None and self.lost()
        taken = sample - self.delay if self.late is None else sample - self.delay - self.late()
        if taken < self.last:
            taken = self.last
        if self.align is not None:
            taken = self.align.aligned(taken, f"a measurement over connections.{self.name}")
        self.last = taken
        return _made(Message, (self.index, k, taken, None if lost else sample))


@dataclass(kw_only=True)
class _Task:
    """A sampled component as the agenda sees it."""

    index: int
    name: str
    rank: int
    nominal: Iterator[int]
    """the times of the samples to come, were none of them late [ns]"""
    late: Lateness | None
    incoming: list[_Link]
    outgoing: list[_Link]
    align: list[FixedStep]
    halts: int
    """components in continuous time that it reads at its sampling instant, as bits"""
    reads_ahead: bool
    """whether any of what it receives is measured before"""
    ahead: int
    """how long before a sample its earliest measurement may be taken [ns]"""
    stop: int
    """end of the run [ns]"""
    k: int = 0
    time: int = 0
    drawn: deque[Due] = field(default_factory=deque)

    def instant(self, k: int) -> int:
        """The true time of sample k [ns]; to be asked for in order, once."""
        time = next(self.nominal)
        if self.late is not None:
            time += self.late()
        return self._aligned(time, k) if self.align else time

    def _aligned(self, time: int, k: int) -> int:
        before = None
        while time < self.stop + self.ahead and time != before:
            before = time
            for fixed in self.align:
                time = fixed.aligned(time, f"a sample of components.{self.name}")
        if k > 0 and time == self.time < self.stop:
            raise UsageError(
                f"samples {k - 1} and {k} of components.{self.name} both move to t = {_seconds(time)} s, the next "
                f"point of components.{self.align[-1].name}: expected a period that leaves one for each"
            )
        return time


_CHANGE, _POINT, _MEASURE, _ARRIVE, _DUE, _END = range(6)


class Agenda(Iterator[Instant]):
    """The instants of one run over [0, stop], in order.

    Instants are the points of each component in continuous time, every sample, every measurement that is taken
    ahead of its sample, every arrival, every change of a source, the start, and the end, at which nothing samples.
    """

    def __init__(self, system: System, streams: Streams, fixed: Mapping[str, FixedStep] | None = None) -> None:
        self.stop = nanoseconds(system.stop_time)
        self.count = 0
        """how many instants are past"""
        self.aligns = bool(fixed)
        """whether instants have to lie on grids of fixed steps"""
        self._names = list(system.components)
        self._plan = plan = Plan(system)
        self._heap: list[tuple[int, int, int, int, Any]] = []
        self._serial = itertools.count()
        self._finished = False
        self._handlers: tuple[Callable[[int, Any, Instant], int], ...] = (
            self._change, self._point, self._measure, self._arrive, self._sample, self._end,
        )  # fmt: skip
        self._order = [self._names.index(name) for name in plan.continuous]
        self._ordered: dict[int, tuple[int, ...]] = {}
        self._points = {
            i: iter(Grid(Fraction(0), exact_nanoseconds(system.components[self._names[i]].step or 0.0)))
            for i in self._order
        }
        self._sender = [self._names.index(x.sender) for x in system.connections]
        receivers = [self._names.index(x.receiver) for x in system.connections]
        self._halt_of_receiver = [1 << i if i in self._points else 0 for i in receivers]
        for each in (fixed or {}).values():
            each.expect_end(self.stop)
        links = self._links(system, streams, fixed or {})
        self._posted = {i: [links[j] for j in plan.posted if self._sender[j] == i] for i in self._order}
        self._tasks = self._sampled(system, streams, links, receivers, fixed or {})
        self._sources = self._changing(system)
        self._push(self.stop, _END, 0, None)
        for i, points in self._points.items():
            self._push(next(points), _POINT, i, 0)
        for task in self._tasks.values():
            task.time = task.instant(0)
            self._draw(task)
            self._push(task.drawn[0].time, _DUE, task.rank, task.index)

    def __next__(self) -> Instant:
        if self._finished:
            raise StopIteration
        heap, handlers, time = self._heap, self._handlers, self.next_time()
        instant, halts = Instant(time), 0
        while heap[0][0] == time:
            _, phase, which, _, item = heap[0]
            halts |= handlers[phase](which, item, instant)
        self.count += 1
        if halts:
            ordered = self._ordered.get(halts)
            if ordered is None:
                ordered = self._ordered[halts] = tuple(i for i in self._order if halts >> i & 1)
            instant.halts = ordered
        return instant

    def next_time(self) -> int:
        """The time of the instant that comes next [ns]; the first is the start."""
        if self.count == 0:
            return 0
        return self._heap[0][0]

    def _push(self, time: int, phase: int, which: int, item: Any) -> None:
        heapq.heappush(self._heap, (time, phase, which, next(self._serial), item))

    def _push_instead(self, time: int, phase: int, which: int, item: Any) -> None:
        """In place of the item that comes first."""
        heapq.heapreplace(self._heap, (time, phase, which, next(self._serial), item))

    # -- what happens: each takes its item off the heap and note of it in the instant, and says who must halt, as bits

    def _change(self, source: int, k: int, instant: Instant) -> int:
        grid, halts = self._sources[source]
        self._push_instead(grid[k + 1], _CHANGE, source, k + 1)
        return halts

    def _point(self, component: int, k: int, instant: Instant) -> int:
        self._push_instead(next(self._points[component]), _POINT, component, k + 1)
        halts = 1 << component
        for link in self._posted[component]:
            message = link.message(k, instant.time)
            instant.posted += (message,)
            halts |= self._under_way(message, instant.time)
        return halts

    def _measure(self, sender: int, message: Message, instant: Instant) -> int:
        heapq.heappop(self._heap)
        instant.measured += (message,)
        return 1 << sender

    def _arrive(self, connection: int, message: Message, instant: Instant) -> int:
        heapq.heappop(self._heap)
        instant.arrivals += (message,)
        return self._halt_of_receiver[message.connection]

    def _sample(self, rank: int, component: int, instant: Instant) -> int:
        task = self._tasks[component]
        due = task.drawn.popleft()
        heapq.heappop(self._heap)
        self._draw(task)
        self._push(task.drawn[0].time, _DUE, rank, component)
        instant.due += (due,)
        halts = task.halts
        for message in due.sent:
            halts |= self._under_way(message, instant.time)
        return halts

    def _end(self, which: int, item: None, instant: Instant) -> int:
        """Everybody halts, and nothing samples."""
        self._finished = True
        self._push_instead(self.stop + 1, _END, which, item)
        instant.due = ()
        return (1 << len(self._names)) - 1

    def _under_way(self, message: Message, time: int) -> int:
        """Have a message arrive later, unless it is lost or arrives at once."""
        if message.arrival is None:
            return 0
        if message.arrival == time:
            return self._halt_of_receiver[message.connection]
        self._push(message.arrival, _ARRIVE, 0, message)
        return 0

    def _draw(self, task: _Task) -> None:
        """Decide about samples until none that is still to be decided can be measured before the next one is due."""
        while not task.drawn or task.drawn[-1].time - task.ahead < task.drawn[0].time:
            time, k = task.time, task.k
            task.k, task.time = k + 1, task.instant(k + 1)
            received = tuple([link.measurement(k, time) for link in task.incoming])
            if task.reads_ahead:
                self._expect_measurements(received)
            sent = tuple([link.message(k, task.time if link.jacobi else time) for link in task.outgoing])
            task.drawn.append(_made(Due, (task.index, k, time, task.time, received, sent)))
            if task.ahead == 0:
                return

    def _expect_measurements(self, messages: tuple[Message, ...]) -> None:
        """Have those taken that are not read at the sample itself."""
        for message in messages:
            if message.connection in self._plan.read_ahead:
                self._push(message.sent, _MEASURE, self._sender[message.connection], message)

    # -- how it is made --------------------------------------------------------------------------------------------

    def _links(self, system: System, streams: Streams, fixed: Mapping[str, FixedStep]) -> list[_Link]:
        links = []
        for i, x in enumerate(system.connections):
            owner, longest = f"connections.{x.name}", nanoseconds(x.delay_jitter)
            partner = x.sender if i in self._plan.measured else x.receiver
            link = _Link(
                index=i,
                name=x.name,
                delay=nanoseconds(x.delay),
                late=lateness(longest, x.jitter_distribution, partial(streams.of, owner, DELAY_JITTER)),
                lost=losses(x.loss, x.burst_length, partial(streams.of, owner, LOSS)),
                jacobi=x.order == "jacobi",
                align=fixed.get(partner),
                longest=nanoseconds(x.delay) + longest,
            )
            links.append(link)
        return links

    def _sampled(
        self, system: System, streams: Streams, links: list[_Link], receivers: list[int], fixed: Mapping[str, FixedStep]
    ) -> dict[int, _Task]:
        tasks = {}
        for rank, name in enumerate(self._plan.sampled):
            sampling = system.components[name].sampling
            assert sampling is not None
            index, ratio = self._names.index(name), Fraction(repr(float(sampling.clock_ratio)))
            incoming = [links[i] for i in self._plan.measured if receivers[i] == index]
            partners = {system.connections[link.index].sender for link in incoming}
            read_now = {self._sender[link.index] for link in incoming if link.index not in self._plan.read_ahead}
            largest = nanoseconds(sampling.jitter)
            ahead = max((link.longest for link in incoming), default=0)
            tasks[index] = _Task(
                index=index,
                name=name,
                rank=rank,
                nominal=iter(
                    Grid(exact_nanoseconds(sampling.offset) / ratio, exact_nanoseconds(sampling.period) / ratio)
                ),
                late=lateness(largest, sampling.jitter_distribution, partial(streams.of, f"components.{name}", JITTER)),
                incoming=incoming,
                outgoing=[links[i] for i in self._plan.commanded if self._sender[i] == index],
                align=[fixed[partner] for partner in sorted(partners) if partner in fixed],
                halts=sum(1 << sender for sender in read_now),
                reads_ahead=any(link.index in self._plan.read_ahead for link in incoming),
                ahead=ahead,
                stop=self.stop,
            )
        return tasks

    def _changing(self, system: System) -> dict[int, tuple[Grid, int]]:
        """Sources that change by themselves: their grids, and who halts for them."""
        found = {}
        for i, source in enumerate(system.sources.values()):
            if source.period is None:
                continue
            receivers = {self._names.index(end.partition(".")[0]) for end in source.to}
            found[i] = (
                Grid(Fraction(0), exact_nanoseconds(source.period)),
                sum(1 << j for j in receivers if j in self._points),
            )
            self._push(found[i][0][1], _CHANGE, i, 1)  # the value of the start is that of initialisation
        return found


def _seconds(time: int) -> str:
    return f"{time / NANOSECONDS:.9g}"
