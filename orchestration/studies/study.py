"""What a study is: a base scenario, axes, and the runs that they make."""

import dataclasses
import functools
import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import fmpy

from orchestration import fmus
from orchestration.errors import UsageError
from orchestration.scenario import FmuChoice, Scenario
from orchestration.studies.axes import Axis, Method, Value, points
from orchestration.timing import TIMING_KEYS


@dataclass(frozen=True, kw_only=True)
class Study:
    """Runs of a base scenario over axes."""

    name: str
    base: Scenario
    axes: tuple[Axis, ...]
    method: Method = "sobol"
    samples: int = 0
    design_seed: int = 0
    vary_seed: bool = False
    """whether each run has a seed of its own: that of the base plus its index"""
    keep_signals: tuple[int, ...] | bool = False
    """indices of the runs whose signals are kept, or all"""

    def __post_init__(self) -> None:
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names) or not names:
            raise UsageError(f"axes = {', '.join(names)}: expected at least one axis, each with a name of its own")

    @cached_property
    def points(self) -> list[dict[str, Value]]:
        """The value of each axis, run by run."""
        return points(self.axes, self.method, self.samples, self.design_seed)

    def scenario(self, index: int, starts: Mapping[str, float]) -> Scenario:
        """The scenario of one run; `starts` are the FMUs' own parameters, as `controller.NAME`, `plant.NAME`.

        Raises `UsageError` for a value that cannot be.
        """
        point = self.points[index]
        changes: dict[str, Any] = {}
        if self.vary_seed and "seed" not in point:
            changes["seed"] = self.base.seed + index
        for axis in self.axes:
            value = point[axis.name]
            for target in axis.targets:
                changes[target] = _product(value, target, self.base, starts) if axis.multiplies else value
        return changed(self.base, changes)

    def keeps_signals(self, index: int) -> bool:
        """Whether the signals of a run are kept."""
        return self.keep_signals if isinstance(self.keep_signals, bool) else index in self.keep_signals


def expect_target(target: str) -> None:
    """Raise `UsageError` naming what an axis can set, unless `target` is among it; FMUs know their own names."""
    side, _, key = target.partition(".")
    kind, _, measurement = key.partition(".")
    if side == "timing":
        known = bool(measurement) if kind in _BY_MEASUREMENT else key == "loss" or key in TIMING_KEYS
    else:
        known = target in ("seed", "stop_time") or (side in ("controller", "plant") and bool(key))
    if not known:
        keys = ", ".join(key for key in TIMING_KEYS if key not in _BY_MEASUREMENT)
        raise UsageError(
            f"{target}: expected controller.NAME, plant.NAME, seed, stop_time, timing.loss, timing.noise.NAME, "
            f"timing.quantisation.NAME or timing.KEY with KEY one of {keys}"
        )


_BY_MEASUREMENT = ("noise", "quantisation")


def changed(base: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """`base` with other values of `timing.KEY`, `controller.NAME`, `plant.NAME`, `seed` or `stop_time`."""
    timing: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    top: dict[str, Any] = {}
    for target, value in changes.items():
        expect_target(target)
        side, _, key = target.partition(".")
        if side == "timing" and key == "loss":
            timing |= {"measurement_loss": value, "command_loss": value}
        elif side == "timing" and key.partition(".")[0] in _BY_MEASUREMENT:
            kind, _, measurement = key.partition(".")
            timing[kind] = {**timing.get(kind, getattr(base.timing, kind)), measurement: value}
        elif side == "timing":
            timing[key] = value
        elif side in ("controller", "plant"):
            parameters[target] = value
        else:
            top[target] = int(value) if target == "seed" else float(value)
    return base.with_changes(timing=timing, parameters=parameters, **top)


def _product(value: Value, target: str, base: Scenario, starts: Mapping[str, float]) -> float:
    if not isinstance(value, (int, float)):
        raise UsageError(f"{target}: expected a number to multiply with, got {value}")
    side, _, key = target.partition(".")
    if side == "timing" and isinstance(getattr(base.timing, key, None), float):
        return float(value) * float(getattr(base.timing, key))
    choice: FmuChoice | None = getattr(base, side, None) if side in ("controller", "plant") else None
    if choice is not None and key in choice.parameters:
        return float(value) * float(choice.parameters[key])
    if target in starts:
        return float(value) * starts[target]
    raise UsageError(f"{target}: expected a number of the base scenario or of an FMU to multiply")


@dataclass(frozen=True, kw_only=True)
class Fmus:
    """The FMU files of a study, and what identifies them."""

    plant: Path
    controller: Path

    @cached_property
    def descriptions(self) -> dict[str, Any]:
        """Model descriptions by side."""
        return {side: fmpy.read_model_description(str(getattr(self, side))) for side in ("plant", "controller")}

    @cached_property
    def guids(self) -> dict[str, str]:
        """GUIDs by side."""
        return {side: description.guid for side, description in self.descriptions.items()}

    @cached_property
    def starts(self) -> dict[str, float]:
        """The start values of all Real parameters, as `side.NAME`."""
        return {
            f"{side}.{v.name}": float(v.start)
            for side, description in self.descriptions.items()
            for v in description.modelVariables
            if v.type == "Real" and v.causality == "parameter"
        }


def locate_fmus(base: Scenario) -> Fmus:
    """The FMUs of a scenario, built if need be."""
    return Fmus(plant=fmus.locate(base.plant.fmu), controller=fmus.locate(base.controller.fmu))


@functools.cache
def versions() -> dict[str, str]:
    """The software that a run's bits depend on."""
    return {name: importlib.metadata.version(name) for name in ("quadcosim", "numpy", "fmpy")}


def run_key(scenario: Scenario, guids: Mapping[str, str]) -> str:
    """The hash of everything that determines a run."""
    content: dict[str, Any] = {
        "scenario": dataclasses.asdict(scenario),
        "fmus": dict(guids),
        "versions": versions(),
    }
    file = scenario.reference.file
    content["scenario"]["reference"] = None if file is None else hashlib.sha256(file.read_bytes()).hexdigest()
    content["scenario"].pop("model_mismatch")  # says something of the run, and changes none
    for side in ("plant", "controller"):  # an FMU is its GUID, wherever the file lies
        content["scenario"][side].pop("fmu")
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def fingerprint(study: Study, guids: Mapping[str, str]) -> dict[str, str]:
    """What the rows of a store belong to, part by part, so that a difference can be named."""
    base = dataclasses.asdict(study.base)
    file = study.base.reference.file
    parts: dict[str, Any] = {
        "reference": None if file is None else hashlib.sha256(file.read_bytes()).hexdigest(),
        "axes": [axis.name for axis in study.axes],
        "design": [study.method, study.samples, study.design_seed, study.vary_seed],
        **{f"FMU of the {side}": guid for side, guid in guids.items()},
        **{f"version of {name}": version for name, version in versions().items()},
        **{f"axis {axis.name}": dataclasses.asdict(axis) for axis in study.axes},
        **{f"timing.{key}": value for key, value in base["timing"].items()},
        **{f"{side}.{name}": v for side in ("controller", "plant") for name, v in base[side]["parameters"].items()},
        **{key: base[key] for key in ("stop_time", "seed", "record")},
    }
    return {name: json.dumps(value, sort_keys=True) for name, value in parts.items()}
