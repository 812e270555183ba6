"""Labels of given values: the index of pandas, the dimensions of xarray, of which arrays of NumPy have none."""

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestration.foundation.basics.errors import UsageError

RUN = "run"
"""Name of the axis of the rows of a table"""


def without_labels(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The same values, to broadcast as NumPy's arrays do; and by name the axes that they have, with labels or None.

    Values of xarray broadcast by the names of their dimensions. Raises `UsageError`, naming the path, for one whose
    labels are not those of the others, as they would be put in order by position.
    """
    pandas, xarray = sys.modules.get("pandas"), sys.modules.get("xarray")
    named = {path: each for path, each in values.items() if xarray and isinstance(each, xarray.DataArray)}
    if named:
        return _by_dimension(values, named)
    labels: Any = None
    for path, each in values.items():
        if pandas and isinstance(each, pandas.Series) and len(each) > 1:
            labels = _same(labels, each.index, f"values of {path}: index")
    return {**values}, {} if labels is None else {RUN: labels}


def _by_dimension(values: Mapping[str, Any], named: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    sizes: dict[str, int] = {}
    axes: dict[str, Any] = {}
    for path, each in named.items():
        for dimension, size in each.sizes.items():
            if sizes.setdefault(dimension, size) != size:
                raise UsageError(f"values of {path}: {dimension}: {size} values; expected {sizes[dimension]} as before")
            axes[dimension] = _same(axes.get(dimension), each.indexes.get(dimension), f"values of {path}: {dimension}")
    for path, each in values.items():
        if path not in named and np.ndim(each) and len(sizes) > 1:
            raise UsageError(
                f"values of {path}: an array; expected one of xarray with dimensions of {', '.join(sizes)}"
            )
    arrays = {
        path: each.transpose(*(name for name in sizes if name in each.dims)).values.reshape(
            [each.sizes.get(name, 1) for name in sizes]
        )
        for path, each in named.items()
    }
    return {**values, **arrays}, axes


def _same(labels: Any, others: Any, what: str) -> Any:
    """The labels of an axis, of two values that may have none; raises `UsageError` where they have others."""
    if labels is not None and others is not None and not others.equals(labels):
        raise UsageError(f"{what} has other labels than before; expected the same for all, in the same order")
    return others if labels is None else labels
