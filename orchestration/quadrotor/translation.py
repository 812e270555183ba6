"""A scenario of the quadrotor as the system that it means."""

import functools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestration.basics.errors import UsageError
from orchestration.quadrotor.nominal_model import mismatch
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.signals import DRAG, DisturbanceChoice, ReferenceChoice
from orchestration.quadrotor.timing import TIMING_KEYS
from orchestration.quadrotor.wiring import EXTERNAL_FORCE, REFERENCE, RIGID_BODY, USE_REFERENCE_INPUTS
from orchestration.signals.limits import AXES
from orchestration.signals.table_file import header_of
from orchestration.system.model import Source, System
from orchestration.system.paths import TOP, changed
from orchestration.system.system_file import load_system


@functools.cache
def quadrotor() -> System:
    """The system that is shipped: the paper's flight."""
    return load_system(Path(__file__).with_name("system.toml"))


@contextmanager
def in_its_own_words(asked: object) -> Iterator[None]:
    """What is wrong with the system of a scenario is said of the scenario, which is what somebody wrote."""
    try:
        yield
    except UsageError as error:
        if not isinstance(asked, Scenario):
            raise
        raise type(error)(in_words_of_a_scenario(str(error))) from error


def in_words_of_a_scenario(text: str) -> str:
    """`text` with the paths of a system as a scenario calls them."""
    for place, meant in PLACES.items():
        text = text.replace(place, meant)
    return text


def warnings(scenario: Scenario, parameters: Mapping[str, float]) -> tuple[str, ...]:
    """What may not be meant: a nominal model that is not the plant's, a run too short for its timing."""
    found = []
    if not scenario.model_mismatch:
        sides = [
            {name: parameters[f"{side}.{name}"] for name in RIGID_BODY if f"{side}.{name}" in parameters}
            for side in ("plant", "controller")
        ]
        different = mismatch(*sides)
        found += [] if different is None else [different]
    return (*found, *scenario.timing.warnings(scenario.stop_time))


def system_of(scenario: Scenario) -> System:
    """The system that a scenario means: the quadrotor with the scenario's values."""
    scenario = scenario.resolved()
    timing, sides = scenario.timing, {"plant": scenario.plant, "controller": scenario.controller}
    changes: dict[str, Any] = {"stop_time": scenario.stop_time, "seed": scenario.seed}
    for key, paths in TIMING.items():
        changes |= {path: getattr(timing, key) for path in paths}
    for kind in BY_MEASUREMENT:
        changes |= {f"connections.measurement.{kind}.{name}": v for name, v in getattr(timing, kind).items()}
    for side, choice in sides.items():
        changes[f"components.{side}.fmu"] = choice.fmu
        changes |= {f"components.{side}.parameters.{name}": value for name, value in choice.parameters.items()}
        changes[f"components.{side}.record"] = getattr(scenario.record, side)
    if scenario.reference.name is not None or scenario.reference.file is not None:
        changes |= {f"sources.reference.{key}": value for key, value in _reference(scenario.reference).items()}
        changes[f"components.controller.parameters.{USE_REFERENCE_INPUTS}"] = True
    elif scenario.controller.parameters.get(USE_REFERENCE_INPUTS) is True:
        raise UsageError(f"controller.{USE_REFERENCE_INPUTS}: expected [reference] name or file = … to feed them")
    return _disturbed(changed(quadrotor(), changes), scenario.disturbance)


def _reference(choice: ReferenceChoice) -> dict[str, Any]:
    """The source that feeds the reference inputs of the controller."""
    keys: dict[str, Any] = {
        "trajectory": None,
        "to": tuple(f"controller.{name}" for name in REFERENCE),
        "parameters": dict(choice.parameters),
    }
    if choice.file is None:
        return {**keys, "signal": choice.name}
    columns = header_of(choice.file)
    is_table = REFERENCE[0] in columns or not {*AXES} & {*columns}
    return {**keys, "file": choice.file, "interpolation": "linear" if is_table else "spline"}


def _disturbed(system: System, choice: DisturbanceChoice) -> System:
    """`system` with what pushes the plant."""
    if choice.name is None and choice.file is None:
        return system
    keys: dict[str, Any] = {"to": tuple(f"plant.{name}" for name in EXTERNAL_FORCE)}
    drag = DRAG if choice.drag is None else choice.drag
    if choice.file is None:
        keys |= {"signal": choice.name, "parameters": dict(choice.parameters), "scale": drag}
    else:
        keys |= {"file": choice.file, "interpolation": choice.interpolation}
        if {*WIND} & {*header_of(choice.file)}:
            keys |= {"columns": WIND, "scale": drag}
        elif choice.drag is not None:
            raise UsageError(f"disturbance.drag: expected columns {', '.join(WIND)} in {choice.file}")
    try:
        source = Source(**keys)
    except UsageError as error:
        raise UsageError(f"sources.disturbance.{error}") from error
    return replace(system, sources={**system.sources, "disturbance": source})


