"""The values that differ between runs of one system, as arrays by path that broadcast to one value for each run."""

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.errors import UsageError, prefixed, shown
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.runs.arguments import values_by_path
from orchestration.systems.system.check import check_parameter
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, parameter_name, parameter_path, value_at
from orchestration.systems.system.request import Request

SEED = "seed"


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Runs of a system: the values that they share, and those of each run."""

    system: System
    given: Mapping[str, Any]
    """The arrays by target, as they were given"""
    axes: Mapping[str, Any]
    """The axes that they have by name, with their labels or None; empty: they have no names"""
    shape: tuple[int, ...]
    """The shape to which they broadcast: runs are counted in the order of C"""
    parameters: Mapping[str, Floats]
    """Real ones, as COMPONENT.NAME, shape (count,)"""
    seeds: Sequence[int] | None
    """None: all runs have that of the system"""
    settings: Mapping[str, Sequence[Any]]
    """all others, by path: each combination makes a system"""

    @property
    def count(self) -> int:
        """The number of runs."""
        return math.prod(self.shape)

    def name(self, run: int) -> str:
        """The index of a run in the arrays."""
        return str(run) if len(self.shape) < 2 else str(tuple(map(int, np.unravel_index(run, self.shape))))

    @cached_property
    def systems(self) -> list[System]:
        """The system of each run, without its `parameters` and its seed; runs of the same settings share one.

        Raises `UsageError` for settings that are invalid.
        """
        by_settings: dict[tuple[Any, ...], System] = {}
        systems = []
        for run in range(self.count):
            point = tuple(column[run] for column in self.settings.values())
            if point not in by_settings:
                with prefixed(f"run {self.name(run)}: "):
                    by_settings[point] = changed(self.system, dict(zip(self.settings, point))) if point else self.system
            systems.append(by_settings[point])
        return systems

    def seeded(self, run: int) -> System:
        """The system of one run with its seed."""
        return self.systems[run] if self.seeds is None else changed(self.systems[run], {SEED: self.seeds[run]})

    def alone(self, run: int) -> System:
        """The system of one run, with all of its values."""
        parameters = {parameter_path(name): float(column[run]) for name, column in self.parameters.items()}
        return changed(self.seeded(run), parameters)


def columns(request: Request, system: System, models: Mapping[str, Model], values: Mapping[str, Any]) -> Columns:
    """The runs of a request, whose `system` fits the `models` of its FMUs, with these `values`.

    `values` has an array for each target that `request` knows. Raises `UsageError` for an unknown target, arrays that
    do not broadcast, and values that the FMUs do not accept.
    """
    unlabelled, axes = without_labels(values_by_path(values, "values ="))
    arrays = {target: _array(target, value) for target, value in unlabelled.items()}
    shape = _common_shape(arrays)
    parameters: dict[str, Floats] = {}
    settings: dict[str, Sequence[Any]] = {}
    for target, array in arrays.items():
        column = np.broadcast_to(array, shape).reshape(-1)
        for path in request.paths_of(target):
            value_at(system, path)
            name = parameter_name(path)
            if name in parameters or path in settings:
                raise UsageError(f"values of {target}: are given twice; expected each path once")
            if path.endswith(".fmu"):
                raise UsageError(
                    f"values of {target}: expected runs of the same FMUs: run those of each FMU separately"
                )
            if name is None:
                settings[path] = column.tolist()
            elif _is_real(models, name):
                parameters[name] = _real(target, column)
                _expect_accepted(system, models, path, (parameters[name].min(), parameters[name].max()))
            else:
                settings[path] = column.tolist()
                _expect_accepted(system, models, path, np.unique(column))
    seeds = _seeds(settings.pop(SEED)) if SEED in settings else None
    if [each if labels is None else len(labels) for labels, each in zip(axes.values(), shape)] != [*shape]:
        axes = {}  # those of a part of the axes
    return Columns(
        system=system, given=arrays, axes=axes, shape=shape, parameters=parameters, seeds=seeds, settings=settings
    )


def first_differences(columns: Mapping[str, Any], parameters: Mapping[str, float]) -> list[int]:
    """The first place at which each column differs from the parameter of this name that another component has.

    Columns are by COMPONENT.NAME, of values of `parameters` in many runs.
    """
    of_all: dict[str, dict[str, Any]] = {}
    for name, value in {**parameters, **columns}.items():
        of_all.setdefault(variable_of(name), {})[name] = value
    pairs = [(columns[name], other) for name in columns for other in of_all[variable_of(name)].values()]
    different = [np.flatnonzero(column != other)[:1] for column, other in pairs]
    return sorted({int(place) for places in different for place in places})


def _common_shape(arrays: Mapping[str, Any]) -> tuple[int, ...]:
    """The shape to which arrays broadcast; raises `UsageError` naming the first that does not with those before it."""
    shape: tuple[int, ...] = ()
    for i, (target, array) in enumerate(arrays.items()):
        try:
            shape = np.broadcast_shapes(shape, array.shape)
        except ValueError:
            others = ", ".join([*arrays][:i])
            raise UsageError(
                f"values of {target}: shape {array.shape}; expected one that broadcasts with {shape}, that of {others}"
            ) from None
    return shape


def _seeds(values: Sequence[Any]) -> Sequence[int]:
    """Seeds as whole numbers; raises `UsageError` for one that is invalid."""
    for value in values:
        if (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not (0 <= value < 2**63 and value == int(value))
        ):
            raise UsageError(f"seed = {shown(value)}: expected a whole number from 0 to 2^63 - 1")
    return [int(value) for value in values]


def _array(target: str, value: Any) -> Any:
    """A value as an array of numbers, truth values or texts; raises `UsageError` if it is none, or is masked."""
    if np.ma.is_masked(value):
        raise UsageError(f"values of {target}: some are masked; expected a value for each run")
    try:
        array = np.asarray(value)
        if array.dtype == object:  # words in a column of pandas
            array = np.asarray(array.tolist())
    except ValueError:  # rows of different lengths
        array = np.zeros(0)
    if array.dtype.kind not in "fiubU" or not array.size:
        raise UsageError(f"values of {target}: expected an array of numbers, truth values or words, with one at least")
    return array


def _real(target: str, column: Any) -> Floats:
    """The values of a Real parameter; raises `UsageError`, naming the run, for one that is no finite number."""
    if column.dtype.kind not in "fiu":
        raise UsageError(f"values of {target}: {shown(repr(column[0].item()))} is no number; expected numbers")
    numbers: Floats = np.ascontiguousarray(column, dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if len(wrong):
        raise UsageError(f"values of {target}: {numbers[wrong[0]]} in run {wrong[0]}; expected finite numbers")
    return numbers


def _expect_accepted(system: System, models: Mapping[str, Model], path: str, values: Any) -> None:
    """Raise `UsageError` for values of a parameter that its FMU rejects; of Reals `values` are least and largest."""
    name = str(parameter_name(path))
    for value in values:
        check_parameter(changed(system, {path: value.item()}), models, component_of(name), variable_of(name))


def _is_real(models: Mapping[str, Model], name: str) -> bool:
    """Whether it is a Real; a variable that does not exist is reported where its value is checked."""
    variable = models[component_of(name)].variables.get(variable_of(name))
    return variable is None or variable.kind == "Real"


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
