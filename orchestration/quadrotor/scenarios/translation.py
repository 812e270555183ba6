"""Translates a scenario of the quadrotor into its system: its reference, its disturbance, and names of parts."""

import functools
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Literal

from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, did_you_mean, prefixed
from orchestration.foundation.basics.records import record
from orchestration.quadrotor.scenarios.timing import TIMING_KEYS
from orchestration.quadrotor.scenarios.wiring import EXTERNAL_FORCE, POSITION_REFERENCE
from orchestration.systems.signals.library import AXES
from orchestration.systems.signals.table_file import header_of
from orchestration.systems.system.connection import Source
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import AT_REST, TOP
from orchestration.systems.system.requirements import is_finite, require

Between = Literal["linear", "previous"]
DRAG = 0.1
"""Factor by which a wind becomes a force by default [N·s/m]: an assumption, not a measured figure"""


@record("reference.")
class ReferenceChoice:
    """What the vehicle follows: a motion or a file; default: the trajectory built into the controller.

    Raises `UsageError` for an invalid name, parameter or value.
    """

    name: str | None = None
    """The name of a motion: hover, step, circle, lemniscate, helix or paper."""
    file: Path | None = None
    """A CSV file of `time` [s] and reference.position.x … reference.snap.z, linear between rows; or of way-points,
    columns x, y, z [m] with `time`, or with optional `hold` [s] and `speed` [m/s], joined by a smooth curve."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the motion, as radius = 2.0; of way-points without times, `speed` [m/s] and `acceleration`
    [m/s²]."""

    def __post_init__(self) -> None:
        _expect_one(self, "reference")
        if self.name is not None:
            _expect_signal("reference", self.name, self.parameters)
        elif self.file is not None:
            _expect_signal("reference", None, self.parameters)


@record("disturbance.")
class DisturbanceChoice:
    """Forces on the vehicle beside the built-in wind: gusts or a file; default: none.

    Raises `UsageError` for an invalid name, parameter or value.
    """

    name: str | None = None
    """The name of gusts of wind: dryden."""
    file: Path | None = None
    """A CSV file of `time` [s] and external_force.x, .y, .z [N], or wind.x, .y, .z [m/s], in the inertial frame."""
    interpolation: Between = "linear"
    """The value between the rows of a file: on the line (linear), or of the row before (previous)."""
    drag: float | None = None
    """The force by wind [N·s/m], in the direction of the wind, by default 0.1; the vehicle's own motion is
    neglected."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the gusts, as wind_speed = 8.0 [m/s]."""

    def __post_init__(self) -> None:
        _expect_one(self, "disturbance")
        of_file = self.file is not None or self.interpolation == "linear"
        require(of_file, "disturbance.interpolation", self.interpolation, "none without a file")
        fits = self.drag is None or (is_finite(self.drag) and self.drag >= 0.0)
        require(fits, "disturbance.drag", self.drag, "zero or a positive number")
        if self.name is not None:
            _expect_signal("disturbance", self.name, self.parameters)
        elif self.parameters:
            raise UsageError(f"disturbance.{next(iter(self.parameters))}: expected none without a name")


def choice_of(text: str) -> dict[str, Any]:
    """The fields of a reference or a disturbance given as one word: a file if it ends in .csv, else a name."""
    return {"file": Path(text)} if text.lower().endswith(".csv") else {"name": text}


def _expect_one(choice: ReferenceChoice | DisturbanceChoice, place: str) -> None:
    both = choice.name is not None and choice.file is not None
    require(not both, f"{place}.name", choice.name, "none beside a file")
    if choice.parameters and choice.name is None and choice.file is None:
        raise UsageError(f"{place}.{next(iter(choice.parameters))}: expected {place}.name or {place}.file as well")


