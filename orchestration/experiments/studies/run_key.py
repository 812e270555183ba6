"""Identity of runs and stores: by content, sources and versions, never by the path or age of a file."""

import dataclasses
import hashlib
import json
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.identity import IdentityCache
from orchestration.foundation.basics.records import replaced
from orchestration.simulation.results.own_metrics import OwnMetric
from orchestration.simulation.workers.provenance import machine, versions
from orchestration.systems.system.component import Component
from orchestration.systems.system.computers import Computer, Network
from orchestration.systems.system.connection import Connection, Source, component_of, variable_of
from orchestration.systems.system.files import Files, files_read_by
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import with_values


def run_key(system: System, files: Files, metrics: Sequence[OwnMetric] = ()) -> str:
    """The hash of everything that determines a run and its metrics.

    A parameter with the start value of its FMU counts as not set.
    """
    return hashlib.sha256(_text(system, files, metrics).encode()).hexdigest()


class KeyText:
    """The text of which the keys of runs are hashes, with places for their seeds and some Real parameters."""

    def __init__(self, system: System, files: Files, metrics: Sequence[OwnMetric], names: Sequence[str]) -> None:
        """`names` are the parameters, as COMPONENT.NAME, all of which the system has set."""
        self._system, self._files, self._metrics = system, files, metrics
        components = dict(system.components)
        for number, name in enumerate(names):
            owner, own = component_of(name), {variable_of(name): f"{_PLACE}{number}"}
            components[owner] = replaced(components[owner], parameters={**components[owner].parameters, **own})
        seeded: Any = replaced(system, components=components, seed=f"{_PLACE}{len(names)}")
        begin, *parts = _IN_TEXT.split(_text(seeded, files, metrics))
        self._begin, self._ends = hashlib.sha256(begin.encode()), parts[1::2]
        self._order = [[*names, _SEED][int(number)] for number in parts[::2]]
        starts = {name: files.start_values[system.components[component_of(name)].fmu] for name in names}
        self._starts = {name: starts[name].get(variable_of(name)) for name in names}

    def keys(self, seeds: Sequence[int], parameters: Mapping[str, Sequence[float]]) -> list[str]:
        """The keys of runs with these seeds, and a value of each parameter."""
        texts = {name: [*map(repr, values)] for name, values in parameters.items()} | {_SEED: [*map(str, seeds)]}
        columns = ([f"{text}{end}" for text in texts[name]] for name, end in zip(self._order, self._ends))
        keys = []
        for rest in zip(*columns):
            whole = self._begin.copy()
            whole.update("".join(rest).encode())
            keys.append(whole.hexdigest())
        for run in {run for name, column in parameters.items() for run in self._unset(name, column)}:
            own = {name: column[run] for name, column in parameters.items()}
            keys[run] = run_key(with_values(self._system, seeds[run], own), self._files, self._metrics)
        return keys

    def _unset(self, name: str, values: Sequence[float]) -> Iterable[int]:
        """The runs in which a parameter counts as not set."""
        start = self._starts[name]
        return (run for run, value in enumerate(values) if value == start)


_PLACE, _SEED = "\0", ""
_IN_TEXT = re.compile(r'"\\u0000(\d+)"')
"""The text that holds the place of a value"""


def _text(system: System, files: Files, metrics: Sequence[OwnMetric]) -> str:
    content = {
        **_texts_shared(
            system.connections, system.sources, system.computers, system.networks, system.objectives, system.streams,
            system.criterion, versions(), files.hashes,
        ),
        **{key: json.dumps(getattr(system, key)) for key in ("stop_time", "seed")},
        "components": _listed(
            _text_of_component(name, component, files.hashes, files.start_values[component.fmu])
            for name, component in system.components.items()
        ),
    }  # fmt: skip
    if metrics:
        content["metrics"] = json.dumps([(metric.name, metric.source) for metric in metrics])
    text = ", ".join(f'"{key}": {content[key]}' for key in sorted(content))
    return f"{{{text}}}"


def _json(content: Any) -> str:
    return json.dumps(content, sort_keys=True)


def _listed(parts: Iterable[str]) -> str:
    return f"[{', '.join(parts)}]"


@IdentityCache
def _texts_shared(
    connections: Sequence[Connection],
    sources: Mapping[str, Source],
    computers: Mapping[str, Computer],
    networks: Mapping[str, Network],
    objectives: Mapping[str, str],
    streams: Mapping[str, int],
    criterion: Criterion,
    software: Mapping[str, str],
    hashes: Mapping[str, str],
) -> dict[str, str]:
    """The JSON of the parts that most runs of a study share."""
    parts: dict[str, Any] = {
        "connections": [_content(x, hashes) for x in connections],
        "sources": [[name, _content(source, hashes)] for name, source in sources.items()],
        **{
            key: dict(value)
            for key, value in (("objectives", objectives), ("streams", streams), ("versions", software))
        },
        "criterion": dataclasses.asdict(criterion),
    }
    if computers:
        parts["computers"] = _shared_of("tasks", computers, hashes)
    if networks:
        parts["networks"] = _shared_of("messages", networks, hashes)
    return {key: _json(value) for key, value in parts.items()}


@IdentityCache
def _text_of_component(name: str, component: Component, hashes: Mapping[str, str], starts: Mapping[str, float]) -> str:
    content = {
        **_values_of(component),
        "name": name,
        "fmu": hashes[component.fmu],
        "parameters": {key: v for key, v in component.parameters.items() if key not in starts or v != starts[key]},
        "sampling": None if component.sampling is None else _content(component.sampling, hashes),
    }
    return _json(content)


