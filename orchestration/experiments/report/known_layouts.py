"""Layouts of runs that are recognised by their columns: panels, the scene in space, computed columns."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Protocol

from orchestration.foundation.basics.registry import Registry

if TYPE_CHECKING:
    from orchestration.experiments.report.model import Panel, Scene
    from orchestration.foundation.basics.simulator import Floats
    from orchestration.systems.system.model import System

    Signals = Mapping[str, Floats]
    """Columns of shape (n,), the `time` [s] among them"""


class KnownLayout(Protocol):
    """The layout of one kind of runs."""

    @property
    def compact(self) -> tuple[str, ...]:
        """The columns of a short track."""

    @property
    def logarithmic(self) -> Collection[str]:
        """Computed columns that are stored by their logarithms."""

    def fits(self, columns: Collection[str]) -> bool:
        """Whether the columns are those of such a run."""

    def computed(self, signals: Signals) -> Signals:
        """Columns computed from others, if these exist."""

    def panels(self, columns: Collection[str]) -> tuple[Panel, ...]:
        """Panels for the columns, computed ones included; the remaining columns get panels as in any run."""

    def scene(self, columns: Collection[str], system: System | None) -> Scene | None:
        """The scene in space; None if the page does not know the axes of the system."""


LAYOUTS: Registry[KnownLayout] = Registry()
"""Rooms above register theirs"""


def layout_for(columns: Collection[str]) -> KnownLayout | None:
    """The first layout that fits the columns; None if none does."""
    return next((layout for layout in LAYOUTS.all() if layout.fits(columns)), None)
