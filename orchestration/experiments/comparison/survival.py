"""The outcomes of the runs of a comparison: which survive, and which of these settle.

A run survives if it has not diverged by its horizon. It settles if its outcome is `settled`: the error stays within
5 cm throughout the last third. The largest error there is its residual.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    Fate = Callable[["pd.DataFrame"], "pd.Series"]
    """A mask of the rows of a table of runs"""

SETTLING = "settling_time"
"""The objective that is the time from which a run stays within 5 cm; a run that settles has one"""
RESIDUAL = "ultimate_bound"
"""The objective that is the largest error at the end"""


def survived(table: "pd.DataFrame") -> "pd.Series":
    """Mask of the runs that have not diverged by their horizon."""
    return table["outcome"].notna() & table["outcome"].ne("diverged")


def settled(table: "pd.DataFrame") -> "pd.Series":
    """Mask of the runs that settle."""
    return table["outcome"].eq("settled")


def diverged_late(table: "pd.DataFrame", horizon: float) -> "pd.Series":
    """Mask of the runs that diverged in the second half of a horizon [s]: with a longer one more might."""
    return ~survived(table) & table["divergence_time"].astype(float).gt(0.5 * horizon)


FATES: Mapping[str, "Fate"] = {"survive": survived, "settle": settled}
"""Fates by the name in tables and files"""
WORDS = {"survive": ("surviving", "diverged"), "settle": ("settled", "not settled")}
"""The names of a run that has a fate, and of one that has not"""
