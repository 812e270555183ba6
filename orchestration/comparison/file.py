"""Reads comparison files, and the files of parameters that they name."""

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from orchestration.basics.documents import read_toml
from orchestration.basics.errors import UsageError, no_such_key
from orchestration.basics.records import record
from orchestration.basics.typed_tables import table_of
from orchestration.comparison.design import FMU, Comparison, Condition, Controller, Craft, Front
from orchestration.expressions.at_instant import compiled
from orchestration.expressions.syntax import is_truth, names, parse
from orchestration.studies.axes import Value
from orchestration.studies.linked_settings import Key
from orchestration.studies.study_file import AxisTable, axis_of, load, loop_of
from orchestration.system.parameters import parameters_in
from orchestration.system.request import ControlLoop


@record()
class ControllerTable:
    """`[[controllers]]`: an FMU, a file of parameters, and parameters on top of that."""

    name: str
    """What tables and pictures call it."""
    fmu: str | None = None
    """The FMU, by name or path; without it, that of the base."""
    file: str | None = None
    """A file with parameters in `[controller]`; {vehicle}, {value} and {milli}, 1000 · value, are filled in."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """Parameters on top of those of the file."""
    scheduled: dict[str, Any] = field(default_factory=dict)
    """Parameters that follow the axis, on top of all others: expressions over its name, such as "0.9 / period"."""
    bandwidth: float | None = None
    """Its bandwidth [rad/s]; without it, the bandwidth is measured."""


@record()
class VehicleTable:
    """`[[vehicles]]`: one by its name or its file, and parameters on top of that."""

    name: str
    """What tables and pictures call it."""
    vehicle: str | None = None
    """A vehicle by name, or the path of its file; without it, that of the base."""
    plant: dict[str, Any] = field(default_factory=dict)
    """Parameters of the plant on top of those of the vehicle."""
    controller: dict[str, Any] = field(default_factory=dict)
    """Parameters of every controller on top of those of the vehicle."""


class ConditionTable(
    table_of(Condition, sets=(dict[str, Any], {}), multiplies=(dict[str, Any], {}))  # type: ignore[misc]
):
    """`[[conditions]]`: what is set, and what is multiplied, by the names of axes of studies."""


@record()
class ComparisonFile:
    """The file: a scenario, or the path of one, and what is compared on it."""

    controllers: list[ControllerTable]
    """The controllers; pairs are made with the first."""
    axis: AxisTable
    """What is varied: one axis of numbers that grow."""
    vehicles: list[VehicleTable] = field(default_factory=list)
    """The vehicles; without any, that of the base."""
    conditions: list[ConditionTable] = field(default_factory=lambda: [ConditionTable(name="nominal")])
    """What else each is flown under; without any, nothing but the base."""
    starts: dict[str, Any] = field(default_factory=dict)
    """The initial states that every controller is flown from."""
    front: Front = field(default_factory=Front)
    """The two objectives that are weighed against each other."""
    name: str | None = None
    """The name of the comparison and of its folder in `results/`; without it, that of the file."""
    scenario: str | None = None
    """The path of the scenario file that everything is flown on."""
    base: dict[str, Any] = field(default_factory=dict)
    """The same here instead of in a file of its own: the tables of a scenario file."""


def load_comparison(path: str | Path) -> Comparison:
    """Read such a file; paths in it are relative to its folder.

    Raises `UsageError` for a file that cannot be read, a key that does not exist (naming those that do) or a value
    that cannot be.
    """
    return load(Path(path), "comparison file", ComparisonFile, _comparison)


def _comparison(file: ComparisonFile, path: Path) -> Comparison:
    folder = path.parent
    base = loop_of(file, folder)
    axis = axis_of(file.axis, folder)
    crafts = _crafts(file.vehicles, base, folder)
    keys = [(craft.name, value) for craft in crafts for value in axis.values or ()]
    return Comparison(
        name=file.name or path.stem,
        base=base.without_vehicle(),
        controllers=tuple(_controller(table, axis.name, keys, folder) for table in file.controllers),
        vehicles=crafts,
        conditions=tuple(_condition(table) for table in file.conditions),
        axis=axis,
        starts=base.ensemble(file.starts),
        front=file.front,
    )


def _crafts(tables: list[VehicleTable], base: ControlLoop, folder: Path) -> tuple[Craft, ...]:
    if base.vehicle is None:
        return tuple(_craft(table, base, folder) for table in tables or [VehicleTable(name="base")])
    if tables:
        raise UsageError("base.vehicle and vehicles: expected one of them")
    return (Craft(name=base.vehicle.name, vehicle=base.vehicle),)


def _controller(table: ControllerTable, axis: str, keys: list[tuple[str, Value]], folder: Path) -> Controller:
    place = f"controllers.{table.name}"
    sets: dict[str, Value] = {}
    if table.fmu is not None:
        sets[FMU] = str(folder / table.fmu) if table.fmu.endswith(".fmu") else table.fmu
    own = _of_controller(parameters_in(table.parameters, f"{place}.parameters"))
    tuned: dict[Key, Mapping[str, Value]] = {}
    if table.file is not None and "{" in table.file:  # a file for each vehicle, or value of the axis
        for vehicle, value in keys:
            name = _filled(table.file, vehicle, value)
            tuned[vehicle, value] = {**_read(folder / name), **own}
    elif table.file is not None:
        sets |= _read(folder / table.file)
    for target, text in parameters_in(table.scheduled, f"{place}.scheduled").items():
        follows = _followed(text, axis, f"{place}.scheduled.{target}")
        for vehicle, value in keys:
            tuned[vehicle, value] = {**tuned.get((vehicle, value), {}), f"controller.{target}": follows(value)}
    return Controller(name=table.name, sets={**sets, **own}, tuned=tuned, bandwidth=table.bandwidth)


def _followed(text: Value, axis: str, place: str) -> Callable[[Value], float]:
    """What a parameter is at a value of the axis, by an expression over the axis's name."""
    if not isinstance(text, str):
        raise UsageError(f'{place} = {text}: expected an expression over {axis}, such as "0.9 / {axis}"')

    def follows(value: Value) -> float:
        if not _is_number(value):
            raise UsageError(f"axis {axis}: expected numbers for {place} to follow")
        found = at([float(value)])
        if not math.isfinite(found):
            raise UsageError(f"{place} = {text}: is {found} at {axis} = {value}; expected a number")
        return found

    try:
        node = parse(text)
        for name in names(node):
            if name != axis:
                raise UsageError(f"there is no {name}; expected {axis}")
        if is_truth(node):
            raise UsageError(f"it is true or false; expected a number over {axis}")
        at = compiled(node, {axis: 0})
    except UsageError as error:
        raise UsageError(f"{place} = {text}: {error}") from None
    return follows


