"""Whether plant and controller mean the same: by the model that the controller believes in, and by their axes."""

from collections.abc import Mapping

from orchestration.quadrotor.wiring import RIGID_BODY

_FRAME, _INDEX = "frame", "frame_index"
"""Parameters of both: their axes, and what sets them too unless it is 0"""


def axes_differ(parameters: Mapping[str, float]) -> str | None:
    """What is wrong with the axes of plant and controller; None if they are the same, or one has no other axes.

    The map holds the parameters of a run by their paths.
    """
    frames = [frame_of(parameters, side) for side in ("controller", "plant")]
    if None in frames or frames[0] == frames[1]:
        return None
    there, here = (f"{frame:g}" for frame in frames)
    return f"controller.{_FRAME} is item {there}, plant.{_FRAME} item {here}: expected the same axes on both sides"


def frame_of(parameters: Mapping[str, float], side: str) -> float | None:
    """The item of `fmu_kit.frames.Frame` that a run's plant or controller is told in; None if it has no choice."""
    return parameters.get(f"{side}.{_INDEX}") or parameters.get(f"{side}.{_FRAME}")


def mismatch(plant: Mapping[str, float], controller: Mapping[str, float]) -> str | None:
    """What differs in mass or inertia, and what to do about it; None if nothing does.

    Both maps hold the parameters of a run by name; what one side does not have is not compared.
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
        "docs/vehicles.md), or say that it is meant: --model-mismatch, model_mismatch = true in a scenario file"
    )
