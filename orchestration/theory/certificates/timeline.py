"""The family of maps of the periods of a loop, from the loop and the quantities that vary in it.

A period is divided at instants at which no draw is open: within a piece each varying quantity has one draw. The events
of a piece follow one another in an order; where the order depends on the draw there is a letter for each order, and one
for a single value at which events of one instant are in an order that matters and that no other value has.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import lowest
from orchestration.theory.certificates.events import (
    DELAY,
    JITTER,
    LATENCY,
    LOSS,
    SHIFT,
    Draws,
    LoopEvent,
    Varying,
    first_time,
    last_time,
)
from orchestration.theory.certificates.family import Letter, LoopFamily
from orchestration.theory.certificates.family_builder import FamilyBuilder
from orchestration.theory.certificates.parts import CertifiedLoop, StateLayout

LARGEST = 400
"""numbers in the state of a loop"""


class LoopTimeline:
    """The events of a loop in which one quantity varies, or two, or none."""

    def __init__(self, loop: CertifiedLoop, varying: Sequence[Varying]) -> None:
        self.loop, self.varying = loop, varying
        self._timed = [each for each in varying if each.kind != LOSS]
        for each in varying:
            if each.kind in (JITTER, SHIFT) and each.name in loop.step_dependent:
                raise UsageError(f"{each.path}: samples of {each.name} depend on the time to the next one")
        self._lossy = next((each.name for each in varying if each.kind == LOSS), None)
        self._events = self._all_events()
        self._queued = frozenset(event.subject for event in self._events if event.kind != "sample")
        self._groups = self._groups_by_draw()

    def largest(self) -> float:
        """The largest value [s] of one quantity, the others at 0, for which no two draws are open at once."""
        gap, nothing = self.loop.period / len(self._groups), [(Fraction(0),) * len(self._timed)]
        spans = [last_time(group, nothing) - first_time(group, nothing) for group in self._groups]
        return float(gap - max(spans)) / NANOSECONDS

    def family(self, largest: Sequence[float] = (), run: int = 0, largest_sum: float | None = None) -> LoopFamily:
        """The family for values of times in [0, `largest`] [s], the sum of two at most `largest_sum`.

        At most `run` messages are lost in a row. Raises `UsageError` where two draws would be open at once.
        """
        limits = [exact_nanoseconds(J) for J in largest]
        draws = Draws(limits, sum(limits, Fraction(0)) if largest_sum is None else exact_nanoseconds(largest_sum))
        run = run if self._lossy else 0
        begins = sorted((first_time(group, draws.corners()), i) for i, group in enumerate(self._groups))
        ends = [time for time, _ in begins[1:]] + [begins[0][0] + self.loop.period]
        for (_, i), end in zip(begins, ends):
            if last_time(self._groups[i], draws.corners()) > end:
                raise UsageError(
                    f"{self._paths_text()}: expected less, so that no message is open when the next one is drawn"
                )
        layout = StateLayout(loop=self.loop, kept=frozenset([self._lossy] if self._lossy else []))
        for size in (LARGEST, None):
            builder = FamilyBuilder(layout, size or len(layout.places), self._lossy, self._queued)
            letters: list[Letter] = []
            for piece, ((begin, i), end) in enumerate(zip(begins, ends)):
                events = [*self._groups[i], *self._deterministic_events(begin, end)]
                letters += self._letters(builder, events, draws, (begin, end), (piece, len(begins)), run)
        return builder.family(letters, [begin for begin, _ in begins])

    # -- events ----------------------------------------------------------------------------------------------------

    def _all_events(self) -> list[LoopEvent]:
        """The events that begin in one period of the loop."""
        loop, found = self.loop, []
        for rank, name in enumerate(loop.order):
            for k, time in enumerate(loop.samples_of(name)):
                by, sent = self._slopes((JITTER, SHIFT), name), self._slopes((JITTER, LATENCY), name)
                found.append(LoopEvent(time, by, (1, rank, k), "sample", name))
                for place, x in enumerate(loop.system.connections):
                    delay = exact_nanoseconds(lowest(x.delay))
                    own = self._slopes((DELAY,), x.name)
                    if x.receiver == name and not loop.is_sampled(x.sender) and self._is_late(x):
                        slopes = tuple(a - b for a, b in zip(by, own))
                        found.append(LoopEvent(time - delay, slopes, (0, rank, place), "measure", x.name))
                    elif x.sender == name and (self._is_late(x) or x.order == "jacobi"):
                        slopes = tuple(a + b for a, b in zip(sent, own))
                        wait = delay
                        if x.order == "jacobi":
                            wait += loop.period / len(loop.samples_of(name))
                            if any(by):
                                raise UsageError(f"connections.{x.name}.order: expected gauss-seidel beside jitter")
                        order = (1, rank, k, place) if not wait else (0, rank, place)  # at once, or before all samples
                        if not loop.is_sampled(x.receiver):
                            order = (2, rank, place)
                        found.append(LoopEvent(time + wait, slopes, order, "arrive", x.name))
        return found

    def _is_late(self, x: Connection) -> bool:
        """Whether its messages do not arrive with the sample that sends or reads them."""
        own = (*self._slopes((DELAY,), x.name), *self._slopes((LATENCY,), x.sender))
        return lowest(x.delay) > 0.0 or any(own) or self.loop.feeds_through(x.receiver)

    def _slopes(self, kinds: Sequence[str], name: str) -> tuple[int, ...]:
        return tuple(int(each.kind in kinds and each.name == name) for each in self._timed)

    def _owner(self) -> str:
        """The sampled component at whose samples quantities are drawn; any, where nothing varies."""
        owners = set[str]() if self.varying else {self.loop.order[0]}
        for each in self.varying:
            if each.kind in (JITTER, SHIFT, LATENCY):
                owners.add(each.name)
            else:
                x = self.loop.connection(each.name)
                owners.add(x.sender if self.loop.is_sampled(x.sender) else x.receiver)
        if len(owners) != 1:
            raise UsageError(f"{self._paths_text()}: expected quantities of one sampled component")
        return owners.pop()

    def _groups_by_draw(self) -> list[list[LoopEvent]]:
        """For each draw the events that depend on it; of losses the sample at which they occur."""
        owner = self._owner()
        count = len(self.loop.samples_of(owner))
        depend = [event for event in self._events if any(event.slopes)]
        if not depend:
            kinds = [event for event in self._events if (event.kind, event.subject) == ("sample", owner)]
            late = [event for event in self._events if (event.kind, event.subject) == ("measure", self._lossy)]
            depend = late or kinds
        groups: list[list[LoopEvent]] = [[] for _ in range(count)]
        for event in depend:
            groups[self._draw_of(event, count)].append(event)
        return groups

    def _draw_of(self, event: LoopEvent, count: int) -> int:
        """The index of the sample within a period to which an event belongs: each kind of event is in order."""
        alike = [e for e in self._events if (e.kind, e.subject) == (event.kind, event.subject)]
        return alike.index(event) % count

    def _deterministic_events(self, begin: Fraction, end: Fraction) -> list[LoopEvent]:
        """The events between two instants that do not depend on draws."""
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
        self, builder: FamilyBuilder, events: list[LoopEvent], draws: Draws, span: tuple[Fraction, Fraction],
        piece: tuple[int, int], run: int,
    ) -> list[Letter]:  # fmt: skip
        """The letters of a piece: one for each order of its events, and another one where a message may be lost."""
        moves, lost_moves = _moves(piece, run)
        number = f" {piece[0] + 1}" if piece[1] > 1 else ""
        found = []
        for box in self._boxes(events, draws):
            in_order = _in_order(events, [(low + high) / 2 for low, high in box])
            ranges = tuple((float(low) / NANOSECONDS, float(high) / NANOSECONDS) for low, high in box)
            for lost, these in ((False, moves), (True, lost_moves)):
                if these:
                    product = builder.product(in_order, span, lost=lost)
                    name = ("lost" if lost else "arrives" if self._lossy else "late") + number
                    found.append(Letter(name=name, moves=these, product=product, ranges=ranges))
        names, word = [letter.name for letter in found], "order" if len(draws.largest) < 2 else "part"
        return [
            letter if names.count(letter.name) == 1 else Letter(
                name=f"{letter.name}, {word} {names[:i].count(letter.name) + 1}", moves=letter.moves,
                product=letter.product, ranges=letter.ranges,
            )
            for i, letter in enumerate(found)
        ]  # fmt: skip

    def _boxes(self, events: Sequence[LoopEvent], draws: Draws) -> list[list[tuple[Fraction, Fraction]]]:
        """Boxes of values, divided where two events change their order, and covering two of a limited sum."""
        if not draws.largest:
            return [[]]
        pairs = [
            (a.time - b.time, tuple(p - q for p, q in zip(a.slopes, b.slopes)))
            for a, b in itertools.combinations(events, 2)
        ]
        if len(draws.largest) == 1:
            (limit,) = draws.largest
            cuts = {Fraction(0), limit}
            cuts |= {-distance / slope for distance, (slope,) in pairs if slope and 0 < -distance / slope < limit}
            between = [*itertools.pairwise(sorted(cuts))]
            orders = [self._order_that_matters(events, [(low + high) / 2]) for low, high in between]
            single = [
                (cut, cut)
                for cut in sorted(cuts)
                if self._order_that_matters(events, [cut])
                not in (order for order, ends in zip(orders, between) if cut in ends)
            ]
            return [[each] for each in sorted([*between, *single])]
        corners = draws.corners()
        middle = [sum(along, Fraction(0)) / len(corners) for along in zip(*corners)]
        one_order = self._order_that_matters(events, middle)
        changes = any(self._order_that_matters(events, corner) != one_order for corner in corners)
        for distance, slopes in pairs:
            ends = [distance + sum(s * x for s, x in zip(slopes, corner)) for corner in corners]
            changes = changes or min(ends) < 0 < max(ends)
        if changes:
            raise UsageError(f"{self._paths_text()}: expected values that do not change the order of events")
        return draws.boxes()

    def _order_that_matters(
        self, events: Sequence[LoopEvent], point: Sequence[Fraction]
    ) -> set[tuple[LoopEvent, LoopEvent]]:
        """The pairs of events, in order, of which one may have an effect on the other."""
        return {pair for pair in itertools.combinations(_in_order(events, point), 2) if self._interact(*pair)}

    def _interact(self, a: LoopEvent, b: LoopEvent) -> bool:
        """Whether the order of two events of one instant may matter."""
        return bool(self._touched(a) & self._touched(b))

    def _touched(self, event: LoopEvent) -> set[str]:
        """The components that an event reads or changes; of those in continuous time, whose states no instant changes,
        only those with inputs that act on outputs at once. Messages stay in order, so their queues do not count.
        """
        if event.kind == "sample":
            at_once = [x for x in self.loop.system.connections if x.name not in self._queued]
            ends = [{x.sender, x.receiver} for x in at_once if event.subject in (x.sender, x.receiver)]
            names = {event.subject}.union(*ends)
        else:
            x = self.loop.connection(event.subject)
            names = {x.receiver if event.kind == "arrive" else x.sender}
        return {name for name in names if self.loop.is_sampled(name) or self.loop.feeds_through(name)}

    def _paths_text(self) -> str:
        return " and ".join(dict.fromkeys(each.path for each in self.varying))


def _in_order(events: Sequence[LoopEvent], point: Sequence[Fraction]) -> list[LoopEvent]:
    return sorted(events, key=lambda event: (event.at(point), event.rank))


def _moves(piece: tuple[int, int], run: int) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """The moves with an arrival and with a loss: a mode is a piece, and the number of losses in a row before it."""
    here, pieces = piece
    after, modes = (here + 1) % pieces, run + 1
    with_arrival = tuple((here * modes + k, after * modes) for k in range(modes))
    with_loss = tuple((here * modes + k, after * modes + k + 1) for k in range(run))
    return with_arrival, with_loss
