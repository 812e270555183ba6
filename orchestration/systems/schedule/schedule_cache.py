"""A cache of the schedules of runs: those without randomness share one."""

from collections import OrderedDict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestration.systems.schedule.common_timetable import CommonTimetable, Span
from orchestration.systems.schedule.compiled_timetable import timetable
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system import placement
from orchestration.systems.system.distribution import content
from orchestration.systems.system.model import System

INSTANTS = 2**15
"""Approximate number of a span"""
MAX_CACHED_INSTANTS = 2**17
"""The most instants of a cached schedule"""
_KEPT = 8


@dataclass(frozen=True)
class ScheduleKey:
    """The key of a schedule: everything in a system that determines it."""

    regular: Hashable
    """Key of the regular part"""
    drawn: tuple[int, Hashable] | None
    """the seed and the streams; None: nothing is random"""

    def with_seed(self, seed: int) -> "ScheduleKey":
        """That of the same system with another seed."""
        return self if self.drawn is None else ScheduleKey(self.regular, (seed, self.drawn[1]))


def schedule_key(system: System) -> ScheduleKey:
    """The key of the schedule of a system."""
    samplings = [c.sampling for c in system.components.values() if c.sampling is not None]
    regular = (
        system.stop_time,
        tuple((name, c.step, c.points, c.sampling) for name, c in system.components.items()),
        tuple(content(each.jitter) for each in samplings),
        tuple(
            (content(x.delay), content(x.delay_jitter), x.jitter_distribution, content(x.loss), x.burst_length)
            for x in system.connections
        ),
        placement.content_of(system),
        tuple((source.to, source.period) for source in system.sources.values() if source.period is not None),
    )
    drawn = (system.seed, tuple(sorted(system.streams.items()))) if system.has_random_timing else None
    return ScheduleKey(regular, drawn)


@dataclass(frozen=True, kw_only=True)
class RunSchedule:
    """The schedule of one run."""

    first_samples: Mapping[str, int]
    """First samples as in a `Timetable`"""
    spans: Iterator[Span]


class ScheduleCache:
    """Makes the schedules of runs, and caches the last ones."""

    def __init__(self) -> None:
        self._common_parts: OrderedDict[Hashable, CommonTimetable] = OrderedDict()
        self._kept: OrderedDict[Hashable, tuple[Mapping[str, int], Sequence[Span]]] = OrderedDict()

    def of(self, outline: Hashable, timing: ScheduleKey, system: System) -> RunSchedule:
        """The schedule of a system with this outline and timing; raises `UsageError` as `Timetable`."""
        key = outline, timing
        if key in self._kept:
            self._kept.move_to_end(key)
            first_samples, spans = self._kept[key]
            return RunSchedule(first_samples=first_samples, spans=iter(spans))
        table = timetable(system, Streams(system.seed, system.streams), common=self._common(outline, timing, system))
        return RunSchedule(first_samples=table.first_samples, spans=self._spans(key, table))

    def _common(self, outline: Hashable, timing: ScheduleKey, system: System) -> CommonTimetable:
        key = outline, timing.regular
        if key not in self._common_parts:
            _keep(self._common_parts, key, CommonTimetable(system, {}))
        self._common_parts.move_to_end(key)
        return self._common_parts[key]

    def _spans(self, key: Hashable, table: Timetable) -> Iterator[Span]:
        found: list[Span] = []
        count = 0
        for span in table.spans(INSTANTS):
            count += len(span.regular) + len(span.own)
            if count <= MAX_CACHED_INSTANTS:
                found.append(span)
            yield span
        if count <= MAX_CACHED_INSTANTS:
            _keep(self._kept, key, (table.first_samples, found))


def _keep(kept: OrderedDict[Hashable, Any], key: Hashable, value: Any) -> None:
    """Add an item, dropping the oldest beyond `_KEPT`."""
    kept[key] = value
    while len(kept) > _KEPT:
        kept.popitem(last=False)
