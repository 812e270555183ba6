"""The timetable of one run: its instants in integer nanoseconds, as arrays. Nothing here knows an FMU.

It follows from the system, the stop time and the seed alone; no value of a signal is needed. It is computed window by
window: samples and messages of each component and connection are drawn up to the end of the window, and sorted into
instants.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.systems.schedule.common_timetable import CommonTimetable, InstantCollector, Span
from orchestration.systems.schedule.instant_arrays import Schedule
from orchestration.systems.schedule.plan import FixedStep, Misalignment
from orchestration.systems.schedule.random_timing import (
    ClockedComponent,
    Link,
    ScheduledComponent,
    TimedComponent,
)
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System

if TYPE_CHECKING:
    from orchestration.systems.schedule.lookahead import Lookahead


class Timetable:
    """Makes the schedules of one run, in order."""

    def __init__(
        self,
        system: System,
        streams: Streams,
        fixed: Mapping[str, FixedStep] | None = None,
        common: CommonTimetable | None = None,
    ) -> None:
        """`fixed` has the components of fixed step; `common` is that of the system, if known.

        Raises `UsageError` as `CommonTimetable`.
        """
        self._common = common = common or CommonTimetable(system, fixed or {})
        self._plan, self._fixed, self.stop = common.plan, common.fixed, common.stop
        self._begin, self._end = 0, self.stop + 1
        self._misaligned: list[Misalignment] = []
        self._ahead: Schedule | None = None
        self.first_samples = {name: first for name, first in self._set_out(streams).items() if first < self.stop}
        """Times of the first samples [ns], by sampled component, of those that sample before the end"""

    def _set_out(self, streams: Streams) -> Mapping[str, int]:
        """Prepare to draw; the times of first samples [ns], by sampled component."""
        common = self._common
        self._connections = common.system.connections
        self._links: list[Link] = []
        for i, x in enumerate(self._connections):
            stepped = self._fixed.get(x.sender if i in self._plan.measured else x.receiver)
            self._links.append(Link(i, x, streams, stepped, self._misaligned))
        self._lookahead = _lookahead(common, streams) if common.system.uses_scheduler else None
        self._tasks = [self._timed(name, streams) for name in self._plan.sampled]
        own = [j for j in self._plan.posted if j not in self._plan.over_networks]
        self._posted = {i: [self._links[j] for j in own if common.sender[j] == i] for i in common.points}
        self._over_networks = [self._links[j] for j in self._plan.posted if j in self._plan.over_networks]
        self._posted_before = dict.fromkeys((link.index for link in self._over_networks), 0)
        self._in_flight = _NO_MESSAGES
        return {name: task.first for name, task in zip(self._plan.sampled, self._tasks)}

    def _timed(self, name: str, streams: Streams) -> TimedComponent:
        if self._lookahead is not None and name in self._lookahead.samples:
            return ScheduledComponent(name, self._plan, self._links, self._lookahead, self._fixed, self._misaligned)
        return ClockedComponent(name, self._plan, self._links, streams, self._fixed, self._misaligned)

    def next_schedule(self, most: int) -> Schedule | None:
        """The next instants, about `most` of them; None at the end.

        Raises `UsageError` for an instant off the grid of a component of fixed step, once all instants before it have
        been returned.
        """
        found = self._ahead or self._window(most)
        if found is not None:
            self._ahead = self._window(most)
            found.times[-1] = self._end if self._ahead is None else self._ahead.times[0]
        elif self._end <= self.stop:
            raise UsageError(min(self._misaligned).text)
        return found

    def spans(self, most: int) -> Iterator[Span]:
        """All spans of a run without components of fixed step, about `most` instants in each."""
        before: Span | None = None
        while self._begin < self._end:
            span = self._span(most)
            if len(span.regular) or len(span.own):
                if before is not None:
                    before.end = span.begin
                    yield before
                before = span
        if before is not None:
            before.end = self._end
            yield before

    def _window(self, most: int) -> Schedule | None:
        """The schedule of the next window with instants."""
        while self._begin < self._end:
            schedule = self._scheduled(self._span(most))
            if self._misaligned:
                self._end = min(self._end, min(self._misaligned).time)
                schedule = schedule.part(0, int(np.searchsorted(schedule.times[:-1], self._end)))
            if len(schedule):
                return schedule
        return None

    def _scheduled(self, span: Span) -> Schedule:
        """The schedule of a window."""
        return span.schedule(self._common.continuous)

    def _span(self, most: int) -> Span:
        """The next window, of about `most` instants, or none."""
        begin = self._begin
        self._begin = end = min(self._end, begin + max(int(most * self._common.mean_interval), 1))
        return self._drawn(begin, end)

    def _drawn(self, begin: int, end: int) -> Span:
        """The window from `begin` to before `end` [ns], the first that is not drawn yet."""
        for task in self._tasks:
            task.draw_until(end)
        found = InstantCollector(len(self._common.continuous))
        posted, later = self._post(begin, end, found)
        measured = self._measure(begin, end, found)
        sampled, samples, exchanged, sent = self._sample(end, found)
        arrivals = self._arrive(end, [later, sent], found)
        for task in self._tasks:
            task.drop_before(end)
        return Span(
            end=end,
            regular=self._common.regular(begin, end),
            own=found.instants(),
            posted=posted,
            measured=measured,
            arrivals=arrivals,
            samples=samples,
            sampled=sampled,
            exchanged=exchanged,
        )

    def _post(self, begin: int, end: int, found: InstantCollector) -> tuple[Integers, Integers]:
        """Messages between components in continuous time: all in order, and those that arrive later."""
        tables, later = [_NO_MESSAGES], [_NO_MESSAGES]
        for component, links in self._posted.items():
            if not links:
                continue
            grid = self._common.points[component]
            first, last = grid.index_from(begin), grid.index_from(end)
            points = grid.between(first, last)
            for place, link in enumerate(links):
                sent = _Sent(link, np.arange(first, last), points, link.messages(points), points, 0, component, place)
                tables.append(sent.table())
                later.append(self._not_arrived(sent, found))
        for link in self._over_networks:
            component = int(self._common.sender[link.index])
            k, points, arrivals = self._network_messages(link, end)
            found.add(points, self._common.place[component])
            sent = _Sent(link, k, points, arrivals, points, 0, component, link.index)
            tables.append(sent.table())
            later.append(self._not_arrived(sent, found))
        table = np.concatenate(tables)
        if len(tables) > 2:
            table = table[np.lexsort((table[:, 7], table[:, 6], table[:, 4]))]
        return np.ascontiguousarray(table[:, :4]), np.concatenate(later)

    def _network_messages(self, link: Link, end: int) -> tuple[Integers, Integers, Integers]:
        """Messages of a component in continuous time over a network before `end` [ns]: k, sending and arrival."""
        lookahead = self._lookahead
        assert lookahead is not None
        messages, end = lookahead.messages[self._connections[link.index].name], min(end, self.stop)
        lookahead.advance_to(end)
        while (count := int(np.searchsorted(messages.instants(), end))) > messages.known(lookahead.is_complete):
            lookahead.advance()
        first = self._posted_before[link.index]
        self._posted_before[link.index] += count
        sent, own = messages.take(count)
        stepped = self._fixed.get(self._connections[link.index].sender)
        if stepped is not None:
            sent = stepped.aligned(sent, "a message", self._misaligned)
        return np.arange(first, first + count), sent, link.arrivals(np.where(own < 0, -1, np.maximum(own, sent)))

    def _measure(self, begin: int, end: int, found: InstantCollector) -> Integers:
        """Messages measured for samples to come."""
        tables = [_NO_MESSAGES[:, :4]]
        for task in self._tasks:
            for i, link in enumerate(task.incoming):
                if link.index in self._plan.read_ahead:
                    taken = task.measured(i)
                    now = slice(*np.searchsorted(taken, (begin, end)).tolist())
                    tables.append(task.messages(now)[:, i])
                    found.add(taken[now], self._common.place[self._common.sender[link.index]])
        table = np.concatenate(tables)
        return table[np.argsort(table[:, 2], kind="stable")]

    def _sample(self, end: int, found: InstantCollector) -> tuple[Integers, Integers, Integers, Integers]:
        """Times of samples, the samples, the messages that they exchange, and those sent that arrive later."""
        times, samples, exchanged, later = (
            [_NO_MESSAGES[:, 0]],
            [_NO_MESSAGES[:, :5]],
            [_NO_MESSAGES[:, :4].reshape(0, 0, 4)],
            [_NO_MESSAGES],
        )
        sender, place = self._common.sender, self._common.place
        for task in self._tasks:  # in the order of one instant
            to_end, count = np.searchsorted(task.times, (end, min(end, self.stop))).tolist()
            now = task.times[:count]
            now_read = [link.index for link in task.incoming if link.index not in self._plan.read_ahead]
            found.add(now, *place[sender[now_read]].tolist())
            for i, link in enumerate(task.outgoing):
                sent = task.sent(i)[:count], task.arrivals(i)[:count]
                later.append(self._not_arrived(_Sent(link, task.numbers[:count], *sent, now, 1, task.rank, i), found))
            found.add(task.times[count:to_end])
            messages = task.messages(slice(count))
            table = np.empty((count, 5), dtype=np.int64)
            for i, column in enumerate((task.index, task.following[:count], 0, len(task.incoming), messages.shape[1])):
                table[:, i] = column
            times.append(now)
            samples.append(table)
            exchanged.append(messages)
        return *_sorted_samples(_concatenated(times), _concatenated(samples), exchanged), _concatenated(later)

    def _not_arrived(self, sent: "_Sent", found: InstantCollector) -> Integers:
        """The messages that arrive later; the receivers of the others are stepped at once."""
        at_once = sent.arrival == sent.time
        found.add(
            sent.time if at_once.all() else sent.time[at_once],
            self._common.place[self._common.receiver[sent.link.index]],
        )
        return _NO_MESSAGES if at_once.all() else sent.table(sent.arrival > sent.time)

    def _arrive(self, end: int, more: Sequence[Integers], found: InstantCollector) -> Integers:
        """The messages that arrive before `end`; the others remain under way."""
        table = _concatenated([self._in_flight, *more])
        if not len(table):
            return table[:, :4]
        now = table[:, 3] < end
        self._in_flight, table = table[~now], table[now]
        found.add_each(table[:, 3], self._common.place[self._common.receiver[table[:, 0]]])
        return np.ascontiguousarray(table[np.lexsort(table[:, [1, 7, 6, 5, 4, 3]].T), :4])


_ORDER = 4
"""Columns that order messages: the instant of sending, whether a sample sent it, the sender, and the place among those
of one sender"""
_NO_MESSAGES: Integers = np.zeros((0, _ORDER + 4), dtype=np.int64)


class _Sent(NamedTuple):
    """Messages of a link, with the values that order them."""

    link: Link
    k: Integers
    sent: Integers
    arrival: Integers
    time: Integers
    phase: int
    sender: int
    place: int

    def table(self, which: Booleans | None = None) -> Integers:
        """All of them, or those of `which`, one per row."""
        rows = np.empty((len(self.k) if which is None else int(which.sum()), _ORDER + 4), dtype=np.int64)
        rows[:, 0], rows[:, 5], rows[:, 6], rows[:, 7] = self.link.index, self.phase, self.sender, self.place
        if len(rows):
            for i, column in enumerate((self.k, self.sent, self.arrival, self.time)):
                rows[:, i + 1] = column if which is None else column[which]
        return rows


def _lookahead(common: CommonTimetable, streams: Streams) -> "Lookahead":
    from orchestration.systems.schedule.lookahead import Lookahead  # not before: few systems use the scheduler

    return Lookahead(common.system, common.resources, streams)


def _concatenated(tables: Sequence[Integers]) -> Integers:
    """The rows of all tables; a single one that is not empty is not copied."""
    some = [table for table in tables if len(table)]
    return np.concatenate(some or tables[:1]) if len(some) != 1 else some[0]


def _sorted_samples(
    times: Integers, samples: Integers, exchanged: Sequence[Integers]
) -> tuple[Integers, Integers, Integers]:
    """Samples in order of time, and the messages that they exchange, which their last three columns index.

    These begin as 0, the number received, and the number of all; `exchanged` has the messages of each task.
    """
    alone = sum(len(messages) > 0 for messages in exchanged) <= 1
    order = slice(None) if alone else np.argsort(times, kind="stable")
    begins = np.empty(len(samples), dtype=np.int64)
    begins[order] = np.cumsum(samples[order, 4]) - samples[order, 4]
    for column in (2, 3, 4):
        samples[:, column] += begins
    if alone:
        return times, samples, _concatenated([messages.reshape(-1, 4) for messages in exchanged])
    table, first = np.empty((sum(messages.size // 4 for messages in exchanged), 4), dtype=np.int64), 0
    for messages in exchanged:
        places = begins[first : first + len(messages), None] + np.arange(messages.shape[1])
        table[places] = messages
        first += len(messages)
    return times[order], samples[order], table
