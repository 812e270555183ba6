"""The maps of a family, built event by event."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.systems.system.connection import Connection, variable_of
from orchestration.systems.system.distribution import lowest
from orchestration.theory.certificates.events import LoopEvent
from orchestration.theory.certificates.family import Factor, Letter, LoopFamily
from orchestration.theory.certificates.parts import InstantMap, StateLayout


class FamilyBuilder:
    """Collects the matrices of a family."""

    def __init__(self, layout: StateLayout, size: int, lossy: str | None, late: frozenset[str]) -> None:
        self._layout, self._size, self._lossy, self._late = layout, size, lossy, late
        self._matrices: dict[str, Floats] = {}

    def family(self, letters: Sequence[Letter], begins: Sequence[Fraction]) -> LoopFamily:
        """The family; messages that are not in transit at the beginning of a piece are not kept."""
        in_transit = [self._in_transit(begin) for begin in begins]
        kept = [
            i
            for place, i in self._layout.places.items()
            if place[0] != "message" or int(place[2]) < max(counts[place[1]] for counts in in_transit)
        ]
        found = LoopFamily(
            matrices={"flow": self._layout.flow(), **self._matrices}, kept=tuple(kept), letters=tuple(letters)
        )
        return found.without_idle()

    def product(
        self, events: Sequence[LoopEvent], span: tuple[Fraction, Fraction], *, lost: bool
    ) -> tuple[Factor, ...]:
        """The map from the beginning of a piece to its end."""
        found, at = list[Factor](), (span[0], (0,) * len(events[0].slopes))
        in_transit = self._in_transit(span[0])
        for event in events:
            found += _flow(at, (event.time, event.slopes))
            at = event.time, event.slopes
            found.append(Factor(matrix=self._matrix_name(event, in_transit, lost)))
        return (*found, *_flow(at, (span[1], (0,) * len(at[1]))))

    def _in_transit(self, time: Fraction) -> dict[str, int]:
        """The number of messages of each connection in transit just before an instant at which no draw is open."""
        loop, found = self._layout.loop, {}
        for x in loop.system.connections:
            owner = x.sender if loop.is_sampled(x.sender) else x.receiver
            delay = exact_nanoseconds(lowest(x.delay))
            step = loop.period / len(loop.samples_of(owner))
            if x.order == "jacobi" and loop.is_sampled(x.sender):
                delay += step
            sent, arrives = (0, delay) if loop.is_sampled(x.sender) else (-delay, 0)
            first = loop.samples_of(owner)[0]
            found[x.name] = math.ceil((time - first - sent) / step) - math.ceil((time - first - arrives) / step)
        return found

    def _matrix_name(self, event: LoopEvent, in_transit: dict[str, int], lost: bool) -> str:
        """The name of the matrix of an event, which is built."""
        loop, instant = self._layout.loop, InstantMap(self._layout, self._size)
        if event.kind == "sample":
            self._sample(event.subject, instant, in_transit, lost)
        else:
            x = loop.connection(event.subject)
            if event.kind == "measure":
                self._send(x, instant, instant.measure(x), in_transit, lost)
            else:
                instant.receive(x, instant.pop(x, in_transit[x.name]))
                in_transit[x.name] -= 1
        verb = {"sample": "samples", "measure": "is measured", "arrive": "arrives"}[event.kind]
        base = f"{event.subject} {verb}{', lost' if lost and event.subject == self._lossy else ''}"
        for i in itertools.count(1):
            name = base if i == 1 else f"{base} ({i})"
            if name not in self._matrices or np.array_equal(self._matrices[name], instant.rows):
                self._matrices[name] = instant.rows
                return name
        raise AssertionError

    def _send(
        self, x: Connection, instant: InstantMap, values: list[Floats], in_transit: dict[str, int], lost: bool
    ) -> None:
        if x.name == self._lossy:
            values = instant.remember(x, None if lost else values)
        instant.push(x, values, in_transit[x.name])
        in_transit[x.name] += 1

    def _sample(self, name: str, instant: InstantMap, in_transit: dict[str, int], lost: bool) -> None:
        loop = self._layout.loop
        for x in loop.system.connections:
            if x.receiver == name and not loop.is_sampled(x.sender):
                if x.name in self._late:
                    instant.receive(x, instant.pop(x, in_transit[x.name]))
                    in_transit[x.name] -= 1
                elif not (lost and x.name == self._lossy):
                    instant.receive(x, instant.measure(x))
        outputs = instant.sample(name)
        for x in loop.system.connections:
            if x.sender == name:
                values = [x.scale * outputs[variable_of(start)] for start in x.start]
                if x.name in self._late:
                    self._send(x, instant, values, in_transit, lost)
                elif not (lost and x.name == self._lossy):
                    instant.receive(x, values)


def _flow(start: tuple[Fraction, tuple[int, ...]], end: tuple[Fraction, tuple[int, ...]]) -> list[Factor]:
    """The flow between two instants; none if they are equal."""
    times = (float(end[0] - start[0]) / NANOSECONDS, *(float(b - a) for a, b in zip(start[1], end[1])))
    return [Factor(matrix="flow", times=times)] if any(times) else []
