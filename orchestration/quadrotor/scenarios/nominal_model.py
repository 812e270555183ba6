"""The model of the vehicle: its hover thrust, and what differs from it in the controller: mass, inertia, axes."""

from collections.abc import Mapping
from typing import Any

from orchestration.quadrotor.scenarios.wiring import COMMAND, RIGID_BODY

_FRAME, _INDEX = "frame", "frame_index"
"""Parameters of both: their axes, and an index that overrides it unless it is 0"""


def hover_inputs(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The plant's thrust at hover [N], where it has a mass and gravity; from the parameters of runs by their paths."""
    mass, gravity = (parameters.get(f"plant.{name}") for name in ("mass", "gravity"))
    return {} if mass is None or gravity is None else {f"plant.{COMMAND[0]}": mass * gravity}


def axis_mismatch(parameters: Mapping[str, float]) -> str | None:
    """A warning if the axes of plant and controller differ; None if they agree, or if one side has no choice.

    The map holds the parameters of a run by their paths.
    """
    frames = [frame_of(parameters, side) for side in ("controller", "plant")]
    if None in frames or frames[0] == frames[1]:
        return None
    controller, plant = (f"{frame:g}" for frame in frames)
    return (
        f"controller.{_FRAME} is item {controller}, plant.{_FRAME} item {plant}: expected the same axes on both sides"
    )


def frame_of(parameters: Mapping[str, float], side: str) -> float | None:
    """The item of `fmu_kit.frames.Frame` in which a run's plant or controller works; None if it has no choice."""
    return parameters.get(f"{side}.{_INDEX}") or parameters.get(f"{side}.{_FRAME}")


def model_mismatch(plant: Mapping[str, float], controller: Mapping[str, float]) -> str | None:
    """A warning if mass or inertia differ, with what to do about it; None if they agree.

    Both maps hold the parameters of a run by name; a parameter that one side lacks is not compared.
    """
    different = [
        f"controller.{name} = {controller[name]:g} where plant.{name} = {plant[name]:g}"
        for name in RIGID_BODY
        if name in plant and name in controller and plant[name] != controller[name]
    ]
    if not different:
        return None
    return (
        f"the controller's nominal model is not the plant: {', '.join(different)}. Set both (and the gains: "
        "docs/vehicles.md), or if this is intended: --model-mismatch, model_mismatch = true in a scenario file"
    )
