"""The values of objectives from those of their reductions, for many runs at once, as arrays over runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.systems.expressions.over_run import Recorded, SpanValues, reductions
from orchestration.systems.expressions.syntax import Call, Node


def combined(
    nodes: Sequence[Node], known: Mapping[Call, Floats], numbers: Mapping[str, Floats], count: int
) -> list[tuple[Floats, Booleans]]:
    """The values of expressions in each of `count` runs, and the runs in which they have none.

    `known` are the values of the reductions in them, NaN for none; `numbers` are parameters and the stop time by name.
    """
    number_arrays: Any = numbers
    reduction_arrays: Any = known
    at_rows = SpanValues(
        Recorded(time=np.zeros(0), signals={}, numbers=number_arrays, stop_time=0.0), reduction_arrays
    ).at_rows
    unknown = {call: np.isnan(values) for call, values in known.items()}
    results = []
    with np.errstate(all="ignore"):
        for node in nodes:
            values: Floats = np.empty(count)
            values[:] = at_rows(node)
            none = np.zeros(count, dtype=np.bool_)
            for call in reductions(node):
                if call in unknown:
                    none |= unknown[call]
            results.append((values, none))
    return results
