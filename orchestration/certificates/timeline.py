"""From a loop and what varies in it to the family of maps of its periods.

The time is cut where nothing that varies is open: a piece has one draw of each quantity that varies. Within a piece
its events follow one another in an order; where the order depends on the draw there is a letter for each order.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.certificates.family import Factor, Family, Letter
from orchestration.certificates.parts import Assigned, Layout, Loop
from orchestration.system.connection import Connection
from orchestration.system.distribution import lowest
from orchestration.system.times import NANOSECONDS, exact_nanoseconds
from orchestration.system.variable_names import variable_of

LARGEST = 400
"""numbers in the state of a loop"""

JITTER, DELAY, LOSS = "jitter", "delay_jitter", "loss"
START, LATENCY = "start", "latency"
BOXES = 6
"""that two quantities of which the sum is limited are covered by"""


@dataclass(frozen=True)
class Varying:
    """A quantity that may be another one at each draw."""

    kind: str
    """`jitter` of a sampled component, with which its messages are late; its `start`, with which they are not; the
    `latency` of all that it sends; `delay_jitter` or `loss` of a connection"""
    name: str
    """of that"""
    path: str


@dataclass(frozen=True)
class _Event:
    """Something that happens at `time` + `slopes` · parameters, in the order of `rank` where others do too [ns]."""

    time: Fraction
    slopes: tuple[int, ...]
    rank: tuple[int, ...]
    what: str
    """measure, sample or arrive"""
    whom: str

    def later(self, by: Fraction) -> _Event:
        return _Event(self.time + by, self.slopes, self.rank, self.what, self.whom)

    def at(self, point: Sequence[Fraction]) -> Fraction:
        return self.time + sum((s * x for s, x in zip(self.slopes, point)), Fraction(0))


@dataclass(frozen=True)
class _Draws:
    """What is drawn at once: each quantity from 0 to its largest, two of them no more than `together` [ns]."""

    most: Sequence[Fraction]
    together: Fraction

    def corners(self) -> list[tuple[Fraction, ...]]:
        """Between which all draws lie."""
        if len(self.most) < 2:
            return [*itertools.product(*((Fraction(0), J) for J in self.most))]
        bend = min(max(self.together - self.most[1], Fraction(0)), self.most[0])
        return [(x, y) for x in (Fraction(0), bend, self.most[0]) for y in (Fraction(0), self._beside(x))]

    def boxes(self) -> list[list[tuple[Fraction, Fraction]]]:
        """That cover all draws of two quantities."""
        first, second = self.most
        count = 1 if self.together >= first + second else BOXES
        ends = [first * i / count for i in range(count + 1)]
        return [[(low, high), (Fraction(0), self._beside(low))] for low, high in itertools.pairwise(ends)]

    def _beside(self, first: Fraction) -> Fraction:
        """The largest value of the second quantity beside one of the first."""
        return min(self.most[1], self.together - first)


class Timeline:
    """The events of a loop in which one quantity varies, or two, or none."""

    def __init__(self, loop: Loop, varying: Sequence[Varying]) -> None:
        self.loop, self.varying = loop, varying
        self._timed = [each for each in varying if each.kind != LOSS]
        for each in varying:
            if each.kind in (JITTER, START) and each.name in loop.minds:
                raise UsageError(f"{each.path}: {each.name} does something else where its next sample comes later")
        self._lossy = next((each.name for each in varying if each.kind == LOSS), None)
        self._events = self._all()
        self._groups = self._drawn_together()

    def largest(self) -> float:
        """The largest value that one quantity may take, the others at 0: two draws are never open at once [s]."""
        gap, nothing = self.loop.period / len(self._groups), [(Fraction(0),) * len(self._timed)]
        spans = [_last(group, nothing) - _first(group, nothing) for group in self._groups]
        return float(gap - max(spans)) / NANOSECONDS

    def family(self, most: Sequence[float] = (), run: int = 0, together: float | None = None) -> Family:
        """With values of what is timed in [0, `most`] [s], two of which are no more than `together` in sum.

        At most `run` messages are lost in a row. Raises `UsageError` where draws would be open at once.
        """
        limits = [exact_nanoseconds(J) for J in most]
        draws = _Draws(limits, sum(limits, Fraction(0)) if together is None else exact_nanoseconds(together))
        run = run if self._lossy else 0
        begins = sorted((_first(group, draws.corners()), i) for i, group in enumerate(self._groups))
        ends = [time for time, _ in begins[1:]] + [begins[0][0] + self.loop.period]
        for (_, i), end in zip(begins, ends):
            if _last(self._groups[i], draws.corners()) > end:
                raise UsageError(
                    f"{self._said()}: expected less, so that no message is open when the next one is drawn"
                )
        layout = Layout(loop=self.loop, kept=frozenset([self._lossy] if self._lossy else []))
        for size in (LARGEST, None):
            built = _Built(layout, size or len(layout.places), self._lossy, self._queued())
            letters: list[Letter] = []
            for piece, ((begin, i), end) in enumerate(zip(begins, ends)):
                events = [*self._groups[i], *self._fixed(begin, end)]
                letters += self._letters(built, events, draws, (begin, end), (piece, len(begins)), run)
        return built.family(letters, [begin for begin, _ in begins])

    # -- events ----------------------------------------------------------------------------------------------------

    def _all(self) -> list[_Event]:
        """Those that begin in one period of the loop."""
        loop, found = self.loop, []
        for rank, name in enumerate(loop.order):
            for k, time in enumerate(loop.samples_of(name)):
                by, sent = self._slopes((JITTER, START), name), self._slopes((JITTER, LATENCY), name)
                found.append(_Event(time, by, (1, rank, k), "sample", name))
                for place, x in enumerate(loop.system.connections):
                    delay = exact_nanoseconds(lowest(x.delay))
                    own = self._slopes((DELAY,), x.name)
                    if x.receiver == name and not loop.is_sampled(x.sender) and self._is_late(x):
                        slopes = tuple(a - b for a, b in zip(by, own))
                        found.append(_Event(time - delay, slopes, (0, rank, place), "measure", x.name))
                    elif x.sender == name and (self._is_late(x) or x.order == "jacobi"):
                        slopes = tuple(a + b for a, b in zip(sent, own))
                        wait = delay
                        if x.order == "jacobi":
                            wait += loop.period / len(loop.samples_of(name))
                            if any(by):
                                raise UsageError(f"connections.{x.name}.order: expected gauss-seidel beside jitter")
                        last = 2 if not loop.is_sampled(x.receiver) else 0
                        found.append(_Event(time + wait, slopes, (last, rank, place), "arrive", x.name))
        return found

    def _queued(self) -> frozenset[str]:
        """The connections whose messages may be on their way."""
        return frozenset(event.whom for event in self._events if event.what != "sample")

    def _is_late(self, x: Connection) -> bool:
        own = (*self._slopes((DELAY,), x.name), *self._slopes((LATENCY,), x.sender))
        return lowest(x.delay) > 0.0 or any(own)

    def _slopes(self, kinds: Sequence[str], name: str) -> tuple[int, ...]:
        return tuple(int(each.kind in kinds and each.name == name) for each in self._timed)

    def _owner(self) -> str:
        """The sampled component at whose samples something is drawn; any, where nothing is."""
        owners = set[str]() if self.varying else {self.loop.order[0]}
        for each in self.varying:
            if each.kind in (JITTER, START, LATENCY):
                owners.add(each.name)
            else:
                x = self.loop.connection(each.name)
                owners.add(x.sender if self.loop.is_sampled(x.sender) else x.receiver)
        if len(owners) != 1:
            raise UsageError(f"{self._said()}: expected quantities of one sampled component")
        return owners.pop()

    def _drawn_together(self) -> list[list[_Event]]:
        """For each draw the events that depend on it; of losses the sample at which they happen."""
        owner = self._owner()
        count = len(self.loop.samples_of(owner))
        depend = [event for event in self._events if any(event.slopes)]
        if not depend:
            kinds = [event for event in self._events if (event.what, event.whom) == ("sample", owner)]
            late = [event for event in self._events if (event.what, event.whom) == ("measure", self._lossy)]
            depend = late or kinds
        groups: list[list[_Event]] = [[] for _ in range(count)]
        for event in depend:
            groups[self._draw_of(event, count)].append(event)
        return groups

    def _draw_of(self, event: _Event, count: int) -> int:
        """Which of the samples within a period an event belongs to: they are in order for each kind of event."""
        alike = [e for e in self._events if (e.what, e.whom) == (event.what, event.whom)]
        return alike.index(event) % count

    def _fixed(self, begin: Fraction, end: Fraction) -> list[_Event]:
        """The events between two instants that do not depend on what is drawn."""
        drawn = {id(event) for group in self._groups for event in group}
        found, period = [], self.loop.period
        for event in self._events:
            if id(event) not in drawn:
                first = event.later(math.ceil((begin - event.time) / period) * period)
                if first.time < end:
                    found.append(first)
        return found

    # -- letters ---------------------------------------------------------------------------------------------------

    def _letters(
        self, built: _Built, events: list[_Event], draws: _Draws, span: tuple[Fraction, Fraction],
        piece: tuple[int, int], run: int,
    ) -> list[Letter]:  # fmt: skip
        """The letters of a piece: one for each order of its events; as many again where a message may be lost."""
        moves, lost_moves = _moves(piece, run)
        number = f" {piece[0] + 1}" if piece[1] > 1 else ""
        found = []
        for box in self._boxes(events, draws):
            middle = [(low + high) / 2 for low, high in box]
            in_order = sorted(events, key=lambda event: (event.at(middle), event.rank))
            ranges = tuple((float(low) / NANOSECONDS, float(high) / NANOSECONDS) for low, high in box)
            for lost, these in ((False, moves), (True, lost_moves)):
                if these:
                    product = built.product(in_order, span, lost=lost)
                    name = ("lost" if lost else "arrives" if self._lossy else "late") + number
                    found.append(Letter(name=name, moves=these, product=product, ranges=ranges))
        names, word = [letter.name for letter in found], "order" if len(draws.most) < 2 else "part"
        return [
            letter if names.count(letter.name) == 1 else Letter(
                name=f"{letter.name}, {word} {names[:i].count(letter.name) + 1}", moves=letter.moves,
                product=letter.product, ranges=letter.ranges,
            )
            for i, letter in enumerate(found)
        ]  # fmt: skip

    def _boxes(self, events: Sequence[_Event], draws: _Draws) -> list[list[tuple[Fraction, Fraction]]]:
        """The values of what varies, divided where two events change places, and to cover two of a limited sum."""
        if not draws.most:
            return [[]]
        pairs = [
            (a.time - b.time, tuple(p - q for p, q in zip(a.slopes, b.slopes)))
            for a, b in itertools.combinations(events, 2)
        ]
        if len(draws.most) == 1:
            (limit,) = draws.most
            cuts = {Fraction(0), limit}
            cuts |= {-apart / slope for apart, (slope,) in pairs if slope and 0 < -apart / slope < limit}
            return [[each] for each in itertools.pairwise(sorted(cuts))] or [[(Fraction(0), Fraction(0))]]
        for apart, slopes in pairs:
            ends = [apart + sum(s * x for s, x in zip(slopes, corner)) for corner in draws.corners()]
            if min(ends) < 0 < max(ends):
                raise UsageError(f"{self._said()}: expected values at which what happens stays in one order")
        return draws.boxes()

    def _said(self) -> str:
        return " and ".join(dict.fromkeys(each.path for each in self.varying))


def _first(group: Sequence[_Event], corners: Sequence[Sequence[Fraction]]) -> Fraction:
    return min(event.at(corner) for event in group for corner in corners)


def _last(group: Sequence[_Event], corners: Sequence[Sequence[Fraction]]) -> Fraction:
    return max(event.at(corner) for event in group for corner in corners)


def _moves(piece: tuple[int, int], run: int) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """The moves of what arrives and of what is lost: a mode is a piece, and how many were lost in a row before it."""
    here, pieces = piece
    after, modes = (here + 1) % pieces, run + 1
    arrives = tuple((here * modes + k, after * modes) for k in range(modes))
    lost = tuple((here * modes + k, after * modes + k + 1) for k in range(run))
    return arrives, lost


class _Built:
    """The matrices of a family while it is made, and how many messages are on their way."""

    def __init__(self, layout: Layout, size: int, lossy: str | None, late: frozenset[str]) -> None:
        self._layout, self._size, self._lossy, self._late = layout, size, lossy, late
        self._matrices: dict[str, Floats] = {}

    def family(self, letters: Sequence[Letter], begins: Sequence[Fraction]) -> Family:
        """Of all that was made; messages that are not on their way where a piece begins are not kept."""
        on_way = [self._on_way(begin) for begin in begins]
        kept = [
            i
            for place, i in self._layout.places.items()
            if place[0] != "message" or int(place[2]) < max(counts[place[1]] for counts in on_way)
        ]
        found = Family(
            matrices={"flow": self._layout.flow(), **self._matrices}, kept=tuple(kept), letters=tuple(letters)
        )
        return found.without_idle()

    def product(self, events: Sequence[_Event], span: tuple[Fraction, Fraction], *, lost: bool) -> tuple[Factor, ...]:
        """The map from the beginning of a piece to its end."""
        found, at = list[Factor](), (span[0], (0,) * len(events[0].slopes))
        on_way = self._on_way(span[0])
        for event in events:
            found += _flow(at, (event.time, event.slopes))
            at = event.time, event.slopes
            found.append(Factor(matrix=self._named(event, on_way, lost)))
        return (*found, *_flow(at, (span[1], (0,) * len(at[1]))))

    def _on_way(self, time: Fraction) -> dict[str, int]:
        """How many messages of each connection are on their way just before an instant at which none is drawn."""
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

    def _named(self, event: _Event, on_way: dict[str, int], lost: bool) -> str:
        """The name of the matrix of an event, which is made."""
        loop, made = self._layout.loop, Assigned(self._layout, self._size)
        if event.what == "sample":
            self._sample(event.whom, made, on_way, lost)
        else:
            x = loop.connection(event.whom)
            if event.what == "measure":
                self._send(x, made, made.measure(x), on_way, lost)
            else:
                made.hear(x, made.pop(x, on_way[x.name]))
                on_way[x.name] -= 1
        verb = {"sample": "samples", "measure": "is measured", "arrive": "arrives"}[event.what]
        base = f"{event.whom} {verb}{', lost' if lost and event.whom == self._lossy else ''}"
        for i in itertools.count(1):
            name = base if i == 1 else f"{base} ({i})"
            if name not in self._matrices or np.array_equal(self._matrices[name], made.rows):
                self._matrices[name] = made.rows
                return name
        raise AssertionError

    def _send(self, x: Connection, made: Assigned, values: list[Floats], on_way: dict[str, int], lost: bool) -> None:
        if x.name == self._lossy:
            values = made.last(x, None if lost else values)
        made.push(x, values, on_way[x.name])
        on_way[x.name] += 1

    def _sample(self, name: str, made: Assigned, on_way: dict[str, int], lost: bool) -> None:
        loop = self._layout.loop
        for x in loop.system.connections:
            if x.receiver == name and not loop.is_sampled(x.sender):
                if x.name in self._late:
                    made.hear(x, made.pop(x, on_way[x.name]))
                    on_way[x.name] -= 1
                elif not (lost and x.name == self._lossy):
                    made.hear(x, made.measure(x))
        says = made.sample(name)
        for x in loop.system.connections:
            if x.sender == name:
                values = [x.scale * says[variable_of(start)] for start in x.start]
                if x.name in self._late:
                    self._send(x, made, values, on_way, lost)
                elif not (lost and x.name == self._lossy):
                    made.hear(x, values)


def _flow(start: tuple[Fraction, tuple[int, ...]], end: tuple[Fraction, tuple[int, ...]]) -> list[Factor]:
    """What happens between two instants, nothing if they are the same."""
    times = (float(end[0] - start[0]) / NANOSECONDS, *(float(b - a) for a, b in zip(start[1], end[1])))
    return [Factor(matrix="flow", times=times)] if any(times) else []