def _filled(name: str, vehicle: str, value: Value) -> str:
    """A file's name for one vehicle and value of the axis."""
    known = {"vehicle": vehicle, "value": value}
    if isinstance(value, int | float):
        known |= {"value": f"{value:g}", "milli": f"{1e3 * value:g}"}
    try:
        return name.format(**known)
    except (LookupError, ValueError):
        raise UsageError(
            f"{name}: expected a file, with {{vehicle}}, {{value}} of the axis or {{milli}} times it"
        ) from None


def _craft(table: VehicleTable, base: ControlLoop, folder: Path) -> Craft:
    place = f"vehicles.{table.name}"
    plant, own = parameters_in(table.plant, f"{place}.plant"), parameters_in(table.controller, f"{place}.controller")
    return Craft(name=table.name, vehicle=base.craft(table.vehicle, folder, plant=plant, controller=own))


def _condition(table: ConditionTable) -> Condition:
    place = f"conditions.{table.name}"
    sets, multiplies = (parameters_in(getattr(table, kind), f"{place}.{kind}") for kind in ("sets", "multiplies"))
    factors = {target: value for target, value in multiplies.items() if _is_number(value)}
    for target in multiplies.keys() - factors.keys():
        raise UsageError(f"{place}.multiplies.{target} = {multiplies[target]}: expected a number")
    return Condition(
        name=table.name, sets=dict(sets), multiplies={target: float(value) for target, value in factors.items()}
    )


def _is_number(value: Value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


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
