"""When components sample and messages come and go, as the scheduler decides it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from orchestration.basics.simulator import Integers
from orchestration.computers.compiled import scheduler
from orchestration.computers.parts import ARRIVES, LATER, NONE, QUEUED, RELEASED, SAMPLED, SENT
from orchestration.exact.clockwork import ATTOSECONDS
from orchestration.schedule.resources import Resources
from orchestration.schedule.streams import Streams
from orchestration.system.model import System
from orchestration.system.placement import placed_messages, placed_tasks
from orchestration.system.times import NANOSECONDS

_FROM_NANOSECONDS = ATTOSECONDS // NANOSECONDS


@dataclass(frozen=True, kw_only=True)
class Foretold:
    """What happens in a period again and again, from some on; or, up to a horizon, what happens until then."""

    period: Fraction
    """[s]"""
    samples: Mapping[str, tuple[Fraction, ...]]
    """by component, when it samples in a period [s]"""
    sent: Mapping[str, tuple[Fraction, ...]]
    """by connection from continuous time over a network, when a message goes [s]"""
    behind: Mapping[str, tuple[int | None, ...]]
    """by connection, how long after its sample, or after it went, each message is received [attoseconds], if it is"""
    settled: frozenset[str]
    """connections whose own delays and losses are in that"""


NOTHING = Foretold(period=Fraction(1), samples={}, sent={}, behind={}, settled=frozenset())
"""Of a system without computers and networks"""


class Course:
    """What the scheduler does up to a time."""

    def __init__(self, system: System, stop: int) -> None:
        self.resources = Resources(system, stop)
        at_work = scheduler(self.resources.of_run(Streams(system.seed, system.streams)))
        at_work.run(LATER)
        self.notes = at_work.taken()
        self.places = [each.place for each in placed_tasks(system.computers)]
        self.messages = [each.place for each in placed_messages(system.networks)]
        self.system, self.stop = system, stop

    @property
    def jobs(self) -> int:
        """How many there were, of messages too."""
        return int(np.isin(self.notes[:, 1], (RELEASED, QUEUED)).sum())

    def of(self, kind: int, whose: int) -> Integers:
        """Notes of one kind of a task, message or carrier."""
        found: Integers = self.notes[(self.notes[:, 1] == kind) & (self.notes[:, 2] == whose)]
        return found

    def foretold(self, begin: int, end: int, period: Fraction) -> Foretold | None:
        """What happens between two times [ns], as of a `period` [s]; None where it is not known to its end.

        Nothing is known of what is on its way at the end of the course, but that it is not received by then.
        """
        parts, until = self.resources.parts, end == self.stop
        samples, sent, behind = dict[str, tuple[Fraction, ...]](), dict[str, tuple[Fraction, ...]](), {}
        for name, task in self.resources.tasks.items():
            samples[name] = _in_turn(self.of(SAMPLED, task)[:, 4], begin, end, period)[0]
        released = frozenset(name for name, c in self.resources.carriers.items() if parts.carriers[c].releases)
        for name, c in self.resources.carriers.items():
            sender, notes, arriving = parts.carriers[c].sender, self.of(SENT, c), self.of(ARRIVES, c)
            times = notes[:, 0] if sender == NONE else self.of(SAMPLED, sender)[:, 4]
            what, arrives = np.full((2, len(times)), NONE)
            what[notes[:, 3]], arrives[arriving[:, 3]] = notes[:, 4], arriving[:, 4]
            offsets, which = _in_turn(times, begin, end, period)
            is_open = (what[which] == NONE) | ((what[which] == 0) & (arrives[which] == NONE))
            if is_open.any() and not until:
                return None
            late = ((arrives - times)[which] * _FROM_NANOSECONDS).tolist()
            behind[name] = tuple(each if arrives[k] != NONE else None for each, k in zip(late, which.tolist()))
            if sender == NONE:
                sent[name] = offsets
        return Foretold(period=period, samples=samples, sent=sent, behind=behind, settled=released)


def _in_turn(times: Integers, begin: int, end: int, period: Fraction) -> tuple[tuple[Fraction, ...], Integers]:
    """Those of the times [ns] from `begin` to before `end`, in a period [s], in order; and which they are."""
    which = np.flatnonzero((times >= begin) & (times < end))
    offsets = [Fraction(time, NANOSECONDS) % period for time in times[which].tolist()]
    order = sorted(range(len(offsets)), key=offsets.__getitem__)
    return tuple(offsets[k] for k in order), which[order]
