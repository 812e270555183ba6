"""Whether the model that the controller believes in is the plant that it flies."""

from collections.abc import Mapping

from orchestration.quadrotor.wiring import RIGID_BODY


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
