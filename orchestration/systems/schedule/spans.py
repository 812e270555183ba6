"""Spans of time: their regular instants, which many runs share, and those of a single run."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.systems.schedule.schedule import Schedule


@dataclass(frozen=True, kw_only=True, eq=False)
class Instants:
    """Instants in order, each once, and the components that are stepped to them."""

    times: Integers
    """Times [ns], shape (n,)"""
    stepped: Booleans
    """shape (n, components in continuous time), in the order of stepping"""

    def __len__(self) -> int:
        return len(self.times)

    def merged_with(self, others: "Instants") -> "Instants":
        """The union of these and others."""
        at = np.searchsorted(self.times, others.times)
        new = np.ones(len(others), dtype=np.bool_)
        inside = at < len(self)
        new[inside] = self.times[at[inside]] != others.times[inside]
        if not new.any():
            stepped = self.stepped.copy()
            stepped[at] |= others.stepped
            return Instants(times=self.times, stepped=stepped)
        stepped = np.insert(self.stepped, at[new], False, axis=0)
        stepped[at + np.cumsum(new) - new] |= others.stepped
        return Instants(times=np.insert(self.times, at[new], others.times[new]), stepped=stepped)


class InstantCollector:
    """Collects instants, each with the components in continuous time that are stepped to it, by their places."""

    def __init__(self, count: int) -> None:
        """`count` is the number of components in continuous time."""
        self._count = count
        self._times: list[Integers] = [np.zeros(0, dtype=np.int64)]
        self._places: list[Any] = [[]]
        """a list for all times that were added together, or an array with one place for each"""

    def add(self, times: Integers, *places: int) -> None:
        """Add instants, in order, to which the components in these places are stepped; -1 is none.

        The same array again adds to these instants.
        """
        if times is not self._times[-1]:
            self._times.append(times)
            self._places.append([])
        self._places[-1] += [place for place in places if place >= 0]

    def add_each(self, times: Integers, places: Integers) -> None:
        """Add instants, each with the component in its place."""
        self._times.append(times)
        self._places.append(places)

    def instants(self) -> Instants:
        """All instants in order."""
        times = instants = np.concatenate(self._times)
        which = np.arange(len(times))
        if not (times[1:] > times[:-1]).all():
            order = np.argsort(times, kind="stable")  # sorted parts are only merged
            times = times[order]
            first = np.empty(len(times), dtype=np.bool_)
            first[0:1] = True
            np.not_equal(times[1:], times[:-1], out=first[1:])
            instants = times[first]
            which[order] = np.cumsum(first) - 1
        table = np.zeros((len(instants), self._count), dtype=np.bool_)
        begin = 0
        for added, places in zip(self._times, self._places, strict=True):
            rows, begin = which[begin : begin + len(added)], begin + len(added)
            if isinstance(places, list):
                for place in places:
                    table[rows, place] = True
            else:
                table[rows[places >= 0], places[places >= 0]] = True
        return Instants(times=instants, stepped=table)


@dataclass(frozen=True, kw_only=True)
class Span:
    """Everything from one time to another, in order; the tables are those of a `Schedule`."""

    end: int
    """Time of the instant after these [ns]"""
    regular: Instants
    """those that do not depend on the seed"""
    own: Instants
    """those of this run; some are regular ones too"""
    posted: Integers
    measured: Integers
    """both at the time of sending"""
    arrivals: Integers
    samples: Integers
    sampled: Integers
    """Times of the samples [ns]"""
    exchanged: Integers

    @property
    def begin(self) -> int:
        """[ns], the first instant."""
        return min(int(each.times[0]) for each in (self.regular, self.own) if len(each))

    def count_of(self, connection: int, table: str) -> int:
        """The number of messages of a connection in `table`."""
        return int(np.count_nonzero(getattr(self, table)[:, 0] == connection))

    def schedule(self, continuous: Integers) -> Schedule:
        """The schedule of the span; `continuous` are the components in continuous time, in their order."""
        instants = self.regular.merged_with(self.own)
        of, places = np.nonzero(instants.stepped)

        def begins(times: Integers) -> Integers:
            return _begins(np.searchsorted(instants.times, times), len(instants))

        return Schedule(
            times=np.append(instants.times, self.end),
            stepped=continuous[places],
            stepped_at=_begins(of, len(instants)),
            posted=self.posted,
            posted_at=begins(self.posted[:, 2]),
            measured=self.measured,
            measured_at=begins(self.measured[:, 2]),
            arrivals=self.arrivals,
            arrivals_at=begins(self.arrivals[:, 3]),
            samples=self.samples,
            samples_at=begins(self.sampled),
            exchanged=self.exchanged,
        )


def _begins(instants: Integers, count: int) -> Integers:
    """The index at which the rows of each of `count` instants begin, from the instant of each row in order."""
    ends = np.concatenate([[-1], instants, [count]])
    return np.repeat(np.arange(len(instants) + 1), np.diff(ends))
