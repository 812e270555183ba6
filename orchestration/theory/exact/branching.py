"""All courses of events between two cuts of a loop's hyperperiod, instant by instant in the order of `docs/timing.md`.

An event with a random outcome splits a branch in two or more. Times are whole attoseconds.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.theory.exact.branch import (
    ARRIVES,
    MEASURES,
    NEVER,
    POSTS,
    SAMPLES,
    SETTLES,
    Branch,
    BranchEvent,
    Mode,
    Piece,
    in_transit,
    place_in,
)
from orchestration.theory.exact.effects import LoopEffects
from orchestration.theory.exact.random_times import Kinks, RandomLink, SampledTask, attoseconds

NEGLIGIBLE = 1e-13
"""A probability: less likely runs of losses count as the longest distinguished one"""
LONGEST_AGE = 100
"""messages that a first-order hold may lose in a row and still have a known age"""


class Branching:
    """Follows branches from event to event, with the effects that these have."""

    def __init__(
        self,
        tasks: Sequence[SampledTask],
        links: Sequence[RandomLink],
        effects: LoopEffects,
        *,
        order: int,
        kinks: Kinks,
        hyperperiod: int,
    ) -> None:
        """`order` is that of Gauss's rule, `hyperperiod` in attoseconds."""
        self.tasks, self.links, self._effects, self._order = tasks, links, effects, order
        self._kinks_between, self._hyperperiod = kinks, hyperperiod

    def mode_of(self, branch: Branch) -> tuple[Mode, float, Piece]:
        """The mode that a branch has reached, its probability and piece."""
        holds = tuple(self._hold_age(i, branch.time - at, gap) for i, (at, gap) in enumerate(branch.holds))
        events = tuple(event.later(-branch.time) for event in branch.events)
        return (events, branch.bursts, holds), branch.probability, branch.piece

    def branch_of(self, mode: Mode, time: int) -> Branch:
        """The branch that is in a mode at a time, with probability 1."""
        events, bursts, holds = mode
        return Branch(
            time=time, events=tuple(event.later(time) for event in events), bursts=bursts,
            holds=tuple((time - age, gap) for age, gap in holds), piece=self._effects.start(in_transit(events)),
        )  # fmt: skip

    def _hold_age(self, i: int, age: int, gap: int | None) -> tuple[int, int | None]:
        """Age and gap of the last arrival at a first-order hold; ages beyond the longest are folded."""
        link = self.links[i]
        if not link.first_order:
            return 0, None
        between = link.step if link.step is not None else self._clock_of(link).period
        repeats = 1.0 - 1.0 / link.burst_length if link.has_bursts and link.burst_length is not None else link.loss
        longest = math.ceil(math.log(NEGLIGIBLE) / math.log(repeats)) if 0.0 < repeats < 1.0 else 0
        if longest > LONGEST_AGE or repeats >= 1.0:
            raise UsageError(f"{link.name}: a first-order hold that may lose more than {LONGEST_AGE} messages in a row")
        most = attoseconds((longest + 3) * between) + link.longest_delay + self._clock_of(link).jitter.highest
        if age > most:
            age -= math.ceil((age - most) / self._hyperperiod) * self._hyperperiod
        return age, gap

    def _clock_of(self, link: RandomLink) -> SampledTask:
        which = link.sender if link.sender is not None else link.receiver
        return self.tasks[which] if which is not None else SampledTask(name="", period=link.step or Fraction(1))

    # -- events are planned --------------------------------------------------------------------------------------

    def plan_nominal_sample(self, branch: Branch, task: int, nominal: int, place: int) -> Iterator[Branch]:
        """A sample with the jitter of its task, and the measurements for it."""
        for late, p in self.tasks[task].jitter.draws(nominal, self._kinks_between, self._order):
            yield from self._plan_sample(_likely(branch, p), task, nominal + late, place)

    def plan_post(self, branch: Branch, link: int, place: int) -> Branch:
        """A message from continuous time to continuous time, sent now."""
        return _planned(branch, BranchEvent(branch.time, POSTS, link, "post", link, place=place))

    def tick(self, branch: Branch, grid: int) -> Branch:
        """A point of a grid is reached."""
        return replace(branch, piece=self._effects.tick(branch.piece, grid))

    def _plan_sample(self, branch: Branch, task: int, time: int, place: int) -> Iterator[Branch]:
        """A sample at a known time, with its measurements, and the dispatch of messages that wait for it."""
        branches = [_planned(branch, BranchEvent(time, SAMPLES, 2 * task + 1, "sample", task, place=place))]
        for i, link in enumerate(self.links):
            if link.is_read_ahead and link.receiver == task:
                branches = [after for each in branches for after in self._plan_measurement(each, i, time)]
        for event in branch.events:
            if event.time == NEVER and self.links[event.of].sender == task:
                branches = [after for each in branches for after in self._dispatch(each, event, time)]
        yield from branches

    def _plan_measurement(self, branch: Branch, i: int, time: int) -> Iterator[Branch]:
        link = self.links[i]
        last = max((x.time for x in branch.events if x.kind == "measure" and x.of == i), default=0)
        kinks = lambda low, high: [time - at for at in reversed(self._kinks_between(time - high, time - low))]  # noqa: E731
        for late, p in link.delay_jitter.draws(link.delay, kinks, self._order):
            measured = max(time - link.delay - late, last)
            event = BranchEvent(measured, MEASURES, i, "measure", i, place=time - measured)
            yield _planned(_likely(branch, p), event)

    def _dispatch(self, branch: Branch, event: BranchEvent, sent: int) -> Iterator[Branch]:
        """A message that waited for the next sample of its sender is sent then."""
        which = next(k for k, each in enumerate(branch.events) if each is event)
        rest = replace(branch, events=branch.events[:which] + branch.events[which + 1 :])
        begins = [self._effects.size, *(self._effects.size + np.cumsum([x.size for x in branch.events]))]
        for arrival, likely in self._arrivals(rest, event.of, sent):
            then = self._arrival(event.of, arrival)
            order = [k for k in range(len(branch.events)) if k != which]
            order.insert(place_in(rest.events, then), which)
            rows = [*range(self._effects.size), *(i for k in order for i in range(begins[k], begins[k + 1]))]
            yield replace(_planned(likely, then), piece=likely.piece.mapped(np.eye(len(rows))[rows]))

    def _arrival(self, i: int, time: int) -> BranchEvent:
        """The arrival of a message at a time."""
        link = self.links[i]
        return BranchEvent(time, SETTLES if link.settles else ARRIVES, i, "arrive", i, link.size)

    # -- events happen -------------------------------------------------------------------------------------------

    def branches_until(self, branch: Branch, until: int) -> Iterator[Branch]:
        """All outcomes of the events of a branch before a time."""
        while branch.events and branch.events[0].time < until:
            event = branch.events[0]
            branch = self._advance(replace(branch, events=branch.events[1:]), event.time)
            outcomes = [
                replace(each, piece=self._effects.done(each.piece, event, in_transit(each.events)))
                for each in self._outcomes(branch, event)
            ]
            if len(outcomes) > 1:
                for each in outcomes:
                    yield from self.branches_until(each, until)
                return
            branch = outcomes[0]
        yield self._advance(branch, until)

    def _advance(self, branch: Branch, time: int) -> Branch:
        if time == branch.time:
            return branch
        return replace(branch, time=time, piece=self._effects.advance(branch.piece, time - branch.time))

    def _outcomes(self, branch: Branch, event: BranchEvent) -> Iterator[Branch]:
        if event.kind == "arrive":
            yield self._receive(branch, event.of)
        elif event.kind == "sample":
            yield from self._sample(branch, event.of, event.place)
        else:  # a message from continuous time, measured or posted
            link = self.links[event.of]
            for lost, likely in self._losses(branch, event.of):
                if lost and not link.is_repeatable:
                    yield likely
                elif event.kind == "measure":
                    yield self._put_in_transit(likely, BranchEvent(
                        branch.time + event.place, SAMPLES, 2 * (link.receiver or 0), "arrive", event.of, link.size
                    ), again=lost)  # fmt: skip
                else:
                    yield from self._send(likely, event.of, event.place, again=lost)

    def _sample(self, branch: Branch, task: int, place: int) -> Iterator[Branch]:
        branches = [branch]
        for i, link in enumerate(self.links):
            if link.is_measured and not link.is_read_ahead and link.receiver == task:
                branches = [
                    each if lost else self._deliver_now(each, i) for b in branches for lost, each in self._losses(b, i)
                ]
        branches = [
            replace(b, piece=self._effects.sample(b.piece, task, self.tasks[task].numbers[place])) for b in branches
        ]
        for i, link in enumerate(self.links):
            if link.sender == task:
                branches = [
                    after
                    for b in branches
                    for lost, each in self._losses(b, i)
                    for after in ([each] if lost and not link.is_repeatable else self._send(each, i, place, again=lost))
                ]
        yield from branches

    def _losses(self, branch: Branch, i: int) -> list[tuple[bool, Branch]]:
        """Whether the next message is lost, with the branch in which it is or is not."""
        link = self.links[i]
        p = link.loss
        if link.has_bursts and link.burst_length is not None:
            p = 1.0 - 1.0 / link.burst_length if branch.bursts[i] else p / (link.burst_length * (1.0 - p))
        outcomes = [(p >= 1.0, 1.0)] if p <= 0.0 or p >= 1.0 else [(False, 1.0 - p), (True, p)]
        found = []
        for lost, probability in outcomes:
            bursts = branch.bursts
            if link.has_bursts:
                bursts = (*bursts[:i], lost, *bursts[i + 1 :])
            found.append((lost, replace(_likely(branch, probability), bursts=bursts)))
        return found

    def _send(self, branch: Branch, i: int, place: int, *, again: bool) -> Iterator[Branch]:
        """A message that is not lost; or the one before, again."""
        link = self.links[i]
        transit_time = link.transit_times[place]
        if transit_time is None:
            yield branch
            return
        sent: int | None = branch.time + transit_time
        if link.jacobi and link.sender is not None:
            sent = next((x.time for x in branch.events if x.kind == "sample" and x.of == link.sender), None)
        if sent is None:
            yield self._put_in_transit(branch, BranchEvent(NEVER, ARRIVES, i, "wait", i, link.size), again=again)
            return
        for arrival, likely in self._arrivals(branch, i, sent):
            if arrival == branch.time and not link.settles:
                yield likely if again else self._deliver_now(likely, i)
            else:
                yield self._put_in_transit(likely, self._arrival(i, arrival), again=again)

    def _arrivals(self, branch: Branch, i: int, sent: int) -> Iterator[tuple[int, Branch]]:
        """Arrival times of a message sent at a time: none overtakes another."""
        link = self.links[i]
        last = max((x.time for x in branch.events if x.kind == "arrive" and x.of == i), default=0)
        for late, p in link.delay_jitter.draws(sent + link.delay, self._kinks_between, self._order):
            yield max(sent + link.delay + late, last), _likely(branch, p)

    def _put_in_transit(self, branch: Branch, arrival: BranchEvent, *, again: bool) -> Branch:
        i, events = arrival.of, branch.events
        at = sum(event.size for event in events[: place_in(events, arrival)])
        if again:
            last = max((k for k, event in enumerate(events) if event.of == i and event.size), default=None)
            number = None if last is None else sum(event.size for event in events[:last])
            piece = self._effects.repeat(branch.piece, i, at, number)
        else:
            piece = self._effects.send(branch.piece, i, at)
        return replace(_planned(branch, arrival), piece=piece)

    def _deliver_now(self, branch: Branch, i: int) -> Branch:
        return self._receive(replace(branch, piece=self._effects.send(branch.piece, i, 0)), i)

    def _receive(self, branch: Branch, i: int) -> Branch:
        """The first message in transit arrives."""
        last, gap = branch.holds[i]
        since = branch.time - last
        piece, holds = self._effects.receive(branch.piece, i, since, gap), branch.holds
        if self.links[i].first_order and since > 0:
            holds = (*holds[:i], (branch.time, since), *holds[i + 1 :])
        return replace(branch, piece=piece, holds=holds)


def _planned(branch: Branch, event: BranchEvent) -> Branch:
    at = place_in(branch.events, event)
    return replace(branch, events=(*branch.events[:at], event, *branch.events[at:]))


def _likely(branch: Branch, probability: float) -> Branch:
    return branch if probability == 1.0 else replace(branch, probability=branch.probability * probability)
