"""What became of the runs of a comparison: which survive, and which of these settle by the horizon.

A run survives that has not diverged by its horizon. It settles if from some time on, its settling time, its error stays
within the band of that objective. How far it is pushed about after that is its residual.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    Fate = Callable[["pd.DataFrame"], "pd.Series"]
    """Which rows of a table of runs have it"""

SETTLING = "settling_time"
"""The objective that says when a run settles; without a value it does not"""
RESIDUAL = "ultimate_bound"
"""The objective that says how far off it is at the end"""


def survived(table: "pd.DataFrame") -> "pd.Series":
    """Which runs have not diverged by their horizon."""
    return table["outcome"].notna() & table["outcome"].ne("diverged")


def settled(table: "pd.DataFrame") -> "pd.Series":
    """Which of those settle by their horizon."""
    return survived(table) & table[SETTLING].notna()


def diverged_late(table: "pd.DataFrame", horizon: float) -> "pd.Series":
    """Which diverged in the second half of a horizon [s]: with a longer one more might."""
    return ~survived(table) & table["divergence_time"].astype(float).gt(0.5 * horizon)


FATES: Mapping[str, "Fate"] = {"survive": survived, "settle": settled}
"""By the word for it"""
