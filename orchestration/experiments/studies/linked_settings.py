"""Settings linked to the values of axes: a vehicle, an initial condition, a set of gains."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestration.experiments.studies.axes import Value

Key = tuple[Value, ...]


@dataclass(frozen=True, kw_only=True)
class LinkedSettings:
    """Targets that the values of one or several axes set together."""

    axes: tuple[str, ...]
    sets: Mapping[Key, Mapping[str, Value]] = field(default_factory=dict)
    """values by target, by the values of the axes; values without an entry set nothing"""
    multiplies: Mapping[Key, Mapping[str, float]] = field(default_factory=dict)
    """likewise factors on the targets' values so far, or in the base"""

    @property
    def targets(self) -> Iterator[str]:
        """All targets that it sets or multiplies."""
        for table in (self.sets, self.multiplies):
            for changes in table.values():
                yield from changes

    def of(self, point: Mapping[str, Value]) -> tuple[Mapping[str, Value], Mapping[str, float]]:
        """The values and the factors by target at a point of the design."""
        key = tuple(point[name] for name in self.axes)
        return self.sets.get(key, {}), self.multiplies.get(key, {})

    def as_lists(self) -> list[Any]:
        """The content in JSON types."""
        return [[[*key, dict(changes)] for key, changes in table.items()] for table in (self.sets, self.multiplies)]
