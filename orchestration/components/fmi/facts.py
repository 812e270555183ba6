"""What an FMU declares: what a master needs to call it, and its variables, as a document and as lines."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fmpy

from orchestration.components.fmi.access import Interface
from orchestration.components.fmi.archive import read_archive, read_root
from orchestration.components.fmi.read_description import (
    DeclaredClock,
    Model,
    attribute,
    attributes_of,
    clocks_of,
    declared_of,
    items_text,
)
from orchestration.foundation.basics.terminal import in_columns
from orchestration.foundation.basics.unit_algebra import counted, time_text

_ORDER = ("input", "output", "parameter", "structuralParameter", "calculatedParameter", "local", "independent")
_CAPABILITIES: Mapping[str, Any] = {
    "needsExecutionTool": False,
    "canBeInstantiatedOnlyOncePerProcess": False,
    "canGetAndSetFMUState": False,
    "canSerializeFMUState": False,
    "providesDirectionalDerivatives": False,
}
"""Capabilities of every interface by their names in FMI 3.0, and what they are where they are not declared"""
_OF_STEPS: Mapping[str, Any] = {"canHandleVariableCommunicationStepSize": False, "maxOutputDerivativeOrder": 0}
_NAMES = {
    "canGetAndSetFMUstate": "canGetAndSetFMUState",
    "canSerializeFMUstate": "canSerializeFMUState",
    "providesDirectionalDerivative": "providesDirectionalDerivatives",
}
"""Names of FMI 2.0 of which FMI 3.0 has others"""


@dataclass(frozen=True, kw_only=True)
class DeclaredVariable:
    """A variable as it is declared, an array as a whole; None: not declared."""

    name: str
    causality: str
    variability: str
    type: str
    unit: str | None
    start: str | None
    minimum: str | None
    maximum: str | None
    dimensions: tuple[int, ...]
    choices: Mapping[str, int]
    description: str | None


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What an FMU declares."""

    path: Path
    model: str
    description: str | None
    fmi_version: str
    token: str
    tool: str | None
    date: str | None
    platforms: tuple[str, ...]
    interfaces: Mapping[str, Mapping[str, Any]]
    """Capabilities by interface"""
    default_experiment: Mapping[str, float]
    continuous_states: int
    event_indicators: int
    clocks: tuple[Mapping[str, Any], ...]
    variables: tuple[DeclaredVariable, ...]

    @property
    def verdict(self) -> str:
        """What it is, by whom it is called, and how many variables of each causality it has."""
        counts = [(sum(v.causality == of for v in self.variables), of) for of in _ORDER[:3]]
        named = [counted(count, of) for count, of in counts]
        named += [counted(self.continuous_states, "continuous state")] if self.continuous_states else []
        named += [counted(len(self.clocks), "clock")] if self.clocks else []
        return f"{self.model}: FMI {self.fmi_version}, {' and '.join(self.interfaces)}; {', '.join(named)}"


def facts(model: Model) -> Facts:
    """What an FMU declares."""
    of, root = model.description, read_root(read_archive(model.path, math.inf))
    keys = (("start", "startTime"), ("stop", "stopTime"), ("tolerance", "tolerance"), ("step", "stepSize"))
    times = {key: getattr(of.defaultExperiment, name, None) for key, name in keys}
    variables = [
        DeclaredVariable(
            name=v.name, causality=v.causality or "local", variability=v.variability or "continuous", type=v.type,
            unit=attribute(v, "unit"), start=v.start, minimum=attribute(v, "min"), maximum=attribute(v, "max"),
            dimensions=tuple(v.shape or ()), description=v.description,
            choices={item.name: int(item.value) for item in getattr(v.declaredType, "items", ())},
        )
        for v in of.modelVariables
    ]  # fmt: skip
    return Facts(
        path=model.path, model=model.name, description=of.description, fmi_version=of.fmiVersion, token=of.guid,
        tool=of.generationTool, date=of.generationDateAndTime,
        platforms=tuple(fmpy.supported_platforms(str(model.path))),
        interfaces={name: _capabilities(model, name, root) for name in declared_of(of)},
        default_experiment={key: float(value) for key, value in times.items() if value is not None},
        continuous_states=of.numberOfContinuousStates or len(of.derivatives),
        event_indicators=of.numberOfEventIndicators or len(of.eventIndicators),
        clocks=tuple(_clock(causality, clock) for causality, clock in clocks_of(root)),
        variables=tuple(sorted(variables, key=lambda v: _ORDER.index(v.causality))),
    )  # fmt: skip


def _clock(causality: str, clock: DeclaredClock) -> dict[str, Any]:
    interval = None if clock.interval is None else float(clock.interval)
    return {"causality": causality, **asdict(clock), "interval": interval, "shift": float(clock.shift)}


def _capabilities(model: Model, interface: Interface, root: Any) -> dict[str, Any]:
    """What it can do by an interface: what it declares, and the usual where it declares nothing."""
    declared = {_NAMES.get(name, name): _plain(text) for name, text in attributes_of(model, interface, root).items()}
    of_steps = _OF_STEPS if interface in ("co-simulation", "event-mode") else {}
    return {**_CAPABILITIES, **of_steps, **declared}


def _plain(text: str) -> Any:
    """An attribute as a truth value or a number, where it is one."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text) if text.lstrip("-").isdigit() else float(text)
    except ValueError:
        return text


def as_lines(of: Facts) -> Iterator[str]:
    """Its facts, a line each, then tables of its capabilities, clocks and variables."""
    times = [f"{key} {value:g}{'' if key == 'tolerance' else ' s'}" for key, value in of.default_experiment.items()]
    about = {
        "description": of.description, "token": of.token, "tool": of.tool, "date": of.date,
        "platforms": ", ".join(of.platforms) or "none", "default experiment": ", ".join(times) or "none",
        "event indicators": of.event_indicators or None,
    }  # fmt: skip
    yield from in_columns([(key, str(value)) for key, value in about.items() if value is not None])
    for name, can in of.interfaces.items():
        if name == "event-mode":
            continue  # that of co-simulation
        yield from ("", name, *(f"  {row}" for row in in_columns([(key, _word(can[key])) for key in can])))
    if of.clocks:
        yield from ("", "clocks", *(f"  {row}" for row in in_columns([_ticks(clock) for clock in of.clocks])))
    heads = ("variable", "causality", "variability", "type", "unit", "start", "range", "description")
    yield from ("", *in_columns([heads, *map(_row, of.variables)]))


def _word(value: Any) -> str:
    return str(value) if not isinstance(value, bool) else "yes" if value else "no"


def _ticks(clock: Mapping[str, Any]) -> tuple[str, ...]:
    interval = "interval not stated" if clock["interval"] is None else f"every {time_text(clock['interval'])}"
    shift = f"from {time_text(clock['shift'])}"
    return clock["name"], clock["causality"], clock["variability"], interval, shift, f"priority {clock['priority']}"


def _row(v: DeclaredVariable) -> tuple[str, ...]:
    kind = v.type + (f"[{','.join(map(str, v.dimensions))}]" if v.dimensions else "")
    kind += f" ({items_text(v.choices)})" if v.choices else ""
    ends = ("-inf" if v.minimum is None else v.minimum, "inf" if v.maximum is None else v.maximum)
    limits = "" if v.minimum is None and v.maximum is None else " to ".join(ends)
    return v.name, v.causality, v.variability, kind, v.unit or "", v.start or "", limits, v.description or ""
