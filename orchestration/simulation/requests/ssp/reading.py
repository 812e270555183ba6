"""The tables of a system file from an SSP and a file with the timing that SSP lacks."""

import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.components.fmi.read_description import Model, read_model
from orchestration.foundation.basics.errors import UsageError, listed
from orchestration.foundation.basics.unit_algebra import BaseUnits
from orchestration.simulation.requests.ssp.document import open_package, read
from orchestration.simulation.requests.ssp.parameters import Value
from orchestration.simulation.requests.ssp.structure import Node, Path_, Structure, Wire, dotted, structure_of
from orchestration.simulation.requests.ssp.timing import expect_tables, from_text, with_files
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.conversion import Conversion, OtherQuantity, between
from orchestration.systems.system.proposal import TAKEN

CLOCK = (SAMPLE_PERIOD, SAMPLE_OFFSET)


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A signal from one component to another."""

    start: str
    end: str
    """COMPONENT.VARIABLE"""
    conversion: Conversion
    stated: bool
    """whether suppressUnitConversion is set somewhere on the way, so that the conversion includes that of units"""


def tables_of_ssp(path: Path, timing: Mapping[str, Any] | None) -> dict[str, Any]:
    """The tables of the system file for an SSP with a `timing`; None: that of its annotation.

    A component is stepped as in `timing`, else in continuous time with the step in the SSP's annotations. Components in
    `timing` come first, in its order, which decides ties. Raises `UsageError` for unsupported elements, names that do
    not exist, and a missing step or end.
    """
    package = open_package(path)
    structure = structure_of(read(package.structure, "ssd"), package)
    if timing is None:
        timing = {} if structure.timing is None else from_text(structure.timing)
    expect_tables(timing)
    timing = with_files(timing, package.resource)
    names = _names(structure.components)
    models = {place: read_model(fmu) for place, fmu in structure.components.items()}
    tables: dict[str, Any] = {**timing}
    fed = {end for source in timing.get("sources", {}).values() for end in _ends(source.get("to"))}
    tasks = _components_of_tasks(timing)
    tables["components"] = _components(structure, names, models, timing.get("components", {}), fed, tasks)
    tables["connections"] = _connections(_signals(structure, names, models), timing.get("connections", []))
    if "stop_time" not in tables:
        if structure.stop is None:
            raise UsageError("stop_time: the SSP has no DefaultExperiment with one; expected it in a file with timing")
        tables["stop_time"] = structure.stop
    return tables


def _names(paths: Sequence[Path_] | Mapping[Path_, Any]) -> dict[Path_, str]:
    """The names of components: their paths joined by _, which also replaces invalid characters."""
    names = {path: re.sub(r"\W", "_", "_".join(path), flags=re.ASCII) for path in paths}
    for path, name in names.items():
        same = [".".join(other) for other, its in names.items() if its == name]
        if len(same) > 1 or name in TAKEN:
            raise UsageError(f"{' and '.join(same)}: would be named {name}; expected names that stay apart")
        names[path] = f"_{name}" if name[0].isdigit() else name
    return names


def _ends(to: object) -> list[str]:
    return [end for end in to if isinstance(end, str)] if isinstance(to, list) else []


def _components_of_tasks(timing: Mapping[str, Any]) -> set[str]:
    """The components whose steps are jobs of computers."""
    computers = [each for each in timing.get("computers", {}).values() if isinstance(each.get("tasks"), dict)]
    tasks = [task for computer in computers for task in computer["tasks"].values() if isinstance(task, dict)]
    return {name for task in tasks if isinstance(name := task.get("component"), str)}


def _components(
    structure: Structure,
    names: Mapping[Path_, str],
    models: Mapping[Path_, Model],
    timing: Mapping[str, Any],
    fed: Set[str],
    tasks: Set[str],
) -> dict[str, Any]:
    """The components in the order of `timing`, then in that of the SSP, without values for inputs in `fed`.

    Those in `tasks` are stepped by their computers.
    """
    for name in timing:
        if name not in names.values():
            raise UsageError(
                f"components.{name}: the SSP has no such component; expected one of {listed(names.values())}"
            )
    found = {}
    for place, name in names.items():
        overrides = dict(timing.get(name, {}))
        parameters = _parameters(structure, place, models[place])
        parameters = {key: value for key, value in parameters.items() if f"{name}.{key}" not in fed}
        if "sampling" in overrides or name in tasks:  # which overrides the clock of the SSP
            parameters = {key: value for key, value in parameters.items() if key not in CLOCK}
        parameters |= dict(overrides.pop("parameters", {}))
        table = {"fmu": str(structure.components[place]), "parameters": parameters, **overrides}
        if "step" not in table and "sampling" not in table and name not in tasks:
            if structure.step is None:
                raise UsageError(
                    f"components.{name}: the SSP does not say how it is stepped; expected step or sampling of it in a "
                    "file with timing"
                )
            table["step"] = structure.step
        found[name] = table
    return {name: found[name] for name in (*timing, *(name for name in found if name not in timing))}


def _parameters(structure: Structure, place: Path_, model: Model) -> dict[str, Parameter]:
    """Values for a component, in the units of its FMU, without those for inputs connected to a component."""
    found = {}
    for node, value in structure.values.items():
        if node[0] == place and _source_of(structure, node) is None:
            found[node[1]] = _in_own_unit(structure, node, value, model)
    for node in [node for node in structure.wires if node[0] == place]:
        wires = list(structure.wires_to(node))
        for wire in reversed(wires):  # the outermost value
            if wire.start in structure.values and wire.start[0] not in structure.components:
                outer = _in_own_unit(structure, wire.start, structure.values[wire.start], None)
                found[node[1]] = _passed(outer, wires[: wires.index(wire) + 1], structure, model)
                break
    return found


def _source_of(structure: Structure, node: Node) -> Node | None:
    """The output of a component from which the wires lead to a connector; None if there is none."""
    wires = list(structure.wires_to(node))
    return wires[-1].start if wires and wires[-1].start[0] in structure.components else None


def _passed(value: Parameter, wires: Sequence[Wire], structure: Structure, model: Model) -> Parameter:
    conversion = _along(wires, structure, {wires[0].end[0]: model})
    if conversion.is_none:
        return value
    if isinstance(value, (bool, str)):
        raise UsageError(f"connection {wires[0].label}: is converted; expected a number, not {value!r}")
    return conversion(value)


def _in_own_unit(structure: Structure, node: Node, value: Value, model: Model | None) -> Parameter:
    variable = None if model is None else model.variables.get(node[1])
    own = structure.units.get(node) or (variable.unit if variable is not None else None)
    number = value.value
    if not own or not value.unit or own == value.unit or isinstance(number, (bool, str)):
        return number
    one = value.definition or structure.definitions.get(value.unit)
    other = structure.definitions.get(own) or (model.base_units(own) if model is not None else None)
    return _conversion(one, other, f"{dotted(node)} in {value.unit}, expected {own}")(number)


def _signals(structure: Structure, names: Mapping[Path_, str], models: Mapping[Path_, Model]) -> list[Signal]:
    """The signals between components, in the order of the document's components and their connectors."""
    found = []
    for node in structure.kinds:
        source = _source_of(structure, node) if node[0] in names else None
        if source is not None:
            wires = list(structure.wires_to(node))
            conversion, stated = _along(wires, structure, models), not all(wire.converts_units for wire in wires)
            start, end = (f"{names[place]}.{variable}" for place, variable in (source, node))
            found.append(Signal(start=start, end=end, conversion=conversion, stated=stated))
    return found


