"""What a study is: a base scenario, axes, and the runs that they make."""

import hashlib
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import fmpy

from orchestration import fmus
from orchestration.errors import QuadcosimError, UsageError
from orchestration.scenario import FmuChoice, Scenario
from orchestration.studies.axes import Axis, Method, Points, Value
from orchestration.studies.store import is_column
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
    """whether each run has a seed of its own: made of that of the base and the values of the axes"""
    keep_signals: tuple[int, ...] | bool = False
    """indices of the runs whose signals are kept, or all"""

    def __post_init__(self) -> None:
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names) or not names:
            raise UsageError(f"axes = {', '.join(names)}: expected at least one axis, each with a name of its own")
        if not _NAME.fullmatch(self.name):
            raise UsageError(
                f"name = {self.name!r}: expected the name of a folder: at most 100 letters, digits, spaces and - _ . +"
            )
        for axis in self.axes:
            if is_column(axis.name) and (axis.name, axis.targets, axis.multiplies) != ("seed", ("seed",), False):
                raise UsageError(f"axis {axis.name}: the table of runs has a column of that name, expected another")

    @cached_property
    def points(self) -> Sequence[Mapping[str, Value]]:
        """The value of each axis, run by run; made when it is asked for."""
        return Points(self.axes, self.method, self.samples, self.design_seed)

    def scenario(self, index: int, starts: Mapping[str, float]) -> Scenario:
        """The scenario of one run; `starts` are the FMUs' own parameters, as `controller.NAME`, `plant.NAME`.

        Raises `UsageError` for a value that cannot be.
        """
        point = self.points[index]
        changes: dict[str, Any] = {}
        if self.vary_seed and "seed" not in point:
            changes["seed"] = _own_seed(self.base.seed, point)
        for axis in self.axes:
            value = point[axis.name]
            for target in axis.targets:
                changes[target] = _product(value, target, self.base, starts) if axis.multiplies else value
        return changed(self.base, changes)

    def keeps_signals(self, index: int) -> bool:
        """Whether the signals of a run are kept."""
        return self.keep_signals if isinstance(self.keep_signals, bool) else index in self.keep_signals


_NAME = re.compile(r"[^\W_][\w .+-]{0,99}")


def _own_seed(seed: int, point: Mapping[str, Value]) -> int:
    """A seed that only the base's and the point determine, so that a design may grow."""
    text = json.dumps([seed, dict(point)], sort_keys=True)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big")


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
            whole = isinstance(value, float) and value.is_integer()  # as in a range: 1.0 for the seed 1
            top[target] = int(value) if target == "seed" and whole else value
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
    """The FMU files of a study, read once: what is described, hashed and flown is this content."""

    plant: Path
    controller: Path

    @cached_property
    def contents(self) -> dict[str, bytes]:
        """The files by side."""
        return {side: getattr(self, side).read_bytes() for side in ("plant", "controller")}

    @cached_property
    def hashes(self) -> dict[str, str]:
        """The hash of each file by side."""
        return {side: hashlib.sha256(content).hexdigest() for side, content in self.contents.items()}

    @cached_property
    def descriptions(self) -> dict[str, Any]:
        """Model descriptions by side; raises `QuadcosimError` for a file without one."""
        found = {}
        for side, content in self.contents.items():
            try:
                found[side] = fmpy.read_model_description(io.BytesIO(content))
            except Exception as error:
                raise QuadcosimError(f"{getattr(self, side)}: expected an FMU: {error}") from error
        return found

    @cached_property
    def guids(self) -> dict[str, str]:
        """GUIDs by side."""
        return {side: description.guid for side, description in self.descriptions.items()}

    @cached_property
    def variables(self) -> dict[str, Any]:
        """The variables of both FMUs, as `side.NAME`."""
        return {f"{side}.{v.name}": v for side, found in self.descriptions.items() for v in found.modelVariables}

    @cached_property
    def starts(self) -> dict[str, float]:
        """The start values of all Real parameters, as `side.NAME`."""
        return {
            name: float(v.start)
            for name, v in self.variables.items()
            if v.type == "Real" and v.causality == "parameter"
        }


def locate_fmus(base: Scenario) -> Fmus:
    """The FMUs of a scenario, built if need be."""
    return Fmus(plant=fmus.locate(base.plant.fmu), controller=fmus.locate(base.controller.fmu))
