"""The family of maps of the periods of a loop, from the loop and the quantities that vary in it.

A period is divided at instants at which no draw is open: within a piece each varying quantity has one draw. The events
of a piece follow one another in an order; where the order depends on the draw there is a letter for each order, and one
for a single value at which events of one instant have an effect that no other value has.
"""

from collections.abc import Sequence
from dataclasses import replace

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
from orchestration.theory.certificates.course import Courses, PieceAt, Steps
from orchestration.theory.certificates.family import Letter, LoopFamily
from orchestration.theory.certificates.orders import boxes_of, orders_of
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


class LoopTimeline:
    """The events of a loop in which one quantity varies, or two, or none."""

    def __init__(self, loop: CertifiedLoop, varying: Sequence[Varying]) -> None:
        self.loop, self.varying = loop, varying
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
        self._tasks, self._links = sampled_tasks(loop.system), links_of(loop.system)
        self._owner = self._owner_of_draws()
        self._period = attoseconds(self._tasks[self._owner].period)
        self._events = self._events_of_a_draw()

    def largest(self) -> float:
        """The largest value [s] of one quantity, the others at 0, for which no two draws are open at once."""
        begin, end = self._extent([(0,) * len(self._timed)])
        return (self._period - (end - begin)) / ATTOSECONDS

    def family(self, largest: Sequence[float] = (), run: int = 0, largest_sum: float | None = None) -> LoopFamily:
        """The family for values of times in [0, `largest`] [s], the sum of two at most `largest_sum`.

        At most `run` messages are lost in a row. Raises `UsageError` where two draws would be open at once.
        """
        draws = self.draws(largest, largest_sum)
        begin, _ = self._extent(draws.corners())
        courses = Courses(self.loop, self._timing_at, self._begins(begin), self._lossy)
        pieces = range(len(courses.begins))
        return courses.family([x for i in pieces for x in self._letters(courses, draws, i, run if self._lossy else 0)])

    def draws(self, largest: Sequence[float], largest_sum: float | None = None) -> Draws:
        """The draws of a family; raises `UsageError` where two would be open at once."""
        limits = [attoseconds(exact_seconds(J)) for J in largest]
        draws = Draws(limits, sum(limits) if largest_sum is None else attoseconds(exact_seconds(largest_sum)))
        begin, end = self._extent(draws.corners())
        if end - begin > self._period:
            raise UsageError(
                f"{self._paths_text()}: expected less, so that no message is open when the next one is drawn"
            )
        return draws

    # -- draws -------------------------------------------------------------------------------------------------------

    def _owner_of_draws(self) -> int:
        """The task at whose samples quantities are drawn; any, where nothing varies."""
        names = [task.name for task in self._tasks]
        owners = set[str]() if self.varying else {names[0]}
        for each in self.varying:
            if each.kind in (JITTER, SHIFT, LATENCY):
                owners.add(each.name)
            else:
                x = self.loop.connection(each.name)
                owners.add(x.sender if self.loop.is_sampled(x.sender) else x.receiver)
        if len(owners) != 1:
            raise UsageError(f"{self._paths_text()}: expected quantities of one sampled component")
        return names.index(owners.pop())

    def _events_of_a_draw(self) -> list[tuple[int, Point]]:
        """The events that depend on a draw: their times after its nominal sample, and how often each quantity is added.

        Of losses it is the one at which they occur.
        """
        sample, lossy = self._added((JITTER, SHIFT)), 0
        found = [(0, sample)]
        for x, link in zip(self.loop.system.connections, self._links):
            own = self._added((DELAY,), x.name)
            if link.is_measured and link.receiver == self._owner:
                found.append((-link.delay, tuple(a - b for a, b in zip(sample, own))))
                lossy = -link.delay if x.name == self._lossy else lossy
            elif link.sender == self._owner:
                if link.jacobi and any(sample):
                    raise UsageError(f"connections.{x.name}.order: expected gauss-seidel beside jitter")
                sent = self._added((JITTER, LATENCY))
                wait = link.delay + (self._period if link.jacobi else 0)
                found.append((wait, tuple(a + b for a, b in zip(sent, own))))
        return [each for each in found if any(each[1])] or [(lossy, sample)]

    def _added(self, kinds: Sequence[str], connection: str | None = None) -> Point:
        """By quantity, 1 where it is of these kinds, and of a connection, if given."""
        return tuple(int(each.kind in kinds and connection in (None, each.name)) for each in self._timed)

    def _extent(self, corners: Sequence[Point]) -> tuple[int, int]:
        """The first and the last time after a nominal sample at which a draw may have an effect.

        The last one is an instant later: others of its instant may come before it.
        """
        times = [time + sum(s * x for s, x in zip(added, point)) for time, added in self._events for point in corners]
        return min(times), max(times) + INSTANT

    def _begins(self, first: int) -> list[int]:
        """The times at which the pieces of a period begin, `first` after the nominal samples."""
        task, length = self._tasks[self._owner], hyperperiod([task.period for task in self._tasks])
        samples = [(task.offsets[0] + k * task.period) % length for k in range(round(length / task.period))]
        return [(attoseconds(sample) + first) % attoseconds(length) for sample in sorted(samples)]

    def _timing_at(self, point: Point) -> tuple[list[SampledTask], list[RandomLink]]:
        """The tasks and links where every draw has these values."""
        tasks, links = list(self._tasks), list(self._links)
        for each, value in zip(self._timed, point):
            if each.kind in (JITTER, SHIFT):
                task = tasks[self._owner]
                tasks[self._owner] = replace(task, jitter=RandomTime((task.jitter.highest + value,)))
            added = {(DELAY, each.name): value, (LATENCY, each.name): value, (SHIFT, each.name): -value}
            for i, x in enumerate(self.loop.system.connections):
                more = sum(added.get((each.kind, name), 0) for name in ({x.name} if each.kind == DELAY else {x.sender}))
                links[i] = replace(links[i], delay=links[i].delay + more)
        return tasks, links

    # -- letters -----------------------------------------------------------------------------------------------------

    def _letters(self, courses: Courses, draws: Draws, piece: int, run: int) -> list[Letter]:
        """The letters of a piece: one for each order of its events, and another one where a message may be lost."""
        pieces = len(courses.begins)
        number = f" {piece + 1}" if pieces > 1 else ""
        found = []
        for lost, moves in zip((False, True), _moves((piece, pieces), run)):
            for box, steps in self._boxes(courses, courses.of(piece, lost=lost), draws) if moves else ():
                name = ("lost" if lost else "arrives" if self._lossy else "late") + number
                ranges = tuple((low / ATTOSECONDS, high / ATTOSECONDS) for low, high in box)
                found.append(Letter(name=name, moves=moves, product=courses.product(steps), ranges=ranges))
        names, word = [letter.name for letter in found], "order" if len(draws.largest) < 2 else "part"
        return [
            letter if names.count(letter.name) == 1
            else replace(letter, name=f"{letter.name}, {word} {names[:i].count(letter.name) + 1}")
            for i, letter in enumerate(found)
        ]  # fmt: skip

    def _boxes(self, courses: Courses, of: PieceAt, draws: Draws) -> list[tuple[Box, Steps]]:
        """Boxes of draws that cover them, divided where two events change their order, with their steps."""
        if not draws.largest:
            return [((), of(()))]
        with prefixed(f"{self._paths_text()}: "):
            orders = orders_of(of, courses.same, courses.gaps, draws.corners())
        width = -(-draws.largest[0] // BOXES)
        return sorted(
            ((box, order.steps) for order in orders for box in boxes_of(order.region, width)), key=lambda one: one[0]
        )

    def _paths_text(self) -> str:
        return " and ".join(dict.fromkeys(each.path for each in self.varying))


def _moves(piece: tuple[int, int], run: int) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """The moves with an arrival and with a loss: a mode is a piece, and the number of losses in a row before it."""
    here, pieces = piece
    after, modes = (here + 1) % pieces, run + 1
    with_arrival = tuple((here * modes + k, after * modes) for k in range(modes))
    with_loss = tuple((here * modes + k, after * modes + k + 1) for k in range(run))
    return with_arrival, with_loss
