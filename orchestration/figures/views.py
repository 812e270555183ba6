"""Which figures runs of a kind get: names for whoever has to know them without drawing, and what draws them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.figures.names import FORMATS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orchestration.figures.run import Run
    from orchestration.figures.style import Style

    Maker = Callable[[Sequence[Run], Style], Figure | None]


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What draws the figures of a kind."""

    makers: Mapping[str, Maker]
    """by their names; one that cannot be made of a run gives None"""
    columns: Collection[str] | None
    """that they read; None: all"""


@dataclass(frozen=True, kw_only=True)
class View:
    """The figures of one kind of runs."""

    names: tuple[str, ...]
    """in the order in which they are drawn"""
    first: tuple[str, ...]
    """those that a run draws at once; all others when they are asked for"""
    load: Callable[[], Drawing]
    """with it comes matplotlib"""
    needs: frozenset[str] = frozenset()
    """columns of runs of any kind by which they get these figures too; without any, none does"""


def _of_any_system() -> Drawing:
    from orchestration.figures.gantt import chart
    from orchestration.figures.signals import signals

    return Drawing(makers={"signals": signals, "schedule": chart}, columns=None)


ANY = "run"
VIEWS = {ANY: View(names=("signals", "schedule"), first=("signals", "schedule"), load=_of_any_system)}
"""By kind of request; rooms above enter theirs"""


def view_of(kind: str, columns: Collection[str]) -> View:
    """The figures of runs of a kind: its own, or those that their columns are of, or those of any system."""
    known = (view for view in VIEWS.values() if view.needs and view.needs <= {*columns})
    return VIEWS[kind] if kind != ANY and kind in VIEWS else next(known, VIEWS[ANY])


def files() -> frozenset[str]:
    """What of figures may be in the directory of a run."""
    return frozenset(f"{name}.{ending}" for view in VIEWS.values() for name in view.names for ending in FORMATS)
