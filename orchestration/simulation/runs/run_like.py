"""What labels and figures need of a run."""

from collections.abc import Mapping
from typing import Protocol

from orchestration.foundation.recording.recording import Recording
from orchestration.simulation.results.column_info import ColumnInfo
from orchestration.simulation.results.objectives import Metrics
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request


class RunLike(Protocol):
    """A run, with the fields of `Result` that are drawn."""

    @property
    def request(self) -> Request:
        """What was run."""

    @property
    def system(self) -> System:
        """The system of the request."""

    @property
    def recording(self) -> Recording:
        """Rows and events."""

    @property
    def metrics(self) -> Metrics:
        """Its metrics."""

    @property
    def described(self) -> Mapping[str, ColumnInfo]:
        """The unit and the description of each column."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Of all components, by COMPONENT.NAME."""

    @property
    def divergence(self) -> str | None:
        """What diverged; None if nothing did."""

    @property
    def termination(self) -> str | None:
        """Which FMU ended it; None if none did."""

    @property
    def interrupted_at(self) -> float | None:
        """When Ctrl-C ended it [s]; None if it did not."""
