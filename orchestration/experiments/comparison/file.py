"""Reads comparison files, and the parameter files that they name."""

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, ClassVar

from orchestration.experiments.comparison.design import (
    FMU,
    Comparison,
    Condition,
    Controller,
    Front,
    VehicleEntry,
    over_second_axis,
)
from orchestration.experiments.studies.axes import Axis, Key, Value
from orchestration.experiments.studies.study_file import AxisTable, FileLike, axis_of, control_loop_of, load
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, no_such_key, prefixed
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.typed_tables import table_of
from orchestration.systems.expressions.at_instant import compiled
from orchestration.systems.expressions.syntax import is_truth, names, parse
from orchestration.systems.system.component import parameters_in
from orchestration.systems.system.request import ControlLoop
from orchestration.systems.system.requirements import is_number
from orchestration.systems.system.starts import Starts

_OF_OTHERS = (
    "controllers of other systems are compared by quadcosim sweep or draw, of a study with an axis over "
    "components.NAME.fmu"
)


@record()
class ControllerTable:
    """`[[controllers]]`: an FMU, a parameter file, and parameters on top of that."""

    name: str
    """Its name in tables and pictures."""
    fmu: str | None = None
    """The FMU, by name or path; default: that of the base."""
    file: str | None = None
    """A file with parameters in `[controller]`; {vehicle}, {value} and {milli}, 1000 · value, are substituted."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """Parameters on top of those of the file."""
    scheduled: dict[str, Any] = field(default_factory=dict)
    """Parameters that depend on the axis, on top of all others: expressions of its name, such as "0.9 / period"."""
    bandwidth: float | None = None
    """Its bandwidth [rad/s]; default: the measured one."""


@record()
class VehicleTable:
    """`[[vehicles]]`: a vehicle by name or file, and parameters on top of that."""

    name: str
    """Its name in tables and pictures."""
    vehicle: str | None = None
    """A vehicle by name, or the path of its file; default: that of the base."""
    plant: dict[str, Any] = field(default_factory=dict)
    """Parameters of the plant on top of those of the vehicle."""
    controller: dict[str, Any] = field(default_factory=dict)
    """Parameters of every controller on top of those of the vehicle."""


class ConditionTable(
    table_of(Condition, sets=(dict[str, Any], {}), multiplies=(dict[str, Any], {}))  # type: ignore[misc]
):
    """`[[conditions]]`: values to set and factors, by the names that axes of studies have."""


@record()
class ComparisonFile:
    """A comparison file: a scenario, or the path of one, and the comparison on it."""

    controllers: list[ControllerTable]
    """The controllers; each is paired with the first."""
    axis: AxisTable | None = None
    """The quantity that is varied: one axis of increasing numbers."""
    axes: list[AxisTable] = field(default_factory=list)
    """Instead of `axis`, one or two: limits are along the first, at each value of the second; maps show both."""
    vehicles: list[VehicleTable] = field(default_factory=list)
    """The vehicles; default: that of the base."""
    conditions: list[ConditionTable] = field(default_factory=lambda: [ConditionTable(name="nominal")])
    """The conditions under which each is run; default: the base unchanged."""
    starts: Starts = field(default_factory=Starts)
    """The initial conditions, the same for every controller."""
    front: Front = field(default_factory=Front)
    """The two objectives of the trade-off."""
    name: str | None = None
    """The name of the comparison and of its folder in `results/`; default: that of the file."""
    scenario: str | None = None
    """The path of the scenario file that all runs modify."""
    base: dict[str, Any] = field(default_factory=dict)
    """Instead of `scenario`, the tables of a scenario file."""
    ELSEWHERE: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("stop_time", "components", "system"),
        'it is of a scenario of the quadrotor, which scenario = "FILE.toml" names here, or under [base]; ' + _OF_OTHERS,
    )


def load_comparison(comparison: Comparison | FileLike) -> Comparison:
    """Read a comparison file; paths in it are relative to its folder.

    Its content may be given as a dictionary, in which `base` may be a scenario; a comparison is returned as it is.
    Raises `UsageError` for a file that cannot be read, an unknown key (naming the known ones) or an invalid value.
    """
    return load(comparison, "Comparison", (Comparison,), ComparisonFile, _comparison)


def _comparison(file: ComparisonFile, path: Path) -> Comparison:
    folder = path.parent
    base = control_loop_of(file, folder, f"; {_OF_OTHERS}")
    axis, second = _axes(file)
    vehicles = _vehicles(file.vehicles, base, folder)
    keys = [(entry.name, value) for entry in vehicles for value in axis.values or ()]
    conditions = tuple(_condition(table) for table in file.conditions)
    of_second: dict[str, Any] = {}
    if second is not None:
        conditions, stands_for = over_second_axis(conditions, second)
        of_second = {"second": second, "on_second": stands_for}
    return Comparison(
        name=file.name or path.stem,
        base=base.without_vehicle(),
        controllers=tuple(_controller(table, axis.name, keys, folder) for table in file.controllers),
        vehicles=vehicles,
        conditions=conditions,
        axis=axis,
        starts=file.starts,
        front=file.front,
        folder=folder.absolute(),
        **of_second,
    )


def _axes(file: ComparisonFile) -> tuple[Axis, Axis | None]:
    tables = ([] if file.axis is None else [file.axis]) + file.axes
    if not 1 <= len(tables) <= 2 or (file.axis is not None and file.axes):
        raise UsageError("axis: expected [axis], or one or two [[axes]]")
    axes = [axis_of(table) for table in tables]
    return axes[0], axes[1] if len(axes) == 2 else None


def _vehicles(tables: list[VehicleTable], base: ControlLoop, folder: Path) -> tuple[VehicleEntry, ...]:
    if base.vehicle is None:
        return tuple(_vehicle(table, base, folder) for table in tables or [VehicleTable(name="base")])
    if tables:
        raise UsageError("base.vehicle and vehicles: expected one of them")
    return (VehicleEntry(name=base.vehicle.name, vehicle=base.vehicle),)


def _controller(table: ControllerTable, axis: str, keys: list[tuple[str, Value]], folder: Path) -> Controller:
    place = f"controllers.{table.name}"
    sets: dict[str, Value] = {}
    if table.fmu is not None:
        sets[FMU] = table.fmu
    own = _of_controller(parameters_in(table.parameters, f"{place}.parameters"))
    tuned: dict[Key, Mapping[str, Value]] = {}
    if table.file is not None and "{" in table.file:  # one file for each vehicle or value of the axis
        for vehicle, value in keys:
            name = _substituted(table.file, vehicle, value)
            tuned[vehicle, value] = {**_read(folder / name), **own}
    elif table.file is not None:
        sets |= _read(folder / table.file)
    for target, text in parameters_in(table.scheduled, f"{place}.scheduled").items():
        parameter = _function_of_axis(text, axis, f"{place}.scheduled.{target}")
        for vehicle, value in keys:
            tuned[vehicle, value] = {**tuned.get((vehicle, value), {}), f"controller.{target}": parameter(value)}
    return Controller(name=table.name, sets={**sets, **own}, tuned=tuned, bandwidth=table.bandwidth)


def _function_of_axis(text: Value, axis: str, place: str) -> Callable[[Value], float]:
    """A parameter as a function of the value of the axis, from an expression of the axis's name."""
    if not isinstance(text, str):
        raise UsageError(f'{place} = {text}: expected an expression over {axis}, such as "0.9 / {axis}"')

    def parameter(value: Value) -> float:
        if not is_number(value):
            raise UsageError(f"axis {axis}: expected numbers, for {place} depends on it")
        result = at([float(value)])
        if not math.isfinite(result):
            raise UsageError(f"{place} = {text}: is {result} at {axis} = {value}; expected a number")
        return result

    with prefixed(f"{place} = {text}: "):
        node = parse(text)
        for name in names(node):
            if name != axis:
                raise UsageError(f"there is no {name}; expected {axis}")
        if is_truth(node):
            raise UsageError(f"it is true or false; expected a number over {axis}")
        at = compiled(node, {axis: 0})
    return parameter


