"""What happens when: the instants of one run, in integer nanoseconds, as arrays. Nothing here knows an FMU.

All of it follows from the system, the stop time and the seed; no value of a signal is needed. It is made a window of
time after the other: points, samples and messages of each component and connection are drawn up to its end, and sorted
into instants.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Booleans, Integers
from orchestration.schedule.fixed_step import FixedStep, Refusal, seconds
from orchestration.schedule.foreseen import Foreseen
from orchestration.schedule.plan import Plan
from orchestration.schedule.random_timing import (
    MESSAGES,
    NEXT,
    TIME,
    Link,
    SampledComponent,
    ScheduledComponent,
    TimedComponent,
)
from orchestration.schedule.schedule import Schedule
from orchestration.schedule.streams import Streams
from orchestration.system.computers import require_less
from orchestration.system.distribution import highest
from orchestration.system.frames import ERROR_BITS, frame_nanoseconds
from orchestration.system.model import Sampling, System, is_foreseen
from orchestration.system.placement import carried, placed_messages, placed_tasks, tasks_of
from orchestration.system.times import NANOSECONDS, Grid, exact_nanoseconds, nanoseconds

LONGEST = 2**60
"""[ns], 36 years: a few of them together still are a whole number of 64 bits"""


MOST_AHEAD = 10**6
"""Samples that a measurement may be late by: all of them are drawn before the first one"""


class _Collected:
    """Instants of a window, and who is stepped to them: a component in continuous time by its place, or nobody (-1)."""

    def __init__(self, count: int) -> None:
        """`count` components are in continuous time."""
        self._count = count
        self._times: list[Integers] = []
        self._places: list[Integers] = []

    def add(self, times: Integers, places: int | Integers = -1) -> None:
        """Something happens at each of these times, to which the component in this place, or in each, is stepped."""
        self._times.append(times)
        self._places.append(np.asarray(places))

    def instants(self) -> tuple[Integers, Integers, Integers]:
        """In order, each once; the places of those that are stepped to them; and where those of each instant begin."""
        times = np.concatenate(self._times)
        order = np.argsort(times, kind="stable")  # what is in order already is only merged
        times = times[order]
        first = np.empty(len(times), dtype=np.bool_)
        first[0:1] = True
        np.not_equal(times[1:], times[:-1], out=first[1:])
        instants = times[first]
        which = np.empty(len(times), dtype=np.int64)
        which[order] = np.cumsum(first) - 1
        table = np.zeros((len(instants), self._count), dtype=np.bool_)
        begin = 0
        for added, places in zip(self._times, self._places, strict=True):
            rows, begin = which[begin : begin + len(added)], begin + len(added)
            if places.ndim:
                rows, places = rows[places >= 0], places[places >= 0]
            if places.ndim or places >= 0:
                table[rows, places] = True
        of, places = np.divmod(np.flatnonzero(table), max(self._count, 1))
        return instants, places, _begins(of, len(instants))


def _begins(instants: Integers, count: int) -> Integers:
    """Where what belongs to each of `count` instants begins, and the last ends, given the instant of each."""
    result = np.zeros(count + 1, dtype=np.int64)
    np.cumsum(np.bincount(instants, minlength=count), out=result[1:])
    return result


class Timetable:
    """Gives the schedules of one run, in order."""

    def __init__(self, system: System, streams: Streams, fixed: Mapping[str, FixedStep] | None = None) -> None:
        """`fixed` has the components that take steps of one length only.

        Raises `UsageError` if the end is between two points of one of them, or for times beyond `LONGEST`.
        """
        _expect_no_longer(system)
        self._plan = plan = Plan(system)
        self.stop = nanoseconds(system.stop_time)
        fixed = fixed or {}
        for each in fixed.values():
            each.expect_end(self.stop)
        self._begin, self._end = 0, self.stop + 1
        self._refused: list[Refusal] = []
        names = list(system.components)
        links = []
        for i, x in enumerate(system.connections):
            stepped = fixed.get(x.sender if i in plan.measured else x.receiver)
            links.append(Link(i, x, streams, stepped, self._refused))
        self._continuous = np.array([names.index(name) for name in plan.continuous], dtype=np.int64)
        self._place = np.full(len(names), -1)
        self._place[self._continuous] = np.arange(len(self._continuous))
        self._points = {
            i: Grid(Fraction(0), exact_nanoseconds(system.components[names[i]].step or 0.0))
            for i in sorted(self._continuous.tolist())
        }
        _expect_moves(system, fixed)
        self._fixed = fixed
        self._foreseen = Foreseen(system, streams, max((links[i].longest for i in plan.measured), default=0))
        self._tasks = [self._timed(name, links, streams, fixed) for name in plan.sampled]
        self.first_samples = {
            name: task.first for name, task in zip(plan.sampled, self._tasks) if task.first < self.stop
        }
        """[ns], by sampled component that samples at all"""
        self._connections = system.connections
        self._sender = np.array([names.index(x.sender) for x in system.connections], dtype=np.int64)
        self._receiver = np.array([names.index(x.receiver) for x in system.connections], dtype=np.int64)
        own = [j for j in plan.posted if j not in plan.over_networks]
        self._posted = {i: [links[j] for j in own if self._sender[j] == i] for i in self._points}
        self._over_networks = [links[j] for j in plan.posted if j in plan.over_networks]
        self._posted_before = dict.fromkeys((link.index for link in self._over_networks), 0)
        self._changes = [
            (Grid(Fraction(0), exact_nanoseconds(source.period)), [names.index(end.split(".")[0]) for end in source.to])
            for source in system.sources.values()
            if source.period is not None
        ]
        self._on_their_way: Integers = np.zeros((0, _ORDER + 4), dtype=np.int64)
        self._pace = _pace(system)
        self._ahead: Schedule | None = None

    def _timed(
        self, name: str, links: Sequence[Link], streams: Streams, fixed: Mapping[str, FixedStep]
    ) -> TimedComponent:
        if name in self._foreseen.samples:
            return ScheduledComponent(name, self._plan, links, self._foreseen, fixed, self._refused)
        return SampledComponent(name, self._plan, links, streams, fixed, self._refused)

    def following(self, most: int) -> Schedule | None:
        """The next instants, about `most` of them; None at the end.

        Raises `UsageError` for what cannot be on the grid of a component of fixed steps, when all instants before it
        have been given.
        """
        found = self._ahead or self._window(most)
        if found is not None:
            self._ahead = self._window(most)
            found.times[-1] = self._end if self._ahead is None else self._ahead.times[0]
        elif self._end <= self.stop:
            raise UsageError(min(self._refused).text)
        return found

    def _window(self, most: int) -> Schedule | None:
        """The instants of the next window that has any."""
        while self._begin < self._end:
            begin = self._begin
            self._begin = min(self._end, begin + max(int(most * self._pace), 1))
            schedule = self._between(begin, self._begin)
            if self._refused:
                self._end = min(self._end, min(self._refused).time)
                schedule = schedule.part(0, int(np.searchsorted(schedule.times[:-1], self._end)))
            if len(schedule):
                return schedule
        return None

    def _between(self, begin: int, end: int) -> Schedule:
        """The instants from `begin` to before `end` [ns]."""
        for task in self._tasks:
            task.drawn_to(end)
        found = _Collected(len(self._continuous))
        posted, later = self._post(begin, end, found)
        measured = self._measure(begin, end, found)
        samples, exchanged, sent = self._sample(begin, end, found)
        arrivals = self._arrive(end, [later, sent], found)
        self._step_all(begin, end, found)
        for task in self._tasks:
            task.rows = task.rows[task.rows[:, TIME] >= end]
        instants, places, stepped_at = found.instants()

        def begins(times: Integers) -> Integers:
            return _begins(np.searchsorted(instants, times), len(instants))

        return Schedule(
            times=np.append(instants, end),
            stepped=self._continuous[places],
            stepped_at=stepped_at,
            posted=np.ascontiguousarray(posted[:, :4]),
            posted_at=begins(posted[:, 4]),
            measured=measured,
            measured_at=begins(measured[:, 2]),
            arrivals=arrivals,
            arrivals_at=begins(arrivals[:, 3]),
            samples=np.ascontiguousarray(samples[:, 1:]),
            samples_at=begins(samples[:, 0]),
            exchanged=exchanged,
        )

    def _step_all(self, begin: int, end: int, found: _Collected) -> None:
        """The start, changes of sources, and the end, to which everybody is stepped."""
        if begin == 0:
            found.add(np.zeros(1, dtype=np.int64))
        for grid, receivers in self._changes:  # the value of the start is that of initialisation
            times = grid.between(max(grid.index_from(begin), 1), max(grid.index_from(end), 1))
            for receiver in receivers:
                found.add(times, self._place[receiver])
        if end > self.stop:
            found.add(np.full(len(self._continuous), self.stop), np.arange(len(self._continuous)))
            found.add(np.full(1, self.stop))

    def _post(self, begin: int, end: int, found: _Collected) -> tuple[Integers, Integers]:
        """Messages of components in continuous time to one another: all in order, and those that arrive later."""
        tables = [np.zeros((0, _ORDER + 4), dtype=np.int64)]
        later = [np.zeros((0, _ORDER + 4), dtype=np.int64)]
        for component, grid in self._points.items():
            first, last = grid.index_from(begin), grid.index_from(end)
            points = grid.between(first, last)
            found.add(points, self._place[component])
            for place, link in enumerate(self._posted[component]):
                sent = _Sent(link, np.arange(first, last), points, link.messages(points), points, 0, component, place)
                tables.append(sent.table())
                later.append(self._under_way(sent, found))
        for link in self._over_networks:
            component = int(self._sender[link.index])
            k, points, arrivals = self._networked(link, end)
            found.add(points, self._place[component])
            sent = _Sent(link, k, points, arrivals, points, 0, component, link.index)
            tables.append(sent.table())
            later.append(self._under_way(sent, found))
        table = np.concatenate(tables)
        return table[np.lexsort((table[:, 7], table[:, 6], table[:, 4]))], np.concatenate(later)

    def _networked(self, link: Link, end: int) -> tuple[Integers, Integers, Integers]:
        """Messages of a component in continuous time over a network before `end` [ns]: k, when they go and arrive."""
        foreseen = self._foreseen
        messages, end = foreseen.messages[self._connections[link.index].name], min(end, self.stop)
        foreseen.to(end)
        while (count := int(np.searchsorted(messages.instants(), end))) > messages.known(foreseen.over):
            foreseen.further()
        first = self._posted_before[link.index]
        self._posted_before[link.index] += count
        sent, own = messages.take(count)
        stepped = self._fixed.get(self._connections[link.index].sender)
        if stepped is not None:
            sent = stepped.aligned(sent, "a message", self._refused)
        return np.arange(first, first + count), sent, link.arrivals(np.where(own < 0, -1, np.maximum(own, sent)))

    def _measure(self, begin: int, end: int, found: _Collected) -> Integers:
        """What is measured for samples to come."""
        tables = [np.zeros((0, 4), dtype=np.int64)]
        for task in self._tasks:
            for i, link in enumerate(task.incoming):
                if link.index in self._plan.read_ahead:
                    taken = task.rows[:, MESSAGES + 2 * i]
                    now = (taken >= begin) & (taken < end)
                    tables.append(task.messages(task.rows[now])[:, i])
                    found.add(taken[now], self._place[self._sender[link.index]])
        table = np.concatenate(tables)
        return table[np.argsort(table[:, 2], kind="stable")]

    def _sample(self, begin: int, end: int, found: _Collected) -> tuple[Integers, Integers, Integers]:
        """Samples with their time before them, what they exchange, and of what they send that which arrives later."""
        later = [np.zeros((0, _ORDER + 4), dtype=np.int64)]
        drawn, exchanged = [np.zeros((0, 6), dtype=np.int64)], [np.zeros((0, 0, 4), dtype=np.int64)]
        for task in self._tasks:  # those that come first at one instant come first
            times = task.rows[:, TIME]
            found.add(times[(times >= begin) & (times < end)])
            rows = task.rows[(times >= begin) & (times < min(end, self.stop))]
            for link in task.incoming:
                if link.index not in self._plan.read_ahead:
                    found.add(rows[:, TIME], self._place[self._sender[link.index]])
            messages, middle = task.messages(rows), len(task.incoming)
            samples = np.empty((len(rows), 6), dtype=np.int64)
            samples[:, 0], samples[:, 1], samples[:, 2], samples[:, 3] = rows[:, TIME], task.index, rows[:, NEXT], 0
            samples[:, 4:] = middle, messages.shape[1]
            drawn.append(samples)
            exchanged.append(messages)
            for place, link in enumerate(task.outgoing):
                _, k, sent, arrivals = messages[:, middle + place].T
                later.append(self._under_way(_Sent(link, k, sent, arrivals, samples[:, 0], 1, task.rank, place), found))
        return *_one_after_the_other(np.concatenate(drawn), exchanged), np.concatenate(later)

    def _under_way(self, sent: "_Sent", found: _Collected) -> Integers:
        """Messages that arrive later; for those that arrive at once their receiver is stepped."""
        found.add(sent.time[sent.arrival == sent.time], self._place[self._receiver[sent.link.index]])
        return sent.table(sent.arrival > sent.time)

    def _arrive(self, end: int, more: Sequence[Integers], found: _Collected) -> Integers:
        """Messages that arrive before `end`; the others stay on their way."""
        table = np.concatenate([self._on_their_way, *more])
        now = table[:, 3] < end
        self._on_their_way, table = table[~now], table[now]
        found.add(table[:, 3], self._place[self._receiver[table[:, 0]]])
        return np.ascontiguousarray(table[np.lexsort(table[:, [1, 7, 6, 5, 4, 3]].T), :4])


def _expect_no_longer(system: System) -> None:
    """Raise `UsageError` for a time beyond `LONGEST`."""
    times = {"stop_time": system.stop_time}
    times |= {f"components.{name}.step": component.step or 0.0 for name, component in system.components.items()}
    times |= {f"sources.{name}.period": source.period or 0.0 for name, source in system.sources.items()}
    for name, component in system.components.items():
        if component.sampling is not None:
            _expect_jitter_within_period(name, component.sampling)
            for key in ("period", "offset"):
                place = f"components.{name}.sampling.{key}"
                times[place] = getattr(component.sampling, key) / component.sampling.clock_ratio
    for x in system.connections:
        times |= {f"connections.{x.name}.{key}": highest(getattr(x, key)) for key in ("delay", "delay_jitter")}
    for task in placed_tasks(system.computers):
        ratio = task.computer.clock_ratio
        if task.task.period is not None:
            require_less(f"{task.place}.jitter", task.task.jitter, task.task.period / ratio)
        times |= {f"{task.place}.{key}": (getattr(task.task, key) or 0.0) / ratio for key in ("period", "offset")}
        times |= {f"{task.place}.execution": highest(task.task.execution), f"{task.place}.deadline": task.task.due}
        times[f"computers.{task.computer_name}.switch"] = task.computer.switch
    for of in placed_messages(system.networks):
        if of.message.period is not None:
            require_less(f"{of.place}.jitter", of.message.jitter, of.message.period)
        times |= {f"{of.place}.{key}": getattr(of.message, key) or 0.0 for key in ("period", "offset", "deadline")}
        times[f"{of.place}.bytes"] = frame_nanoseconds(of.network, of.message, ERROR_BITS) / NANOSECONDS
        times[f"networks.{of.network_name}.latency"] = of.network.latency
    for place, time in times.items():
        if time >= LONGEST / NANOSECONDS:
            raise UsageError(f"{place} = {time:g} s: expected less than {LONGEST / NANOSECONDS:.4g} s")
    over = carried(system)
    for x in system.connections:
        sampling = system.components[x.receiver].sampling
        if sampling is None or system.components[x.sender].sampling is not None:
            continue
        period, late = sampling.period / sampling.clock_ratio, highest(x.delay) + highest(x.delay_jitter)
        if x.name in over:
            continue
        if late > MOST_AHEAD * period:
            raise UsageError(
                f"connections.{x.name}.delay: is measured {late:g} s before a sample of "
                f"{x.receiver}, every {period:g} s: expected at most {MOST_AHEAD} samples"
            )


def _expect_jitter_within_period(name: str, sampling: Sampling) -> None:
    try:
        sampling.expect_jitter_within_period()
    except UsageError as error:
        raise UsageError(f"components.{name}.sampling.{error}") from error


def _expect_moves(system: System, fixed: Mapping[str, FixedStep]) -> None:
    """Raise `UsageError` for a component of fixed steps that a task or a network meets between two of its points."""
    tasks, over = tasks_of(system), carried(system)
    for x in system.connections:
        places = [of.place for of in (tasks.get(x.sender), tasks.get(x.receiver), over.get(x.name)) if of is not None]
        for name in (x.sender, x.receiver):
            if places and name in fixed and not fixed[name].moves:
                raise UsageError(
                    f"{places[0]}: components.{name} takes steps of {seconds(fixed[name].grid[1])} s only: expected "
                    'align = "next" there'
                )


def _pace(system: System) -> float:
    """From one instant to the next [ns], about."""
    periods = [component.step for component in system.components.values()]
    periods += [source.period for source in system.sources.values()]
    rates = [1.0 / float(exact_nanoseconds(period)) for period in periods if period is not None]
    for component in system.components.values():
        if component.sampling is not None:
            instants = 2.0 if is_foreseen(component.sampling) else 1.0  # it samples, and it writes
            period = float(exact_nanoseconds(component.sampling.period))
            rates.append(instants * component.sampling.clock_ratio / period)
    by_connection = carried(system)
    periods = [by_connection[x.name].message.period for x in system.connections if x.name in by_connection]
    rates += [1.0 / float(exact_nanoseconds(period)) for period in periods if period is not None]
    if not rates:
        return float(nanoseconds(system.stop_time))
    return 1.0 / sum(rates)


_ORDER = 4
"""Columns by which messages are put in order: the instant at which they were sent, whether by a sample, by whom, and
which of those of one sender they are"""


class _Sent(NamedTuple):
    """Messages of a link, and by what they are put in order."""

    link: Link
    k: Integers
    sent: Integers
    arrival: Integers
    time: Integers
    phase: int
    whom: int
    place: int

    def table(self, which: Booleans | None = None) -> Integers:
        """All of them, or these: a row each."""
        rows = np.empty((len(self.k) if which is None else int(which.sum()), _ORDER + 4), dtype=np.int64)
        rows[:, 0], rows[:, 5], rows[:, 6], rows[:, 7] = self.link.index, self.phase, self.whom, self.place
        if len(rows):
            for i, column in enumerate((self.k, self.sent, self.arrival, self.time)):
                rows[:, i + 1] = column if which is None else column[which]
        return rows


def _one_after_the_other(samples: Integers, exchanged: Sequence[Integers]) -> tuple[Integers, Integers]:
    """Samples in order of time, and what they exchange: their last three columns say from where on in it.

    They begin as 0, the number that is received, and that of all; `exchanged` has the messages task after task.
    """
    if sum(len(messages) > 0 for messages in exchanged) <= 1:
        table = np.concatenate([messages.reshape(-1, 4) for messages in exchanged])
        samples[:, 3:] += (np.cumsum(samples[:, 5]) - samples[:, 5])[:, None]
        return samples, table
    order = np.argsort(samples[:, 0], kind="stable")
    begins = np.empty(len(samples), dtype=np.int64)
    begins[order] = np.cumsum(samples[order, 5]) - samples[order, 5]
    table, first = np.empty((int(samples[:, 5].sum()), 4), dtype=np.int64), 0
    for messages in exchanged:
        places = begins[first : first + len(messages), None] + np.arange(messages.shape[1])
        table[places] = messages
        first += len(messages)
    samples[:, 3:] += begins[:, None]
    return samples[order], table
