"""The figures of runs by kind of request: names, available without matplotlib, and the functions that draw them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.simulation.figures.names import FORMATS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orchestration.simulation.figures.drawn_run import DrawnRun
    from orchestration.simulation.figures.style import Style
    from orchestration.simulation.results.units import ColumnInfo
    from orchestration.systems.system.model import System

    Maker = Callable[[Sequence[DrawnRun], Style], Figure | None]


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """The functions that draw the figures of a kind."""

    makers: Mapping[str, Maker]
    """Makers by the names of figures; they return None if a run has no such figure"""
    columns: Callable[[System, Mapping[str, ColumnInfo]], Collection[str]]
    """Columns that they read of a run of a system, all of whose columns are described"""


@dataclass(frozen=True, kw_only=True)
class View:
    """The figures of one kind of runs."""

    names: tuple[str, ...]
    """Names in the order in which they are drawn"""
    first: tuple[str, ...]
    """drawn after every run; the others on request"""
    load: Callable[[], Drawing]
    """imports matplotlib"""
    needs: frozenset[str] = frozenset()
    """runs of any kind with these columns get the figures too; empty: none"""


def _of_any_system() -> Drawing:
    from orchestration.simulation.figures.gantt import chart
    from orchestration.simulation.figures.signals import drawn, signals

    return Drawing(makers={"signals": signals, "schedule": chart}, columns=drawn)


ANY = "run"
VIEWS = {ANY: View(names=("signals", "schedule"), first=("signals", "schedule"), load=_of_any_system)}
"""Views by kind of request; rooms above register theirs"""


def view_of(kind: str, columns: Collection[str]) -> View:
    """The figures of runs of a kind: its own, or those that fit their columns, or those of any system."""
    known = (view for view in VIEWS.values() if view.needs and view.needs <= {*columns})
    return VIEWS[kind] if kind != ANY and kind in VIEWS else next(known, VIEWS[ANY])


def files() -> frozenset[str]:
    """The names of files of figures in a run directory."""
    return frozenset(f"{name}.{ending}" for view in VIEWS.values() for name in view.names for ending in FORMATS)
