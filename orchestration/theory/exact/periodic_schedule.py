"""When components sample and messages are sent and arrive, as decided by the scheduler."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.systems.computers import note
from orchestration.systems.computers.compiled import scheduler
from orchestration.systems.computers.parts import LATER, NONE
from orchestration.systems.schedule.resources import Resources
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import placed_messages, placed_tasks
from orchestration.theory.exact.links import ATTOSECONDS

_FROM_NANOSECONDS = ATTOSECONDS // NANOSECONDS


@dataclass(frozen=True, kw_only=True)
class PeriodicSchedule:
    """The events of each period, from some period on; or, up to a horizon, all events until then."""

    period: Fraction
    """Period [s]"""
    samples: Mapping[str, tuple[Fraction, ...]]
    """Times of the samples in a period [s], by component"""
    sent: Mapping[str, tuple[Fraction, ...]]
    """Times at which messages are sent [s], by connection from continuous time over a network"""
    transit_times: Mapping[str, tuple[int | None, ...]]
    """Times from its sample, or its sending, to its arrival [attoseconds], by connection; None: it does not arrive"""
    with_own_delay: frozenset[str]
    """connections whose own delays and losses `transit_times` include"""


NO_SCHEDULE = PeriodicSchedule(period=Fraction(1), samples={}, sent={}, transit_times={}, with_own_delay=frozenset())
"""Schedule of a system without computers and networks"""


class ScheduleTrace:
    """The events of the scheduler up to a time."""

    def __init__(self, system: System, stop: int) -> None:
        self.resources = Resources(system, stop)
        running = scheduler(self.resources.of_run(Streams(system.seed, system.streams)))
        running.run(LATER)
        self.notes = running.take_notes()
        self.places = [each.place for each in placed_tasks(system.computers)]
        self.messages = [each.place for each in placed_messages(system.networks)]
        self.system, self.stop = system, stop

    @property
    def jobs(self) -> int:
        """The number of jobs and messages."""
        return int(np.isin(self.notes[:, 1], (note.RELEASED, note.QUEUED)).sum())

    def notes_of(self, kind: int, owner: int) -> Integers:
        """Notes of one kind of a task, message or carrier."""
        return np.asarray(self.notes[(self.notes[:, 1] == kind) & (self.notes[:, 2] == owner)])

    def schedule_between(self, begin: int, end: int, period: Fraction) -> PeriodicSchedule | None:
        """The events between two times [ns], as those of a `period` [s]; None where an arrival is not known.

        Of messages in transit at the end of the trace it is only known that they do not arrive by then.
        """
        parts, until = self.resources.parts, end == self.stop
        samples, sent, transit_times = dict[str, tuple[Fraction, ...]](), dict[str, tuple[Fraction, ...]](), {}
        for name, task in self.resources.tasks.items():
            samples[name] = _offsets_between(self.notes_of(note.SAMPLED, task)[:, 4], begin, end, period)[0]
        released = frozenset(name for name, c in self.resources.carriers.items() if parts.carriers[c].releases)
        for name, c in self.resources.carriers.items():
            sender = parts.carriers[c].sender
            notes, arriving = self.notes_of(note.SENT, c), self.notes_of(note.ARRIVES, c)
            times = notes[:, 0] if sender == NONE else self.notes_of(note.SAMPLED, sender)[:, 4]
            outcome, arrives = np.full((2, len(times)), NONE)
            outcome[notes[:, 3]], arrives[arriving[:, 3]] = notes[:, 4], arriving[:, 4]
            offsets, which = _offsets_between(times, begin, end, period)
            is_open = (outcome[which] == NONE) | ((outcome[which] == 0) & (arrives[which] == NONE))
            if is_open.any() and not until:
                return None
            late = ((arrives - times)[which] * _FROM_NANOSECONDS).tolist()
            transit_times[name] = tuple(each if arrives[k] != NONE else None for each, k in zip(late, which.tolist()))
            if sender == NONE:
                sent[name] = offsets
        return PeriodicSchedule(
            period=period, samples=samples, sent=sent, transit_times=transit_times, with_own_delay=released
        )  # fmt: skip


def _offsets_between(times: Integers, begin: int, end: int, period: Fraction) -> tuple[tuple[Fraction, ...], Integers]:
    """The times [ns] from `begin` to before `end`, as offsets in a period [s], in order; and their indices."""
    which = np.flatnonzero((times >= begin) & (times < end))
    offsets = [Fraction(time, NANOSECONDS) % period for time in times[which].tolist()]
    order = sorted(range(len(offsets)), key=offsets.__getitem__)
    return tuple(offsets[k] for k in order), which[order]
