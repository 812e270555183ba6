"""The course of a loop's events, recorded as matrices: each event by a map of the state, with flows in between.

The state of the family has places for the numbers of the loop, and for the messages of each link in transit, by age.
"""

import functools
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from orchestration.theory.certificates.certified_loop import CertifiedLoop, Point
from orchestration.theory.certificates.family import Factor, Letter, LoopFamily
from orchestration.theory.exact.branch import BranchEvent, Mode, Piece
from orchestration.theory.exact.effects import ContinuousEffects, Places
from orchestration.theory.exact.random_times import ATTOSECONDS, RandomLink, SampledTask
from orchestration.theory.exact.timing_chain import TimingChain
from orchestration.theory.stability.matrices import Components

SAME = 1e-10
"""Share of the largest number of a row: two maps that differ by less are the same"""
VERBS = {"sample": "samples", "measure": "is measured", "arrive": "arrives"}


@dataclass(frozen=True, kw_only=True)
class Jump:
    """The map of an event, from some places of the state to some."""

    name: str
    change: Floats
    before: tuple[int, ...]
    after: tuple[int, ...]
    of: str | None = None
    """Name of the component of which it is a sample"""

    def matrix(self, size: int) -> Floats:
        """The map of a whole state of `size` numbers."""
        found: Floats = np.zeros((size, size))
        found[np.ix_(self.after, self.before)] = self.change
        return found

    def is_same(self, other: "Jump") -> bool:
        """Whether another event has the same map."""
        places = (self.before, self.after) == (other.before, other.after)
        return places and np.array_equal(self.change, other.change)


@dataclass(frozen=True, kw_only=True)
class Course(Piece):
    """A piece with all that happens in it: events, and the time between them [attoseconds]."""

    steps: tuple[Jump | int, ...] = ()
    in_transit: tuple[int, ...]
    """the links of messages after the last event, in the order of their numbers"""


class RecordedEffects(ContinuousEffects):
    """The effects of events, which are recorded.

    All messages of the connection `lossy` are lost while `loses`: they bring what was sent before instead. What arrives
    from an `unsure` connection waits: for the sample that reads it, or for the message after it.
    """

    loses = False

    def __init__(
        self, system: System, components: Components, tasks: Sequence[str], lossy: str | None, unsure: Collection[str]
    ) -> None:
        self._lossy, self._unsure = lossy, unsure
        super().__init__(system, components, tasks)
        self._slots: dict[tuple[int, int], int] = {}
        self.places_count = self.size
        """Places of the whole state: they grow as further messages are seen in transit"""

    def _add_more_places(self, places: Places) -> None:
        for x in self.system.connections:
            if x.name == self._lossy:
                places.add("sent", x.name, len(x.start))
            if x.name in self._unsure:
                places.add("waiting", x.name, len(x.start))

    def start(self, in_transit: Sequence[int]) -> Course:
        """As `LoopEffects`."""
        return Course(**vars(super().start(in_transit)), in_transit=tuple(in_transit))

    def advance(self, piece: Piece, duration: int) -> Piece:
        """As `LoopEffects`."""
        assert isinstance(piece, Course)
        return replace(piece, steps=(*piece.steps, duration))

    def send(self, piece: Piece, link: int, at: int) -> Piece:
        """As `LoopEffects`."""
        x = self.system.connections[link]
        if x.name == self._lossy and not self.loses:
            change = np.eye(len(piece.Z))
            change[self.places("sent", x.name), : self.size] = super()._message_rows(x)
            piece = piece.mapped(change)
        return super().send(piece, link, at)

    def _message_rows(self, x: Connection) -> Floats:
        if x.name == self._lossy:
            return np.eye(self.size)[self.places("sent", x.name)]
        return super()._message_rows(x)

    def receive(self, piece: Piece, link: int, since: int, gap: int | None) -> Piece:
        """As `LoopEffects`."""
        x = self.system.connections[link]
        if x.name not in self._unsure:
            return super().receive(piece, link, since, gap)
        leaves = slice(self.size, self.size + len(x.start))
        change = self._read(len(piece.Z), x.name)
        change[self.places("waiting", x.name)] = np.eye(len(piece.Z))[leaves]
        return piece.mapped(np.delete(change, leaves, axis=0))

    def _read(self, size: int, connection: str) -> Floats:
        """The map by which what waits is read."""
        change = np.eye(size)
        change[self.places("received", connection)] = np.eye(size)[self.places("waiting", connection)]
        return change

    def having_read(self, jump: Jump, connection: str) -> Jump:
        """A sample after it has read what waits."""
        change = jump.change @ self._read(len(jump.before), connection)
        return replace(jump, name=f"{jump.name} with {connection}", change=change)

    def done(self, piece: Piece, event: BranchEvent, in_transit: Sequence[int]) -> Piece:
        """As `LoopEffects`: its map is recorded."""
        assert isinstance(piece, Course)
        subject = self.tasks[event.of] if event.kind == "sample" else self.system.connections[event.of].name
        lost = ", lost" if self.loses and subject == self._lossy else ""
        jump = Jump(
            name=f"{subject} {VERBS[event.kind]}{lost}", change=piece.Z,
            before=self._places_with(piece.in_transit), after=self._places_with(in_transit),
            of=subject if event.kind == "sample" else None,
        )  # fmt: skip
        return replace(self.start(in_transit), steps=(*piece.steps, jump))

    def _places_with(self, in_transit: Sequence[int]) -> tuple[int, ...]:
        """The places of the numbers of the loop, and of messages of these links, the oldest of each first."""
        found = [*range(self.size)]
        for i, link in enumerate(in_transit):
            key, count = (link, in_transit[:i].count(link)), len(self.system.connections[link].start)
            if key not in self._slots:
                self._slots[key] = self.places_count
                self.places_count += count
            found += range(self._slots[key], self._slots[key] + count)
        return tuple(found)


