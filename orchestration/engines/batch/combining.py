"""What reductions come to in objectives, for many runs at once: the functions of expressions over arrays of runs."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestration.basics.simulator import Booleans, Floats
from orchestration.expressions.over_run import reductions
from orchestration.expressions.over_span import SpanValues
from orchestration.expressions.recorded import Recorded
from orchestration.expressions.syntax import Call, Node


def combined(
    node: Node, known: Mapping[Call, Floats], numbers: Mapping[str, Floats], count: int
) -> tuple[Floats, Booleans]:
    """The value of an expression in each of `count` runs, and in which it has none.

    `known` are the reductions in it, NaN where there is none; `numbers` parameters and the stop time by name.
    """
    of_all: Any = numbers
    run = Recorded(time=np.zeros(0), signals={}, numbers=of_all, stop_time=0.0)
    of_each: Any = known
    with np.errstate(all="ignore"):
        found: Any = SpanValues(run, of_each).at_rows(node)
        values: Floats = np.broadcast_to(np.asarray(found, dtype=np.float64), (count,))
    none = np.zeros(count, dtype=np.bool_)
    for call in reductions(node):
        if call in known:
            none |= np.isnan(known[call])
    return values, none
