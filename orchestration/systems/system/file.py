"""Reads system files (TOML), and provides the JSON schema with which editors complete them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from orchestration.components.building.models import FMI3, PATHS, WRAPPED
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, expected_name, prefixed
from orchestration.foundation.basics.typed_tables import fields_of, parsed, schema_of, table_of
from orchestration.systems.system.choices import Order
from orchestration.systems.system.component import Component, Sampling, SamplingOnArrival, flattened, parameters_in
from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import at_operating_point, by_elements, for_each
from orchestration.systems.system.requirements import is_number, require

Part = TypeVar("Part")


DistributionTable = table_of(Distribution, file=(str | None, None))
"""The path of a trace is text, as written"""


_OFTEN = {"period": (float | None, None), "offset": (float | None, None)}
"""Keys that may follow from a message, or from a clock of the FMU"""


class SamplingTable(table_of(Sampling, within=[DistributionTable], **_OFTEN)):  # type: ignore[misc]
    """When a digital task runs: every period, or whenever a message arrives."""

    on: str | None = None
    """The connection whose arriving messages it runs on, in place of a period."""


ComponentTable = table_of(Component, within=[SamplingTable], parameters=(dict[str, Any], {}))
ConnectionTable = table_of(
    Connection,
    within=[DistributionTable],
    called={"start": "from", "end": "to"},
    without=["stated"],
    name=(str | None, None),
    order=(Order | None, None),
    noise=(float | dict[str, Any], {}),
    quantisation=(float | dict[str, Any], {}),
)
SourceTable = table_of(Source, file=(str | None, None))
CriterionTable = table_of(Criterion)
ArrivalsTable = table_of(Arrivals)
TaskTable = table_of(Task, within=[ArrivalsTable, DistributionTable])
ComputerTable = table_of(Computer, within=[TaskTable])
MessageTable = table_of(Message, within=[ArrivalsTable, DistributionTable], called={"start": "from", "end": "to"})
NetworkTable = table_of(Network, within=[MessageTable])


_PARTS = [ComponentTable, ConnectionTable, SourceTable, ComputerTable, NetworkTable, CriterionTable]


class SystemTable(table_of(System, within=_PARTS)):  # type: ignore[misc]
    """Components, what connects and drives them, the objectives of a run and the criterion of a good one."""

    order: Order = "gauss-seidel"
    """The default order of connections."""


def schema() -> dict[str, Any]:
    """The JSON schema of a system file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema_of(SystemTable),
        "title": "quadcosim system",
    }


def load_system(path: str | Path) -> System:
    """Read a system file; paths in it are relative to its folder.

    Raises `UsageError` in one line that names the place and what is valid there.
    """
    path = Path(path)
    tables = read_toml(path, "system file")
    with prefixed(f"{path}: "):
        return system_from_tables(tables, path.parent)


def is_system(tables: Mapping[str, Any]) -> bool:
    """Whether a TOML document is a system file rather than a scenario of the quadrotor."""
    return not {"components", "computers", "networks"}.isdisjoint(tables)


def system_from_tables(tables: Mapping[str, Any], folder: Path) -> System:
    """The system of a TOML document whose relative paths start at `folder`; raises `UsageError`."""
    table = parsed(tables, SystemTable)
    given = {key: getattr(table, key) for key in fields_of(SystemTable) if key != "order"}
    tasks = {task.component for computer in table.computers.values() for task in computer.tasks.values()}
    system = System(
        **given
        | {
            "components": {
                name: _component(name, value, folder, name in tasks) for name, value in table.components.items()
            },
            "connections": tuple(
                _connection(i, value, table.order, folder) for i, value in enumerate(table.connections)
            ),
            "sources": {name: _source(name, value, folder) for name, value in table.sources.items()},
            "computers": {name: _computer(name, value, folder) for name, value in table.computers.items()},
            "networks": {name: _network(name, value, folder) for name, value in table.networks.items()},
            "criterion": _part("criterion", Criterion, table.criterion.as_dict()),
            "operating_point": dict(flattened(table.operating_point)),
        }
    )
    for name in system.optional:
        known = ", ".join(system.objectives) or "no objectives"
        require(name in system.objectives, "optional", name, f"one of {known}")
    with prefixed("operating_point: "):
        at_operating_point(system)
    return system


def _component(name: str, table: Any, folder: Path, is_task: bool) -> Component:
    place = f"components.{name}"
    keys = table.as_dict(without=("sampling",))
    keys["fmu"] = str(folder / table.fmu) if table.fmu.endswith(PATHS) else table.fmu
    given = by_elements(keys["fmu"], dict(flattened(table.parameters)), f"{place}.parameters.")
    keys["parameters"] = parameters_in(given, f"{place}.parameters")
    of_clock = {}
    if table.partition is not None:
        keys["fmu"] = _with_partitions(keys["fmu"])
        of_clock = {} if is_task else _of_clock(f"{place}.partition", table.partition, keys["fmu"])
    if table.sampling is not None:
        keys["sampling"] = _sampling(f"{place}.sampling", table.sampling, folder, keys["fmu"], of_clock)
    elif of_clock:
        keys["sampling"] = _part(f"{place}.sampling", Sampling, of_clock)
    return _part(place, Component, keys)


