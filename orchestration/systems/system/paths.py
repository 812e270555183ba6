"""Changes of a system by path: axes of studies, `limit --of`, flags and operating points."""

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from orchestration.components.building.models import PATHS
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError, did_you_mean, prefixed
from orchestration.foundation.basics.records import replaced
from orchestration.systems.system.component import (
    OWN_PERIOD,
    Component,
    OwnPeriod,
    Sampling,
    SamplingOnArrival,
    TaskSampling,
    with_own_period,
)
from orchestration.systems.system.computers import Arrivals, Computer, Network, Task
from orchestration.systems.system.connection import Connection, Source, component_of, variable_of
from orchestration.systems.system.distribution import parsed_fields
from orchestration.systems.system.model import AFTER, System
from orchestration.systems.system.placement import SHARED

TOP = ("stop_time", "seed")
AT_REST = "operating_point"
_IN_FILE_ONLY = "is set in the file only"
_COMPONENTS, _PARAMETERS = "components.", ".parameters."


def changed(system: System, changes: Mapping[str, Any]) -> System:
    """A system with new values, by path.

    Paths are such as `components.tank.step`, `components.controller.sampling.period`, `connections.valve.delay`,
    `components.controller.parameters.maxlevel`, `sources.wind.noise`, `computers.autopilot.tasks.telemetry.execution`,
    `networks.bus.messages.status.period`, `stop_time`, or `operating_point.` and any of these. Where a whole number is
    expected, 1.0 is 1; where a number may vary, a table or the text of one is its distribution, as
    `{uniform = [0.001, 0.004]}`.

    Raises `UsageError` for a path that does not exist, naming those that do, or an invalid value.
    """
    grouped: dict[tuple[str, str], dict[str, Any]] = {}
    top: dict[str, Any] = {}
    for path, given in changes.items():
        table, _, rest = path.partition(".")
        if table == AT_REST and rest:
            at_rest = top.get(AT_REST, system.operating_point)
            top[AT_REST] = {**at_rest, rest: _converted(rest, _at_rest(system, rest, given))}
            continue
        value = _converted(path, given)
        if path in TOP:
            top[path] = value
            continue
        name, key = _split(system, path, table, rest)
        grouped.setdefault((table, name), {})[key] = value
    components, sources = dict(system.components), dict(system.sources)
    shared: dict[str, dict[str, Any]] = {table: dict(getattr(system, table)) for table in SHARED}
    connections = {x.name: x for x in system.connections}
    for (table, name), keys in grouped.items():
        place = f"{table}.{name}"
        if table == "components":
            components[name] = _component(place, components[name], keys)
        elif table == "connections":
            connections[name] = _replaced(place, connections[name], _by_variable(connections[name], keys))
        elif table in SHARED:
            shared[table][name] = _with_parts(place, shared[table][name], keys)
        else:
            sources[name] = _replaced(
                place, sources[name], _with_new_kind(sources[name], _by_parameter(f"{place}.", sources[name], keys))
            )
    if _only_numbers(system, grouped, top):
        return replaced(system, components=components, connections=tuple(connections.values()), **top)
    result: System = _replaced(
        "",
        system,
        {**top, "components": components, "connections": tuple(connections.values()), "sources": sources, **shared},
    )
    return result


def _at_rest(system: System, path: str, value: Any) -> Any:
    """The value at a path of the operating point; raises `UsageError` where the system cannot have it."""
    if path != AFTER:
        with prefixed(f"{AT_REST}."):
            changed(system, {path: value})
    return value


def at_operating_point(system: System) -> System:
    """The system with the values of its operating point; raises `UsageError` as `changed`."""
    return changed(system, {path: value for path, value in system.operating_point.items() if path != AFTER})


def _only_numbers(system: System, grouped: Mapping[tuple[str, str], Mapping[str, Any]], top: Mapping[str, Any]) -> bool:
    """Whether no change needs a check of the whole system: so it is in most runs of a study.

    Components and connections have checked their own numbers.
    """
    is_seed = all(key == "seed" and type(value) is int and 0 <= value < 2**63 for key, value in top.items())
    return is_seed and all(
        (table == "components" and _are_parameters(keys)) or _are_times(system, table, keys)
        for (table, _), keys in grouped.items()
    )


def _are_times(system: System, table: str, keys: Mapping[str, Any]) -> bool:
    """Whether numbers of a clock or a connection, which no other part of a system without scheduler depends on."""
    known = {"components": _OF_CLOCKS, "connections": _OF_CONNECTIONS}.get(table, ())
    return not system.uses_scheduler and all(key in known and type(value) is float for key, value in keys.items())