def _along(wires: Sequence[Wire], structure: Structure, models: Mapping[Path_, Model]) -> Conversion:
    """The conversion along wires, given from the last: each transformation, followed by that of units."""
    result = Conversion()
    for wire in reversed(wires):
        result = result.then(wire.transformation)
        if wire.converts_units:
            result = result.then(_of_units(wire, structure, models))
    return result


def _of_units(wire: Wire, structure: Structure, models: Mapping[Path_, Model]) -> Conversion:
    named, defined = [], []
    for node in (wire.start, wire.end):
        model = models.get(node[0])
        variable = model.variables.get(node[1]) if model is not None else None
        name = structure.units.get(node) or (variable.unit if variable is not None else None)
        named.append(name)
        own = structure.definitions.get(name) if name else None
        defined.append(own or (model.base_units(name) if model is not None else None))
    if not all(named) or named[0] == named[1]:
        return Conversion()
    return _conversion(defined[0], defined[1], f"connection {wire.label}, from {named[0]} to {named[1]}")


def _conversion(one: BaseUnits | None, other: BaseUnits | None, place: str) -> Conversion:
    if one is None or other is None:
        raise UsageError(f"{place}: a unit is not defined; expected it in ssd:Units")
    try:
        return between(one, other)
    except OtherQuantity:
        raise UsageError(f"{place}: these are units of different quantities") from None


