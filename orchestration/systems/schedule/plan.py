"""The classes of the connections of a system, the order of its components at one instant, and the longest times."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orchestration.foundation.basics.errors import UsageError, prefixed, told_apart
from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import Grid, seconds
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.computers import require_less
from orchestration.systems.system.connection import Connection, component_of
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.frames import ERROR_BITS, frame_nanoseconds
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import messages_by_connection, placed_messages, placed_tasks

MAX_TIME = 2**60
"""Latest time [ns], 36 years: the sum of a few of them still fits into 64 bits"""
MAX_AHEAD = 10**6
"""The largest delay of a measurement in samples: all of them are drawn before the first one"""


@dataclass(frozen=True)
class Plan:
    """The connections of a system, as indices, by kinds of their ends; its components in the order of an instant."""

    system: System

    @cached_property
    def wires(self) -> tuple[int, ...]:
        """Between components in continuous time, without faults: read whenever the receiver is stepped."""
        return tuple(
            i
            for i, x in enumerate(self._connections)
            if self._between_continuous(x) and is_plain(x) and i not in self.over_networks
        )

    @cached_property
    def posted(self) -> tuple[int, ...]:
        """From components in continuous time: to others, a message at each point of the sender if it is no wire; over a
        network, to any component, at the instants of the message.
        """
        return tuple(
            i
            for i, x in enumerate(self._connections)
            if (self._between_continuous(x) and not is_plain(x))
            or (self._continuous(x.sender) and i in self.over_networks)
        )

    @cached_property
    def over_networks(self) -> frozenset[int]:
        """Connections that go over networks."""
        names = messages_by_connection(self.system) if self.system.networks else ()
        return frozenset(i for i, x in enumerate(self._connections) if x.name in names)

    @cached_property
    def measured(self) -> tuple[int, ...]:
        """From a component in continuous time to a sampled one: a message for each sample of the receiver."""
        return tuple(
            i
            for i, x in enumerate(self._connections)
            if self._continuous(x.sender) and not self._continuous(x.receiver) and i not in self.over_networks
        )

    @cached_property
    def read_ahead(self) -> frozenset[int]:
        """Those of `measured` whose messages can be read before their sample."""
        return frozenset(i for i in self.measured if self._connections[i].delay or self._connections[i].delay_jitter)

    @cached_property
    def commanded(self) -> tuple[int, ...]:
        """From a sampled component: a message for each of its samples."""
        return tuple(i for i, x in enumerate(self._connections) if not self._continuous(x.sender))

    @cached_property
    def continuous(self) -> tuple[str, ...]:
        """Components in continuous time, in the order in which they are stepped to one instant."""
        members = [name for name in self.system.components if self._continuous(name)]
        return ranked(members, (self._pair(i) for i in self.wires if self._follows(i)))

    @cached_property
    def sampled(self) -> tuple[str, ...]:
        """Sampled components, in the order in which those that are due at one instant are processed."""
        members = [name for name in self.system.components if not self._continuous(name)]
        at_once = (
            i
            for i in self.commanded
            if not (self._connections[i].delay or self._connections[i].delay_jitter or i in self.over_networks)
        )
        return ranked(members, (self._pair(i) for i in at_once if self._follows(i)))

    @cached_property
    def always_together(self) -> bool:
        """Whether all components in continuous time have a point at every instant, whatever the times.

        So it is with one that every sampled component reads, and that alone gets messages which may be late.
        """
        if not self.continuous:
            return True
        only, of = self.continuous[0], self._connections
        now_read = {of[i].receiver for i in self.measured if i not in self.read_ahead and of[i].sender == only}
        late = {
            x.receiver
            for i, x in enumerate(of)
            if i not in self.measured and (x.delay or x.delay_jitter or x.order == "jacobi" or i in self.over_networks)
        }
        changed = [set(map(component_of, x.to)) for x in self.system.sources.values() if x.period is not None]
        return (
            len(self.continuous) == 1
            and not self.system.uses_scheduler
            and now_read == set(self.sampled)
            and late <= {only}
            and all(only in names for names in changed)
        )

    def _follows(self, index: int) -> bool:
        return self._connections[index].order == "gauss-seidel"

    def _pair(self, index: int) -> tuple[str, str]:
        return self._connections[index].sender, self._connections[index].receiver

    @property
    def _connections(self) -> tuple[Connection, ...]:
        return self.system.connections

    def _continuous(self, name: str) -> bool:
        return self.system.components[name].sampling is None

    def _between_continuous(self, x: Connection) -> bool:
        return self._continuous(x.sender) and self._continuous(x.receiver)


def own_outputs(system: System, signals: Iterable[str]) -> list[str]:
    """Those of `signals` that components in continuous time give at their own points, not what is set in them."""
    continuous = {name for name, component in system.components.items() if component.sampling is None}
    held = {
        end for each in (*(x.end for x in system.connections), *(x.to for x in system.sources.values())) for end in each
    }
    return [name for name in signals if component_of(name) in continuous and name not in held]


def is_plain(x: Connection) -> bool:
    """Whether its messages arrive unchanged, at once."""
    return not (
        x.delay or x.delay_jitter or x.loss or any(x.noise.values()) or any(x.quantisation.values()) or x.hold != "zero"
    )


def ranked(members: Sequence[str], before: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """`members` sorted so that the first of each pair in `before` precedes the second.

    Pairs are used in their order; one that would close a cycle with those before it is ignored. Members that no pair
    orders keep their given order.
    """
    followers: dict[str, set[str]] = {member: set() for member in members}
    for first, second in before:
        if first in followers and second in followers and not reaches(followers, second, first):
            followers[first].add(second)
    waiting = {member: sum(member in after for after in followers.values()) for member in members}
    result: list[str] = []
    while waiting:
        chosen = next(member for member, count in waiting.items() if count == 0)
        del waiting[chosen]
        result.append(chosen)
        for follower in followers[chosen]:
            waiting[follower] -= 1
    return tuple(result)


def reaches(followers: Mapping[str, Iterable[str]], start: str, end: str) -> bool:
    """Whether followers of a member, or theirs, include another; a member reaches itself."""
    seen, stack = set(), [start]
    while stack:
        member = stack.pop()
        if member == end:
            return True
        if member not in seen:
            seen.add(member)
            stack.extend(followers[member])
    return False


def expect_no_longer(system: System) -> None:
    """Raise `UsageError` for a time beyond `MAX_TIME`."""
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
    if system.uses_scheduler:
        times |= _times_of_resources(system)
    for place, time in times.items():
        if time >= seconds(MAX_TIME):
            given, most = told_apart(time, seconds(MAX_TIME))
            raise UsageError(f"{place} = {given} s: expected less than {most} s")
    for i, x in enumerate(system.connections):
        sampling = system.components[x.receiver].sampling
        if sampling is None or system.components[x.sender].sampling is not None:
            continue
        period, late = sampling.period / sampling.clock_ratio, highest(x.delay) + highest(x.delay_jitter)
        if late > MAX_AHEAD * period and i not in Plan(system).over_networks:
            raise UsageError(
                f"connections.{x.name}.delay: is measured {late:g} s before a sample of "
                f"{x.receiver}, every {period:g} s: expected at most {MAX_AHEAD} samples"
            )


def _times_of_resources(system: System) -> dict[str, float]:
    """The times of tasks and messages [s], by path."""
    times: dict[str, float] = {}
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
        times[f"a frame of {of.place}"] = seconds(frame_nanoseconds(of.network, of.message, ERROR_BITS))
        times[f"networks.{of.network_name}.latency"] = of.network.latency
    return times


def _expect_jitter_within_period(name: str, sampling: Sampling) -> None:
    with prefixed(f"components.{name}.sampling."):
        sampling.expect_jitter_within_period()


class Misalignment(NamedTuple):
    """An instant between two points of a component that may not move: the run ends there."""

    time: int
    """Time of that instant [ns]"""
    text: str


@dataclass(frozen=True, kw_only=True)
class FixedStep:
    """The grid of a component of fixed step, and whether instants between its points move to the next one."""

    name: str
    grid: Grid
    moves: bool

    def aligned(self, times: Integers, what: str, misaligned: list[Misalignment]) -> Integers:
        """`times` [ns] on the grid; if they may not move, the first between two points is added to `misaligned`."""
        points: Integers = np.array([self.grid.from_(time) for time in times.tolist()], dtype=np.int64)
        between = np.flatnonzero(points != times)
        if len(between) and not self.moves:
            time, point = int(times[between[0]]), int(points[between[0]])
            before = max(point - self.grid[1], 0)
            misaligned.append(
                Misalignment(
                    time,
                    f"{what} at t = {in_seconds(time)} s falls between two points of components.{self.name}, "
                    f"{self._steps}: expected {in_seconds(before)} s or {in_seconds(point)} s; "
                    'align = "next" moves it there',
                )
            )
        return points

    def expect_end(self, stop: int) -> None:
        """Raise `UsageError` unless `stop` [ns] is on the grid: the end never moves."""
        point = self.grid.from_(stop)
        if point != stop:
            raise UsageError(
                f"stop_time = {in_seconds(stop)}: falls between two points of components.{self.name}, {self._steps}: "
                f"expected {in_seconds(point - self.grid[1])} or {in_seconds(point)}"
            )

    @property
    def _steps(self) -> str:
        return f"which takes steps of {in_seconds(self.grid[1])} s only"


def in_seconds(time: int) -> str:
    """A time [ns] as text in seconds."""
    return f"{seconds(time):.9g}"