def _substituted(name: str, vehicle: str, value: Value) -> str:
    """The name of the file for one vehicle and value of the axis."""
    known = {"vehicle": vehicle, "value": value}
    if isinstance(value, int | float):
        known |= {"value": f"{value:g}", "milli": f"{1e3 * value:g}"}
    try:
        return name.format(**known)
    except (LookupError, ValueError):
        raise UsageError(
            f"{name}: expected a file, with {{vehicle}}, {{value}} of the axis or {{milli}} times it"
        ) from None


def _vehicle(table: VehicleTable, base: ControlLoop, folder: Path) -> VehicleEntry:
    place = f"vehicles.{table.name}"
    plant, own = parameters_in(table.plant, f"{place}.plant"), parameters_in(table.controller, f"{place}.controller")
    return VehicleEntry(name=table.name, vehicle=base.vehicle_of(table.vehicle, folder, plant=plant, controller=own))


def _condition(table: ConditionTable) -> Condition:
    place = f"conditions.{table.name}"
    sets, multiplies = (parameters_in(getattr(table, kind), f"{place}.{kind}") for kind in ("sets", "multiplies"))
    factors = {target: value for target, value in multiplies.items() if is_number(value)}
    for target in multiplies.keys() - factors.keys():
        raise UsageError(f"{place}.multiplies.{target} = {multiplies[target]}: expected a number")
    return Condition(
        name=table.name, sets=dict(sets), multiplies={target: float(value) for target, value in factors.items()}
    )


def _read(path: Path) -> dict[str, Value]:
    """The parameters of a controller in a file."""
    tables = read_toml(path, "file of parameters")
    for key in tables.keys() - {"controller"}:
        raise UsageError(no_such_key(f"{path}: ", key, ["controller"]))
    if not isinstance(tables.get("controller"), Mapping):
        raise UsageError(f"{path}: controller: expected a table of parameters")
    return _of_controller(parameters_in(tables["controller"], f"{path}: controller"))


def _of_controller(parameters: Mapping[str, Value]) -> dict[str, Value]:
    return {f"controller.{name}": value for name, value in parameters.items()}
