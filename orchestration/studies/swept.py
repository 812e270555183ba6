"""What a sweep leaves, to look at."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.basics.extras import explains_missing
from orchestration.results import html
from orchestration.studies.store import open_for_reading
from orchestration.studies.study import Study
from orchestration.workers.batching import Agreement

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from orchestration.figures.gallery import Figures


@dataclass(frozen=True, kw_only=True, repr=False)
class Swept:
    """A study that was flown: how that went, and where its rows are."""

    total: int
    """How many runs the study has."""
    flown: int
    """How many of them this sweep has flown; the others were there."""
    failed: int
    """How many runs in the store have failed, as `message` in their row says; a run that diverges has not."""
    study: Study
    """What was flown."""
    path: Path
    """The store of the study."""
    engine: str
    """What flew, as `--engine` has it."""
    agreement: Agreement | None = None
    """How runs flown as lanes agree with the same flown by FMUs; None if none were."""
    follows: tuple[str, ...] = ()
    """What is followed in its runs, and by whom."""

    def __repr__(self) -> str:
        return f"<Swept: {self._counts()}, in {self.path}>"

    def _counts(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.total} runs, {self.flown} flown now{failed}"

    def _repr_html_(self) -> str:
        """As notebooks show it: what became of how many runs."""
        with open_for_reading(self.path) as opened:
            outcomes = Counter(str(outcome or "failed") for block in opened.blocks() for outcome in block["outcome"])
        rows = [(outcome, str(count), "runs") for outcome, count in outcomes.most_common()]
        return html.card("A study", None, None, self._counts(), rows)

    @explains_missing
    def plot(self, metric: str | None = None) -> "Figures":
        """The figures of a metric over the axes, by default of the first that varies; a notebook shows them.

        Raises `UsageError` for a metric that does not exist, or axes that no figure is for.
        """
        from orchestration.figures.gallery import Figures
        from orchestration.figures.style import SCREEN
        from orchestration.studies.drawing import study_figures

        made, _ = study_figures(self.study, self.path, metric, SCREEN)
        return Figures(made, SCREEN)

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each run: axes, metrics, seed, status; units are in its `attrs["units"]`, by column."""
        from orchestration.studies.table import frame, units_in

        table = frame(self.path)
        table.attrs["units"] = units_in(self.path)
        return table

    @explains_missing
    def to_xarray(self) -> "xr.Dataset":
        """The metrics over the axes, with units as attributes; raises `UsageError` if some axis is sampled."""
        from orchestration.studies.table import dataset

        return dataset(self.path)
