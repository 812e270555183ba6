"""The geometric controller's slave: that it gives what its law does."""

import math
from typing import Any

import pytest

from controller_fmu.gain_scaling import GainScaling
from controller_fmu.geometric.law import Evaluation, Gains, Heading, evaluate
from controller_fmu.geometric.slave import GeometricController
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.trajectory import Trajectory
from tests.slaves import assert_fails, get, put

AT = Measurement(
    Vec3(0.3, -0.2, 1.7),
    Vec3(0.1, 0.4, -0.3),
    Quaternion.from_xyzw(0.1, -0.2, 0.05, 0.95).normalised(),
    Vec3(0.2, -0.1, 0.3),
)
PARAMETERS = {
    "gain.position": 6.0,
    "gain.velocity": 3.0,
    "gain.attitude": 50.0,
    "gain.angular_velocity": 12.0,
    "heading": 0.4,
    "mass": 1.4,
    "gravity": 9.7,
    "inertia.xx": 0.8,
    "inertia.yy": 0.9,
    "inertia.zz": 1.3,
    "inertia.xz": 0.1,
}
MODEL = Model(mass=1.4, gravity=9.7, inertia=Inertia(xx=0.8, yy=0.9, zz=1.3, xz=0.1))
HEADING = Heading(Vec3(math.cos(0.4), math.sin(0.4), 0.0))


def named(name: str, value: Any) -> dict[str, float]:
    """The scalar variables of a vector or quaternion."""
    return {f"{name}.{axis}": component for axis, component in zip("xyzw", value)}


def initialised(values: dict[str, float], scaling: GainScaling = GainScaling.ABSOLUTE) -> GeometricController:
    slave = GeometricController(instance_name="c")
    measurement = [named(name, value) for name, value in AT._asdict().items()]
    for group in (*measurement, values):
        put(slave, group)
    slave.set_integer([slave._index["gain_scaling"]], [scaling])
    slave.setup_experiment(4.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def law(scaling: GainScaling) -> Evaluation:
    gains = Gains(k_x=6.0, k_v=3.0, k_R=50.0, k_Omega=12.0, per_inertia=scaling == GainScaling.INERTIA)
    return evaluate(AT, Trajectory().at(4.0), gains, MODEL, heading=HEADING)


@pytest.mark.parametrize("scaling", GainScaling)
def test_outputs_and_locals_are_those_of_the_law(scaling: GainScaling) -> None:
    slave, now = initialised(PARAMETERS, scaling), law(scaling)
    for name in ("thrust", "error_function", "energy"):
        assert get(slave, name) == pytest.approx([getattr(now, name)], rel=1e-12)
    for name in (
        *("torque", "position_error", "velocity_error", "angular_velocity_error", "rotation_error"),
        *("desired_angular_velocity", "desired_quaternion", "attitude_error"),
    ):
        value = getattr(now, name)
        assert get(slave, *named(name, value)) == pytest.approx([*value], rel=1e-11, abs=1e-13), name


def test_defaults_of_the_fmu_are_those_of_the_law() -> None:
    now = evaluate(AT, Trajectory().at(4.0), Gains(), Model())
    assert get(initialised({}), "thrust", *named("torque", now.torque)) == pytest.approx([now.thrust, *now.torque])


def test_a_reference_in_free_fall_fails_by_name() -> None:
    slave = GeometricController(instance_name="c")
    slave.set_boolean([slave._index["use_reference_inputs"]], [True])
    put(slave, {"reference.acceleration.z": 9.81})
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    words = ("-A/m = (", "a length of at least 1e-09 m/s2", "the desired attitude does not exist")
    assert_fails(slave.exit_initialization_mode, *words)


def test_the_geometric_slave_says_that_it_has_no_semi_implicit_form() -> None:
    slave = GeometricController(instance_name="c")
    slave.set_integer([slave._index["discretisation"]], [2])
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    assert_fails(slave.exit_initialization_mode, "discretisation = semi_implicit", "no semi-implicit form")