def _with_partitions(fmu: str) -> str:
    """The path of an FMU that has partitions: that of a controller in C is of FMI 3.0."""
    path = Path(fmu)
    return str(path.parent / FMI3 / path.name) if path.suffix == WRAPPED and path.is_file() else fmu


def _sampling(place: str, table: Any, folder: Path, fmu: str, of_clock: Mapping[str, float]) -> Sampling:
    keys = {key: value for key, value in with_distributions(f"{place}.", table, folder).items() if value is not None}
    if table.fmu_clock is not None and table.on is None:
        keys = {**_of_clock(f"{place}.fmu_clock", table.fmu_clock, fmu), **keys, "fmu_clock": table.fmu_clock}
    if table.on is None:
        return _part(place, Sampling, {**of_clock, **keys})
    require(table.period is None, f"{place}.period", table.period, "none beside on: messages say when it runs")
    return _part(place, SamplingOnArrival, keys)


def _of_clock(place: str, clock: str, fmu: str) -> dict[str, float]:
    """Period and offset of an FMU's clock [s], as far as the FMU states them, or the code that it is made of."""
    with prefixed(f"{place} = {clock}: "):
        known = _clocks(fmu)
    if known is None:
        return {}
    if clock not in known:
        raise UsageError(f"{place} = {clock}: {expected_name(clock, list(known))}")
    return known[clock]


def _clocks(fmu: str) -> dict[str, dict[str, float]] | None:
    """Period and offset of each clock; None where the FMU is not there yet."""
    if fmu.endswith(WRAPPED):
        from orchestration.components.building import wrap  # not before: loads what reads such files

        return {task.name: {"period": float(task.period)} for task in wrap.load(wrap.described_by(Path(fmu))[0]).tasks}
    if not Path(fmu).is_file():
        return None
    return {
        each.name: {} if each.interval is None else {"period": float(each.interval), "offset": float(each.shift)}
        for each in read_model(fmu).clocks
    }


def _computer(name: str, table: Any, folder: Path) -> Computer:
    place = f"computers.{name}"
    tasks = {key: _with_arrivals(f"{place}.tasks.{key}", Task, task, folder) for key, task in table.tasks.items()}
    return _part(place, Computer, table.as_dict(without=("tasks",)) | {"tasks": tasks})


def _network(name: str, table: Any, folder: Path) -> Network:
    place, of = f"networks.{name}", table.messages.items()
    messages = {key: _with_arrivals(f"{place}.messages.{key}", Message, one, folder) for key, one in of}
    return _part(place, Network, table.as_dict(without=("messages",)) | {"messages": messages})


def _with_arrivals(place: str, kind: type[Part], table: Any, folder: Path) -> Part:
    arrivals = table.arrivals and _part(f"{place}.arrivals", Arrivals, table.arrivals.as_dict())
    return _part(place, kind, with_distributions(f"{place}.", table, folder) | {"arrivals": arrivals})


def _connection(index: int, table: Any, order: Order, folder: Path) -> Connection:
    name = table.name if table.name is not None else str(index)
    keys = with_distributions(f"connections.{name}.", table, folder) | {"name": name}
    keys["order"] = table.order or order
    keys["stated"] = bool({"scale", "offset"} & table.given)
    for what in ("noise", "quantisation"):
        keys[what] = for_each(table.start, keys[what])
        for variable, value in keys[what].items():
            if not is_number(value):
                raise UsageError(f"connections.{keys['name']}.{what}.{variable} = {value!r}: expected a number")
    return _part(f"connections.{keys['name']}", Connection, keys)


def _source(name: str, table: Any, folder: Path) -> Source:
    file = None if table.file is None else folder / table.file
    return _part(f"sources.{name}", Source, {**table.as_dict(), "file": file})


def _part(place: str, kind: type[Part], keys: Mapping[str, Any]) -> Part:
    with prefixed(f"{place}."):
        return kind(**keys)


def with_distributions(place: str, table: Any, folder: Path) -> dict[str, Any]:
    """The keys of a table of a file, with distributions in place of their tables; `place` ends with its dot."""
    keys: dict[str, Any] = table.as_dict()
    for key in keys:
        value = getattr(table, key)
        if isinstance(value, DistributionTable):
            keys[key] = _distribution(f"{place}{key}", value, folder)
    return keys


def parsed_distribution(place: str, table: Mapping[str, Any]) -> Distribution:
    """The distribution of a table, with the path of its trace from the current folder; raises `UsageError`."""
    with prefixed(f"{place}."):
        found = parsed(table, DistributionTable)
    return _distribution(place, found, Path())


def _distribution(place: str, table: Any, folder: Path) -> Distribution:
    keys = table.as_dict() | {"file": None if table.file is None else folder / table.file}
    with prefixed(f"{place}."):
        return Distribution(**keys)
