"""What a command is of each motor: it makes up the command, in either convention for axes, or is not known."""

from typing import Any

import pytest

from controller_fmu.cascaded.slave import CascadedController
from controller_fmu.geometric.slave import GeometricController
from controller_fmu.redesign.interface import Discretisation
from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.algebra import Vec3
from fmu_kit.frames import Frame
from fmu_kit.mixer import Mixer, Thrusts
from fmu_kit.slave import Slave

CONTROLLERS = (UnifiedController, GeometricController, CascadedController)
KNOWN = {"motor_arm_x": 0.075, "motor_arm_y": 0.1, "motor_drag_to_thrust": 0.022}
MIXER = Mixer(arm_x=0.075, arm_y=0.1, drag_to_thrust=0.022)


def sampled(controller: type[Slave], **values: Any) -> Any:
    """One that has sampled where the vehicle is off its path and turns."""
    law = controller(instance_name="it")
    moving = {"position": Vec3(0.3, -0.2, 1.5), "angular_velocity": Vec3(0.1, 0.2, -0.3)}
    for name, value in {**values, **moving}.items():
        setattr(law, name, value)
    law.setup_experiment(0.0)
    law.enter_initialization_mode()
    law.exit_initialization_mode()
    law.do_step(0.0, 0.01)
    return law


def assert_makes_up_the_command(law: Any) -> None:
    made = MIXER.wrench(law.motor_thrust)
    assert [made.thrust, *made.torque] == pytest.approx([law.thrust, *law.torque], rel=1e-9, abs=1e-9)
    assert max(law.motor_thrust) > min(law.motor_thrust)


@pytest.mark.parametrize("frame", Frame)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_motors_make_up_the_command(controller: type[Slave], frame: Frame) -> None:
    assert_makes_up_the_command(sampled(controller, frame=frame, **KNOWN))


@pytest.mark.parametrize("controller", [UnifiedController, GeometricController])
def test_the_motors_make_up_a_redesigned_command(controller: type[Slave]) -> None:
    assert_makes_up_the_command(sampled(controller, discretisation=Discretisation.MEAN, **KNOWN))


@pytest.mark.parametrize("unknown", KNOWN)
@pytest.mark.parametrize("controller", [UnifiedController, GeometricController])
def test_motors_of_which_not_all_is_known_have_no_thrust(controller: type[Slave], unknown: str) -> None:
    assert sampled(controller, **{**KNOWN, unknown: 0.0}).motor_thrust == Thrusts(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_motor_thrusts_make_up_the_initial_command_too(controller: type[Slave]) -> None:
    law = controller(instance_name="it")
    for name, value in KNOWN.items():
        setattr(law, name, value)
    law.setup_experiment(0.0)
    law.enter_initialization_mode()
    law.exit_initialization_mode()
    assert sum(law.motor_thrust) == pytest.approx(law.thrust)
    assert law.thrust > 0.0
