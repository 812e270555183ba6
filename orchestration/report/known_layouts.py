"""How runs are laid out whose columns say what they are of: panels, what moves in space, columns that are computed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Protocol

from orchestration.basics.registry import Registry

if TYPE_CHECKING:
    from orchestration.basics.simulator import Floats
    from orchestration.report.model import Panel, Scene
    from orchestration.system.model import System

    Signals = Mapping[str, Floats]
    """Columns of shape (n,), the `time` [s] among them"""


class KnownLayout(Protocol):
    """Of one kind of runs."""

    @property
    def compact(self) -> tuple[str, ...]:
        """Columns that a track has, if it is to be short."""

    @property
    def logarithmic(self) -> Collection[str]:
        """Of the computed columns, those that are kept by their logarithms."""

    def fits(self, columns: Collection[str]) -> bool:
        """Whether columns are those of such a run."""

    def computed(self, signals: Signals) -> Signals:
        """Columns that are made of others, where these are there."""

    def panels(self, columns: Collection[str]) -> tuple[Panel, ...]:
        """For the columns that are there, computed ones among them; what is left over gets panels as in any run."""

    def scene(self, columns: Collection[str], system: System | None) -> Scene | None:
        """What moves in space; None where the system is told in axes that the page does not know."""


LAYOUTS: Registry[KnownLayout] = Registry()
"""Rooms above enter theirs"""


def layout_for(columns: Collection[str]) -> KnownLayout | None:
    """The first that fits; None for the columns of any system."""
    return next((layout for layout in LAYOUTS.all() if layout.fits(columns)), None)
