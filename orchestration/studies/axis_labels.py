"""Axes of studies in words and units for people, and as edges of cells."""

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.figures import cells
from orchestration.requests.ranges import is_in_seconds
from orchestration.results import display_names as labels
from orchestration.studies.axes import Axis

SCALES = {"linear": "linear", "logarithmic": "log"}
"""As matplotlib calls them"""


def label(axis: Axis) -> str:
    """An axis in words, with its unit."""
    return labels.with_unit(name_of(axis), unit_and_factor(axis)[0])


def name_of(axis: Axis) -> str:
    """An axis in words: its own name, or that of what it sets where it is named by its path."""
    return labels.setting(axis.name) if axis.name in axis.targets else labels.words(axis.name)


def unit_and_factor(axis: Axis) -> tuple[str | None, float]:
    """The unit in which an axis is drawn and the factor on its values: milliseconds for times below 1 s."""
    if axis.multiplies or not axis.targets:
        return None, 1.0
    if all(is_in_seconds(target) for target in axis.targets):
        largest = axis.high if axis.values is None else max(map(float, axis.values))
        return ("ms", 1e3) if largest < 1.0 else ("s", 1.0)
    return labels.SETTINGS.get(axis.targets[0], ("", None))[1], 1.0


def drawn(axis: Axis, values: object) -> Floats:
    """Values of an axis in its unit, shape (n,)."""
    found: Floats = unit_and_factor(axis)[1] * np.asarray(values, float)
    return found


def edges(axis: Axis, values: object) -> Floats:
    """Of the cells around the values that an axis takes, in its unit."""
    return cells.edges(np.unique(drawn(axis, values)), logarithmic=axis.scale == "logarithmic")
