"""Axes of studies in words and units for people, and as edges of cells."""

from collections.abc import Mapping

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.figures import cells
from orchestration.results import display_names as labels
from orchestration.results.quantities import Quantity, quantity, unit_known
from orchestration.studies.axes import Axis

SCALES = {"linear": "linear", "logarithmic": "log"}
"""As matplotlib calls them"""


def quantity_of(axis: Axis, units: Mapping[str, str]) -> Quantity:
    """An axis in words and in the unit that its store has for it, by its name; a factor has none."""
    unit = None
    if axis.targets and not axis.multiplies:
        known = {unit_known(target) for target in axis.targets}
        unit = units.get(axis.name) or (known.pop() if len(known) == 1 else None)
    return quantity(name_of(axis), unit, (axis.low, axis.high) if axis.values is None else axis.values)


def name_of(axis: Axis) -> str:
    """An axis in words: its own name, or that of what it sets where it is named by its path."""
    return labels.setting(axis.name) if axis.name in axis.targets else labels.words(axis.name)


def edges(axis: Axis, values: Floats) -> Floats:
    """Of the cells around the values that an axis takes."""
    return cells.edges(np.unique(values), logarithmic=axis.scale == "logarithmic")