def _expect_signal(place: str, name: str | None, parameters: Mapping[str, Any]) -> None:
    from orchestration.systems.signals import library

    try:
        if name is None:
            library.limits(parameters)
        else:
            library.make_signal(name, parameters, library.KINDS["wind" if place == "disturbance" else "motion"])
    except UsageError as error:
        text = str(error)
        raise UsageError(f"{place}.{text.removeprefix('parameters.').replace('signal =', 'name =')}") from error


SYSTEM = Path(__file__).with_name("system.toml")
"""The paper's flight; every scenario is this system with changes"""


@functools.cache
def quadrotor() -> System:
    """The system of the paper's flight."""
    return load_system(SYSTEM)


def in_scenario_terms(text: str) -> str:
    """`text` with the paths of the system replaced by the names of a scenario."""
    for path, name in _scenario_names().items():
        text = text.replace(path, name)
    return text


@functools.cache
def _scenario_names() -> dict[str, str]:
    return read_toml(Path(__file__).with_name("scenario_names.toml"), "names in scenarios")


def reference_source(choice: ReferenceChoice) -> dict[str, Any]:
    """The keys of the source of the reference; empty for the trajectory built into the controller."""
    if choice.name is None and choice.file is None:
        return {}
    keys: dict[str, Any] = {"parameters": dict(choice.parameters)}
    if choice.file is None:
        return {**keys, "signal": choice.name}
    columns = header_of(choice.file)
    is_table = POSITION_REFERENCE[0] in columns or not {*AXES} & {*columns}
    return {**keys, "file": choice.file, "interpolation": "linear" if is_table else "spline"}


def disturbed(system: System, choice: DisturbanceChoice) -> System:
    """`system` with the source of a disturbance of the plant."""
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
    with prefixed("sources.disturbance."):
        source = Source(**keys)
    return replace(system, sources={**system.sources, "disturbance": source})


def paths_of(target: str) -> tuple[str, ...]:
    """The paths in the system of `timing.KEY`, `controller.NAME` or `plant.NAME`; a path is returned as it is.

    Raises `UsageError` for any other name.
    """
    table, _, key = target.partition(".")
    kind, _, measurement = key.partition(".")
    if target in TOP or table in ("components", "connections", "sources", AT_REST):
        return (target,)
    if table == "timing" and key == "loss":
        return (*TIMING["measurement_loss"], *TIMING["command_loss"])
    if table == "timing" and key in TIMING:
        return TIMING[key]
    if table == "timing" and kind in BY_MEASUREMENT and measurement:
        return (f"connections.measurement.{key}",)
    if table in ("reference", "disturbance") and key:
        return (f"sources.{table}.{SIGNAL_KEYS[table].get(key, f'parameters.{key}')}",)
    if target == "controller":
        return ("components.controller.fmu",)
    if table in ("controller", "plant") and key:
        return (f"components.{table}.fmu" if key == "fmu" else f"components.{table}.parameters.{key}",)
    raise UsageError(
        f"{target}: expected controller.NAME, plant.NAME, reference.NAME, disturbance.NAME, seed, stop_time, "
        f"timing.loss, timing.noise.NAME, timing.quantisation.NAME or timing.KEY with KEY one of {', '.join(_SINGLE)}"
        + did_you_mean(target, [f"timing.{name}" for name in ("loss", *_SINGLE)])
    )


SIGNAL_KEYS = {
    "reference": {"name": "signal", "file": "file"},
    "disturbance": {"name": "signal", "file": "file", "interpolation": "interpolation", "drag": "scale"},
}
"""Keys of `[reference]` and `[disturbance]` that are not parameters, and the keys of their sources"""
WIND = ("wind.x", "wind.y", "wind.z")
"""Columns of a file that has a wind instead of a force"""

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
"""Paths by key of `[timing]`"""
BY_MEASUREMENT = ("noise", "quantisation")
"""Keys of `[timing]` that are tables by measurement"""
_SINGLE = tuple(key for key in TIMING_KEYS if key not in BY_MEASUREMENT)
