"""The schedules of runs: runs of one timing in which nothing is left to chance share one."""

from collections import OrderedDict
from collections.abc import Hashable, Iterator, Sequence

from orchestration.schedule.cursor import INSTANTS
from orchestration.schedule.schedule import Schedule
from orchestration.schedule.streams import Streams
from orchestration.schedule.timetable import Timetable
from orchestration.system import placement
from orchestration.system.distribution import content
from orchestration.system.model import System

MOST = 2**17
"""Instants of a schedule that is kept"""
_KEPT = 8


def timing(system: System) -> Hashable:
    """What the schedule of a system follows from."""
    samplings = [c.sampling for c in system.components.values() if c.sampling is not None]
    chance = any(each.is_random for each in samplings) or any(x.is_random for x in system.connections)
    chance = chance or placement.is_random(system)
    return (
        system.stop_time,
        tuple((name, c.step, c.sampling) for name, c in system.components.items()),
        tuple(content(each.jitter) for each in samplings),
        tuple(
            (content(x.delay), content(x.delay_jitter), x.jitter_distribution, content(x.loss), x.burst_length)
            for x in system.connections
        ),
        placement.content_of(system),
        tuple((source.to, source.period) for source in system.sources.values() if source.period is not None),
        (system.seed, tuple(sorted(system.streams.items()))) if chance else None,
    )


class ScheduleCache:
    """Gives the windows of the schedules of runs, those that are asked for again from memory."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, Sequence[Schedule]] = OrderedDict()

    def of(self, key: Hashable, system: System) -> Iterator[Schedule]:
        """The windows of a system whose outline and timing are `key`, in order."""
        if key in self._kept:
            self._kept.move_to_end(key)
            yield from self._kept[key]
            return
        table, found = Timetable(system, Streams(system.seed, system.streams)), []
        count = 0
        while (window := table.following(INSTANTS)) is not None:
            count += len(window)
            if count <= MOST:
                found.append(window)
            yield window
        if count <= MOST:
            self._kept[key] = found
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