_OF_CLOCKS = ("sampling.period", "sampling.offset", "sampling.jitter", "sampling.clock_ratio")
_OF_CONNECTIONS = ("delay", "delay_jitter", "loss", "burst_length", "noise", "quantisation")


def _are_parameters(keys: Iterable[str]) -> bool:
    return all(key.startswith("parameters.") for key in keys)


def parameter_name(path: str) -> str | None:
    """COMPONENT.NAME of the path of a parameter of an FMU; None for any other."""
    component, is_parameter, parameter = path.removeprefix(_COMPONENTS).partition(_PARAMETERS)
    return f"{component}.{parameter}" if path.startswith(_COMPONENTS) and is_parameter else None


def parameter_path(name: str) -> str:
    """The path of the parameter COMPONENT.NAME."""
    return f"{_COMPONENTS}{component_of(name)}{_PARAMETERS}{variable_of(name)}"


def with_values(system: System, seed: int, parameters: Mapping[str, float]) -> System:
    """A system with another seed and other parameters by COMPONENT.NAME."""
    return changed(system, {"seed": seed, **{parameter_path(name): value for name, value in parameters.items()}})


def is_source_file(path: str) -> bool:
    """Whether the value at a path is the file of a source."""
    return path.startswith("sources.") and path.endswith(".file")


def _converted(path: str, value: Any) -> Any:
    """A value as the system has it: ranges have no whole numbers, the command line no paths of files."""
    is_whole = path == "seed" or (path.startswith(tuple(f"{table}." for table in SHARED)) and path.endswith(_WHOLE))
    if is_whole and isinstance(value, float) and value.is_integer():
        return int(value)
    return Path(value) if is_source_file(path) and isinstance(value, str) else value


def value_at(system: System, path: str) -> Any:
    """The value at a path, None where it is not set; raises `UsageError` as `changed` does."""
    if path in TOP:
        return getattr(system, path)
    table, _, rest = path.partition(".")
    if table == AT_REST and rest:
        at_rest = system.operating_point
        return at_rest[rest] if rest in at_rest else None if rest == AFTER else value_at(system, rest)
    name, key = _split(system, path, table, rest)
    if table == "components":
        component = system.components[name]
        kind, _, inner = key.partition(".")
        if kind == "parameters":
            return component.parameters.get(inner)
        return getattr(component.sampling, inner) if kind == "sampling" else getattr(component, kind)
    if table in SHARED:
        return _value_of_part(getattr(system, table)[name], key)
    owner: Any = system.sources[name] if table == "sources" else _connection(system, name)
    kind, _, inner = key.partition(".")
    found = getattr(owner, kind)
    return found.get(inner) if inner else found


def with_followers(system: System, paths: Iterable[str]) -> tuple[str, ...]:
    """The paths, and those of the parameters that follow the period at any of them."""
    found = [*paths]
    for name, component in system.components.items():
        if f"{_COMPONENTS}{name}.{OWN_PERIOD}" in found:
            own = (key for key, value in component.parameters.items() if isinstance(value, OwnPeriod))
            found += [parameter_path(f"{name}.{key}") for key in own]
    return tuple(found)


def _connection(system: System, name: str) -> Connection:
    return next(x for x in system.connections if x.name == name)


def _split(system: System, path: str, table: str, rest: str) -> tuple[str, str]:
    """Name and key of a path below one of the tables; a name may hold dots."""
    tables: dict[str, Iterable[str]] = {
        "components": system.components,
        "connections": [x.name for x in system.connections],
        "sources": system.sources,
        **{shared: getattr(system, shared) for shared in SHARED},
    }
    if table not in tables:
        listed = f"{', '.join(TOP)} or one that begins with {', '.join(tables)}, {AT_REST}"
        if table in ("order", *(f.name for f in dataclasses.fields(System))):
            raise UsageError(f"{path}: {_IN_FILE_ONLY}; expected {listed}")
        raise UsageError(f"{path}: no such path; expected {listed}{did_you_mean(table, [*TOP, *tables, AT_REST])}")
    known = list(tables[table])
    names = [name for name in known if rest.startswith(f"{name}.")]
    if not names:
        near = did_you_mean(rest.partition(".")[0], known)
        listed = ", ".join(known) or "(there is none)"
        raise UsageError(f"{path}: expected {table}.NAME.KEY with NAME one of {listed}{near}")
    name = max(names, key=len)
    key = rest[len(name) + 1 :]
    _expect_key(path, table, system, name, key)
    return name, key


