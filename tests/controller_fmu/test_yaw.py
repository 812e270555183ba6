"""The nose follows the desired yaw, on a path and in either axes convention."""

import math

import pytest

from controller_fmu.cascaded.slave import CascadedController
from controller_fmu.geometric.slave import GeometricController
from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.frames import Frame
from fmu_kit.slave import Slave
from fmu_kit.trajectory import Trajectory
from tests.controller_fmu.wired import H, Rows, flight
from tests.extent import sample

CONTROLLERS = (UnifiedController, GeometricController, CascadedController)
STEPS = 800
TURNING = Trajectory(amplitude_x=1.0, amplitude_y=1.0, frequency=0.2, yaw=-0.5, yaw_rate=0.6)


def miss(rows: Rows, yaw: float) -> float:
    """By how much [rad] the nose misses a yaw in the end."""
    *_, last = rows
    (attitude,) = (Quaternion.from_xyzw(*values) for name, values in last.items() if name.endswith(" quaternion"))
    nose = attitude.to_inertial(Vec3(1.0, 0.0, 0.0))
    return abs(math.remainder(math.atan2(nose.y, nose.x) - yaw, 2.0 * math.pi))


@pytest.mark.parametrize("frame", sample([*Frame], 1))
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_nose_follows_the_yaw_of_a_reference(controller: type[Slave], frame: Frame) -> None:
    rows = flight(controller, frame, TURNING.at, steps=STEPS)
    assert miss(rows, TURNING.at(STEPS * H).yaw) < 0.05


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_nose_follows_the_yaw_of_the_built_in_trajectory(controller: type[Slave]) -> None:
    path = {f"trajectory_{name}": getattr(TURNING, name) for name in TURNING.__slots__}
    rows = flight(controller, Frame.NED, None, steps=STEPS, **path)
    assert miss(rows, TURNING.at(STEPS * H).yaw) < 0.05


def test_the_heading_of_the_geometric_controller_is_added_to_the_yaw() -> None:
    rows = flight(GeometricController, Frame.NED, TURNING.at, steps=STEPS, heading=0.7)
    assert miss(rows, TURNING.at(STEPS * H).yaw + 0.7) < 0.05
