"""What a flight is told from outside: the reference that it follows, and what disturbs it."""

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.system.requirements import is_finite, require

Between = Literal["linear", "previous"]
DRAG = 0.1
"""[N·s/m] by which a wind becomes a force where nobody says another: an assumption, not a measured figure"""


@record("reference.")
class ReferenceChoice:
    """What the vehicle is to follow: the controller's built-in trajectory unless a motion or a file is named.

    Raises `UsageError` for a name, a parameter or a value that cannot be.
    """

    name: str | None = None
    """The name of a motion: hover, step, circle, lemniscate, helix or paper."""
    file: Path | None = None
    """A CSV file of `time` [s] and reference.position.x … reference.snap.z, linear between rows; or of way-points,
    columns x, y, z [m] with `time`, or with `hold` [s] and `speed` [m/s] where they are told, and a smooth curve
    through them."""
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
    """What pushes the vehicle beside the built-in wind: nothing unless gusts or a file are named.

    Raises `UsageError` for a name, a parameter or a value that cannot be.
    """

    name: str | None = None
    """The name of gusts of wind: dryden."""
    file: Path | None = None
    """A CSV file of `time` [s] and external_force.x, .y, .z [N], or wind.x, .y, .z [m/s], in the inertial frame."""
    interpolation: Between = "linear"
    """What holds between the rows of a file: the line (linear), or the row before (previous)."""
    drag: float | None = None
    """The force by wind [N·s/m], in the direction of the wind, 0.1 unless told; the vehicle's own motion is left
    out."""
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


def chosen(text: str) -> dict[str, Any]:
    """What somebody means who says one word of a reference or a disturbance: a file if it ends in .csv, else a name."""
    return {"file": Path(text)} if text.lower().endswith(".csv") else {"name": text}


def _expect_one(choice: ReferenceChoice | DisturbanceChoice, place: str) -> None:
    both = choice.name is not None and choice.file is not None
    require(not both, f"{place}.name", choice.name, "none beside a file")
    if choice.parameters and choice.name is None and choice.file is None:
        raise UsageError(f"{place}.{next(iter(choice.parameters))}: expected {place}.name or {place}.file as well")


def _expect_signal(place: str, name: str | None, parameters: Mapping[str, Any]) -> None:
    from orchestration.signals import library

    try:
        if name is None:
            library.limits(parameters)
        else:
            library.made(name, parameters, library.KINDS["wind" if place == "disturbance" else "motion"])
    except UsageError as error:
        text = str(error)
        raise UsageError(f"{place}.{text.removeprefix('parameters.').replace('signal =', 'name =')}") from error
