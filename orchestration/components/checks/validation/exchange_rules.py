"""Rules on the continuous states and event indicators of an FMU for model exchange."""

import math
from collections.abc import Iterator

from orchestration.components.checks.validation.excitation import PLAIN
from orchestration.components.checks.validation.fmu import Fmu
from orchestration.components.checks.validation.probe import Probe


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
    described = probe.fmu.description
    states = sum(math.prod(each.variable.shape or ()) for each in described.derivatives)
    if probe.fmu.version == 2:
        indicators = int(described.numberOfEventIndicators or 0)
    else:
        indicators = sum(math.prod(each.variable.shape or ()) for each in described.eventIndicators)
    with probe.instance() as instance:
        probe.begin(instance, PLAIN)
        found = instance.numbers_of_states()
    for what, has, listed in zip(("continuous states", "event indicators"), found, (states, indicators)):
        if has != listed:
            yield f"it has {has} {what}, its description says {listed}"


RULES = (derivatives,)
OF_RUNS = (numbers_of_states,)
