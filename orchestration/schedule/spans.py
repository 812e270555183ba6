"""What happens in a span of time: what is regular of it, which many runs share, and what a run has of its own."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.basics.simulator import Booleans, Integers
from orchestration.schedule.schedule import Schedule


@dataclass(frozen=True, kw_only=True, eq=False)
class Instants:
    """Instants in order, each once, and who is stepped to them."""

    times: Integers
    """[ns], shape (n,)"""
    stepped: Booleans
    """shape (n, components in continuous time), these in the order in which they are stepped"""

    def __len__(self) -> int:
        return len(self.times)

    def merged_with(self, others: "Instants") -> "Instants":
        """These and some others."""
        at = np.searchsorted(self.times, others.times)
        new = np.ones(len(others), dtype=np.bool_)
        inside = at < len(self)
        new[inside] = self.times[at[inside]] != others.times[inside]
        stepped = np.insert(self.stepped, at[new], False, axis=0)
        stepped[at + np.cumsum(new) - new] |= others.stepped
        return Instants(times=np.insert(self.times, at[new], others.times[new]), stepped=stepped)


class InstantCollector:
    """Instants as they are found, and who is stepped to them: components in continuous time by their places."""

    def __init__(self, count: int) -> None:
        """`count` components are in continuous time."""
        self._count = count
        self._times: list[Integers] = [np.zeros(0, dtype=np.int64)]
        self._places: list[Any] = [[]]
        """of all times that were added together, or of each of them one"""

    def add(self, times: Integers, *places: int) -> None:
        """Something happens at each of these times, in order, to which the components in these places are stepped; -1
        is none. The same array once more adds to what happens then.
        """
        if times is not self._times[-1]:
            self._times.append(times)
            self._places.append([])
        self._places[-1] += [place for place in places if place >= 0]

    def add_each(self, times: Integers, places: Integers) -> None:
        """The same, of each the component in one place."""
        self._times.append(times)
        self._places.append(places)

    def instants(self) -> Instants:
        """All of them."""
        times = instants = np.concatenate(self._times)
        which = np.arange(len(times))
        if not (times[1:] > times[:-1]).all():
            order = np.argsort(times, kind="stable")  # what is in order already is only merged
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
    """What happens from one time to another, each table in the order of time; tables as a `Schedule` has them."""

    end: int
    """[ns], of the instant after these"""
    regular: Instants
    """those that are the same whatever is drawn"""
    own: Instants
    """at which something else happens too; some are regular ones"""
    posted: Integers
    measured: Integers
    """both happen when they are sent"""
    arrivals: Integers
    samples: Integers
    sampled: Integers
    """[ns], the times of the samples"""
    exchanged: Integers

    @property
    def begin(self) -> int:
        """[ns], the first instant."""
        return min(int(each.times[0]) for each in (self.regular, self.own) if len(each))

    def count_of(self, connection: int, table: str) -> int:
        """How many messages of a connection take their values, as `table` has them."""
        return int(np.count_nonzero(getattr(self, table)[:, 0] == connection))

    def schedule(self, continuous: Integers) -> Schedule:
        """The same instant by instant; `continuous` are the components in continuous time, in their order."""
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
    """Where what belongs to each of `count` instants begins, and the last ends, given the instant of each in order."""
    ends = np.concatenate([[-1], instants, [count]])
    return np.repeat(np.arange(len(instants) + 1), np.diff(ends))
