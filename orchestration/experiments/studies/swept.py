"""The result of a sweep."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.experiments.studies.infinite_means import InfiniteMeans
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.simulation.results import html
from orchestration.simulation.results.objectives import how_runs_ended
from orchestration.simulation.workers.batching import LaneAgreement

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from orchestration.simulation.figures.style import Figures


@dataclass(frozen=True, kw_only=True, repr=False)
class Swept:
    """The result of a sweep: counts of runs, and the store with the rows."""

    total: int
    """The number of runs of the study."""
    flown: int
    """Number of them that this sweep has run; the others were in the store."""
    failed: int
    """Number of runs in the store that have failed, with `message` in their row; divergence is not a failure."""
    study: Study
    """The study as it was run."""
    path: Path
    """The store of the study."""
    engine: str
    """The engine, by its name in `--engine`."""
    engines: Mapping[str, int]
    """The number of runs in the store that have not failed by their engine."""
    agreement: LaneAgreement | None = None
    """Agreement of runs in SIMD lanes with the same runs by FMUs; None if there were none."""
    follows: tuple[str, ...] = ()
    """The references of its runs and the components that follow them."""

    infinite_means: InfiniteMeans | None = None
    """The points at which averages over runs have no finite expectation or variance, and hence no intervals, and those
    at which it is not known."""

    @property
    def verdict(self) -> str:
        """How many runs of the store have ended in which way."""
        return how_runs_ended(self.outcomes, self.total)

    def __repr__(self) -> str:
        return f"<Swept: {self._counts()}, in {self.path}>"

    @property
    def outcomes(self) -> dict[str | None, int]:
        """The number of runs in the store by their outcome; None: runs that have failed, or have no criterion."""
        with open_for_reading(self.path) as opened:
            return opened.outcomes()

    def _counts(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.total} runs, {self.flown} of them new{failed}"

    def _repr_html_(self) -> str:
        """The form that notebooks show: the number of runs by outcome."""
        counts = sorted(((count, outcome or "failed") for outcome, count in self.outcomes.items()), reverse=True)
        rows = [(outcome, str(count), "runs") for count, outcome in counts]
        return html.card("A study", None, None, self._counts(), rows)

    @explains_missing
    def plot(self, metric: str | None = None, *, mean: bool = False) -> "Figures":
        """The figures of a metric over the axes, default: the first that varies; a notebook shows them.

        With `mean` cells have its mean over all runs that have it, not the median over the good ones.

        Raises `UsageError` for an unknown metric, or axes for which there is no figure.
        """
        from orchestration.experiments.studies.drawing import study_figures
        from orchestration.simulation.figures.style import SCREEN, Figures

        figures, _ = study_figures(self.study, self.path, metric, SCREEN, mean=mean)
        return Figures(figures, SCREEN)

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each run: axes, metrics, seed, status; units are in its `attrs["units"]`, by column."""
        from orchestration.experiments.studies.table import frame, units_in

        table = frame(self.path)
        table.attrs["units"] = units_in(self.path)
        return table

    @explains_missing
    def shares(self, metric: str = "good", *, mean: bool = False) -> "pd.DataFrame":
        """A row for each combination of the axes but `repeat`: `count` of runs, `good`, their `share`, `low`, `high`.

        Also of `diverged`; of another metric its median over the good runs or, with `mean`, its mean over all that have
        it. Intervals at 95 % are Wilson's, of order statistics, or Student's t, nan where nothing is random. Raises
        `UsageError` if the study has no axis that repeats, for an unknown metric, and without a criterion.
        """
        from orchestration.experiments.studies.shares import cells_of

        return cells_of(*self._cells(metric, mean=mean))

    @explains_missing
    def differences(self, metric: str = "good", *, mean: bool = False) -> "pd.DataFrame":
        """Likewise of two laws the second minus the first, over pairs, as of one seed: `difference`, `low`, `high`.

        Intervals of shares are Newcombe's for pairs. Raises `UsageError` also if the study has not two laws.
        """
        from orchestration.experiments.studies.shares import differences_in, laws_of

        table, by, metric, average = self._cells(metric, mean=mean)
        laws = laws_of(table, by)
        if laws is None:
            raise UsageError("differences: expected one axis of two names, such as two controllers")
        return differences_in(table, by, laws, metric, average).assign(law=laws.second, minus=laws.first)

    def _cells(self, metric: str, *, mean: bool) -> "tuple[pd.DataFrame, tuple[str, ...], str, str]":
        from orchestration.experiments.studies.shares import MEAN, MEDIAN, expect_mean, with_chance
        from orchestration.experiments.studies.table import expect_metric_of_cells, frame

        expect_metric_of_cells(self.study, metric)
        if mean:
            expect_mean(metric, self.study.repeat)
        runs = with_chance(frame(self.path), self.study, self.infinite_means)
        return runs, self.study.cell_names or (), metric, MEAN if mean else MEDIAN

    @explains_missing
    def to_xarray(self) -> "xr.Dataset":
        """The metrics over the axes, with units as attributes; raises `UsageError` if some axis is sampled."""
        from orchestration.experiments.studies.table import dataset

        return dataset(self.path)