def _connections(signals: Sequence[Signal], timing: object) -> list[dict[str, Any]]:
    """The connections that the timing names by their ends, in its order, then a message for each other pair."""
    left = list(signals)
    tables = []
    for index, table in enumerate(timing if isinstance(timing, list) else []):
        place = f"connections.{table.get('name', index)}"
        if "scale" in table or "offset" in table:
            raise UsageError(f"{place}: has scale or offset, which the SSP decides")
        members = _named(place, table, left)
        left = [signal for signal in left if signal not in members]
        if len({(signal.conversion, signal.stated) for signal in members}) > 1:
            raise UsageError(f"{place}: its signals are converted differently; expected a connection for each")
        tables.append(_table(members) | {key: value for key, value in table.items() if key not in ("from", "to")})
    groups: dict[tuple[str, str, Conversion, bool], list[Signal]] = {}
    for signal in left:
        pair = component_of(signal.start), component_of(signal.end)
        groups.setdefault((*pair, signal.conversion, signal.stated), []).append(signal)
    taken = {table["name"] for table in tables if "name" in table}
    for (sender, receiver, _, _), members in groups.items():
        base = f"{sender}_to_{receiver}"
        name = next(n for k in range(1, 2 + len(taken)) if (n := base if k == 1 else f"{base}_{k}") not in taken)
        taken.add(name)
        tables.append({"name": name, **_table(members)})
    return tables


def _table(members: Sequence[Signal]) -> dict[str, Any]:
    conversion, stated = members[0].conversion, members[0].stated
    is_stated = stated or not conversion.is_none
    changed = {"scale": conversion.scale, "offset": conversion.offset} if is_stated else {}
    return {"from": [signal.start for signal in members], "to": [signal.end for signal in members], **changed}


def _named(place: str, table: Mapping[str, Any], signals: Sequence[Signal]) -> list[Signal]:
    """The signals of a table of the timing: each by the names of its ends, or all between two components."""
    starts, ends = ([end] if isinstance(end, str) else end for end in (table.get("from"), table.get("to")))
    if not (isinstance(starts, list) and isinstance(ends, list) and len(starts) == len(ends) > 0):
        raise UsageError(f"{place}: expected from and to: as many ends, or a component each")
    found: list[Signal] = []
    for start, end in zip(starts, ends, strict=True):
        whole = [s for s in signals if (component_of(s.start), component_of(s.end)) == (start, end)]
        matching = whole or [s for s in signals if (s.start, s.end) == (start, end)]
        if not matching:
            known = listed(f"{s.start} -> {s.end}" for s in signals)
            raise UsageError(f"{place}: {start} -> {end} is not in the SSP, or named before; expected of {known}")
        found += matching
    return found
