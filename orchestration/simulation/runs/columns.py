"""The values that differ between runs of one system, as arrays by path: one value for each run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.check import check_parameter
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, parameter_name, parameter_path, value_at
from orchestration.systems.system.request import Request


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Runs of a system: the values that they share, and those of each run."""

    system: System
    count: int
    parameters: Mapping[str, Floats]
    """Real ones, as COMPONENT.NAME, shape (count,)"""
    settings: Mapping[str, Sequence[Any]]
    """all others, by path: each combination makes a system"""

    @cached_property
    def systems(self) -> list[System]:
        """The system of each run, without its `parameters`; runs of the same settings share one.

        Raises `UsageError` for settings that are invalid.
        """
        by_settings: dict[tuple[Any, ...], System] = {}
        systems = []
        for run in range(self.count):
            point = tuple(column[run] for column in self.settings.values())
            if point not in by_settings:
                by_settings[point] = changed(self.system, dict(zip(self.settings, point))) if point else self.system
            systems.append(by_settings[point])
        return systems

    def alone(self, run: int) -> System:
        """The system of one run, with all of its values."""
        parameters = {parameter_path(name): float(column[run]) for name, column in self.parameters.items()}
        return changed(self.systems[run], parameters)


def columns(request: Request, system: System, models: Mapping[str, Model], values: Mapping[str, Any]) -> Columns:
    """The runs of a request, whose `system` fits the `models` of its FMUs, with these `values`.

    `values` has an array for each target that `request` knows, shape (runs,), or one value for all runs. Raises
    `UsageError` for an unknown target, arrays of different lengths, and values that the FMUs do not accept.
    """
    arrays = {target: _array(target, value) for target, value in dict(values).items()}
    lengths = {target: len(array) for target, array in arrays.items() if array.ndim}
    if not lengths:
        raise UsageError("values: expected at least one array, with a value for each run")
    first, count = next(iter(lengths.items()))
    parameters: dict[str, Floats] = {}
    settings: dict[str, Sequence[Any]] = {}
    for target, array in arrays.items():
        if lengths.get(target, count) != count:
            raise UsageError(f"values of {target}: {len(array)} of them; expected {count}, as many as of {first}")
        column = np.broadcast_to(array, (count,))
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
    return Columns(system=system, count=count, parameters=parameters, settings=settings)


def _array(target: str, value: Any) -> Any:
    """A value as an array of numbers, truth values or texts; raises `UsageError` if it is none."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.zeros((0, 0))
    if array.ndim > 1 or array.dtype.kind not in "fiubU" or not array.size:
        raise UsageError(f"values of {target}: expected an array of shape (runs,), or one value for all runs")
    return array


def _real(target: str, column: Any) -> Floats:
    """The values of a Real parameter; raises `UsageError`, naming the run, for one that is no finite number."""
    if column.dtype.kind not in "fiu":
        raise UsageError(f"values of {target}: {shown(column[0])} is no number; expected numbers")
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
