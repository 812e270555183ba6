"""The events of a run: those of messages from its engine, and those of tasks and frames from the scheduler."""

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import nanoseconds
from orchestration.foundation.recording.recording import Events
from orchestration.systems.computers.compiled import scheduler
from orchestration.systems.computers.scheduler_events import NEEDED
from orchestration.systems.schedule.resources import Resources
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System

_AT_ONCE = 1_000_000_000
"""[ns], the time advanced at once over unneeded events"""


class _OnComputers:
    """The events of the tasks and frames of a system, computed as far as requested."""

    def __init__(self, system: System) -> None:
        resources = Resources(system, nanoseconds(system.stop_time))
        parts = resources.of_run(Streams(system.seed, system.streams))
        self._scheduler, self._events = scheduler(parts, NEEDED), resources.event_builder()
        self.names = self._events.names
        self.reached = -1

    def up_to(self, time: int) -> Integers:
        """The events after the last requested time, up to `time` [ns]."""
        self.reached = time
        self._scheduler.run(time + 1)
        return self._events.before(time + 1, self._scheduler.take_notes())


class RunEvents:
    """The events of a run that are not handed over yet."""

    def __init__(self, system: System) -> None:
        connections = tuple(x.name for x in system.connections)
        self._on_computers = _OnComputers(system) if system.computers or system.networks else None
        self._first = len(connections)
        self._names = connections if self._on_computers is None else (*connections, *self._on_computers.names)
        self._kept: Integers = np.zeros((0, 4), dtype=np.int64)

    def with_messages(self, events: Integers, time: int) -> Events:
        """Events of tasks and frames up to `time` [ns] and `events` of messages, as a table of `Events`, in order.

        At one instant computers and networks come first.
        """
        if self._on_computers is not None:
            found = self._on_computers.up_to(time)
            found[:, 2] += self._first
            self._kept = np.concatenate([self._kept, found]) if len(self._kept) else found
            events = np.concatenate([self._kept, events])
        return Events(self._names, _in_order(events))

    def discard_until(self, time: int) -> None:
        """Discard the events up to `time` [ns]."""
        if self._on_computers is not None:
            begin = self._on_computers.reached
            for until in range(begin, time, max(_AT_ONCE, (time - begin) // 1000)):
                self._on_computers.up_to(until)
            self._on_computers.up_to(time)
            self._kept = self._kept[:0]


def _in_order(events: Integers) -> Integers:
    """A table of events sorted by time, a new one."""
    if (events[1:, 0] >= events[:-1, 0]).all():
        return np.array(events)
    ordered: Integers = events[np.argsort(events[:, 0], kind="stable")]
    return ordered
