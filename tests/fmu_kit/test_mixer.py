"""Four motors on an X frame: what is asked of them is what they make up."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import Vec3
from fmu_kit.mixer import Mixer, Thrusts
from fmu_kit.rigid_body import Wrench

MIXER = Mixer(arm_x=0.075, arm_y=0.1, drag_to_thrust=0.022)
number = st.floats(-20.0, 20.0)


def parts(wrench: Wrench) -> list[float]:
    return [wrench.thrust, *wrench.torque]


@given(number, st.builds(Vec3, number, number, number))
def test_the_thrusts_for_a_wrench_make_it_up(thrust: float, torque: Vec3) -> None:
    assert parts(MIXER.wrench(MIXER.thrusts(Wrench(thrust, torque)))) == pytest.approx([thrust, *torque], abs=1e-9)


@pytest.mark.parametrize(
    ("motor", "torque"),
    [
        ("front_right", (-0.1, 0.075, 0.022)),
        ("rear_left", (0.1, -0.075, 0.022)),
        ("front_left", (0.1, 0.075, -0.022)),
        ("rear_right", (-0.1, -0.075, -0.022)),
    ],
)
def test_a_motor_lifts_its_corner_and_turns_the_body_against_its_propeller(
    motor: str, torque: tuple[float, float, float]
) -> None:
    at_rest = Thrusts(0.0, 0.0, 0.0, 0.0)
    assert parts(MIXER.wrench(at_rest._replace(**{motor: 1.0}))) == pytest.approx([1.0, *torque])
