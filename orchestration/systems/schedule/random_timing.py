"""Random times of the samples of one component and of the messages of one connection, in order."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import Constant, clock_grid, nanoseconds
from orchestration.systems.schedule.lateness_and_loss import lateness, losses, times
from orchestration.systems.schedule.plan import FixedStep, Misalignment, Plan, in_seconds
from orchestration.systems.schedule.streams import DELAY, DELAY_JITTER, JITTER, LOSS, Streams
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import highest

if TYPE_CHECKING:
    from orchestration.systems.schedule.lookahead import Lookahead

NEVER = 2**60
"""Time [ns] of what does not occur before the end"""


class Link:
    """A connection with its random streams."""

    def __init__(
        self, index: int, x: Connection, streams: Streams, fixed: FixedStep | None, misaligned: list[Misalignment]
    ) -> None:
        """`fixed` is the component that is stepped to its messages, if it has a fixed step."""
        owner = f"connections.{x.name}"
        self.index, self.jacobi = index, x.order == "jacobi"
        self.longest = nanoseconds(highest(x.delay)) + nanoseconds(highest(x.delay_jitter))
        self._name, self._fixed, self._misaligned = owner, fixed, misaligned
        delay = times(x.delay, partial(streams.of, owner, DELAY))
        late = lateness(x.delay_jitter, x.jitter_distribution, partial(streams.of, owner, DELAY_JITTER))
        self._late = [each for each in (delay, late) if each != Constant(0)]
        self._lost = losses(x.loss, x.burst_length, partial(streams.of, owner, LOSS)) if x.loss != 0.0 else None
        self._last = 0

    def messages(self, sent: Integers) -> Integers:
        """Arrivals of the next messages, sent at these times; -1 for a lost one."""
        own = sum((late(len(sent)) for late in self._late), sent)
        return self.arrivals(self._without_lost(own))

    def arrivals(self, own: Integers) -> Integers:
        """Arrivals of the next messages from their separate ones, so that none overtakes; -1 for a lost one."""
        found = self._in_order(own, "an arrival")
        return found if own.min(initial=0) == 0 else np.where(own < 0, -1, found)

    def measurements(self, samples: Integers) -> tuple[Integers, Integers]:
        """When the next messages are measured, for samples at these times, and their arrivals as in `messages`."""
        own = samples - sum(late(len(samples)) for late in self._late)
        return self._in_order(own, "a measurement"), self._without_lost(samples)

    def _without_lost(self, arrivals: Integers) -> Integers:
        """The arrivals of the next messages, with -1 for lost ones."""
        return arrivals if self._lost is None else np.where(self._lost(len(arrivals)), -1, arrivals)

    def _in_order(self, own: Integers, what: str) -> Integers:
        """The times `own`, delayed so that no message overtakes another."""
        times: Integers = np.maximum(np.maximum.accumulate(own), self._last)
        if self._fixed is not None:
            times = self._fixed.aligned(times, f"{what} over {self._name}", self._misaligned)
        self._last = int(times[-1]) if len(times) else self._last
        return times


class TimedComponent:
    """A sampled component, and its samples that are drawn and not past, in order."""

    first: int
    """Time of its first sample [ns]"""

    def __init__(
        self,
        name: str,
        plan: Plan,
        links: Sequence[Link],
        fixed: Mapping[str, FixedStep],
        misaligned: list[Misalignment],
    ) -> None:
        connections = plan.system.connections
        self.index, self.rank = list(plan.system.components).index(name), plan.sampled.index(name)
        self.incoming = [links[i] for i in plan.measured if connections[i].receiver == name]
        self.outgoing = [links[i] for i in plan.commanded if connections[i].sender == name]
        self._ahead = max((link.longest for link in self.incoming), default=0)
        self._name, self._misaligned, self._stop = f"components.{name}", misaligned, nanoseconds(plan.system.stop_time)
        self._fixed = [fixed[x] for x in sorted({connections[link.index].sender for link in self.incoming} & {*fixed})]
        self._columns = [np.zeros(0, dtype=np.int64)] * (_OF_LINKS + 2 * len(self.incoming + self.outgoing))

    @property
    def numbers(self) -> Integers:
        """The indices of the samples."""
        return self._columns[0]

    @property
    def times(self) -> Integers:
        """The times of the samples [ns]."""
        return self._columns[1]

    @property
    def following(self) -> Integers:
        """The time of the sample after each [ns]."""
        return self._columns[2]

    def measured(self, place: int) -> Integers:
        """When the messages of an incoming link are measured for the samples [ns]."""
        return self._columns[_OF_LINKS + 2 * place]

    def sent(self, place: int) -> Integers:
        """When the samples send over an outgoing link [ns]."""
        return self._columns[_OF_LINKS + 2 * (len(self.incoming) + place)]

    def arrivals(self, place: int) -> Integers:
        """When those messages arrive [ns]."""
        return self._columns[_OF_LINKS + 2 * (len(self.incoming) + place) + 1]

    def draw_until(self, end: int) -> None:
        """Draw samples until no later one affects anything before `end` [ns]."""
        raise NotImplementedError

    def messages(self, which: slice) -> Integers:
        """The messages of these samples in the order of exchange, shape (n, messages of a sample, 4)."""
        numbers, links = self.numbers[which], [*self.incoming, *self.outgoing]
        result = np.empty((len(numbers), len(links), 4), dtype=np.int64)
        for i, link in enumerate(links):
            result[:, i, 0], result[:, i, 1] = link.index, numbers
            for j in range(2):
                result[:, i, 2 + j] = self._columns[_OF_LINKS + 2 * i + j][which]
        return result

    def drop_before(self, end: int) -> None:
        """Drop the samples before `end` [ns]."""
        first = int(np.searchsorted(self.times, end))
        self._columns = [column[first:] for column in self._columns]

    def _append(self, numbers: Integers, times: Integers, following: Integers, links: Sequence[Integers]) -> None:
        """Add samples; `links` has two columns for each link: when it is measured or sent, and when that arrives."""
        drawn = (numbers, times, following, *links)
        self._columns = [np.concatenate([a, b]) if len(a) else b for a, b in zip(self._columns, drawn, strict=True)]

    def _moved(self, times: Integers, first: int, before: int) -> Integers:
        """Samples from index `first` on, moved to points of what they read; `before` is the one before them [ns]."""
        if not self._fixed:
            return times
        found = []
        for k, time in enumerate(times.tolist(), first):
            found.append(self._aligned(time))
            if found[-1] == before < self._stop:
                text = (
                    f"samples {k - 1} and {k} of {self._name} both move to t = {in_seconds(before)} s, the next "
                    f"point of components.{self._fixed[-1].name}: expected a period that leaves one for each"
                )
                self._misaligned.append(Misalignment(before, text))
            before = found[-1]
        return np.array(found, dtype=np.int64)

    def _aligned(self, time: int) -> int:
        """The next common point, from `time` [ns] on, of all components of fixed step that it reads."""
        before = None
        while time < self._stop + self._ahead and time != before:
            before = time
            for fixed in self._fixed:
                time = int(fixed.aligned(np.array([time]), f"a sample of {self._name}", self._misaligned)[0])
        return time


class ClockedComponent(TimedComponent):
    """A component that samples by its own clock."""

    def __init__(
        self,
        name: str,
        plan: Plan,
        links: Sequence[Link],
        streams: Streams,
        fixed: Mapping[str, FixedStep],
        misaligned: list[Misalignment],
    ) -> None:
        super().__init__(name, plan, links, fixed, misaligned)
        sampling = plan.system.components[name].sampling
        assert sampling is not None
        self._grid = clock_grid(sampling.offset, sampling.period, sampling.clock_ratio)
        generator = partial(streams.of, self._name, JITTER)
        self._late = lateness(sampling.jitter, sampling.jitter_distribution, generator)
        self._k, self._next = 0, self._times(0, 1, -1)
        self.first = int(self._next[0])

    def _times(self, first: int, end: int, before: int) -> Integers:
        """The times of samples `first` to before `end`; `before` is that of the one before them [ns]."""
        return self._moved(self._grid.between(first, end) + self._late(end - first), first, before)

    def draw_until(self, end: int) -> None:
        """Draw samples until no later one affects anything before `end` [ns]."""
        while self._next[0] - self._ahead < end:
            last = max(self._grid.index_from(end + self._ahead), self._k + 1)
            times = np.append(self._next, self._times(self._k + 1, last + 1, int(self._next[0])))
            now, then, k = times[:-1], times[1:], np.arange(self._k, last)
            columns: list[Integers] = []
            for link in self.incoming:
                columns += link.measurements(now)
            for link in self.outgoing:
                sent = then if link.jacobi else now
                columns += [sent, link.messages(sent)]
            self._append(k, now, then, columns)
            self._k, self._next = last, times[-1:]


class ScheduledComponent(TimedComponent):
    """A component whose samples and messages the scheduler computes: a task, or one that messages release."""

    def __init__(
        self,
        name: str,
        plan: Plan,
        links: Sequence[Link],
        lookahead: "Lookahead",
        fixed: Mapping[str, FixedStep],
        misaligned: list[Misalignment],
    ) -> None:
        super().__init__(name, plan, links, fixed, misaligned)
        self._lookahead, self._samples = lookahead, lookahead.samples[name]
        names = [x.name for x in plan.system.connections]
        self._sent = [lookahead.messages.get(names[link.index]) for link in self.outgoing]
        self._k, self._before = 0, -1
        while not (len(self._samples.times) or lookahead.is_complete):
            lookahead.advance()
        first = self._moved(self._samples.times[:1], 0, -1)
        self.first = int(first[0]) if len(first) else NEVER

    def draw_until(self, end: int) -> None:
        """As in `TimedComponent`."""
        lookahead, samples = self._lookahead, self._samples
        end += self._ahead
        lookahead.advance_to(end)
        while True:
            self._draw(min(samples.known(lookahead.is_complete), samples.before(end)))
            if lookahead.is_complete or (len(samples.times) and samples.times[0] >= end):
                return
            lookahead.advance()

    def _draw(self, count: int) -> None:
        """Add the next `count` samples."""
        if not count:
            return
        times, then = self._samples.take(count)
        now = self._moved(times, self._k, self._before)
        following, columns = self._moved(then, self._k + 1, -1), list[Integers]()
        for link in self.incoming:
            columns += link.measurements(now)
        for link, messages in zip(self.outgoing, self._sent):
            if messages is None:
                sent = following if link.jacobi else now
                columns += [sent, link.messages(sent)]
            else:
                sent, own = messages.take(count)
                sent, own = np.maximum(sent, now), np.where(own < 0, -1, np.maximum(own, now))
                columns += [sent, link.arrivals(own)]
        self._append(np.arange(self._k, self._k + count), now, following, columns)
        self._k, self._before = self._k + count, int(now[-1])


_OF_LINKS = 3
"""Columns before those of the links"""
