"""The points of a study at which averages over runs have no finite expectation, as its store keeps them."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestration.experiments.studies.axes import Value, place_of
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.systems.system.files import Files
from orchestration.theory.exact.mean_square import infinite_means_in_words, mean_squares, objectives_of_means
from orchestration.theory.stability.known_loops import LOOPS

if TYPE_CHECKING:
    import pandas as pd

INFINITE = "infinite means"
"""Name of the entry of a store; empty until they are examined"""
MAX_RUNS, MAX_POINTS = 100_000, 1000
"""Runs of a study that are looked at, and points of them that are examined"""
NAMED = 3
"""Points that a warning names"""


@dataclass(frozen=True, kw_only=True)
class InfiniteMeans:
    """The points of a study at which means of squares have no finite expectation, and how many were examined."""

    metrics: tuple[str, ...]
    """Objectives that consist of means"""
    axes: tuple[str, ...]
    """All axes but those of seeds alone"""
    points: tuple[tuple[Value, ...], ...]
    """The values of these axes, by point"""
    radius: float
    """The largest mean-square radius there; 0 without such a point"""
    total: int
    """number of points, in as many runs as are looked at"""
    left_out: int
    """number of those that were too many, or have too long a hyperperiod, to be examined"""

    @classmethod
    def of(cls, study: Study, files: Files) -> "InfiniteMeans":
        """Examine the points of a study; those are left out that are not linear about a rest."""
        axes = tuple(axis.name for axis in study.axes if axis.targets != ("seed",))
        metrics = tuple(objectives_of_means(study.origin))
        firsts = dict[tuple[Value, ...], int]()
        if metrics and study.base.kind not in LOOPS:
            for index in range(min(len(study.points), MAX_RUNS)):
                point = study.points[index]
                firsts.setdefault(tuple(point[name] for name in axes), index)
        points = [*firsts]
        systems = [study.system(firsts[point], files.start_values) for point in points[:MAX_POINTS]]
        found = mean_squares(study.base, systems, files)
        return cls(
            metrics=metrics, axes=axes, points=tuple(points[place] for place in found.infinite),
            radius=max((found.radii[place] or 0.0 for place in found.infinite), default=0.0),
            total=len(points), left_out=found.left_out + len(points) - len(systems),
        )  # fmt: skip

    def as_text(self) -> str:
        """The form in which a store keeps it."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> "InfiniteMeans":
        """From the form in which a store keeps it."""
        known = json.loads(text)
        of_lists = {name: tuple(known[name]) for name in ("metrics", "axes")}
        return cls(**{**known, **of_lists, "points": tuple(map(tuple, known["points"]))})

    @classmethod
    def in_store(cls, path: Path) -> "InfiniteMeans | None":
        """Those of a study by its store; None: they were not examined."""
        with open_for_reading(path) as opened:
            text = opened.about().get(INFINITE)
        return cls.from_text(text) if text else None

    def warning(self, study: Study, units: Mapping[str, str]) -> str | None:
        """What is to be said of the averages of a study, which names some points; None: nothing."""
        if not self.points:
            return None
        named = [place_of(study.axes, dict(zip(self.axes, point)), units) for point in self.points[:NAMED]]
        more = [f"{len(self.points) - NAMED} more"] if len(self.points) > NAMED else []
        where = f" at {len(self.points)} of {self.total} points ({'; '.join([*named, *more])})" if self.axes else ""
        where += f", of which {self.left_out} were not examined" if self.left_out else ""
        return infinite_means_in_words(self.metrics, where, self.radius)

    def column(self, table: "pd.DataFrame") -> "pd.Series[Any]":
        """The metrics of each run of a table without a finite expectation, in a tuple."""
        import pandas as pd

        points = {*self.points}
        values = zip(*(table[name] for name in self.axes)) if self.axes else [()] * len(table)
        return pd.Series([self.metrics if each in points else () for each in values], index=table.index, dtype=object)
