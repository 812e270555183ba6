"""External signals of a flight: its reference and its disturbance."""

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
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
