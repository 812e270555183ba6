"""The objective of a study that is drawn by default."""

from collections.abc import Callable, Iterable

import numpy as np

from orchestration.foundation.basics.simulator import Floats

VARIES = 0.01
"""Share of the largest value: an objective that varies less over a study is not informative"""


def default_metric(objectives: Iterable[str], values: Callable[[str], Floats], preferred: str | None) -> str:
    """The first objective that varies over the good runs, else the preferred one, else the first.

    `values` gives those of an objective, shape (n,), nan where a run has none or is not good.
    """
    named = [*objectives]
    return next((name for name in named if _varies(values(name))), preferred or next(iter(named), "horizon"))


def _varies(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return bool(len(known) and np.ptp(known) > VARIES * abs(known).max())
