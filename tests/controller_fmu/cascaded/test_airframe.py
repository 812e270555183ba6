"""Commands and forces of an X frame against its allocation matrix."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_fmu.cascaded.airframe import Airframe
from fmu_kit.algebra import Vec3

FRAME = Airframe(thrust_max=3.0, arm_x=0.12, arm_y=0.12, drag_to_thrust=0.015)
COMMANDS = st.builds(Vec3, *[st.floats(-1.0, 1.0)] * 3)


def exerted(frame: Airframe) -> np.ndarray:
    """Torques x, y, z and thrust by the thrusts of motors: front right, rear left, front left, rear right."""
    places = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)]
    drags = (1.0, 1.0, -1.0, -1.0)
    return np.array(
        [
            [*np.cross((frame.arm_x * x, frame.arm_y * y, 0.0), (0.0, 0.0, -1.0))[:2], frame.drag_to_thrust * drag, 1.0]
            for (x, y), drag in zip(places, drags)
        ]
    ).T


def mixed(frame: Airframe) -> np.ndarray:
    """Motor commands by commands, as PX4 scales them: the pseudo-inverse, its columns divided by their sizes."""
    mix = np.linalg.pinv(exerted(frame))
    roll_and_pitch = np.sqrt((mix[:, :2] ** 2).sum(axis=0) / 2.0)
    return mix / np.array([*roll_and_pitch, np.abs(mix[:, 2]).max(), np.abs(mix[:, 3]).mean()])


@given(COMMANDS)
def test_a_command_is_the_torque_that_motors_mixed_for_it_exert(command: Vec3) -> None:
    torque = exerted(FRAME) @ (FRAME.thrust_max * mixed(FRAME) @ [*command, 0.0])
    assert [*FRAME.torque(command), 0.0] == pytest.approx(list(torque), abs=1e-12)


def test_full_thrust_is_that_of_four_motors() -> None:
    assert (exerted(FRAME) @ (FRAME.thrust_max * mixed(FRAME) @ [0.0, 0.0, 0.0, 1.0]))[3] == pytest.approx(
        FRAME.full_thrust, rel=1e-12
    )


def test_full_torque_is_that_of_the_arm_and_the_drag() -> None:
    arm = 0.12 * np.sqrt(2.0)
    assert [*FRAME.full_torque] == pytest.approx([2.0 * arm * 3.0, 2.0 * arm * 3.0, 4.0 * 0.015 * 3.0], rel=1e-12)


@given(COMMANDS)
def test_the_command_of_a_torque_is_that_which_gives_it(command: Vec3) -> None:
    assert [*FRAME.command(FRAME.torque(command))] == pytest.approx([*command], abs=1e-12)
