"""Which objective of a study is drawn where nobody names one."""

from collections.abc import Callable, Iterable

import numpy as np

from orchestration.basics.simulator import Floats

VARIES = 0.01
"""of the largest value: what varies less than that over a study says nothing"""


def shown_first(objectives: Iterable[str], values: Callable[[str], Floats], preferred: str | None) -> str:
    """The first objective that varies over the runs that are good, else the one that is preferred, else any.

    `values` are those of an objective, nan where it has none or a run is not good, shape (n,).
    """
    named = [*objectives]
    return next((name for name in named if _varies(values(name))), preferred or next(iter(named), "horizon"))


def _varies(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return bool(len(known) and np.ptp(known) > VARIES * abs(known).max())
