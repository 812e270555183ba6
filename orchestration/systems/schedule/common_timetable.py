"""Spans of a timetable: regular instants, which no seed changes and many runs share, and those of a single run."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestration.foundation.basics.c_structures import address
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.foundation.basics.times import Grid, clock_grid, exact_nanoseconds, nanoseconds
from orchestration.systems.schedule.instant_arrays import Schedule
from orchestration.systems.schedule.plan import FixedStep, Plan, expect_no_longer, in_seconds
from orchestration.systems.system.component import has_scheduled_instants
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import messages_by_connection, placed_tasks, tasks_of

if TYPE_CHECKING:
    from orchestration.systems.schedule.resources import Resources


@dataclass(frozen=True, kw_only=True, eq=False)
class Instants:
    """Instants in order, each once, and the components that are stepped to them."""

    times: Integers
    """Times [ns], shape (n,)"""
    stepped: Booleans
    """shape (n, components in continuous time), in the order of stepping"""

    def __len__(self) -> int:
        return len(self.times)

    @cached_property
    def addresses(self) -> tuple[int, int]:
        """The addresses of both."""
        return address(self.times), address(self.stepped)

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


@dataclass(kw_only=True, eq=False)
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
    addresses: Mapping[str, int] = field(default_factory=dict)
    """The addresses of tables that are known"""

    @property
    def begin(self) -> int:
        """[ns], the first instant."""
        return min(int(each.times[0]) for each in (self.regular, self.own) if len(each))

    def address_of(self, table: str) -> int:
        """The address of a table."""
        return self.addresses.get(table) or address(getattr(self, table))

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


_KEPT = 32
"""Spans whose regular instants are cached"""
_Points = tuple[tuple[Fraction, tuple[int, ...]], ...]
"""Distances of points [ns], and the components in continuous time, by their places, that are stepped to them"""
_SinglePoints = tuple[tuple[tuple[int, ...], int], ...]
"""Times of other points [ns], and the component that is stepped to them"""


class CommonTimetable:
    """The common part of all timetables of a system."""

    def __init__(self, system: System, fixed: Mapping[str, FixedStep]) -> None:
        """`fixed` has the components of fixed step.

        Raises `UsageError` if the end is between two points of one of them, or for times beyond `MAX_TIME`.
        """
        expect_no_longer(system)
        self.system, self.fixed, self.plan = system, fixed, Plan(system)
        self.stop = nanoseconds(system.stop_time)
        for name, each in fixed.items():
            each.expect_end(self.stop)
            if system.components[name].points:
                raise UsageError(f"components.{name}.points: it takes steps of one length only; expected none")
        if system.uses_scheduler:
            _expect_moves(system, fixed)
        names = list(system.components)
        self.continuous = np.array([names.index(name) for name in self.plan.continuous], dtype=np.int64)
        """indices of components in continuous time, in the order in which they are stepped"""
        self.place = np.full(len(names), -1)
        """the position of each component among those, -1 for a sampled one"""
        self.place[self.continuous] = np.arange(len(self.continuous))
        self.points = {
            i: Grid(Fraction(0), exact_nanoseconds(system.components[names[i]].step or 0.0))
            for i in sorted(self.continuous.tolist())
        }
        """the grids of the components in continuous time, by their indices"""
        self.sender = np.array([names.index(x.sender) for x in system.connections], dtype=np.int64)
        self.receiver = np.array([names.index(x.receiver) for x in system.connections], dtype=np.int64)
        """the components at the ends of the connections"""
        self.mean_interval = _mean_interval(system)
        """the approximate mean time between instants [ns]"""
        self._steps: _Points = tuple(
            (exact_nanoseconds(system.components[names[i]].step or 0.0), (int(self.place[i]),)) for i in self.points
        )
        self._single: _SinglePoints = tuple(
            (tuple(map(nanoseconds, system.components[names[i]].points)), int(self.place[i])) for i in self.points
        )
        self._changes: _Points = tuple(
            (
                exact_nanoseconds(source.period),
                tuple(int(self.place[names.index(end.split(".")[0])]) for end in source.to),
            )
            for source in system.sources.values()
            if source.period is not None
        )
        self.outlines: dict[Hashable, object] = {}
        """Outlines for C, by the numbers of streams"""

    @cached_property
    def grids(self) -> dict[str, Grid]:
        """The grids of all components by name: of points in continuous time, or of samples."""
        components = self.system.components
        names = [*components]
        grids = {names[i]: grid for i, grid in self.points.items()}
        for name, component in components.items():
            if component.sampling is not None:
                sampling = component.sampling
                grids[name] = clock_grid(sampling.offset, sampling.period, sampling.clock_ratio)
        return grids

    @cached_property
    def resources(self) -> "Resources":
        """The computers and networks for the scheduler, up to the time until which it has to run.

        That is after the end for measurements ahead of a sample after the end, and up to the deadlines of jobs that
        read at their release.
        """
        from orchestration.systems.schedule.resources import Resources  # not before: few systems have any

        measured = (self.system.connections[i] for i in self.plan.measured)
        ahead = (nanoseconds(highest(x.delay)) + nanoseconds(highest(x.delay_jitter)) for x in measured)
        tasks = (each.task for each in placed_tasks(self.system.computers))
        open_for = (nanoseconds(task.due) for task in tasks if task.read == "release" and task.overrun == "abort")
        return Resources(self.system, self.stop + max(ahead, default=0) + max(open_for, default=0))

    def regular(self, begin: int, end: int) -> Instants:
        """The regular instants from `begin` to before `end` [ns]: points, changes of sources, the start and the end."""
        return _regular(self._steps, self._single, self._changes, self.stop, begin, end)


@lru_cache(_KEPT)
def _regular(steps: _Points, single: _SinglePoints, changes: _Points, stop: int, begin: int, end: int) -> Instants:
    """The regular instants of all systems with these steps and changes of sources: they do not follow from samples."""
    found = InstantCollector(len(steps))
    for distance, places in steps:
        grid = Grid(Fraction(0), distance)
        found.add(grid.between(grid.index_from(begin), grid.index_from(end)), *places)
    for times, place in single:
        points = np.array(times, dtype=np.int64)
        found.add(points[(points >= begin) & (points < min(end, stop))], place)
    if begin == 0:
        found.add(np.zeros(1, dtype=np.int64))
    for distance, places in changes:  # the value at the start is that of initialisation
        grid = Grid(Fraction(0), distance)
        found.add(grid.between(max(grid.index_from(begin), 1), max(grid.index_from(end), 1)), *places)
    if end > stop:
        found.add(np.full(1, stop), *range(len(steps)))
    return found.instants()


def _expect_moves(system: System, fixed: Mapping[str, FixedStep]) -> None:
    """Raise `UsageError` for a component of fixed steps beside a task or a network unless its instants may move."""
    tasks, over = tasks_of(system), messages_by_connection(system)
    for x in system.connections:
        places = [of.place for of in (tasks.get(x.sender), tasks.get(x.receiver), over.get(x.name)) if of is not None]
        for name in (x.sender, x.receiver):
            if places and name in fixed and not fixed[name].moves:
                raise UsageError(
                    f"{places[0]}: components.{name} takes steps of {in_seconds(fixed[name].grid[1])} s only: expected "
                    'align = "next" there'
                )


def _mean_interval(system: System) -> float:
    """The approximate mean time between instants [ns]."""
    periods = [component.step for component in system.components.values()]
    periods += [source.period for source in system.sources.values()]
    rates = [1.0 / float(exact_nanoseconds(period)) for period in periods if period is not None]
    for component in system.components.values():
        if component.sampling is not None:
            instants = 2.0 if has_scheduled_instants(component.sampling) else 1.0  # it samples, and it writes
            period = float(exact_nanoseconds(component.sampling.period))
            rates.append(instants * component.sampling.clock_ratio / period)
    by_connection = messages_by_connection(system) if system.networks else {}
    periods = [by_connection[x.name].message.period for x in system.connections if x.name in by_connection]
    rates += [1.0 / float(exact_nanoseconds(period)) for period in periods if period is not None]
    if not rates:
        return float(nanoseconds(system.stop_time))
    return 1.0 / sum(rates)
