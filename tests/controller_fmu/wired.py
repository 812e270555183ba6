"""Slaves of controllers wired to the plant's, all in one convention for axes."""

from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any

from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.frames import Frame
from fmu_kit.slave import Slave
from fmu_kit.trajectory import Reference
from plant_fmu.slave import QuadrotorPlant

MOTION = ("position", "velocity", "quaternion", "angular_velocity")
H = 0.01
"""[s], a step of both"""
Rows = Iterator[dict[str, list[float]]]


def created(slave: type[Slave], frame: Frame, values: dict[str, Any]) -> Any:
    """A slave in the axes convention of `frame`, with `values` given in that of the equations."""
    instance = slave(instance_name="it")
    instance.set_integer([slave._index["frame"]], [frame])
    for attribute, value in values.items():
        setattr(instance, attribute, value)
    return instance


def values_of(slave: Any) -> dict[str, list[float]]:
    """All that a slave shows, turned to the axes of the equations, by attribute."""
    return {name: list(as_vector(getattr(slave, name))) for name in type(slave)._own}


def as_vector(value: Any) -> Any:
    return (float(value),) if isinstance(value, float | int) else value


def flight(
    controller: type[Slave],
    frame: Frame,
    reference: Callable[[float], Reference] | None,
    *,
    steps: int = 200,
    **values: Any,
) -> Rows:
    """Rows of all that plant and controller show, which exchange what they say in a frame as it is."""
    body = {"inertia": Inertia(xx=1.0, yy=1.2, zz=1.5, xy=0.1, xz=-0.15, yz=0.05)}
    plant = created(
        QuadrotorPlant,
        frame,
        {
            **body,
            "initial_position": Vec3(1.0, 0.5, -0.3),
            "initial_velocity": Vec3(0.1, 0.2, 0.3),
            "initial_quaternion": Quaternion.from_xyzw(0.1, 0.2, 0.15, 0.95).unit(),
            "initial_angular_velocity": Vec3(0.2, -0.1, 0.3),
            "wind_amplitude": Vec3(0.3, -0.2, 0.1),
        },
    )
    law = created(controller, frame, {**body, **values})
    law.set_boolean([controller._index["use_reference_inputs"]], [reference is not None])
    for each in (plant, law):
        each.setup_experiment(0.0)
        each.enter_initialization_mode()

    def measure(t: float) -> None:
        for name in names(*MOTION):
            law.set_real([controller._index[name]], plant.get_real([QuadrotorPlant._index[name]]))
        if reference is not None:
            now = reference(t).turned(frame == Frame.ENU)
            for each in fields(now):
                set_value(law, f"reference.{each.name}", getattr(now, each.name))

    measure(0.0)
    plant.exit_initialization_mode()
    law.exit_initialization_mode()
    for k in range(steps):
        measure(k * H)
        law.do_step(k * H, H)
        for name in ("thrust", "torque.x", "torque.y", "torque.z"):
            plant.set_real([QuadrotorPlant._index[name]], law.get_real([controller._index[name]]))
        plant.do_step(k * H, H)
        yield {
            **{f"plant {k}": v for k, v in values_of(plant).items()},
            **{f"law {k}": v for k, v in values_of(law).items()},
        }


def names(*vectors: str) -> Iterator[str]:
    for vector in vectors:
        yield from (f"{vector}.{axis}" for axis in ("xyzw" if vector == "quaternion" else "xyz"))


def set_value(slave: Any, name: str, value: Any) -> None:
    for scalar, number in zip([name] if isinstance(value, float) else names(name), as_vector(value)):
        slave.set_real([slave._index[scalar]], [number])
