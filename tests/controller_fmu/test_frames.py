"""A closed loop in other axes is the same flight: of every law, wired to the plant, with whatever has axes set."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from controller_fmu.cascaded.slave import CascadedController
from controller_fmu.geometric.slave import GeometricController
from controller_fmu.redesign.interface import Discretisation
from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit import frames
from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.frames import Frame
from fmu_kit.slave import Slave
from fmu_kit.trajectory import Reference, Trajectory
from plant_fmu.slave import QuadrotorPlant

CONTROLLERS = (UnifiedController, GeometricController, CascadedController)
MOTION = ("position", "velocity", "quaternion", "angular_velocity")
FORWARD = {
    UnifiedController: {},
    GeometricController: {"heading": 0.3},
    CascadedController: {},
}
"""What the nose is told"""
H = 0.01
PATH = Trajectory(amplitude_x=2.0, amplitude_y=1.5, frequency=0.8, start_z=-1.0, rate_z=0.2)


def made(slave: type[Slave], frame: Frame, values: dict[str, Any]) -> Any:
    """One that is told, in the axes of a frame, what `values` say in those of the equations."""
    instance = slave(instance_name="it")
    instance.set_integer([slave._index["frame"]], [frame])
    for attribute, value in values.items():
        setattr(instance, attribute, value)
    return instance


def told(slave: Any) -> dict[str, list[float]]:
    """All that a slave shows, turned to the axes of the equations, by attribute."""
    return {name: list(as_vector(getattr(slave, name))) for name in type(slave)._own}


def as_vector(value: Any) -> Any:
    return (float(value),) if isinstance(value, float | int) else value


def flight(controller: type[Slave], frame: Frame, reference: Callable[[float], Reference] | None, **values: Any) -> Any:
    """Rows of all that plant and controller show, which exchange what they say in a frame as it is."""
    body = {"inertia": Inertia(xx=1.0, yy=1.2, zz=1.5, xy=0.1, xz=-0.15, yz=0.05)}
    plant = made(
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
    law = made(controller, frame, {**body, **FORWARD[controller], **values})
    law.set_boolean([controller._index["use_reference_inputs"]], [reference is not None])
    for each in (plant, law):
        each.setup_experiment(0.0)
        each.enter_initialization_mode()

    def measure(t: float) -> None:
        for name in names(*MOTION):
            law.set_real([controller._index[name]], plant.get_real([QuadrotorPlant._index[name]]))
        if reference is not None:
            for name, value in vars_of(reference(t)):
                turned = frames.inertial(frame == Frame.ENU, value)
                for axis, component in zip("xyz", turned):
                    law.set_real([controller._index[f"reference.{name}.{axis}"]], [component])

    measure(0.0)
    plant.exit_initialization_mode()
    law.exit_initialization_mode()
    for k in range(200):
        measure(k * H)
        law.do_step(k * H, H)
        for name in ("thrust", "torque.x", "torque.y", "torque.z"):
            plant.set_real([QuadrotorPlant._index[name]], law.get_real([controller._index[name]]))
        plant.do_step(k * H, H)
        yield {**{f"plant {k}": v for k, v in told(plant).items()}, **{f"law {k}": v for k, v in told(law).items()}}


def names(*vectors: str) -> Iterator[str]:
    for vector in vectors:
        yield from (f"{vector}.{axis}" for axis in ("xyzw" if vector == "quaternion" else "xyz"))


def vars_of(reference: Reference) -> Iterator[tuple[str, Vec3]]:
    for name in ("position", "velocity", "acceleration", "jerk", "snap"):
        yield name, getattr(reference, name)


def assert_same_flight(one: Iterator[dict[str, list[float]]], other: Iterator[dict[str, list[float]]]) -> None:
    for here, there in zip(one, other, strict=True):
        differing = {
            name: (value, there[name])
            for name, value in here.items()
            if not np.allclose(value, there[name], rtol=0.0, atol=1e-9)
        }
        assert differing == {}


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_flight_in_other_axes_is_the_same_if_whatever_has_axes_is_turned(controller: type[Slave]) -> None:
    gains = {"k_t": Vec3(1.5, 2.5, 2.0)} if controller is UnifiedController else {}
    one, other = (flight(controller, frame, PATH.at, **gains) for frame in Frame)
    assert_same_flight(one, other)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_built_in_trajectory_is_along_the_axes_that_are_chosen(controller: type[Slave]) -> None:
    path = {f"trajectory_{name}": getattr(PATH, name) for name in PATH.__slots__}
    turned = flight(controller, Frame.NED, lambda t: PATH.at(t).turned(True))
    assert_same_flight(flight(controller, Frame.ENU, None, **path), turned)


@pytest.mark.parametrize("controller", [UnifiedController, GeometricController])
def test_a_redesign_knows_the_built_in_trajectory_along_the_axes_that_are_chosen(controller: type[Slave]) -> None:
    rising = {"trajectory_amplitude_x": 0.0, "trajectory_amplitude_y": 0.0, "trajectory_start_z": 1.0}
    sinking = {**rising, "trajectory_start_z": -1.0, "trajectory_rate_z": -0.1}
    mean = {"discretisation": Discretisation.MEAN, "stages": 1}
    one = flight(controller, Frame.ENU, None, **rising, **mean)
    assert_same_flight(one, flight(controller, Frame.NED, None, **sinking, **mean))


@pytest.mark.parametrize("slave", [QuadrotorPlant, *CONTROLLERS])
def test_all_that_has_axes_is_turned_but_what_there_is_along_axes_of_the_body(slave: type[Slave]) -> None:
    along = ("gain", "limit")
    with_axes = [each for each in slave._declared if isinstance(each.start, Vec3 | Quaternion | Inertia)]
    untold = [each.name for each in with_axes if each._frame is None]
    assert [name for name in untold if not name.startswith(along)] == []
    assert len(with_axes) > len(untold)
