"""The points of a study but for their seeds, and where among them something is so, in words."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

from orchestration.experiments.studies.axes import Axis, Value, place_of, quantity_of
from orchestration.experiments.studies.study import Study

MAX_RUNS = 100_000
"""Runs of a study that are looked at"""
NAMED = 3
"""Points that are named"""
Point = tuple[Value, ...]
"""The values of the axes at a point"""


@dataclass(frozen=True)
class DesignPoints:
    """The points of a study, in as many of its runs as are looked at."""

    study: Study

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """All axes but those of seeds alone."""
        return tuple(axis for axis in self.study.axes if axis.targets != ("seed",))

    @cached_property
    def firsts(self) -> Mapping[Point, int]:
        """The index of the first run of each point."""
        found, points = dict[Point, int](), self.study.points
        for index in range(min(len(points), MAX_RUNS)):
            point = points[index]
            found.setdefault(tuple(point[axis.name] for axis in self.axes), index)
        return found

    def where(self, chosen: Collection[Point], units: Mapping[str, str]) -> str:
        """Which points are meant, as " at 4 of 12 points (delay from 3 ms on)"; empty for a study of seeds alone."""
        if not self.axes:
            return ""
        total = len(self.firsts)
        if len(chosen) == total:
            return f" at all {total} points" if total > 1 else " at its only point"
        texts = [
            place_of(self.axes, dict(zip((axis.name for axis in self.axes), point)), units)
            for point in [*chosen][:NAMED]
        ]
        if len(chosen) > NAMED:
            texts.append(f"{len(chosen) - NAMED} more")
        return f" at {len(chosen)} of {total} points ({self._beyond(chosen, units) or '; '.join(texts)})"

    def _beyond(self, chosen: Collection[Point], units: Mapping[str, str]) -> str:
        """The values of an axis of numbers from or up to which all points are the chosen ones, and no others."""
        for place, axis in enumerate(self.axes):
            found = sorted({point[place] for point in chosen}) if axis.is_numeric and axis.values is not None else []
            if not found or len(chosen) != sum(point[place] in {*found} for point in self.firsts):
                continue
            of, values = quantity_of(axis, units), sorted(map(float, axis.values or ()))
            if len(found) > 1 and values[-len(found) :] == found:
                return f"{of.name} from {of.text_of(float(found[0]))} on"
            if len(found) > 1 and values[: len(found)] == found:
                return f"{of.name} up to {of.text_of(float(found[-1]))}"
        return ""
