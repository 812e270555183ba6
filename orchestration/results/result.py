"""The outcome of a run."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.master.recording import About, Event, Recording
from orchestration.quadrotor.scenario import Scenario
from orchestration.results.described import Described
from orchestration.results.objectives import Metrics
from orchestration.simulator import Floats
from orchestration.system.model import System


@dataclass(frozen=True, kw_only=True)
class Result:
    """One run: what was asked, what was recorded, what it comes to."""

    asked: Scenario | System
    """as the user wrote it"""
    system: System
    """what it means"""
    recording: Recording
    """rows and events in chunks; what follows has them whole"""
    metrics: Metrics
    units: Mapping[str, str]
    """of metrics that have one, by name"""
    described: Mapping[str, Described]
    """unit and description of each column"""
    parameters: Mapping[str, float]
    """the numeric ones of all components, as they were flown, as COMPONENT.NAME"""
    divergence: str | None
    """what diverged, if it did"""
    interrupted_at: float | None
    """[s]; it was ended there before its time"""
    provenance: dict[str, Any]
    """versions, the GUID of each FMU, and `wall_time`, what the run took [s]"""
    warnings: tuple[str, ...] = ()
    """what the FMUs warned of"""

    @property
    def columns(self) -> tuple[str, ...]:
        """`time`, then COMPONENT.NAME, then the signals of the sources."""
        return self.recording.columns

    @cached_property
    def rows(self) -> Floats:
        """Shape (n, number of columns); a row is the value just after its instant."""
        return np.concatenate([chunk.rows for chunk in self.recording.chunks()])

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """In order of time."""
        return tuple(event for chunk in self.recording.chunks(("time",)) for event in chunk.events)

    @property
    def about(self) -> About:
        """What is known of each column, in words: its `unit` and its `description`, where it has them."""
        return {name: one.as_words() for name, one in self.described.items()}

    @property
    def end(self) -> float:
        """Time of the last row [s]."""
        return [float(t) for chunk in self.recording.chunks(("time",)) for t in chunk.rows[-1:, 0]][-1]

    @cached_property
    def signals(self) -> dict[str, Floats]:
        """Every recorded column as an array of shape (n,)."""
        return {name: self.rows[:, i] for i, name in enumerate(self.columns)}

    @cached_property
    def sampled(self) -> npt.NDArray[np.bool_]:
        """Which rows are sampling instants, shape (n,)."""
        return rows_of(self.rows[:, 0], self.events, "sampled")


def rows_of(time: Floats, events: tuple[Event, ...], kind: str, what: str | None = None) -> npt.NDArray[np.bool_]:
    """At which of the recorded times [s] there is an event of a kind, and of that (`what`) if it is given."""
    instants = [event.time for event in events if event.kind == kind and what in (None, event.what)]
    return np.isin(np.round(time * 1e9).astype(np.int64), np.array(instants, dtype=np.int64))