def paths_of(target: str) -> tuple[str, ...]:
    """The paths of what a scenario calls `timing.KEY`, `controller.NAME` or `plant.NAME`; a path is one by itself.

    Raises `UsageError` for a name that is none of them.
    """
    table, _, key = target.partition(".")
    kind, _, measurement = key.partition(".")
    if target in TOP or table in ("components", "connections", "sources"):
        return (target,)
    if table == "timing" and key == "loss":
        return (*TIMING["measurement_loss"], *TIMING["command_loss"])
    if table == "timing" and key in TIMING:
        return TIMING[key]
    if table == "timing" and kind in BY_MEASUREMENT and measurement:
        return (f"connections.measurement.{key}",)
    if table in ("reference", "disturbance") and key:
        return (f"sources.{table}.{SIGNAL_KEYS[table].get(key, f'parameters.{key}')}",)
    if table in ("controller", "plant") and key:
        return (f"components.{table}.fmu" if key == "fmu" else f"components.{table}.parameters.{key}",)
    raise UsageError(
        f"{target}: expected controller.NAME, plant.NAME, reference.NAME, disturbance.NAME, seed, stop_time, "
        f"timing.loss, timing.noise.NAME, timing.quantisation.NAME or timing.KEY with KEY one of {', '.join(_SINGLE)}"
    )


PLACES = {
    "components.controller.parameters.": "controller.",
    "components.plant.parameters.": "plant.",
    "components.controller.record": "record.controller",
    "components.plant.record": "record.plant",
    "components.controller.sampling.": "timing.",
    "components.controller.": "controller.",
    "components.plant.step": "timing.plant_interval",
    "components.plant.": "plant.",
    "connections.measurement.from": "plant.fmu",
    "connections.measurement.to": "controller.fmu",
    "connections.command.from": "controller.fmu",
    "connections.command.to": "plant.fmu",
    "connections.measurement.noise": "timing.noise",
    "connections.measurement.quantisation": "timing.quantisation",
    "connections.measurement.loss": "timing.measurement_loss",
    "connections.command.loss": "timing.command_loss",
    "connections.measurement.burst_length": "timing.burst_length",
    "connections.command.": "timing.",
    "sources.reference.signal": "reference.name",
    "sources.reference.parameters.": "reference.",
    "sources.reference.": "reference.",
    "sources.disturbance.signal": "disturbance.name",
    "sources.disturbance.scale": "disturbance.drag",
    "sources.disturbance.parameters.": "disturbance.",
    "sources.disturbance.": "disturbance.",
}
"""Where a scenario says what its system says elsewhere."""

SIGNAL_KEYS = {
    "reference": {"name": "signal", "file": "file"},
    "disturbance": {"name": "signal", "file": "file", "interpolation": "interpolation", "drag": "scale"},
}
"""What is no parameter in `[reference]` and `[disturbance]`, and what their sources call it"""
WIND = ("wind.x", "wind.y", "wind.z")
"""Columns of a file with a wind in place of a force"""

_SAMPLING, _COMMAND = "components.controller.sampling", "connections.command"
TIMING: dict[str, tuple[str, ...]] = {
    "period": (f"{_SAMPLING}.period",),
    "offset": (f"{_SAMPLING}.offset",),
    "plant_interval": ("components.plant.step",),
    "order": (f"{_COMMAND}.order",),
    "delay": (f"{_COMMAND}.delay",),
    "delay_jitter": (f"{_COMMAND}.delay_jitter",),
    "jitter": (f"{_SAMPLING}.jitter",),
    "jitter_distribution": (f"{_SAMPLING}.jitter_distribution", f"{_COMMAND}.jitter_distribution"),
    "measurement_loss": ("connections.measurement.loss",),
    "command_loss": (f"{_COMMAND}.loss",),
    "burst_length": ("connections.measurement.burst_length", f"{_COMMAND}.burst_length"),
    "clock_ratio": (f"{_SAMPLING}.clock_ratio",),
    "hold": (f"{_COMMAND}.hold",),
    "clock": (f"{_SAMPLING}.clock",),
}
"""Keys of `[timing]`, and the paths that they are"""
BY_MEASUREMENT = ("noise", "quantisation")
"""Keys of `[timing]` that are tables by measurement"""
_SINGLE = tuple(key for key in TIMING_KEYS if key not in BY_MEASUREMENT)
