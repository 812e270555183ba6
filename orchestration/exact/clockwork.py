"""When what happens in a loop, as a Markov chain: who samples, what is sent, when it arrives, or never.

Time is in whole attoseconds. The common period is cut where something begins: at the nominal instants of tasks, earlier
for those that read what was measured earlier. What is on its way at a cut is the mode; between two cuts all that can
happen is gone through, instant by instant in the order of `docs/timing.md`.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple, Protocol

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.exact.chances import CERTAIN, Chance
from orchestration.exact.moments import Passage, Stage
from orchestration.exact.pieces import Piece

ATTOSECONDS = 10**18
MOST_MODES = 2000
MOST_PASSAGES = 12_000
NEGLIGIBLE = 1e-13
"""A probability: runs of losses that are less likely are taken for the longest that is told apart"""
LONGEST_AGE = 100
"""messages of which a first-order hold can have lost so many in a row, and still tell how long it is"""


@dataclass(frozen=True, kw_only=True)
class Task:
    """What samples: at each offset + k period + jitter."""

    name: str
    period: Fraction
    offsets: tuple[Fraction, ...] = (Fraction(0),)
    """in order"""
    jitter: Chance = CERTAIN


@dataclass(frozen=True, kw_only=True)
class Link:
    """Messages of a sender: a value each time that it samples, or that its receiver does."""

    name: str
    size: int
    """numbers in a message"""
    sender: int | None = None
    """the task that sends; None: continuous time"""
    receiver: int | None = None
    """the task that receives, likewise"""
    step: Fraction | None = None
    """from message to message, where no task sends or receives"""
    posts: tuple[Fraction, ...] = (Fraction(0),)
    """when messages go in each step"""
    behind: tuple[int | None, ...] = (0,)
    """for each offset of its sender, or of `posts`, how long it is on its way before its delay counts; None: nothing is
    sent"""
    delay: int = 0
    late: Chance = CERTAIN
    loss: float = 0.0
    burst: float | None = None
    jacobi: bool = False
    first: bool = False
    """whether its hold is of first order"""

    @property
    def longest(self) -> int:
        """The longest delay."""
        return max((each for each in self.behind if each is not None), default=0) + self.delay + self.late.highest

    @property
    def is_measured(self) -> bool:
        """Whether a task reads it of what is in continuous time."""
        return self.sender is None and self.receiver is not None

    @property
    def is_read_ahead(self) -> bool:
        """Whether it is measured before the sample that it is for."""
        return self.is_measured and self.longest > 0

    @property
    def has_bursts(self) -> bool:
        """Whether a loss makes the next one likelier."""
        return self.burst is not None and 0.0 < self.loss < 1.0


class Effects(Protocol):
    """What happens to the state, whose first numbers are those of the loop; messages on their way are behind them."""

    size: int
    costs: int

    def passed(self, piece: Piece, duration: int) -> Piece:
        """Time goes by."""

    def taken(self, piece: Piece, link: int) -> Piece:
        """A message is made: it is behind all others."""

    def arrived(self, piece: Piece, link: int, at: int, since: int, gap: int | None) -> Piece:
        """A message that begins at number `at` arrives, and is on its way no more.

        The one before arrived `since` ago; at once after it (0), `gap` after the one before that.
        """

    def sampled(self, piece: Piece, task: int, ages: Sequence[tuple[int, int | None]]) -> Piece:
        """A task samples; of each link how old what arrived last is, and how long after the one before."""

    def ticked(self, piece: Piece, tick: int) -> Piece:
        """What happens at points that are known before."""


class Item(NamedTuple):
    """Something that is to happen; in the order of the fields."""

    time: int
    phase: int
    rank: int
    birth: int
    kind: str
    of: int
    token: int
    """of its message; -1: it has none"""
    place: int = 0
    """of a sample or a posted message, which of those of a period it is"""


ARRIVES, POSTS, MEASURES, SAMPLES = 1, 2, 3, 4
"""Phases of an instant"""
NEVER = 10**40
"""When what waits for the next sample of its sender is due"""


@dataclass(frozen=True)
class State:
    """Where a path is."""

    time: int
    items: tuple[Item, ...]
    tokens: tuple[tuple[int, int], ...]
    """messages on their way, in the order of their numbers: token and size"""
    bursts: tuple[bool, ...]
    holds: tuple[tuple[int, int | None], ...]
    """by link when what arrived last did, and how long after the one before"""
    born: int
    probability: float
    piece: Piece


Mode = tuple[
    tuple[tuple[int, int, int, str, int, int, int], ...],
    tuple[int, ...],
    tuple[bool, ...],
    tuple[tuple[int, int | None], ...],
]
"""What at a cut is known of what is to happen: items without birth, sizes of messages, bursts, holds"""


class Clockwork:
    """The stages of a common period, by the effects that its instants have."""

    def __init__(
        self,
        tasks: Sequence[Task],
        links: Sequence[Link],
        effects: Effects,
        *,
        order: int,
        grids: Sequence[Fraction] = (),
        bends: Sequence[Fraction] = (),
    ) -> None:
        """`order` is that of Gauss's rule. `grids` are periods of points at which `effects` tick.

        Raises `UsageError` for what is not due together again, or comes to too much.
        """
        self.tasks, self.links, self._effects, self._order, self._grids = tasks, links, effects, order, grids
        self.period = together([*(t.period for t in tasks), *(x.step for x in links if x.step is not None), *grids])
        self.whole = _attoseconds(self.period)
        """the period [attoseconds]"""
        self._ahead = [
            max((x.longest for x in links if x.is_read_ahead and x.receiver == i), default=0) for i in range(len(tasks))
        ]
        self._begins = self._cuts()
        self.cuts = sorted(self._begins)
        self._bends = self._kinks()

    # -- what begins when ----------------------------------------------------------------------------------------

    def _cuts(self) -> dict[int, list[tuple[str, int, int]]]:
        found: dict[int, list[tuple[str, int, int]]] = {}
        for i, task in enumerate(self.tasks):
            for time, place in self._all(task.period, task.offsets):
                found.setdefault((time - self._ahead[i]) % self.whole, []).append(("sample", i, place))
        for i, link in enumerate(self.links):
            for time, place in self._all(link.step, link.posts) if link.step is not None else ():
                found.setdefault(time, []).append(("post", i, place))
        for i, grid in enumerate(self._grids):
            for time, place in self._all(grid, (Fraction(0),)):
                found.setdefault(time, []).append(("tick", i, place))
        return found or {0: []}

    def _all(self, period: Fraction, offsets: Sequence[Fraction]) -> Iterator[tuple[int, int]]:
        """The times of offset + k period in the common one, each with the place of its offset."""
        for k in range(int(self.period / period)):
            for place, offset in enumerate(offsets):
                yield _attoseconds(offset + k * period), place

    def _kinks(self) -> list[int]:
        """Where what comes of an instant may bend, within a period: where others sample, where messages may wait."""
        found: set[int] = set(self.cuts)
        for i, task in enumerate(self.tasks):
            for nominal, place in self._all(task.period, task.offsets):
                ends = {nominal, nominal + task.jitter.lowest, nominal + task.jitter.highest}
                for link in self.links:
                    if link.sender == i and not link.is_measured:
                        late = link.delay + (link.behind[place] or 0)
                        ends |= {end + late + more for end in ends for more in (link.late.lowest, link.late.highest)}
                found |= {end % self.whole for end in ends}
        return sorted(found)

    def _between(self, low: int, high: int) -> list[int]:
        """The kinks strictly between two times."""
        found, turn = [], low // self.whole
        while turn * self.whole < high:
            shift = turn * self.whole
            first = bisect.bisect_right(self._bends, low - shift)
            last = bisect.bisect_left(self._bends, high - shift)
            found += [shift + at for at in self._bends[first:last]]
            turn += 1
        return found

    # -- all that can happen -------------------------------------------------------------------------------------

    def stages(self) -> tuple[list[Stage], list[list[int]]]:
        """By cut, the passages from each mode there to those at the next cut; and the sizes of the states."""
        modes: list[dict[Mode, int]] = [{} for _ in self.cuts]
        stages: list[list[Passage]] = [[] for _ in self.cuts]
        waiting = [(0, self._empty())]
        modes[0][waiting[0][1]] = 0
        count = passages = 0
        while waiting:
            i, mode = waiting.pop()
            then = (i + 1) % len(self.cuts)
            for end, probability, piece in self.onward(i, mode):
                if end not in modes[then]:
                    modes[then][end] = len(modes[then])
                    waiting.append((then, end))
                    count += 1
                stages[i].append(Passage(modes[i][mode], modes[then][end], probability, piece))
                passages += 1
            if count > MOST_MODES or passages > MOST_PASSAGES:
                raise UsageError(
                    f"more than {MOST_MODES} ways for messages to be on their way, or {MOST_PASSAGES} from one to the "
                    "next: expected fewer random delays at once, or shorter ones"
                )
        sizes = [[self._effects.size + sum(mode[1]) for mode in known] for known in modes]
        return list(stages), sizes

    def _empty(self) -> Mode:
        return (), (), (False,) * len(self.links), tuple((0, None) for _ in self.links)

    def cut(self, k: int) -> int:
        """When the k-th cut from 0 on is."""
        turns, i = divmod(k, len(self.cuts))
        return self.cuts[i] + turns * self.whole

    def begun(self, end: int) -> Iterator[tuple[Mode, float, Piece]]:
        """From the beginning of a run at 0: modes at the first cut, or at `end` if that is before, and by what.

        Nothing is on its way, bursts are as likely as ever, and what is to be read before 0 is read at 0. Raises
        `UsageError` for a task that does not begin within its first period.
        """
        for task in self.tasks:
            if max(task.offsets, default=0) >= task.period:
                raise UsageError(
                    f"components.{task.name}.sampling.offset: expected less than its period, {float(task.period):g} s, "
                    "for a horizon"
                )
        for bursts in itertools.product(*([False, True] if link.has_bursts else [False] for link in self.links)):
            shares = [x.loss if lost else 1.0 - x.loss for x, lost in zip(self.links, bursts) if x.has_bursts]
            state = State(
                time=0, items=(), tokens=(), bursts=bursts, holds=tuple((0, None) for _ in self.links), born=0,
                probability=math.prod(shares), piece=Piece.start(self._effects.size, self._effects.costs),
            )  # fmt: skip
            states = [state]
            for which, nominal, place in self._read_before():
                states = [after for each in states for after in self._due(each, which, nominal, place)]
            for each in states:
                for reached in self._until(each, min(self.cuts[0], end)):
                    yield self._mode(reached)

    def _read_before(self) -> Iterator[tuple[int, int, int]]:
        """Tasks, nominal times and places of the samples whose measurements may be due before 0."""
        for i, task in enumerate(self.tasks):
            for k in itertools.count():
                if not task.offsets or _attoseconds(task.offsets[0] + k * task.period) >= self._ahead[i]:
                    break
                for place, offset in enumerate(task.offsets):
                    nominal = _attoseconds(offset + k * task.period)
                    if nominal < self._ahead[i]:
                        yield i, nominal, place

    def onward(self, i: int, mode: Mode, until: int | None = None) -> Iterator[tuple[Mode, float, Piece]]:
        """From a mode at a cut: modes at the next one, or at a time before it, how likely, and by what."""
        begin = self.cuts[i]
        until = self.cut(i + 1) if until is None else until
        items, sizes, bursts, holds = mode
        state = State(
            time=begin,
            items=tuple(
                Item(begin + time if time != NEVER else NEVER, phase, rank, birth, kind, of, token, place)
                for birth, (time, phase, rank, kind, of, token, place) in enumerate(items)
            ),
            tokens=tuple(enumerate(sizes)),
            bursts=bursts,
            holds=tuple((begin - age, gap) for age, gap in holds),
            born=len(items) + len(sizes),
            probability=1.0,
            piece=Piece.start(self._effects.size + sum(sizes), self._effects.costs),
        )
        states = [state]
        for kind, which, place in self._begins[begin]:
            states = [after for each in states for after in self._begun(each, kind, which, place)]
        for each in states:
            for end in self._until(each, until):
                yield self._mode(end)

    def _begun(self, state: State, kind: str, which: int, place: int) -> Iterator[State]:
        """What begins at a cut is put among what is to happen."""
        if kind == "post":
            yield self._with(state, state.time, POSTS, which, "post", which, place=place)
        elif kind == "tick":
            yield replace(state, piece=self._effects.ticked(state.piece, which))
        else:
            yield from self._due(state, which, state.time + self._ahead[which], place)

    def _due(self, state: State, task: int, nominal: int, place: int) -> Iterator[State]:
        for late, p in self.tasks[task].jitter.draws(nominal, self._between, self._order):
            yield from self._begun_sample(_likely(state, p), task, nominal + late, place)

    def _begun_sample(self, state: State, task: int, time: int, place: int) -> Iterator[State]:
        """A sample is known to be at a time: so are the measurements for it, and when what waits for it arrives."""
        states = [self._with(state, time, SAMPLES, 2 * task + 1, "sample", task, place=place)]
        for i, link in enumerate(self.links):
            if link.is_read_ahead and link.receiver == task:
                states = [after for each in states for after in self._begun_measurement(each, i, time)]
        for item in state.items:
            if item.time == NEVER and self.links[item.of].sender == task:
                states = [after for each in states for after in self._released(each, item, time)]
        yield from states

    def _begun_measurement(self, state: State, i: int, time: int) -> Iterator[State]:
        link = self.links[i]
        last = max((x.time for x in state.items if x.kind == "measure" and x.of == i), default=0)
        kinks = lambda low, high: [time - at for at in reversed(self._between(time - high, time - low))]  # noqa: E731
        for late, p in link.late.draws(link.delay, kinks, self._order):
            measured = max(time - link.delay - late, last)
            likely = _likely(state, p)
            yield self._with(likely, measured, MEASURES, i, "measure", i, time - measured)

    def _released(self, state: State, item: Item, sent: int) -> Iterator[State]:
        """A message that waited for the next sample of its sender goes out then."""
        rest = replace(state, items=tuple(x for x in state.items if x is not item))
        for arrival, likely in self._arrivals(rest, item.of, sent):
            yield self._with(likely, arrival, ARRIVES, item.of, "arrive", item.of, item.token)

    def _until(self, state: State, until: int) -> Iterator[State]:
        """Every end of what can happen before a time."""
        while state.items and state.items[0].time < until:
            item = state.items[0]
            state = self._at(replace(state, items=state.items[1:]), item.time)
            outcomes = list(self._happened(state, item))
            if len(outcomes) > 1:
                for each in outcomes:
                    yield from self._until(each, until)
                return
            state = outcomes[0]
        yield self._at(state, until)

    def _at(self, state: State, time: int) -> State:
        if time == state.time:
            return state
        return replace(state, time=time, piece=self._effects.passed(state.piece, time - state.time))

    def _happened(self, state: State, item: Item) -> Iterator[State]:
        if item.kind == "arrive":
            yield self._arrived(state, item.of, item.token)
        elif item.kind == "sample":
            yield from self._sampled(state, item.of, item.place)
        else:  # a message of what is in continuous time, measured or posted
            for lost, likely in self._losses(state, item.of):
                if lost:
                    yield likely
                elif item.kind == "measure":
                    taken, token = self._taken(likely, item.of)
                    rank = 2 * (self.links[item.of].receiver or 0)
                    yield self._with(taken, state.time + item.token, SAMPLES, rank, "arrive", item.of, token)
                else:
                    yield from self._sent(likely, item.of, item.place)

    def _sampled(self, state: State, task: int, place: int) -> Iterator[State]:
        states = [state]
        for i, link in enumerate(self.links):
            if link.is_measured and not link.is_read_ahead and link.receiver == task:
                states = [
                    each if lost else self._handed_over(each, i) for s in states for lost, each in self._losses(s, i)
                ]
        ages = [tuple((s.time - at, gap) for at, gap in s.holds) for s in states]
        states = [replace(s, piece=self._effects.sampled(s.piece, task, age)) for s, age in zip(states, ages)]
        for i, link in enumerate(self.links):
            if link.sender == task:
                states = [
                    after
                    for s in states
                    for lost, each in self._losses(s, i)
                    for after in ([each] if lost else self._sent(each, i, place))
                ]
        yield from states

    def _losses(self, state: State, i: int) -> list[tuple[bool, State]]:
        """Whether the next message is lost."""
        link = self.links[i]
        p = link.loss
        if link.has_bursts and link.burst is not None:
            p = 1.0 - 1.0 / link.burst if state.bursts[i] else p / (link.burst * (1.0 - p))
        outcomes = [(p >= 1.0, 1.0)] if p <= 0.0 or p >= 1.0 else [(False, 1.0 - p), (True, p)]
        found = []
        for lost, probability in outcomes:
            bursts = state.bursts
            if link.has_bursts:
                bursts = (*bursts[:i], lost, *bursts[i + 1 :])
            found.append((lost, replace(_likely(state, probability), bursts=bursts)))
        return found

    def _sent(self, state: State, i: int, place: int) -> Iterator[State]:
        """A message that is not lost."""
        link = self.links[i]
        behind = link.behind[place]
        if behind is None:
            yield state
            return
        sent: int | None = state.time + behind
        if link.jacobi and link.sender is not None:
            sent = next((x.time for x in state.items if x.kind == "sample" and x.of == link.sender), None)
        if sent is None:
            taken, token = self._taken(state, i)
            yield self._with(taken, NEVER, ARRIVES, i, "wait", i, token)
            return
        for arrival, likely in self._arrivals(state, i, sent):
            if arrival == state.time:
                yield self._handed_over(likely, i)
            else:
                taken, token = self._taken(likely, i)
                yield self._with(taken, arrival, ARRIVES, i, "arrive", i, token)

    def _arrivals(self, state: State, i: int, sent: int) -> Iterator[tuple[int, State]]:
        """When a message of a time arrives: none overtakes another."""
        link = self.links[i]
        last = max((x.time for x in state.items if x.kind == "arrive" and x.of == i), default=0)
        for late, p in link.late.draws(sent + link.delay, self._between, self._order):
            yield max(sent + link.delay + late, last), _likely(state, p)

    # -- what it does to the state -------------------------------------------------------------------------------

    def _with(
        self, state: State, time: int, phase: int, rank: int, kind: str, of: int, token: int = -1, place: int = 0
    ) -> State:
        items = list(state.items)
        bisect.insort(items, Item(time, phase, rank, state.born, kind, of, token, place))
        return replace(state, items=tuple(items), born=state.born + 1)

    def _taken(self, state: State, i: int) -> tuple[State, int]:
        tokens = (*state.tokens, (state.born, self.links[i].size))
        piece = self._effects.taken(state.piece, i)
        return replace(state, tokens=tokens, piece=piece, born=state.born + 1), state.born

    def _handed_over(self, state: State, i: int) -> State:
        taken, token = self._taken(state, i)
        return self._arrived(taken, i, token)

    def _arrived(self, state: State, i: int, token: int) -> State:
        at = self._effects.size
        for other, size in state.tokens:
            if other == token:
                break
            at += size
        last, gap = state.holds[i]
        since = state.time - last
        piece = self._effects.arrived(state.piece, i, at, since, gap)
        holds = state.holds
        if self.links[i].first and since > 0:
            holds = (*holds[:i], (state.time, since), *holds[i + 1 :])
        return replace(state, piece=piece, holds=holds, tokens=tuple(x for x in state.tokens if x[0] != token))

    def _mode(self, state: State) -> tuple[Mode, float, Piece]:
        """Of where a path has come to, its messages in the order in which they are to happen."""
        order = [item.token for item in state.items if item.kind != "measure" and item.token >= 0]
        places, at = {}, self._effects.size
        for token, size in state.tokens:
            places[token] = range(at, at + size)
            at += size
        sizes = dict(state.tokens)
        rows = [*range(self._effects.size), *(row for token in order for row in places[token])]
        piece = state.piece if rows == list(range(at)) else state.piece.mapped(np.eye(at)[rows])
        items = tuple(
            (x.time - state.time if x.time != NEVER else NEVER, x.phase, x.rank, x.kind, x.of,
             x.token if x.kind == "measure" or x.token < 0 else order.index(x.token), x.place)
            for x in state.items
        )  # fmt: skip
        holds = tuple(self._age(i, state.time - at, gap) for i, (at, gap) in enumerate(state.holds))
        return (items, tuple(sizes[token] for token in order), state.bursts, holds), state.probability, piece

    def _age(self, i: int, age: int, gap: int | None) -> tuple[int, int | None]:
        """Of what a first-order hold has got last, as far as that is told apart."""
        link = self.links[i]
        if not link.first:
            return 0, None
        between = link.step if link.step is not None else self._clock_of(link).period
        lasts = 1.0 - 1.0 / link.burst if link.has_bursts and link.burst is not None else link.loss
        longest = math.ceil(math.log(NEGLIGIBLE) / math.log(lasts)) if 0.0 < lasts < 1.0 else 0
        if longest > LONGEST_AGE or lasts >= 1.0:
            raise UsageError(f"{link.name}: a first-order hold that may lose more than {LONGEST_AGE} messages in a row")
        most = _attoseconds((longest + 3) * between) + link.longest + self._clock_of(link).jitter.highest
        if age > most:
            age -= math.ceil((age - most) / self.whole) * self.whole
        return age, gap

    def _clock_of(self, link: Link) -> Task:
        which = link.sender if link.sender is not None else link.receiver
        return self.tasks[which] if which is not None else Task(name="", period=link.step or Fraction(1))


def _likely(state: State, probability: float) -> State:
    return state if probability == 1.0 else replace(state, probability=state.probability * probability)


def together(periods: Sequence[Fraction]) -> Fraction:
    """The time after which all are due together again; 1 s where there is none."""
    if not periods:
        return Fraction(1)
    denominator = math.lcm(*(period.denominator for period in periods))
    return Fraction(math.lcm(*(int(period * denominator) for period in periods)), denominator)


def _attoseconds(seconds: Fraction) -> int:
    return round(seconds * ATTOSECONDS)
