"""The timing of a loop as a Markov chain: which messages are in transit, and when the next events are due.

Time is in whole attoseconds. The hyperperiod is cut at the nominal instants of tasks, earlier for those that read
values measured before. The messages in transit at a cut are the mode; between two cuts all branches are followed.
"""

import bisect
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.exact.branch import Branch, Mode, Piece
from orchestration.theory.exact.branching import Branching
from orchestration.theory.exact.effects import LoopEffects
from orchestration.theory.exact.moments import Passage, Stage
from orchestration.theory.exact.random_times import RandomLink, SampledTask, attoseconds
from orchestration.theory.stability.operating_point import hyperperiod

MOST_MODES = 2000
MOST_PASSAGES = 12_000


class TimingChain:
    """The stages of a hyperperiod, by the effects of its events."""

    def __init__(
        self,
        tasks: Sequence[SampledTask],
        links: Sequence[RandomLink],
        effects: LoopEffects,
        *,
        order: int,
        grids: Sequence[Fraction] = (),
        cuts: Sequence[int] = (),
    ) -> None:
        """`order` is that of Gauss's rule. `grids` are periods of points at which `effects` tick, `cuts` further cuts.

        Raises `UsageError` for periods without a hyperperiod, or for too many modes.
        """
        self.tasks, self.links, self._effects, self._grids = tasks, links, effects, grids
        self.period = hyperperiod([*(t.period for t in tasks), *(x.step for x in links if x.step is not None), *grids])
        self.length = attoseconds(self.period)
        """the period [attoseconds]"""
        self._lead_times = [
            max((x.longest_delay for x in links if x.is_read_ahead and x.receiver == i), default=0)
            for i in range(len(tasks))
        ]
        """Time before its sample at which it may measure, by task"""
        self._cut_actions = self._actions_by_cut(cuts)
        self.cuts = sorted(self._cut_actions)
        self._kinks = self._all_kinks()
        self._branching = Branching(
            tasks, links, effects, order=order, kinks=self._kinks_between, hyperperiod=self.length
        )

    # -- cuts and kinks ------------------------------------------------------------------------------------------

    def _actions_by_cut(self, cuts: Sequence[int]) -> dict[int, list[tuple[str, int, int]]]:
        found: dict[int, list[tuple[str, int, int]]] = {time: [] for time in cuts}
        for i, task in enumerate(self.tasks):
            for time, place in self._times(task.period, task.offsets):
                found.setdefault((time - self._lead_times[i]) % self.length, []).append(("sample", i, place))
        for i, link in enumerate(self.links):
            for time, place in self._times(link.step, link.send_offsets) if link.step is not None else ():
                found.setdefault(time, []).append(("post", i, place))
        for i, grid in enumerate(self._grids):
            for time, place in self._times(grid, (Fraction(0),)):
                found.setdefault(time, []).append(("tick", i, place))
        return found or {0: []}

    def _times(self, period: Fraction, offsets: Sequence[Fraction]) -> Iterator[tuple[int, int]]:
        """The times of offset + k period in the hyperperiod, each with the index of its offset."""
        for k in range(int(self.period / period)):
            for place, offset in enumerate(offsets):
                yield attoseconds(offset + k * period), place

    def _all_kinks(self) -> list[int]:
        """Where costs may have a kink over the time of an event, within a period: at samples and arrivals of others."""
        found: set[int] = set(self.cuts)
        for i, task in enumerate(self.tasks):
            for nominal, place in self._times(task.period, task.offsets):
                ends = {nominal, nominal + task.jitter.lowest, nominal + task.jitter.highest}
                for link in self.links:
                    if link.sender == i and not link.is_measured:
                        late = link.delay + (link.transit_times[place] or 0)
                        jitter = link.delay_jitter
                        ends |= {end + late + more for end in ends for more in (jitter.lowest, jitter.highest)}
                found |= {end % self.length for end in ends}
        return sorted(found)

    def _kinks_between(self, low: int, high: int) -> list[int]:
        """The kinks strictly between two times."""
        found, turn = [], low // self.length
        while turn * self.length < high:
            shift = turn * self.length
            first = bisect.bisect_right(self._kinks, low - shift)
            last = bisect.bisect_left(self._kinks, high - shift)
            found += [shift + at for at in self._kinks[first:last]]
            turn += 1
        return found

    # -- stages --------------------------------------------------------------------------------------------------

    def stages(self) -> tuple[list[Stage], list[list[int]]]:
        """By cut, the passages from each mode there to those at the next cut; and the sizes of the states."""
        modes: list[dict[Mode, int]] = [{} for _ in self.cuts]
        stages: list[list[Passage]] = [[] for _ in self.cuts]
        waiting = [(0, self._empty_mode)]
        modes[0][waiting[0][1]] = 0
        count = passages = 0
        while waiting:
            i, mode = waiting.pop()
            then = (i + 1) % len(self.cuts)
            for end, probability, piece in self.passages_from(i, mode):
                if end not in modes[then]:
                    modes[then][end] = len(modes[then])
                    waiting.append((then, end))
                    count += 1
                stages[i].append(Passage(modes[i][mode], modes[then][end], probability, piece))
                passages += 1
            if count > MOST_MODES or passages > MOST_PASSAGES:
                raise UsageError(
                    f"more than {MOST_MODES} combinations of messages in transit, or {MOST_PASSAGES} passages from one "
                    "to the next: expected fewer random delays at once, or shorter ones"
                )
        sizes = [[self._effects.size + sum(event.size for event in mode[0]) for mode in known] for known in modes]
        return list(stages), sizes

    @property
    def _empty_mode(self) -> Mode:
        return (), (False,) * len(self.links), ((0, None),) * len(self.links)

    def repeating(self, guess: Mode | None = None) -> tuple[list[Piece], Mode]:
        """By cut, the piece from there to the next one, of a loop without chance whose messages in transit repeat.

        And the mode at the first cut: the search begins at `guess`.
        """
        mode, before, pieces = guess or self._empty_mode, None, list[Piece]()
        while mode != before:
            before, pieces = mode, []
            for i in range(len(self.cuts)):
                ((mode, _, piece),) = self.passages_from(i, mode)
                pieces.append(piece)
        return pieces, mode

    def cut_time(self, k: int) -> int:
        """The time of the k-th cut, counted from 0."""
        turns, i = divmod(k, len(self.cuts))
        return self.cuts[i] + turns * self.length

    def initial_passages(self, end: int) -> Iterator[tuple[Mode, float, Piece]]:
        """From the beginning of a run at 0: modes at the first cut, or at `end` if earlier, with probability and piece.

        Nothing is in transit, bursts have their stationary probabilities, and reads before 0 are made at 0. Raises
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
            begin = self._branching.branch_of(((), bursts, self._empty_mode[2]), 0)
            branches = [replace(begin, probability=math.prod(shares))]
            for i, nominal, place in self._samples_read_before_zero():
                branches = [
                    after for each in branches for after in self._branching.plan_nominal_sample(each, i, nominal, place)
                ]
            for each in branches:
                for reached in self._branching.branches_until(each, min(self.cuts[0], end)):
                    yield self._branching.mode_of(reached)

    def _samples_read_before_zero(self) -> Iterator[tuple[int, int, int]]:
        """Tasks, nominal times and places of the samples whose measurements may be due before 0."""
        for i, task in enumerate(self.tasks):
            for k in itertools.count():
                if not task.offsets or attoseconds(task.offsets[0] + k * task.period) >= self._lead_times[i]:
                    break
                for place, offset in enumerate(task.offsets):
                    nominal = attoseconds(offset + k * task.period)
                    if nominal < self._lead_times[i]:
                        yield i, nominal, place

    def passages_from(self, i: int, mode: Mode, until: int | None = None) -> Iterator[tuple[Mode, float, Piece]]:
        """From a mode at a cut: modes at the next one, or at a time before it, with probability and piece."""
        until = self.cut_time(i + 1) if until is None else until
        branches = [self._branching.branch_of(mode, self.cuts[i])]
        for kind, which, place in self._cut_actions[self.cuts[i]]:
            branches = [after for each in branches for after in self._act(each, kind, which, place)]
        for each in branches:
            for end in self._branching.branches_until(each, until):
                yield self._branching.mode_of(end)

    def _act(self, branch: Branch, kind: str, which: int, place: int) -> Iterator[Branch]:
        """An action at a cut: a sample or a post is planned, a grid ticks."""
        if kind == "post":
            yield self._branching.plan_post(branch, which, place)
        elif kind == "tick":
            yield self._branching.tick(branch, which)
        else:
            nominal = branch.time + self._lead_times[which]
            yield from self._branching.plan_nominal_sample(branch, which, nominal, place)


Moments = dict[Mode, Floats]
"""Moments by mode: E[z z'] restricted to that mode; one number of z is 1: its row has the means, its square is the
probability of the mode"""


def costs_until(chain: TimingChain, start: Floats, one: int, end: int) -> Floats:
    """The expected costs, shape (costs,), from the state `start` at 0 to `end` [attoseconds].

    Number `one` of the state is the constant 1. The costs are not finite where the moments overflow.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        moments, costs = _after(np.outer(start, start), chain.initial_passages(end), one)
        known: dict[tuple[int, Mode], list[tuple[Mode, float, Piece]]] = {}
        count, k = len(chain.cuts), 0
        while chain.cut_time(k) < end:
            i, turns = k % count, k // count
            is_last = chain.cut_time(k + 1) > end
            later: Moments = {}
            for mode, before in moments.items():
                if is_last:
                    known[i, mode] = list(chain.passages_from(i, mode, end - turns * chain.length))
                elif (i, mode) not in known:
                    known[i, mode] = list(chain.passages_from(i, mode))
                reached, cost = _after(before, known[i, mode], one)
                costs = costs + cost
                for then, part in reached.items():
                    later[then] = later[then] + part if then in later else part
            moments, k = later, k + 1
    return costs


def _after(before: Floats, passages: Iterable[tuple[Mode, float, Piece]], one: int) -> tuple[Moments, Floats]:
    """The moments by mode after passages from one mode, and the costs of these."""
    reached: Moments = {}
    costs: Floats = np.zeros(1)
    for mode, probability, piece in passages:
        costs = costs + probability * (np.einsum("kij,ij->k", piece.M, before) + before[one, one] * piece.c)
        part = probability * (piece.Z @ before @ piece.Z.T + before[one, one] * piece.W)
        reached[mode] = reached[mode] + part if mode in reached else part
    return reached, costs
