"""What differs from run to run of one system, given as arrays by path: a value for each run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from orchestration.basics.errors import UsageError, shown
from orchestration.basics.simulator import Floats
from orchestration.fmi.model import Model
from orchestration.system.check import check_parameter
from orchestration.system.model import System
from orchestration.system.paths import changed, value_at
from orchestration.system.request import Request
from orchestration.system.variable_names import component_of, variable_of

_COMPONENTS, _PARAMETERS = "components.", ".parameters."


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Runs of a system: what they share, and what each has of its own."""

    system: System
    count: int
    parameters: Mapping[str, Floats]
    """Real ones, as COMPONENT.NAME, shape (count,)"""
    settings: Mapping[str, Sequence[Any]]
    """all else, by path: what a system is made with"""

    @cached_property
    def systems(self) -> list[System]:
        """The system of each run, without its `parameters`; runs of the same settings share one.

        Raises `UsageError` for settings that cannot be.
        """
        made: dict[tuple[Any, ...], System] = {}
        found = []
        for run in range(self.count):
            point = tuple(column[run] for column in self.settings.values())
            if point not in made:
                made[point] = changed(self.system, dict(zip(self.settings, point))) if point else self.system
            found.append(made[point])
        return found

    def alone(self, run: int) -> System:
        """The system of one run, with all that it has of its own."""
        own = {_path(name): float(column[run]) for name, column in self.parameters.items()}
        return changed(self.systems[run], own)


def columns(asked: Request, system: System, models: Mapping[str, Model], values: Mapping[str, Any]) -> Columns:
    """The runs that `values` make of what was asked, whose `system` fits the `models` of its FMUs.

    `values` has an array for each target that `asked` knows, shape (runs,), or one value for all runs. Raises
    `UsageError` for a target that there is not, arrays of different lengths, and what the FMUs cannot take.
    """
    arrays = {target: _array(target, given) for target, given in dict(values).items()}
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
        for path in asked.paths_of(target):
            value_at(system, path)
            name = _name(path)
            if name in parameters or path in settings:
                raise UsageError(f"values of {target}: are given twice; expected each path once")
            if path.endswith(".fmu"):
                raise UsageError(f"values of {target}: expected runs of the same FMUs: fly those of each by themselves")
            if name is None:
                settings[path] = column.tolist()
            elif _is_real(models, name):
                parameters[name] = _real(target, column)
                _expect_taken(system, models, path, (parameters[name].min(), parameters[name].max()))
            else:
                settings[path] = column.tolist()
                _expect_taken(system, models, path, np.unique(column))
    return Columns(system=system, count=count, parameters=parameters, settings=settings)


def _array(target: str, given: Any) -> Any:
    """What was given as an array of numbers, truths or texts; raises `UsageError` for what is none."""
    try:
        array = np.asarray(given)
    except ValueError:  # rows of different lengths
        array = np.zeros((0, 0))
    if array.ndim > 1 or array.dtype.kind not in "fiubU" or not array.size:
        raise UsageError(f"values of {target}: expected an array of shape (runs,), or one value for all runs")
    return array


def _real(target: str, column: Any) -> Floats:
    """The numbers of a Real parameter; raises `UsageError` for what is none, naming the run."""
    if column.dtype.kind not in "fiu":
        raise UsageError(f"values of {target}: {shown(column[0])} is no number; expected numbers")
    found: Floats = np.ascontiguousarray(column, dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(found))
    if len(wrong):
        raise UsageError(f"values of {target}: {found[wrong[0]]} in run {wrong[0]}; expected finite numbers")
    return found


def _expect_taken(system: System, models: Mapping[str, Model], path: str, values: Any) -> None:
    """Raise `UsageError` for values of a parameter that its FMU cannot take; Reals are between the first and last."""
    component, _, parameter = path.removeprefix(_COMPONENTS).partition(_PARAMETERS)
    for value in values:
        check_parameter(changed(system, {path: value.item()}), models, component, parameter)


def _name(path: str) -> str | None:
    """COMPONENT.NAME of the path of a parameter of an FMU; None for any other."""
    component, is_parameter, parameter = path.removeprefix(_COMPONENTS).partition(_PARAMETERS)
    return f"{component}.{parameter}" if path.startswith(_COMPONENTS) and is_parameter else None


def _path(name: str) -> str:
    return f"{_COMPONENTS}{component_of(name)}{_PARAMETERS}{variable_of(name)}"


def _is_real(models: Mapping[str, Model], name: str) -> bool:
    """Whether it is a Real; a variable that there is not is said to be none where its value is looked at."""
    variable = models[component_of(name)].variables.get(variable_of(name))
    return variable is None or variable.kind == "Real"