def _expect_key(path: str, table: str, system: System, name: str, key: str) -> None:
    if table in ("components", "sources") and key.startswith("parameters.") and key != "parameters.":
        return
    keys: list[str]
    if table == "components":
        keys = _keys_of_stepping(system.components[name])
        keys += ["align", "fmu", "record", "tolerance", "parameters.NAME"]
        known = key in keys[:-1]
    elif table == "connections":
        fixed = ("name", "start", "end", "noise", "quantisation", "stated")
        keys = [f.name for f in dataclasses.fields(Connection) if f.name not in fixed]
        keys += ["noise", "quantisation", "noise.VARIABLE", "quantisation.VARIABLE"]
        known = key in keys or key.partition(".")[0] in ("noise", "quantisation")
    elif table in SHARED:
        _expect_part(path, f"{table}.{name}", getattr(system, table)[name], key)
        keys, known = _keys_of_parts(getattr(system, table)[name], key)
    else:
        keys = [f.name for f in dataclasses.fields(Source)] + ["parameters.NAME"]
        known = key in keys[:-1]
    if not known:
        listed = f"{table}.{name}. and one of {', '.join(keys)}"
        if table == "components" and (task := _of_task(system.components[name], key)) is not None:
            raise UsageError(f"{path}: {name} is a task, which its computer times: expected {task}")
        kind = {"components": Component, "connections": Connection}.get(table)
        if key in ("parameters", "sampling") and f"{key}." in listed:
            raise UsageError(
                f"{path}: is a table of several values; expected the path of one: {listed}. An axis of a study sets "
                f'several at once: sets = ["{path}.NAME", ...], values = [[...], ...], with one value for each path'
            )
        of_files = [] if kind is None else [_IN_FILES.get(f.name, f.name) for f in dataclasses.fields(kind)]
        if key in of_files and key != "step":  # which none has beside sampling
            raise UsageError(f"{path}: {_IN_FILE_ONLY}; expected {listed}")
        raise UsageError(f"{path}: no such key; expected {listed}{did_you_mean(key, keys)}")


def _of_task(component: Component, key: str) -> str | None:
    """What a task of a computer has in place of a key of sampling, or step; None: it is none, or the key is another."""
    if not isinstance(component.sampling, TaskSampling) or key.partition(".")[0] not in ("sampling", "step"):
        return None
    keys, asked = [f.name for f in dataclasses.fields(Task)], key.partition(".")[2]
    return f"{component.sampling.task}." + (asked if asked in keys else f" and one of {', '.join(keys)}")


def _keys_of_stepping(component: Component) -> list[str]:
    """The keys of when a component is stepped; none if it is a task, whose computer has them."""
    if isinstance(component.sampling, TaskSampling):
        return []
    if isinstance(component.sampling, SamplingOnArrival):
        return ["sampling.on", "sampling.clock_ratio"]
    return ["step"] if component.sampling is None else [f"sampling.{f.name}" for f in dataclasses.fields(Sampling)]


def _expect_part(path: str, place: str, of: Computer | Network, key: str) -> None:
    """Raise `UsageError` for a task or a message that does not exist, naming those that do."""
    parts, _, rest = key.partition(".")
    if not rest or parts != SHARED[place.partition(".")[0]][0]:
        return
    known, name = [*getattr(of, parts)], rest.partition(".")[0]
    if name not in known:
        listed = f"{place}.{parts}.NAME.KEY with NAME one of {', '.join(known) or '(there is none)'}"
        raise UsageError(f"{path}: expected {listed}{did_you_mean(name, known)}")


_WHOLE = (".priority", ".bytes", ".identifier", ".slot")
_ARRIVALS = "arrivals.poisson"


def _keys_of_parts(of: Computer | Network, key: str) -> tuple[list[str], bool]:
    """The keys of a computer or a network, and whether `key` is one of these."""
    parts, kind = SHARED["computers" if isinstance(of, Computer) else "networks"]
    own = [f.name for f in dataclasses.fields(of) if f.name != parts]
    each = [_IN_FILES.get(f.name, f.name) for f in dataclasses.fields(kind) if f.name != "arrivals"] + [_ARRIVALS]
    valid = {f"{parts}.{name}.{field}" for name in getattr(of, parts) for field in each}
    return [*own, *(f"{parts}.NAME.{field}" for field in each)], key in own or key in valid


_IN_FILES = {"start": "from", "end": "to"}
_FIELDS = {"from": "start", "to": "end"}


