"""What reductions come to in objectives, for many runs at once: the functions of expressions over arrays of runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from orchestration.basics.simulator import Booleans, Floats
from orchestration.expressions.over_run import reductions
from orchestration.expressions.over_span import SpanValues
from orchestration.expressions.recorded import Recorded
from orchestration.expressions.syntax import Call, Node


def combined(
    nodes: Sequence[Node], known: Mapping[Call, Floats], numbers: Mapping[str, Floats], count: int
) -> list[tuple[Floats, Booleans]]:
    """The values of expressions in each of `count` runs, and where they have none.

    `known` are the reductions in them, NaN where there is none; `numbers` parameters and the stop time by name.
    """
    of_all: Any = numbers
    of_each: Any = known
    at_rows = SpanValues(Recorded(time=np.zeros(0), signals={}, numbers=of_all, stop_time=0.0), of_each).at_rows
    unknown = {call: np.isnan(values) for call, values in known.items()}
    found = []
    with np.errstate(all="ignore"):
        for node in nodes:
            values: Floats = np.empty(count)
            values[:] = at_rows(node)
            none = np.zeros(count, dtype=np.bool_)
            for call in reductions(node):
                if call in unknown:
                    none |= unknown[call]
            found.append((values, none))
    return found
