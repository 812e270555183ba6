"""The points of a study at which averages over runs have no finite expectation or variance, as its store keeps them."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestration.experiments.studies.design_points import NAMED, DesignPoints, Point
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.terminal import inform, warn
from orchestration.systems.system.files import Files
from orchestration.theory.exact.mean_square import (
    NO_EXPECTATION,
    NO_VARIANCE,
    NOT_EXAMINED,
    VARIANCE,
    infinite_means_in_words,
    mean_squares,
    objectives_of_means,
    objectives_of_squares,
)
from orchestration.theory.stability.known_loops import LOOPS

if TYPE_CHECKING:
    import pandas as pd

INFINITE = "means of squares"
"""Name of the entry of a store; empty until they are examined"""
MAX_POINTS = 1000
"""Points of a study that are examined"""
OTHERS = f"{NOT_EXAMINED}only the first {MAX_POINTS} points are"
BY_NONE = f"{NOT_EXAMINED}by no sweep yet"
"""Remarks on points of which a store says nothing"""


@dataclass(frozen=True, kw_only=True)
class InfiniteMeans:
    """What is known of the means of squares of a study."""

    metrics: tuple[str, ...]
    """Objectives that consist of means"""
    squares: tuple[str, ...] = ()
    """Those of them whose variance is of fourth moments"""
    axes: tuple[str, ...] = ()
    """All axes but those of seeds alone"""
    remarks: Mapping[str, tuple[Point, ...]]
    """The points that were looked at, as the values of these axes, by a remark, empty for means as they should be"""
    radii: Mapping[str, float]
    """The largest growth factor of moments, by remark"""
    others: str = OTHERS
    """Remark on all other points"""

    @classmethod
    def of(cls, study: Study, files: Files) -> "InfiniteMeans":
        """Examine the points of a study."""
        metrics = _metrics_of(study)
        points = DesignPoints(study)
        chosen = [*points.firsts.items()][:MAX_POINTS] if metrics else []
        found = mean_squares(study.base, [study.system(index, files.start_values) for _, index in chosen], files)
        remarks, radii = dict[str, tuple[Point, ...]](), dict[str, float]()
        for (point, _), one in zip(chosen, found):
            remarks[one.remark] = (*remarks.get(one.remark, ()), point)
            radii[one.remark] = max(one.radius, radii.get(one.remark, 0.0))
        return cls(
            metrics=metrics, squares=tuple(objectives_of_squares(study.origin)),
            axes=tuple(axis.name for axis in points.axes), remarks=remarks, radii=radii,
        )  # fmt: skip

    @property
    def points(self) -> tuple[Point, ...]:
        """The points without a finite expectation."""
        return self.remarks.get(NO_EXPECTATION, ())

    def as_text(self) -> str:
        """The form in which a store keeps it."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> "InfiniteMeans":
        """From the form in which a store keeps it."""
        known = json.loads(text)
        of_lists = {name: tuple(known[name]) for name in ("metrics", "squares", "axes")}
        remarks = {remark: tuple(map(tuple, points)) for remark, points in known["remarks"].items()}
        return cls(**{**known, **of_lists, "remarks": remarks})

    @classmethod
    def in_store(cls, path: Path, study: Study) -> "InfiniteMeans":
        """Those of a study by its store."""
        with open_for_reading(path) as opened:
            text = opened.about().get(INFINITE)
        return cls.from_text(text) if text else cls(metrics=_metrics_of(study), remarks={}, radii={}, others=BY_NONE)

    def warnings(self, study: Study, units: Mapping[str, str]) -> Iterator[str]:
        """What is to be said of the averages of a study where they mean nothing; each names some points."""
        points = DesignPoints(study)
        if some := self.remarks.get(NO_EXPECTATION):
            yield infinite_means_in_words(self.metrics, points.where(some, units), self.radii[NO_EXPECTATION])
        if self.squares and (some := self.remarks.get(NO_VARIANCE)):
            yield (
                f"{', '.join(self.squares)}: without a finite variance{points.where(some, units)}, so a mean over runs "
                f"has no interval; the fourth-moment radius is {self.radii[NO_VARIANCE]:.6g} (quadcosim expect)"
            )

    def notes(self, study: Study, units: Mapping[str, str]) -> Iterator[str]:
        """What is not known of the averages of a study, in a line for each of the first reasons."""
        points = DesignPoints(study)
        unknown = {
            remark: some for remark, some in self.remarks.items()
            if remark.startswith(NOT_EXAMINED) or (remark == VARIANCE and self.squares)
        }  # fmt: skip
        known = {point for some in self.remarks.values() for point in some}
        if self.metrics and self.others != BY_NONE and (rest := [one for one in points.firsts if one not in known]):
            unknown[self.others] = tuple(rest)
        listed = [*unknown.items()]
        for remark, some in listed[:NAMED]:
            _, _, why = remark.partition(": ")
            of = "variances of means" if remark == VARIANCE else "means of squares"
            yield f"{of} not examined{points.where(some, units)}: {why}"
        if more := sum(len(some) for _, some in listed[NAMED:]):
            yield f"means of squares not examined at {more} other points, for other reasons"

    def tell(self, study: Study, units: Mapping[str, str], announce: Callable[[str], None] = inform) -> None:
        """Warn of means, and announce what is not known of them."""
        for warning in self.warnings(study, units):
            warn(warning)
        for note in self.notes(study, units):
            announce(note)

    def column(self, table: "pd.DataFrame") -> "pd.Series[Any]":
        """The remarks on the metrics of each run of a table, by metric."""
        import pandas as pd

        by_point = {point: self._by_metric(remark) for remark, points in self.remarks.items() for point in points}
        rest = self._by_metric(self.others)
        values = zip(*(table[name] for name in self.axes)) if self.axes else [()] * len(table)
        return pd.Series([by_point.get(each, rest) for each in values], index=table.index, dtype=object)

    def _by_metric(self, remark: str) -> dict[str, str]:
        metrics = self.squares if remark in (NO_VARIANCE, VARIANCE) else self.metrics
        return dict.fromkeys(metrics, remark) if remark else {}


def _metrics_of(study: Study) -> tuple[str, ...]:
    """The objectives that consist of means, of a study whose systems are not known as loops of their own."""
    return () if study.base.kind in LOOPS else tuple(objectives_of_means(study.origin))
