"""Display names, units and cell edges of the axes of studies."""

from collections.abc import Mapping

import numpy as np

from orchestration.experiments.studies.axes import Axis
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures import cells
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity, quantity, unit_known

SCALES = {"linear": "linear", "logarithmic": "log"}
"""Names of scales in matplotlib"""


def quantity_of(axis: Axis, units: Mapping[str, str]) -> Quantity:
    """The quantity of an axis, with its display name and its unit in the store; a factor has no unit."""
    unit = None
    if axis.targets and not axis.multiplies:
        known = {unit for target in axis.targets if (unit := unit_known(target)) is not None}  # all have one value
        unit = units.get(axis.name) or (known.pop() if len(known) == 1 else None)
    return quantity(name_of(axis), unit, (axis.low, axis.high) if axis.values is None else axis.values)


def name_of(axis: Axis) -> str:
    """The display name of an axis: its own name, or that of its target if it is named by its path."""
    return labels.setting(axis.name) if axis.name in axis.targets else labels.words(axis.name)


def edges(axis: Axis, values: Floats) -> Floats:
    """The edges of the cells around the values of an axis."""
    return cells.edges(np.unique(values), logarithmic=axis.scale == "logarithmic")
