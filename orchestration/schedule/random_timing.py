"""What is drawn of one connection and of one sampled component: when its messages and samples are, in order."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial

import numpy as np

from orchestration.basics.simulator import Integers
from orchestration.schedule.drawing import times
from orchestration.schedule.fixed_step import FixedStep, Refusal, seconds
from orchestration.schedule.lookahead import NEVER, Lookahead
from orchestration.schedule.message_times import lateness, losses
from orchestration.schedule.plan import Plan
from orchestration.schedule.streams import DELAY, DELAY_JITTER, JITTER, LOSS, Streams
from orchestration.system.connection import Connection
from orchestration.system.distribution import highest
from orchestration.system.times import Grid, exact_nanoseconds, nanoseconds


class Link:
    """A connection, and the random numbers that it has not used."""

    def __init__(
        self, index: int, x: Connection, streams: Streams, fixed: FixedStep | None, refused: list[Refusal]
    ) -> None:
        """`fixed` is who is stepped to its messages, if that takes steps of one length only."""
        owner = f"connections.{x.name}"
        self.index, self.jacobi = index, x.order == "jacobi"
        self.longest = nanoseconds(highest(x.delay)) + nanoseconds(highest(x.delay_jitter))
        self._name, self._fixed, self._refused = owner, fixed, refused
        self._delay = times(x.delay, partial(streams.of, owner, DELAY))
        self._late = lateness(x.delay_jitter, x.jitter_distribution, partial(streams.of, owner, DELAY_JITTER))
        self._lost = losses(x.loss, x.burst_length, partial(streams.of, owner, LOSS))
        self._last = 0

    def messages(self, sent: Integers) -> Integers:
        """Arrivals of the next messages, sent at these times; -1 for one that is lost."""
        lost, own = self._lost(len(sent)), sent + self._delay(len(sent)) + self._late(len(sent))
        return self.arrivals(np.where(lost, -1, own))

    def arrivals(self, own: Integers) -> Integers:
        """When the next messages arrive that would by themselves at these times, -1 for one that is lost."""
        result: Integers = np.where(own < 0, -1, self._in_order(np.maximum(own, 0), "an arrival"))
        return result

    def measurements(self, samples: Integers) -> tuple[Integers, Integers]:
        """When the next messages are measured, for samples at these times, and their arrivals as in `messages`."""
        lost, own = self._lost(len(samples)), samples - self._delay(len(samples)) - self._late(len(samples))
        return self._in_order(own, "a measurement"), np.where(lost, -1, samples)

    def _in_order(self, times: Integers, what: str) -> Integers:
        """Messages never overtake."""
        times = np.maximum.accumulate(np.append(self._last, times))[1:]
        if self._fixed is not None:
            times = self._fixed.aligned(times, f"{what} over {self._name}", self._refused)
        self._last = int(times[-1]) if len(times) else self._last
        return times


class TimedComponent:
    """A sampled component: its samples that are drawn and not past, a row each.

    Columns: k, time, time of the next, then for each incoming link when it is measured and arrives, and for each
    outgoing one when it is sent and arrives.
    """

    first: int
    """[ns], its first sample"""

    def __init__(
        self,
        name: str,
        plan: Plan,
        links: Sequence[Link],
        fixed: Mapping[str, FixedStep],
        refused: list[Refusal],
    ) -> None:
        connections = plan.system.connections
        self.index, self.rank = list(plan.system.components).index(name), plan.sampled.index(name)
        self.incoming = [links[i] for i in plan.measured if connections[i].receiver == name]
        self.outgoing = [links[i] for i in plan.commanded if connections[i].sender == name]
        self._ahead = max((link.longest for link in self.incoming), default=0)
        self._name, self._refused, self._stop = f"components.{name}", refused, nanoseconds(plan.system.stop_time)
        self._fixed = [fixed[x] for x in sorted({connections[link.index].sender for link in self.incoming} & {*fixed})]
        self.rows: Integers = np.zeros((0, 3 + 2 * (len(self.incoming) + len(self.outgoing))), dtype=np.int64)

    def draw_until(self, end: int) -> None:
        """Draw until no sample that is still to be drawn has anything to do with what is before `end` [ns]."""
        raise NotImplementedError

    def messages(self, rows: Integers) -> Integers:
        """Of these samples, in the order in which they are exchanged, shape (n, number, 4)."""
        links = [*self.incoming, *self.outgoing]
        result = np.empty((len(rows), len(links), 4), dtype=np.int64)
        for i, link in enumerate(links):
            result[:, i, 0], result[:, i, 1] = link.index, rows[:, 0]
            result[:, i, 2:] = rows[:, MESSAGES + 2 * i : MESSAGES + 2 * i + 2]
        return result

    def _moved(self, times: Integers, first: int, before: int) -> Integers:
        """Samples from number `first` on, on points of who is read; `before` is the one before them [ns]."""
        if not self._fixed:
            return times
        found = []
        for k, time in enumerate(times.tolist(), first):
            found.append(self._aligned(time))
            if found[-1] == before < self._stop:
                text = (
                    f"samples {k - 1} and {k} of {self._name} both move to t = {seconds(before)} s, the next point of "
                    f"components.{self._fixed[-1].name}: expected a period that leaves one for each"
                )
                self._refused.append(Refusal(before, text))
            before = found[-1]
        return np.array(found, dtype=np.int64)

    def _aligned(self, time: int) -> int:
        """The next point from `time` [ns] of all that it reads and that take steps of one length only."""
        before = None
        while time < self._stop + self._ahead and time != before:
            before = time
            for fixed in self._fixed:
                time = int(fixed.aligned(np.array([time]), f"a sample of {self._name}", self._refused)[0])
        return time


class SampledComponent(TimedComponent):
    """One that samples by its own clock."""

    def __init__(
        self,
        name: str,
        plan: Plan,
        links: Sequence[Link],
        streams: Streams,
        fixed: Mapping[str, FixedStep],
        refused: list[Refusal],
    ) -> None:
        super().__init__(name, plan, links, fixed, refused)
        sampling = plan.system.components[name].sampling
        assert sampling is not None
        ratio = Fraction(repr(float(sampling.clock_ratio)))
        self._grid = Grid(exact_nanoseconds(sampling.offset) / ratio, exact_nanoseconds(sampling.period) / ratio)
        generator = partial(streams.of, self._name, JITTER)
        self._late = lateness(sampling.jitter, sampling.jitter_distribution, generator)
        self._k, self._next = 0, self._times(0, 1, -1)
        self.first = int(self._next[0])

    def _times(self, first: int, end: int, before: int) -> Integers:
        """Of samples `first` up to `end`, without that one; `before` is that of the one before them [ns]."""
        return self._moved(self._grid.between(first, end) + self._late(end - first), first, before)

    def draw_until(self, end: int) -> None:
        """Draw until no sample that is still to be drawn has anything to do with what is before `end` [ns]."""
        while self._next[0] - self._ahead < end:
            last = max(self._grid.index_from(end + self._ahead), self._k + 1)
            times = np.append(self._next, self._times(self._k + 1, last + 1, int(self._next[0])))
            now, then, k = times[:-1], times[1:], np.arange(self._k, last)
            columns: list[Integers] = [k, now, then]
            for link in self.incoming:
                columns += link.measurements(now)
            for link in self.outgoing:
                sent = then if link.jacobi else now
                columns += [sent, link.messages(sent)]
            self.rows = np.vstack([self.rows, np.column_stack(columns)])
            self._k, self._next = last, times[-1:]


class ScheduledComponent(TimedComponent):
    """One whose samples and messages the scheduler finds: a task, or what messages release."""

    def __init__(
        self,
        name: str,
        plan: Plan,
        links: Sequence[Link],
        lookahead: Lookahead,
        fixed: Mapping[str, FixedStep],
        refused: list[Refusal],
    ) -> None:
        super().__init__(name, plan, links, fixed, refused)
        self._lookahead, self._samples = lookahead, lookahead.samples[name]
        names = [x.name for x in plan.system.connections]
        self._sent = [lookahead.messages.get(names[link.index]) for link in self.outgoing]
        self._k, self._before = 0, -1
        while not (len(self._samples.times) or lookahead.is_complete):
            lookahead.advance()
        first = self._moved(self._samples.times[:1], 0, -1)
        self.first = int(first[0]) if len(first) else NEVER

    def draw_until(self, end: int) -> None:
        """As in any other."""
        lookahead, samples = self._lookahead, self._samples
        end += self._ahead
        lookahead.advance_to(end)
        while True:
            self._take(min(samples.known(lookahead.is_complete), samples.before(end)))
            if lookahead.is_complete or (len(samples.times) and samples.times[0] >= end):
                return
            lookahead.advance()

    def _take(self, count: int) -> None:
        """So many more are drawn."""
        if not count:
            return
        times, then = self._samples.take(count)
        now = self._moved(times, self._k, self._before)
        columns: list[Integers] = [np.arange(self._k, self._k + count), now, self._moved(then, self._k + 1, -1)]
        for link in self.incoming:
            columns += link.measurements(now)
        for link, messages in zip(self.outgoing, self._sent):
            if messages is None:
                sent = columns[2] if link.jacobi else now
                columns += [sent, link.messages(sent)]
            else:
                sent, own = messages.take(count)
                sent, own = np.maximum(sent, now), np.where(own < 0, -1, np.maximum(own, now))
                columns += [sent, link.arrivals(own)]
        self.rows = np.vstack([self.rows, np.column_stack(columns)])
        self._k, self._before = self._k + count, int(now[-1])


TIME, NEXT, MESSAGES = 1, 2, 3
"""Columns of a row of `SampledComponent`"""
