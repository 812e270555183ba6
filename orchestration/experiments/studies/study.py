"""Studies: a base system, axes, and the runs that they define."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from orchestration.components.building.fmus import native_twin, native_twins
from orchestration.components.building.models import PATHS
from orchestration.experiments.studies.axes import CONTROLLER, Axis, LinkedSettings, Method, Points, Value
from orchestration.experiments.studies.store_columns import is_column
from orchestration.foundation.basics.errors import UsageError, expected_name
from orchestration.foundation.basics.records import record
from orchestration.simulation.requests.ranges import paths_in
from orchestration.simulation.results.own_metrics import OwnMetric
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.distribution import from_folder, is_table, trace_path
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, is_source_file, parameter_name, value_at
from orchestration.systems.system.request import ControlLoop, Request, errors_in_own_terms, system_of
from orchestration.systems.system.requirements import is_number

StartValues = Mapping[str, Mapping[str, float]]
"""The start values of FMUs, by FMU and name"""


@record()
class Study:
    """Runs of a base system, or a scenario of the quadrotor, over axes."""

    name: str
    """The name of the study, and of the folder of its store in `results`."""
    base: Request
    """The scenario or the system to vary."""
    axes: tuple[Axis, ...]
    """The axes: every combination of the listed values, each with every sampled point, is a run."""
    together: tuple[LinkedSettings, ...] = ()
    """Settings linked to the values of the axes besides their own targets, each applied on top of the previous."""
    method: Method = "sobol"
    """The method by which axes without values are sampled; morris and saltelli are for sensitivity."""
    samples: int = 0
    """The number of points that are sampled; a power of two for sobol."""
    design_seed: int = 0
    """The seed of the sampling."""
    vary_seed: bool = False
    """Whether each run has its own seed, derived from that of the base and the values of the axes."""
    repeat: str | None = None
    """The axis that repeats each combination of the others, as `seed`: `draw` and `export` give the share of good runs
    of a cell, with its interval."""
    keep_signals: tuple[int, ...] | bool = False
    """The indices of the runs whose signals are kept, or whether all are."""
    metrics: tuple[OwnMetric, ...] = ()
    """Functions of a result, passed to `sweep`, besides the objectives of the base."""
    native: bool = False
    """Whether it is run with the native twins of its FMUs."""
    folder: Path | None = None
    """The folder at which paths of files in values of axes start; None: the current one."""
    ELSEWHERE: ClassVar[Mapping[str, str]] = {
        "design": "the keys of [design] are arguments: method, samples, design_seed, vary_seed, repeat"
    }
    """Hints where the content of these keys belongs"""

    def __post_init__(self) -> None:
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names) or not names:
            raise UsageError(f"axes = {', '.join(names) or 'none'}: expected at least one axis, each with its own name")
        if not _NAME.fullmatch(self.name):
            raise UsageError(
                f"name = {self.name!r}: expected the name of a folder: at most 100 letters, digits, spaces and - _ . +"
            )
        for axis in self.axes:
            is_of_seeds = (axis.name, axis.targets, axis.multiplies) == ("seed", ("seed",), False)
            if is_column(axis.name, self.metric_names) and not is_of_seeds:
                raise UsageError(f"axis {axis.name}: the table of runs has a column of that name, expected another")
        listed = [axis.name for axis in self.axes if axis.values is not None]
        if self.repeat is not None and self.repeat not in listed:
            raise UsageError(
                f"design.repeat = {self.repeat}: {expected_name(self.repeat, listed)}, the axes with values"
            )
        for axis in self.axes if self.repeat is not None else ():
            if axis.values is not None and len(set(axis.values)) < len(axis.values):  # one run would count as several
                raise UsageError(f"axis {axis.name}: expected each value once, for shares of the runs of a cell")
        for each in self.together:
            if not set(each.axes) <= set(names):
                raise UsageError(f"axes = {', '.join(names)}: expected {', '.join(each.axes)} among them")
        has_vehicle = isinstance(self.base, ControlLoop) and self.base.vehicle is not None
        for axis in self.axes:
            if has_vehicle and CONTROLLER & {*axis.targets}:
                raise UsageError(
                    f"axis {axis.name}: expected a base without a vehicle, whose parameters are those of one controller"
                )
        assert self._paths is not None  # raises UsageError for an unknown target

    @cached_property
    def origin(self) -> System:
        """The system that the base describes."""
        system = system_of(self.base)
        return native_twins(system) if self.native else system

    @property
    def cell_axes(self) -> tuple[Axis, ...]:
        """The axes besides the one that repeats."""
        return tuple(axis for axis in self.axes if axis.name != self.repeat)

    @property
    def cell_names(self) -> tuple[str, ...] | None:
        """The names of the axes of its cells; None if nothing repeats."""
        return None if self.repeat is None else tuple(axis.name for axis in self.cell_axes)

    @property
    def metric_names(self) -> tuple[str, ...]:
        """The names of the objectives and of the study's own metrics."""
        return (*self.origin.objectives, *(metric.name for metric in self.metrics))

    @cached_property
    def points(self) -> Points:
        """The value of each axis by run, computed on access."""
        return Points(self.axes, self.method, self.samples, self.design_seed)

    @cached_property
    def _paths(self) -> dict[str, tuple[str, ...]]:
        """The paths of each target."""
        listed = [target for axis in self.axes for target in axis.targets]
        listed += [target for each in self.together for target in each.targets]
        return {target: paths_in(self.base, target) for target in dict.fromkeys(listed)}

    def system(self, index: int, starts: StartValues) -> System:
        """The system of one run.

        Raises `UsageError` for an invalid value.
        """
        return self.system_at(self.points[index], starts)

    def system_at(self, point: Mapping[str, Value], starts: StartValues) -> System:
        """The system with a value of each axis, likewise."""
        changes: dict[str, Any] = {}
        settings = [dict.fromkeys(axis.targets, point[axis.name]) for axis in self.axes]
        chosen = {
            path: placed(path, value, self.folder)
            for sets in (*settings, *(each.of(point)[0] for each in self.together))
            for target, value in sets.items()
            for path in self._paths[target]
            if names_fmu(path)
        }
        if self.vary_seed and "seed" not in point:
            changes["seed"] = _own_seed(self.origin.seed, point)
        with errors_in_own_terms(self.base):
            for axis in self.axes:
                value = point[axis.name]
                for path in self.paths_of(axis.targets):
                    changes[path] = (
                        self.product(value, path, chosen, starts)
                        if axis.multiplies
                        else placed(path, value, self.folder)
                    )
            for each in self.together:
                sets, multiplies = each.of(point)
                changes |= {
                    path: placed(path, value, self.folder)
                    for target, value in sets.items()
                    for path in self._paths[target]
                }
                for target, factor in multiplies.items():
                    for path in self._paths[target]:
                        changes[path] = self.product(factor, path, changes, starts)
            system = changed(self.origin, changes)
        return native_twins(system) if self._varies_fmu else system

    def product(self, value: Value, path: str, changes: Mapping[str, Any], starts: StartValues) -> float:
        """`value` times the changed value at a path, else that of the base, else that of the FMU which the run has."""
        if not isinstance(value, (int, float)):
            raise UsageError(f"{path}: expected a number to multiply with, got {value}")
        base = changes[path] if path in changes else value_at(self.origin, path)
        if base is None and (name := parameter_name(path)) is not None:
            component = component_of(name)
            fmu = str(changes.get(f"components.{component}.fmu", self.origin.components[component].fmu))
            base = starts.get(native_twin(fmu) if self.native else fmu, {}).get(variable_of(name))
        if not is_number(base):
            raise UsageError(f"{path}: expected a number of the base or of an FMU to multiply")
        return float(value) * float(base)

    @property
    def needs_start_values(self) -> bool:
        """Whether its runs have products, which may be with start values of FMUs."""
        return any(axis.multiplies for axis in self.axes) or any(each.multiplies for each in self.together)

    @cached_property
    def _varies_fmu(self) -> bool:
        """Whether it is native, and an axis sets FMUs, which may not be."""
        return self.native and any(names_fmu(path) for paths in self._paths.values() for path in paths)

    def paths_of(self, targets: Iterable[str]) -> Iterator[str]:
        """The paths of its targets."""
        return (path for target in targets for path in self._paths[target])

    def axes_of(self, path: str) -> list[Axis]:
        """The axes that set a path, themselves or with others."""
        linked = {name for each in self.together if path in self.paths_of(each.targets) for name in each.axes}
        return [axis for axis in self.axes if axis.name in linked or path in self.paths_of(axis.targets)]

    def keeps_signals(self, index: int) -> bool:
        """Whether the signals of a run are kept."""
        return self.keep_signals if isinstance(self.keep_signals, bool) else index in self.keep_signals

    def files(self) -> Files:
        """The files of all runs; missing FMUs are built."""
        values = [
            (path, str(v)) for axis in self.axes for path in self.paths_of(axis.targets) for v in axis.values or ()
        ]
        linked = [item for each in self.together for sets in each.sets.values() for item in sets.items()]
        values += [(path, str(value)) for target, value in linked for path in self._paths[target]]
        values = [(path, str(placed(path, value, self.folder))) for path, value in values]
        return files_of(
            self.origin,
            fmus_too=[native_twin(value) if self.native else value for path, value in values if names_fmu(path)],
            tables_too=[value for path, value in values if is_source_file(path)] + _traces(values),
        )


def _traces(values: Iterable[tuple[str, str]]) -> list[str]:
    """The files of distributions among the values."""
    paths = (trace_path(value) for path, value in values if is_table(value) and ".parameters." not in path)
    return [path for path in paths if path is not None]


_NAME = re.compile(r"[^\W_][\w .+-]{0,99}")


def placed(path: str, value: Value, folder: Path | None) -> Value:
    """A value at a path of a system, a file by its path from the current folder in place of that from another."""
    if folder is None or not isinstance(value, str) or ".parameters." in path:
        return value
    if is_table(value):
        return from_folder(value, folder)
    is_file = value.endswith(PATHS) if names_fmu(path) else is_source_file(path)
    return str(folder / value) if is_file else value


def names_fmu(path: str) -> bool:
    """Whether the value at a path is an FMU."""
    return path.startswith("components.") and path.endswith(".fmu") and ".parameters." not in path


def _own_seed(seed: int, point: Mapping[str, Value]) -> int:
    """A seed determined by that of the base and the point only, so that a design may grow."""
    text = json.dumps([seed, dict(point)], sort_keys=True)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big")
