"""The classes of the connections of a system, and the order of its components at one instant."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import messages_by_connection


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
        names = messages_by_connection(self.system)
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
        if first in followers and second in followers and not _reaches(followers, second, first):
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


def _reaches(followers: dict[str, set[str]], start: str, end: str) -> bool:
    seen, stack = set(), [start]
    while stack:
        member = stack.pop()
        if member == end:
            return True
        if member not in seen:
            seen.add(member)
            stack.extend(followers[member])
    return False