Steps = list[Jump | Point]
"""Events, and the times between them: t[0] + t[1] τ₁ + … [attoseconds]"""
Timing = Callable[[Point], tuple[Sequence[SampledTask], Sequence[RandomLink]]]
"""Tasks and links where every draw has these values"""
PieceAt = Callable[[Point], Steps]
"""The steps of a piece of a period, by the values of draws"""


Reading = tuple[str, int, str]
"""A component, the number of its sample in a piece, and the connection from which it reads what waits"""


def samples_in(steps: Steps) -> dict[tuple[str, int], int]:
    """The times of samples from the begin of a piece [attoseconds], by component, and by their numbers."""
    found, at = dict[tuple[str, int], int](), 0
    for step in steps:
        if isinstance(step, tuple):
            at += step[0]
        elif step.of is not None:
            found[step.of, sum(name == step.of for name, _ in found)] = at
    return found


def time_at(time: Point, point: Point) -> int:
    """A time between events at values of the quantities."""
    return time[0] + sum(s * x for s, x in zip(time[1:], point))


class Courses:
    """The courses of a period by the values of its draws, in pieces that begin at the same times."""

    def __init__(
        self, loop: CertifiedLoop, timing: Timing, begins: Sequence[int], lossy: str | None, unsure: Collection[str]
    ) -> None:
        self.begins, self._timing = begins, timing
        tasks, _ = timing(())
        self._effects = RecordedEffects(loop.system, loop.components, [task.name for task in tasks], lossy, unsure)
        self._known: dict[tuple[Point, bool], list[Steps]] = {}
        self._jumps: dict[str, Jump] = {}
        self._mode: Mode | None = None

    def of(self, piece: int, spread: Callable[[Point], Point], *, lost: bool) -> PieceAt:
        """A piece in which all messages are lost, or none; `spread` has all values by those that it depends on."""
        return lambda point: self._pieces(spread(point), lost)[piece]

    def reading(self, of: PieceAt, reads: Collection[Reading]) -> PieceAt:
        """A piece in which some samples first read what waits."""

        def steps(point: Point) -> Steps:
            found, counts = list[Jump | Point](), Counter[str]()
            for step in of(point):
                if isinstance(step, Jump) and step.of is not None:
                    own = [x for name, k, x in reads if (name, k) == (step.of, counts[step.of])]
                    counts[step.of] += 1
                    found.append(functools.reduce(self._effects.having_read, sorted(own), step))
                else:
                    found.append(step)
            return found

        return steps

    def _pieces(self, point: Point, lost: bool) -> list[Steps]:
        if (point, lost) not in self._known:
            self._effects.loses = lost
            chain = TimingChain(*self._timing(point), self._effects, order=1, cuts=self.begins)
            parts, self._mode = chain.repeating(self._mode)
            first = [chain.cuts.index(begin) for begin in self.begins]
            counts = [(b - a) % len(parts) or len(parts) for a, b in zip(first, [*first[1:], first[0]])]
            self._known[point, lost] = [
                _joined([parts[(a + k) % len(parts)] for k in range(count)]) for a, count in zip(first, counts)
            ]
        return self._known[point, lost]

    def product(self, steps: Steps, spread: Callable[[Point], Point]) -> tuple[Factor, ...]:
        """The factors of steps, their times by all values: `spread` has these by those that they depend on."""
        return tuple(
            Factor(matrix=self._name_of(step)) if isinstance(step, Jump)
            else Factor(matrix="flow", times=(step[0] / ATTOSECONDS, *map(float, spread(step[1:]))))
            for step in steps
        )  # fmt: skip

    def _name_of(self, jump: Jump) -> str:
        """The name of its matrix: that of the event, with a number where other maps have it."""
        count, name = 1, jump.name
        while not jump.is_same(self._jumps.setdefault(name, jump)):
            count += 1
            name = f"{jump.name} ({count})"
        return name

    def family(self, letters: Sequence[Letter]) -> LoopFamily:
        """The family of letters with these products."""
        size = self._effects.places_count
        matrices = {"flow": self._flow} | {name: jump.matrix(size) for name, jump in self._jumps.items()}
        places, names = self._effects.places, self._effects.parts
        states = tuple(tuple(range(size)[places("state", name)]) for name in names)
        return LoopFamily(
            matrices=matrices, kept=tuple(range(size)), letters=tuple(letters), states=states
        ).without_idle()

    def same(self, one: Steps, other: Steps, point: Point) -> bool:
        """Whether two courses have the same effect at a point."""
        if _are_same(_at(one, point), _at(other, point)):
            return True
        a, b = self._map(one, point), self._map(other, point)
        return bool((np.abs(a - b) <= SAME * np.abs(b).max(axis=1, keepdims=True)).all())

    def gaps(self, steps: Steps) -> list[Point]:
        """The times that vary from each event to those after it with which it may not change places."""
        events, found = list[tuple[Point, Jump]](), dict[Point, None]()
        at: Point = (0,) * max(len(step) for step in steps if isinstance(step, tuple))
        for step in steps:
            if isinstance(step, tuple):
                at = tuple(a + b for a, b in zip(at, step))
                continue
            for before, other in events:
                gap = tuple(b - a for a, b in zip(before, at))
                if any(gap[1:]) and not self._commute(other, step):
                    found[gap] = None
            events.append((at, step))
        return list(found)

    def _commute(self, one: Jump, other: Jump) -> bool:
        """Whether two events may change places: one of them commutes with what happens between, and with the other."""
        a, b, F = self._whole(one), self._whole(other), self._flow
        return np.array_equal(a @ b, b @ a) and any(np.array_equal(x @ F, F @ x) for x in (a, b))

    def _whole(self, jump: Jump) -> Floats:
        """The map of the whole state, of which an event changes nothing that it does not have."""
        found = jump.matrix(self._effects.places_count)
        others = np.setdiff1d(np.arange(len(found)), [*jump.before, *jump.after])
        found[others, others] = 1.0
        return found

    def _map(self, steps: Steps, point: Point) -> Floats:
        from scipy.linalg import expm

        found = np.eye(self._effects.places_count)
        for step in steps:
            if isinstance(step, Jump):
                found = step.matrix(len(found)) @ found
            else:
                found = expm(self._flow * (time_at(step, point) / ATTOSECONDS)) @ found
        return found

    @property
    def _flow(self) -> Floats:
        """The generator of the flow between events."""
        more = self._effects.places_count - self._effects.size
        return np.pad(self._effects.F, (0, more))


def _at(steps: Steps, point: Point) -> list[Jump | int]:
    """Events at a point, and the time between those that are not of one instant."""
    timed = [step if isinstance(step, Jump) else time_at(step, point) for step in steps]
    return [step for step in timed if isinstance(step, Jump) or step]


def _are_same(one: list[Jump | int], other: list[Jump | int]) -> bool:
    """Whether events are the same ones at the same times."""
    return len(one) == len(other) and all(
        a == b if isinstance(a, int) or isinstance(b, int) else a.is_same(b) for a, b in zip(one, other)
    )


def _joined(parts: Sequence[Piece]) -> Steps:
    """The steps of courses one after the other, the times between two events added."""
    found: Steps = []
    for part in parts:
        assert isinstance(part, Course)
        for step in part.steps:
            if isinstance(step, int) and found and isinstance(found[-1], tuple):
                found[-1] = (found[-1][0] + step,)
            else:
                found.append((step,) if isinstance(step, int) else step)
    return found
