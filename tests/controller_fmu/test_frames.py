"""A closed loop in other axes is the same flight: of every law, wired to the plant, with whatever has axes set."""

import math
from typing import Any

import numpy as np
import pytest

from controller_fmu.cascaded.slave import CascadedController
from controller_fmu.geometric.slave import GeometricController
from controller_fmu.redesign.interface import Discretisation
from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.c_code import c_code
from fmu_kit.compiler.pack.building import modules_of
from fmu_kit.compiler.trace.tracing import trace
from fmu_kit.frames import Frame
from fmu_kit.slave import Slave
from fmu_kit.trajectory import Trajectory
from orchestration.components.building.models import MODELS
from plant_fmu.slave import QuadrotorPlant
from tests.controller_fmu.wired import Rows, flight
from tests.extent import in_test_all, sample

CONTROLLERS = (UnifiedController, GeometricController, CascadedController)
PATH = Trajectory(amplitude_x=2.0, amplitude_y=1.5, frequency=0.8, start_z=-1.0, rate_z=0.2, yaw=0.4, yaw_rate=0.5)


def assert_same_flight(one: Rows, other: Rows) -> None:
    for here, there in zip(one, other, strict=True):
        differing = {
            name: (value, there[name])
            for name, value in here.items()
            if not np.allclose(value, there[name], rtol=0.0, atol=1e-9)
        }
        assert differing == {}


@pytest.mark.parametrize("controller", sample([*CONTROLLERS], 1))
def test_a_flight_in_other_axes_is_the_same_if_whatever_has_axes_is_turned(controller: type[Slave]) -> None:
    gains: dict[type[Slave], dict[str, Any]] = {
        UnifiedController: {"k_t": Vec3(1.5, 2.5, 2.0)},
        GeometricController: {"heading": 0.3},
    }
    one, other = (flight(controller, frame, PATH.at, **gains.get(controller, {})) for frame in Frame)
    assert_same_flight(one, other)


@pytest.mark.parametrize("controller", sample([*CONTROLLERS], 1))
def test_the_built_in_trajectory_is_along_the_axes_that_are_chosen(controller: type[Slave]) -> None:
    path = {f"trajectory_{name}": getattr(PATH, name) for name in PATH.__slots__}
    turned = flight(controller, Frame.NED, lambda t: PATH.at(t).turned(True))
    assert_same_flight(flight(controller, Frame.ENU, None, **path), turned)


@pytest.mark.parametrize("controller", [UnifiedController, GeometricController])
def test_a_redesign_knows_the_built_in_trajectory_along_the_axes_that_are_chosen(controller: type[Slave]) -> None:
    still: dict[str, Any] = {"trajectory_amplitude_x": 0.0, "trajectory_amplitude_y": 0.0}
    rising: dict[str, Any] = {"trajectory_start_z": 1.0, "trajectory_yaw": 1.0, "trajectory_yaw_rate": 0.3}
    sinking: dict[str, Any] = {"trajectory_start_z": -1.0, "trajectory_rate_z": -0.1}
    turning: dict[str, Any] = {"trajectory_yaw": 0.5 * math.pi - 1.0, "trajectory_yaw_rate": -0.3}
    mean: dict[str, Any] = {"discretisation": Discretisation.MEAN, "stages": 1}
    one = flight(controller, Frame.ENU, None, **still, **rising, **mean)
    assert_same_flight(one, flight(controller, Frame.NED, None, **still, **sinking, **turning, **mean))


@in_test_all
def test_a_variant_with_its_axes_fixed_has_no_trace_of_others() -> None:
    target = Target.parse(MODELS["QuadrotorPlant"])

    def text(**fixed: str) -> str:
        variant = type("Variant", (QuadrotorPlant,), {"fixed": fixed})
        return c_code(trace(variant, modules_of(target)))

    def turns(code: str) -> bool:
        return f"{math.sqrt(0.5)!r}" in code

    assert (turns(text()), turns(text(frame="enu")), turns(text(frame="ned"))) == (True, True, False)


@pytest.mark.parametrize("slave", [QuadrotorPlant, *CONTROLLERS])
def test_all_that_has_axes_is_turned_but_what_there_is_along_axes_of_the_body(slave: type[Slave]) -> None:
    along = ("gain", "limit")
    with_axes = [each for each in slave._declared if isinstance(each.start, Vec3 | Quaternion | Inertia)]
    untold = [each.name for each in with_axes if each.frame is None]
    forgotten = [name for name in untold if not name.startswith(along)]
    package = slave.__module__.rpartition(".")[0].replace(".", "/")
    assert forgotten == [], f"{package}: expected `frame=`, one of fmu_kit/frames.py, at the declaration of {forgotten}"
    assert len(with_axes) > len(untold)
