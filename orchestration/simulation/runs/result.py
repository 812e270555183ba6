"""The result of a run."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypedDict

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.errors import Named, expect_one_of
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import instants_of
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.foundation.recording.recording import About, Event, Recording, events_of, rows_of
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.objectives import Metrics, judged_objective, unmet
from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import placed_tasks
from orchestration.systems.system.request import Request

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.simulation.figures.style import Figures


class Origin(TypedDict):
    """The FMU of a component."""

    model: str
    """The name of its model."""
    guid: str
    """Identifies the build."""
    path: str
    """Its file."""


class Provenance(TypedDict, total=False):
    """Where the numbers of a run come from."""

    versions: dict[str, str]
    """Versions of Python and of the packages that are used."""
    platform: str
    """The operating system and the processor."""
    fmus: dict[str, Origin]
    """Origins of FMUs, by component."""
    engine: str
    """The engine, `compiled` or `python`; the numbers are the same."""
    follows: str
    """Text of which component follows which reference; empty where none does."""
    loops: list[str]
    """Text of each algebraic loop, and how it is closed; absent without any."""
    events: list[str]
    """Text of each component whose FMU handles its events itself, though others could; absent without any."""
    largest_lateness: float
    """The longest time by which an instant of a run with a pace was late [s]; absent without one."""
    wall_time: float
    """The duration of the run [s]."""


DIGITS = 3
"""Digits of numbers in a sentence"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Result:
    """One run: its request, its recording and its metrics.

    A run that diverged has a result too: `divergence` states what diverged, and objectives have no value. So has one
    that an FMU ended: `termination` states which. In a notebook a result shows its metrics.
    """

    request: Request
    """The request as the user wrote it: a `Scenario` or a `System`."""
    system: System
    """The system of the request, with the objectives that its FMUs have the variables for."""
    recording: Recording
    """Rows and events in chunks, for runs that do not fit into memory; `rows` and `events` have all of them."""
    metrics: Metrics
    """The results of the run: `outcome`, `good`, `horizon` [s], the objectives by name, `diverged`, `divergence_time`
    [s] and `steps`. None is a metric without a value."""
    units: Mapping[str, str]
    """The units of those metrics that have one, by name, as FMI writes them (`N.m`)."""
    described: Mapping[str, ColumnInfo]
    """The unit and the description of each recorded column, by name, as its FMU gives them."""
    parameters: Mapping[str, float]
    """The numeric parameters of all components in the run, by COMPONENT.NAME, in the units of their FMUs."""
    divergence: str | None
    """Text of what diverged; None if nothing did."""
    termination: str | None
    """Text of which FMU ended the run, and how; None if none did."""
    interrupted_at: float | None
    """The time [s] at which Ctrl-C, or an FMU that failed, ended the run; None if neither did."""
    provenance: Provenance
    """Origin of the numbers: versions of the software, the GUID of each FMU, the engine, the wall time [s]."""
    warnings: tuple[str, ...] = ()
    """Warnings of likely mistakes in the request, and those of the FMUs, a sentence each."""

    @property
    def verdict(self) -> str:
        """How a run ended, by the objective that its criterion judges, and its clock; none of an FMU alone without."""
        from orchestration.systems.system.description import describe_clock

        missed = [f"{name} {count}{self._never(name)}" for name, count in self.missed_deadlines.items()]
        late = f"; deadlines missed: {some(missed)}" if missed else ""
        components = self.system.components.values()
        has_clock = len(components) > 1 or any(each.sampling is not None for each in components)
        clock = f", {describe_clock(self.system)}" if has_clock else ""
        return f"{self._ending()}{clock}{late}"

    @cached_property
    def missed_deadlines(self) -> dict[str, int]:
        """How many jobs and frames missed their deadlines, by COMPUTER.TASK or NETWORK.MESSAGE that missed any."""
        if not (self.system.computers or self.system.networks):
            return {}
        return dict(self._counted["missed"].most_common())

    @cached_property
    def _counted(self) -> dict[str, Counter[str]]:
        """Numbers of events of some kinds, by kind and name, in one pass."""
        found = {kind: Counter[str]() for kind in ("missed", "started", "finished")}
        for chunk in self.recording.chunks(("time",)):
            events = chunk.events
            for kind, counter in found.items():
                places, counts = np.unique(events.table[events.are(kind), 2], return_counts=True)
                counter.update({events.names[place]: int(count) for place, count in zip(places, counts)})
        return found

    def _never(self, late: str) -> str:
        """That no job of a late task had any time of its processor, or none was done; empty for any other."""
        if late not in {f"{each.computer_name}.{each.name}" for each in placed_tasks(self.system.computers)}:
            return ""
        without = {"started": " (never ran)", "finished": " (never done)"}
        return next((text for kind, text in without.items() if not self._counted[kind][late]), "")

    def _ending(self) -> str:
        metrics, units = self.metrics, self.units
        if self.divergence is not None:
            return f"diverged: {self.divergence}"
        outcome, until = metrics["outcome"], f"at {quantity(self.end, 's')}"
        if self.termination is not None:
            return f"terminated {until}: {self.termination}"
        if (missed := unmet(self.system, metrics, units)) is not None:
            return f"{outcome}: {missed}"
        name = judged_objective(self.system)
        left = None if name is None else metrics.get(name)
        text = quantity(left, units.get(name or ""), DIGITS) if isinstance(left, float) else "no value"
        settled = metrics.get("settling_time")
        if outcome == "settled" and isinstance(settled, float):
            return f"settled in {quantity(settled, 's', DIGITS)}, {text} left"
        judged = "" if name is None else f": {name} = {text}"
        return f"{outcome or f'ended {until}'}{judged}"

    def __repr__(self) -> str:
        outcome = self.metrics["outcome"] or "run"
        warned = "".join(f"; warning: {text}" for text in self.warnings)
        return (
            f"<Result: {outcome}, {self.end:g} s in {len(self.recording)} rows of {len(self.columns)} columns{warned}>"
        )

    def _repr_html_(self) -> str:
        """As notebooks show it."""
        from orchestration.simulation.results import html

        good = self.metrics["good"]
        named = [name for name in self.metrics if name not in ("outcome", "good")]
        return html.card(
            f"A {self.request.kind}",
            str(self.metrics["outcome"] or "") or None,
            good if isinstance(good, bool) else None,
            f"{self.end:g} s in {len(self.recording)} rows of {len(self.columns)} columns"
            + (f"; diverged: {self.divergence}" if self.divergence else "")
            + (f"; not good: {missed}" if (missed := unmet(self.system, self.metrics, self.units)) else "")
            + (f"; terminated: {self.termination}" if self.termination else "")
            + "".join(f"; warning: {text}" for text in self.warnings),
            [
                (labels.metric(name), html.number(self.metrics[name]), labels.unit(self.units.get(name)) or "")
                for name in named
            ],
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of all columns: `time`, then COMPONENT.NAME, then the signals of the sources."""
        return self.recording.columns

    @cached_property
    def rows(self) -> Floats:
        """All rows, shape (n, number of columns); a row is the value just after its instant."""
        return rows_of(self.recording)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """All events of messages, jobs of tasks and frames of networks, in order of time."""
        return tuple(events_of(self.recording))

    @property
    def about(self) -> About:
        """The `unit` and the `description` of each column, where it has them."""
        return {name: one.as_metadata() for name, one in self.described.items()}

    @property
    def end(self) -> float:
        """The time of the last row [s]."""
        return [float(t) for chunk in self.recording.chunks(("time",)) for t in chunk.rows[-1:, 0]][-1]

    @cached_property
    def signals(self) -> dict[str, Floats]:
        """Every recorded column by its name, as an array of shape (n,)."""
        return Named({name: self.rows[:, i] for i, name in enumerate(self.columns)})

    @cached_property
    def sampled(self) -> npt.NDArray[np.bool_]:
        """Which rows are sampling instants, shape (n,)."""
        events = events_of(self.recording)
        return np.isin(instants_of(self.rows[:, 0]), events.table[events.are("sampled"), 0])

    def plot(
        self,
        *which: str,
        beside: Sequence["Result"] = (),
        window: tuple[float, float] | None = None,
        style: Literal["screen", "paper", "slides"] = "screen",
    ) -> "Figures":
        """Figures of the run; default: all. A notebook shows what is returned.

        Of a flight `which` is among path, errors, components, commands, energy, phase and spectrum, of any other system
        it is signals; or it is a recorded signal, as plant.thrust. Runs `beside` it are overlaid. `window` is the span
        of time [s] that is shown, `style` sets sizes and fonts, as in `quadcosim plot`. The figures are those of
        matplotlib, by name.

        Raises `UsageError` for an unknown figure, a window that begins after the end, and runs of different systems.
        """
        from orchestration.simulation.runs.draw import figures_of  # not before: loads matplotlib

        others = beside if isinstance(beside, Sequence) else [beside]
        return figures_of([self, *others], which or None, window=window, style=style)

    @explains_missing
    def to_pandas(self, what: Literal["signals", "events"] = "signals") -> "pd.DataFrame":
        """The signals as a table indexed by `time` [s], or the events; units are in its `attrs["units"]`, by column.

        Raises `QuadcosimError` where pandas is not installed, `UsageError` for another name.
        """
        from orchestration.foundation.recording import frames

        expect_one_of("what", what, ("signals", "events"))
        return frames.events(self.recording) if what == "events" else frames.signals(self.recording, self.about)

    def to_csv(self, folder: str | Path) -> list[Path]:
        """Write `signals.csv` and `events.csv` into a folder, with units in the column heads; returns their paths."""
        from orchestration.foundation.recording import frames  # not before: loads pyarrow

        return frames.as_csv(self.recording, self.about, Path(folder))

    @explains_missing
    def to_mat(self, path: str | Path) -> Path:
        """Write the run as the structure `run` of a MAT-file, as `quadcosim export --format mat` does; returns it.

        Raises `QuadcosimError` where SciPy is not installed.
        """
        from orchestration.foundation.recording import frames

        return frames.to_mat(Path(path), self.recording, self.about, self.metrics, self.units)
