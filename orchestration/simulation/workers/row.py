"""The row of a run in a store."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from orchestration.foundation.processes.passable import passable


@passable
@dataclass(frozen=True, kw_only=True)
class Row:
    """One run: its settings and its results."""

    index: int
    """position in the design"""
    key: str
    """hash of everything that determines the run"""
    settings: Mapping[str, Any]
    """the value of each axis"""
    seed: int
    metrics: Mapping[str, Any] | None
    """None if the run failed"""
    message: str | None
    """why it failed, or what diverged"""
    duration: float
    """wall-clock time of the run [s]"""
    machine: str | None = None
    """the kind of machine that ran it"""
    engine: str | None = None
    """the engine that its metrics are of, by its name in `--engine`; None if it failed"""

    @property
    def status(self) -> str:
        """`done` or `failed`; divergence is a result."""
        return "failed" if self.metrics is None else "done"