def _value_of_part(of: Computer | Network, key: str) -> Any:
    kind, _, inner = key.partition(".")
    if not inner:
        return getattr(of, kind)
    name, _, field = inner.partition(".")
    part = getattr(of, kind)[name]
    if field == _ARRIVALS:
        return None if part.arrivals is None else part.arrivals.poisson
    return getattr(part, _FIELDS.get(field, field))


def _with_parts(place: str, of: Computer | Network, keys: Mapping[str, Any]) -> Any:
    """A computer with other tasks, or a network with other messages."""
    own = {key: value for key, value in keys.items() if "." not in key}
    inner: dict[str, dict[str, Any]] = {}
    for key, value in keys.items():
        if "." in key:
            _, name, field = key.split(".", 2)
            inner.setdefault(name, {})[_FIELDS.get(field, field)] = value
    parts, key = {}, SHARED[place.partition(".")[0]][0]
    for name, part in getattr(of, key).items():
        changes = inner.get(name, {})
        if _ARRIVALS in changes:
            changes["arrivals"] = Arrivals(poisson=changes.pop(_ARRIVALS))
        parts[name] = _replaced(f"{place}.{key}.{name}", part, changes) if changes else part
    return _replaced(place, of, {**own, key: parts})


def _component(place: str, component: Component, keys: Mapping[str, Any]) -> Component:
    if _are_parameters(keys) and all(type(value) is float for value in keys.values()):
        return replaced(component, **_by_parameter(f"{place}.", component, keys))
    sampling = {key.partition(".")[2]: value for key, value in keys.items() if key.startswith("sampling.")}
    rest = {key: value for key, value in _by_parameter(f"{place}.", component, keys).items() if "." not in key}
    if sampling:
        rest["sampling"] = _replaced(f"{place}.sampling", component.sampling, sampling)
    if rest.keys() == {"sampling"} and "fmu_clock" not in sampling:  # nothing else in a component depends on it
        return replaced(component, **rest, parameters=with_own_period(component.parameters, rest["sampling"]))
    return _replaced(place, component, rest) if rest else component


def by_elements(fmu: str, parameters: Mapping[str, Any], place: str) -> Mapping[str, Any]:
    """Parameters of a component with those of arrays by their elements, where its FMU is there."""
    has_arrays = any(isinstance(each, list) or (isinstance(each, str) and " " in each) for each in parameters.values())
    if not has_arrays or not (fmu.endswith(PATHS[0]) and Path(fmu).is_file()):
        return parameters
    return read_model(Path(fmu)).by_elements(parameters, place)


def _by_parameter(place: str, of: Component | Source, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Keys such as `parameters.radius` merged into their table."""
    parameters = {key.partition(".")[2]: value for key, value in keys.items() if key.startswith("parameters.")}
    rest = {key: value for key, value in keys.items() if not key.startswith("parameters.")}
    if isinstance(of, Component):
        parameters = dict(by_elements(of.fmu, parameters, f"{place}parameters."))
    return {**rest, "parameters": {**rest.get("parameters", of.parameters), **parameters}} if parameters else rest


def _with_new_kind(source: Source, keys: Mapping[str, Any]) -> dict[str, Any]:
    """With a new file, signal, constant or noise, the keys that clear the former kind of the source too."""
    new = [kind for kind in _KINDS if keys.get(kind) is not None and getattr(source, kind) is None]
    others = {f.name: f.default for f in dataclasses.fields(Source) if f.name in (*_KINDS, *_OF_KINDS)} if new else {}
    return {**others, **keys}


_KINDS, _OF_KINDS = ("constant", "file", "noise", "signal"), ("interpolation", "columns", "period")


def _by_variable(connection: Connection, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Keys such as `noise.level` merged into their tables; a plain number is for every variable of the message."""
    result: dict[str, Any] = {}
    for key, value in keys.items():
        kind, _, variable = key.partition(".")
        if kind not in ("noise", "quantisation"):
            result[key] = value
        elif variable:
            result[kind] = {**result.get(kind, getattr(connection, kind)), variable: value}
        else:
            result[kind] = for_each(connection.start, value)
    return result | ({"stated": True} if {"scale", "offset"} & keys.keys() else {})


def for_each(start: Iterable[str], value: Any) -> Any:
    """A number for every variable of a message; a table is unchanged."""
    return value if isinstance(value, Mapping) else {end.partition(".")[2]: value for end in start}


def _replaced(place: str, of: Any, keys: Mapping[str, Any]) -> Any:
    if any(isinstance(value, (str, Mapping)) for value in keys.values()):
        keys = parsed_fields(of, f"{place}.", keys)
    with prefixed(f"{place}." if place else ""):
        return dataclasses.replace(of, **dict(keys))