def _shared_of(part: str, shared: Mapping[str, Any], hashes: Mapping[str, str]) -> list[Any]:
    """Computers with their tasks or networks with their messages, as lists, since their order decides ties."""
    return [
        [
            name,
            _content(one, hashes) | {part: [[each, _content(of, hashes)] for each, of in getattr(one, part).items()]},
        ]
        for name, one in shared.items()
    ]


def _values_of(of: Any) -> dict[str, Any]:
    values = {field.name: getattr(of, field.name) for field in dataclasses.fields(of)}
    return {name: value for name, value in values.items() if name not in _LATER or value not in _UNSET}


_LATER = (
    "interface",
    "partition",
    "instance",
    "solver",
    "fmu_clock",
    "start_time",
    "outside",
    "points",
    "within_steps",
)
"""Keys without which studies were stored before there were any, as they are still if these are not set"""
_UNSET = (None, (), False)


def _content(of: Any, hashes: Mapping[str, str]) -> dict[str, Any]:
    """The fields of a part of a system, with distributions by their fields and files by the hash of their content."""
    return {name: _plain(value, hashes) for name, value in _values_of(of).items()}


def _plain(value: Any, hashes: Mapping[str, str]) -> Any:
    if isinstance(value, Path):
        return hashes[str(value)]
    return _content(value, hashes) if dataclasses.is_dataclass(value) else value


def study_parts(study: Study) -> dict[str, str]:
    """The parts of a study that determine its runs, by name, so that a difference can be named."""
    system = study.origin
    tables = Files(fmus={}, tables=files_read_by(system)).hashes
    parts: dict[str, Any] = {key: getattr(system, key) for key in ("stop_time", "seed")}
    for name, component in system.components.items():
        parts |= _parts(f"components.{name}", component, tables, without=("fmu",))
    for x in system.connections:
        parts |= _parts(f"connections.{x.name}", x, tables)
    for name, source in system.sources.items():
        parts |= {f"sources.{name}.{key}": value for key, value in _content(source, tables).items()}
    for table, part in (("computers", "tasks"), ("networks", "messages")):
        for name, shared in getattr(system, table).items():
            parts |= _parts(f"{table}.{name}", shared, tables, without=(part,))
            for inner, one in getattr(shared, part).items():
                parts |= _parts(f"{table}.{name}.{part}.{inner}", one, tables)
    parts |= {f"objectives.{name}": text for name, text in system.objectives.items()}
    parts |= {f"metrics.{metric.name}": metric.source for metric in study.metrics}
    parts |= _parts("criterion", system.criterion, tables)
    texts: dict[str, str] = {}
    for path, value in parts.items():
        name = study.base.in_own_terms(path)
        texts[path if name in texts else name] = json.dumps(value, sort_keys=True)
    return texts


def _parts(place: str, of: Any, hashes: Mapping[str, str], without: Container[str] = ()) -> dict[str, Any]:
    """Every value of `of` by path, except `None`."""
    parts: dict[str, Any] = {}
    for field in dataclasses.fields(of):
        value, path = getattr(of, field.name), f"{place}.{field.name}"
        if dataclasses.is_dataclass(value):
            parts |= _parts(path, value, hashes)
        elif field.name == "parameters":
            parts |= {f"{path}.{name}": parameter for name, parameter in value.items()}
        elif value is not None and field.name not in without and (field.name not in _LATER or value != ()):
            parts[path] = _plain(value, hashes)
    return parts


def design_parts(study: Study) -> dict[str, str]:
    """The parts of a study that determine its design only; they may change, since rows are identified by their keys."""
    sampled = any(axis.values is None for axis in study.axes)
    parts: dict[str, Any] = {
        "axes": [axis.name for axis in study.axes],
        "design": [study.method, study.samples, study.design_seed] if sampled else None,
        "vary_seed": study.vary_seed,
        **{f"axis {axis.name}": dataclasses.asdict(axis) for axis in study.axes},
        **{f"what {', '.join(each.axes)} stands for": each.as_lists() for each in study.together},
    }
    return {name: json.dumps(value, sort_keys=True) for name, value in parts.items()}


CONTENT = "content of "
"""The beginning of the place of a file that only an axis names: with another design there may be others"""


def place_parts(study: Study, files: Files) -> dict[str, str]:
    """The origin of a store's rows besides the study file, the content of files that an axis names among it."""
    of_components = {f"FMU of the {name}": one.fmu for name, one in study.origin.components.items()}
    others = files.hashes.keys() - {*of_components.values(), *files_read_by(study.origin)}
    return {
        **{of: files.hashes[fmu] for of, fmu in of_components.items()},
        **{f"{CONTENT}{name}": files.hashes[name] for name in sorted(others)},
        **{f"version of {name}": version for name, version in versions().items()},
        "machine": machine(),
    }


def difference(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """The changes in a few words; empty if there are none."""
    differing = [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]
    changes = [f"{name} {_change(before.get(name), now.get(name))}" for name in differing[:_MAX_SETTINGS]]
    more = f"; and {len(differing) - _MAX_SETTINGS} more" if len(differing) > _MAX_SETTINGS else ""
    return "; ".join(changes) + more


_MAX_SETTINGS, _MAX_LENGTH = 3, 60


def _change(before: str | None, now: str | None) -> str:
    """What a text was and is, each from shortly before where they differ if it is long."""
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(before or "", now or "")))
    return f"was {_short(before, same)}, is {_short(now, same)}"


def _short(text: str | None, same: int) -> str:
    if text is None:
        return "absent"
    first = 0 if len(text) <= _MAX_LENGTH else max(0, min(same - _MAX_LENGTH // 4, len(text) - _MAX_LENGTH))
    shown = text[first : first + _MAX_LENGTH]
    return f"{'...' if first else ''}{shown}{'...' if first + len(shown) < len(text) else ''}"
