"""Rules on the continuous states and event indicators of an FMU for model exchange."""

import math
from collections.abc import Iterator

import numpy as np

from orchestration.components.checks.validation.excitation import PLAIN
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.checks.validation.probe import Probe

_MORE = 64
"""Numbers that are watched beyond those that the FMU is asked for"""


def derivatives(fmu: Fmu) -> Iterator[str]:
    """Each of the listed derivatives names its state, a continuous one of the same dimensions, by `derivative`."""
    where = "Derivatives" if fmu.version == 2 else "ContinuousStateDerivative"
    for unknown in fmu.description.derivatives:
        v = unknown.variable
        if v.derivative is None:
            yield f"{where}: {v.name} has no attribute derivative: expected the state that it is the derivative of"
        elif v.shape != v.derivative.shape:
            yield f"{where}: {v.name} has other dimensions than its state {v.derivative.name}"


def numbers_of_states(probe: Probe) -> Iterator[str]:
    """One for model exchange has as many continuous states and event indicators as its description lists."""
    if probe.model.interface != "model-exchange":
        return
    description = probe.fmu.description
    states = sum(math.prod(each.variable.shape or ()) for each in description.derivatives)
    if probe.fmu.version == 2:
        indicators = int(description.numberOfEventIndicators or 0)
    else:
        indicators = sum(math.prod(each.variable.shape or ()) for each in description.eventIndicators)
    with probe.instance() as instance:
        probe.begin(instance, PLAIN)
        counted = instance.counted()
        for what, key, number in (("continuous states", "get_states", states), ("event indicators", "indicators", indicators)):
            if counted is not None and counted[key] != number:
                yield f"it has {counted[key]} {what}, its description lists {number}"
            elif number and counted is None:
                written = instance.written(key, number, number + _MORE)
                if written != number:
                    yield f"asked for its {number} {what}, it gives {written}"


RULES = (derivatives,)
OF_RUNS = (numbers_of_states,)
