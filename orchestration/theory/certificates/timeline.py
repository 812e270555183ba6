"""The family of maps of the periods of a loop, from the loop and the quantities that vary in it.

A period is divided at instants at which no draw is open: within a piece each varying quantity has one draw. The events
of a piece follow one another in an order; where the order depends on the draw there is a letter for each order, and one
for a single value at which events of one instant have an effect that no other value has.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from orchestration.foundation.basics.errors import UsageError, prefixed
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.theory.certificates.certified_loop import (
    BOXES,
    DELAY,
    JITTER,
    LATENCY,
    LOSS,
    SHIFT,
    CertifiedLoop,
    Draws,
    Point,
    Varying,
)
from orchestration.theory.certificates.course import Courses, PieceAt, Reading, Steps, samples_in
from orchestration.theory.certificates.family import Letter, LoopFamily
from orchestration.theory.certificates.open_draws import MOST_AT_ONCE, OpenDraws, Unsure, in_turn
from orchestration.theory.certificates.orders import MOST_ORDERS, boxes_of, orders_of
from orchestration.theory.exact.random_times import (
    ATTOSECONDS,
    RandomLink,
    RandomTime,
    SampledTask,
    attoseconds,
    exact_seconds,
)
from orchestration.theory.exact.timing import links_of, sampled_tasks
from orchestration.theory.stability.matrices import OF_FIXED_STEP
from orchestration.theory.stability.operating_point import hyperperiod

INSTANT = ATTOSECONDS // NANOSECONDS
"""Time by which the events of a draw are over before those of the next one begin"""

Box = tuple[tuple[int, int], ...]
"""The ends of a range, along each quantity"""
NONE_LATE: Mapping[str, int] = MappingProxyType({})
"""No connections"""


class LoopTimeline:
    """The events of a loop in which quantities vary, or none."""

    def __init__(self, loop: CertifiedLoop, varying: Sequence[Varying], latest: Mapping[str, int] = NONE_LATE) -> None:
        """`latest` has connections between sampled components whose messages arrive at any time up to there.

        It counts from the earliest sample of the sender [ns]; the earliest arrival is that of the loop.
        """
        self.loop, self.varying, self._latest = loop, varying, latest
        self._timed = [each for each in varying if each.kind != LOSS]
        for each in varying:
            if each.kind in (JITTER, SHIFT) and loop.depends_on_step(each.name):
                sent = [f"connections.{x.name}.delay_jitter" for x in loop.system.connections if x.sender == each.name]
                flown = [f"limit --of {each.path}, which flies it"] if each.kind == JITTER else []
                raise UsageError(
                    f"{each.path}: samples of {each.name} depend on the time to the next one, which no proof covers: "
                    f"expected {', '.join([*sent, *flown])}, or {OF_FIXED_STEP}"
                )
        self._lossy = next((each.name for each in varying if each.kind == LOSS), None)
        self._tasks, links = sampled_tasks(loop.system), links_of(loop.system)
        self._earliest = {x.name: link.delay for x, link in zip(loop.system.connections, links)}
        self._links = [
            replace(link, delay=0) if x.name in latest else link for x, link in zip(loop.system.connections, links)
        ]
        self._names = [task.name for task in self._tasks]
        self._length = attoseconds(hyperperiod([task.period for task in self._tasks]))
        self._owners = self._owners_of_draws()

    def largest(self) -> float:
        """The largest value [s] of one quantity, the others at 0, for which no two draws are open at once.

        Raises `UsageError` for quantities of several components.
        """
        if len(self._owners) > 1:
            raise UsageError(f"{self._paths_text()}: expected quantities of one sampled component")
        ((owner, own),) = self._owners.items()
        begin, end = self._extent(owner, [(0,) * len(own)])
        return (attoseconds(self._tasks[owner].period) - (end - begin)) / ATTOSECONDS

    def family(self, largest: Sequence[float] = (), run: int = 0, largest_sum: float | None = None) -> LoopFamily:
        """The family for values of times in [0, `largest`] [s], the sum of two of a component at most `largest_sum`.

        At most `run` messages are lost in a row. Raises `UsageError` where two draws of a component would be open at
        once, or more than two of several.
        """
        pieces = self.pieces(largest, largest_sum)
        begins = [piece.begin % self._length for piece in pieces]
        courses = Courses(self.loop, self._timing_at, begins, self._lossy, self._latest)
        unsure = self._unsure(largest)
        return courses.family(
            [
                x for i, piece in enumerate(pieces)
                for x in self._letters(courses, piece, unsure, i, run if self._lossy else 0)
            ]
        )  # fmt: skip

    def pieces(self, largest: Sequence[float], largest_sum: float | None = None) -> list[OpenDraws]:
        """The pieces of a period, each with the draws that are open in it; raises `UsageError` as above."""
        self._expect_in_turn()
        limits = [attoseconds(exact_seconds(J)) for J in largest]
        most = sum(limits) if largest_sum is None else attoseconds(exact_seconds(largest_sum))
        spans = list[OpenDraws]()
        for owner, own in self._owners.items():
            draws = Draws([limits[i] for i in own], most)
            begin, end = self._extent(owner, draws.corners())
            if end - begin > attoseconds(self._tasks[owner].period):
                raise UsageError(
                    f"{self._paths_text()}: expected less, so that no message is open when the next one is drawn"
                )
            spans += [
                OpenDraws(begin=sample + begin, lasts=end - begin, quantities=own, draws=draws)
                for sample in self._samples(owner)
            ]
        return [self._expect_few(piece) for piece in in_turn(spans, self._length)]

    # -- draws -------------------------------------------------------------------------------------------------------

    def _expect_few(self, piece: OpenDraws) -> OpenDraws:
        """Raise `UsageError` where more times vary at once than a proof takes."""
        if len(piece.quantities) > MOST_AT_ONCE:
            names = dict.fromkeys(self._timed[i].name for i in piece.quantities)
            raise UsageError(
                f"{self._paths_text()}: {len(piece.quantities)} times of {' and '.join(names)} vary at once, of "
                f'{MOST_AT_ONCE} at most: expected less load, offsets by which they are apart, or read = "release" or '
                'write = "deadline" of their tasks'
            )
        return piece

    def _expect_in_turn(self) -> None:
        """Raise `UsageError` where a message may arrive when the next one is sampled."""
        for x, link in zip(self.loop.system.connections, self._links):
            if x.name in self._latest:
                assert link.sender is not None
                late = (self._latest[x.name] + 1) * INSTANT
                if link.jacobi or late > attoseconds(self._tasks[link.sender].period):
                    raise UsageError(
                        f"{self._paths_text()}: a message of connections.{x.name} may arrive when the next one is "
                        "sampled: expected less"
                    )

    def _unsure(self, largest: Sequence[float]) -> list[Unsure]:
        """The connections whose messages arrive at any time, for values up to `largest` [s]."""
        late = {
            each.name: attoseconds(exact_seconds(J))
            for each, J in zip(self._timed, largest) if each.kind in (JITTER, SHIFT)
        }  # fmt: skip
        return [
            Unsure(
                name=x.name, receiver=x.receiver, samples=self._samples(self._names.index(x.sender)),
                late=late.get(x.sender, 0), earliest=self._earliest[x.name], latest=self._latest[x.name] * INSTANT,
                length=self._length,
            )
            for x in self.loop.system.connections if x.name in self._latest
        ]  # fmt: skip

    def _samples(self, task: int) -> list[int]:
        """The nominal samples of a task in a hyperperiod."""
        period, first = attoseconds(self._tasks[task].period), attoseconds(self._tasks[task].offsets[0])
        return sorted((first + k * period) % self._length for k in range(self._length // period))

    def _owners_of_draws(self) -> dict[int, tuple[int, ...]]:
        """The tasks at whose samples quantities are drawn, with these; any task, where nothing varies."""
        found = dict[int, tuple[int, ...]]()
        for each in self.varying:
            name = each.name
            if each.kind in (DELAY, LOSS):
                x = self.loop.connection(each.name)
                name = x.sender if self.loop.is_sampled(x.sender) else x.receiver
            task = self._names.index(name)
            found[task] = (*found.get(task, ()), *(i for i, one in enumerate(self._timed) if one is each))
        if self._lossy is not None and len(found) > 1:
            raise UsageError(f"{self._paths_text()}: expected quantities of one sampled component")
        return found or {0: ()}

    def _events_of_a_draw(self, owner: int) -> list[tuple[int, Point]]:
        """The events that depend on a draw: their times after its nominal sample, and how often each quantity is added.

        Of losses it is the one at which they occur.
        """
        sample, lossy = self._added(owner, (JITTER, SHIFT)), 0
        found = [(0, sample)]
        for x, link in zip(self.loop.system.connections, self._links):
            own = self._added(owner, (DELAY,), x.name)
            if link.is_measured and link.receiver == owner:
                found.append((-link.delay, tuple(a - b for a, b in zip(sample, own))))
                lossy = -link.delay if x.name == self._lossy else lossy
            elif link.sender == owner and x.name not in self._latest:
                if link.jacobi and any(sample):
                    raise UsageError(f"connections.{x.name}.order: expected gauss-seidel beside jitter")
                sent = self._added(owner, (JITTER, LATENCY))
                wait = link.delay + (attoseconds(self._tasks[owner].period) if link.jacobi else 0)
                found.append((wait, tuple(a + b for a, b in zip(sent, own))))
        return [each for each in found if any(each[1])] or [(lossy, sample)]

    def _added(self, owner: int, kinds: Sequence[str], connection: str | None = None) -> Point:
        """By quantity of a task, 1 where it is of these kinds, and of a connection, if given."""
        own = [self._timed[i] for i in self._owners[owner]]
        return tuple(int(each.kind in kinds and connection in (None, each.name)) for each in own)

    def _extent(self, owner: int, corners: Sequence[Point]) -> tuple[int, int]:
        """The first and the last time after a nominal sample at which a draw may have an effect.

        The last one is an instant later: others of its instant may come before it.
        """
        events = self._events_of_a_draw(owner)
        times = [time + sum(s * x for s, x in zip(added, point)) for time, added in events for point in corners]
        return min(times), max(times) + INSTANT

    def _timing_at(self, point: Point) -> tuple[list[SampledTask], list[RandomLink]]:
        """The tasks and links where every draw has these values."""
        tasks, links = list(self._tasks), list(self._links)
        for each, value in zip(self._timed, point):
            if each.kind in (JITTER, SHIFT):
                owner = self._names.index(each.name)
                tasks[owner] = replace(tasks[owner], jitter=RandomTime((tasks[owner].jitter.highest + value,)))
            added = {(DELAY, each.name): value, (LATENCY, each.name): value, (SHIFT, each.name): -value}
            for i, x in enumerate(self.loop.system.connections):
                if x.name in self._latest:
                    continue
                more = sum(added.get((each.kind, name), 0) for name in ({x.name} if each.kind == DELAY else {x.sender}))
                links[i] = replace(links[i], delay=links[i].delay + more)
        return tasks, links

    # -- letters -----------------------------------------------------------------------------------------------------

    def _letters(
        self, courses: Courses, piece: OpenDraws, unsure: Sequence[Unsure], place: int, run: int
    ) -> list[Letter]:
        """The letters of a piece: for each order of its events and what samples read, and where a message may be lost.

        Their parameters are all quantities, those of other pieces at 0.
        """
        pieces, count = len(courses.begins), len(self._timed)
        number = f" {place + 1}" if pieces > 1 else ""
        found = []
        for lost, moves in zip((False, True), _moves((place, pieces), run)):
            of = courses.of(place, piece.spread(count), lost=lost)
            for box, steps in self._boxes(courses, of, piece, unsure) if moves else ():
                name = ("lost" if lost else "arrives" if self._lossy else "late") + number
                ends = zip(*(piece.spread(count)(side) for side in zip(*box))) if box else ((0, 0),) * count
                ranges = tuple((low / ATTOSECONDS, high / ATTOSECONDS) for low, high in ends)
                product = courses.product(steps, piece.spread(count))
                found.append(Letter(name=name, moves=moves, product=product, ranges=ranges))
        names, word = [letter.name for letter in found], "order" if count < 2 else "part"
        return [
            letter if names.count(letter.name) == 1
            else replace(letter, name=f"{letter.name}, {word} {names[:i].count(letter.name) + 1}")
            for i, letter in enumerate(found)
        ]  # fmt: skip

    def _boxes(
        self, courses: Courses, of: PieceAt, piece: OpenDraws, unsure: Sequence[Unsure]
    ) -> list[tuple[Box, Steps]]:
        """Boxes of draws that cover them, divided where two events change their order, with their steps."""
        found, draws = list[tuple[Box, Steps]](), piece.draws
        with prefixed(f"{self._paths_text()}: "):
            for each in _readings(courses, of, piece, unsure):
                if not draws.largest:
                    found.append(((), each(())))
                    continue
                width = -(-draws.largest[0] // BOXES)
                orders = orders_of(each, courses.same, courses.gaps, draws.corners())
                found += [(box, order.steps) for order in orders for box in boxes_of(order.region, width)]
        return sorted(found, key=lambda one: one[0])

    def _paths_text(self) -> str:
        return " and ".join(dict.fromkeys(each.path for each in self.varying))


def _moves(piece: tuple[int, int], run: int) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """The moves with an arrival and with a loss: a mode is a piece, and the number of losses in a row before it."""
    here, pieces = piece
    after, modes = (here + 1) % pieces, run + 1
    with_arrival = tuple((here * modes + k, after * modes) for k in range(modes))
    with_loss = tuple((here * modes + k, after * modes + k + 1) for k in range(run))
    return with_arrival, with_loss


def _readings(courses: Courses, of: PieceAt, piece: OpenDraws, unsure: Sequence[Unsure]) -> list[PieceAt]:
    """A piece with each choice of what its samples read, where a message may or may not have arrived."""
    times = dict[tuple[str, int], list[int]]()
    for corner in piece.draws.corners() if unsure else ():
        for key, at in samples_in(of(corner)).items():
            times.setdefault(key, []).append(piece.begin + at)
    always, perhaps = list[Reading](), list[Reading]()
    for x in unsure:
        for (name, k), instants in times.items():
            reads = x.reads(min(instants), max(instants)) if name == x.receiver else False
            always += [(name, k, x.name)] if reads else []
            perhaps += [(name, k, x.name)] if reads is None else []
    if 2 ** len(perhaps) > MOST_ORDERS:
        raise UsageError(f"expected at most {MOST_ORDERS} choices of what samples read; here are 2^{len(perhaps)}")
    chosen = itertools.chain(*(itertools.combinations(perhaps, k) for k in range(len(perhaps) + 1)))
    return [courses.reading(of, {*always, *each}) for each in chosen]
