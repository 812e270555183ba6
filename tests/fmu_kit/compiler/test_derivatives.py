"""Directional derivatives of native FMUs: against the law in 60 digits, and against differences of the FMU itself."""

from pathlib import Path

import mpmath
import numpy as np
import numpy.typing as npt
import pytest

from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.trajectory import Trajectory
from orchestration.components.building import fmus
from tests.fmus.expected import COMMAND, MEASUREMENT
from tests.fmus.instance import Instance
from tests.scalars import PRECISE

START = 0.3
"""[s]"""
OUTPUTS = (*COMMAND, "energy", "theta.x", "desired_quaternion.w", "desired_angular_velocity.y")
Matrix = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def controller() -> Path:
    """The native one."""
    return fmus.locate("native/UnifiedController")


def initialising(controller: Path, values: dict[str, float]) -> Instance:
    instance = Instance(controller)
    instance.fmu.setupExperiment(startTime=START)
    instance.fmu.enterInitializationMode()
    instance.set(values)
    return instance


def jacobian(controller: Path) -> Matrix:
    instance = initialising(controller, MEASUREMENT)
    outputs = [instance.variables[name].valueReference for name in OUTPUTS]
    columns = [
        instance.fmu.getDirectionalDerivative(outputs, [instance.variables[name].valueReference], [1.0])
        for name in MEASUREMENT
    ]
    instance.free()
    return np.array(columns).T


def exact_outputs(values: list[mpmath.mpf]) -> list[mpmath.mpf]:
    """Of the law, in 60 digits, from what is measured in the order of `MEASUREMENT`."""
    at = dict(zip(MEASUREMENT, values))
    vectors = {
        name: Vec3(*(at[f"{name}.{axis}"] for axis in "xyz")) for name in ("position", "velocity", "angular_velocity")
    }
    quaternion = Quaternion.from_xyzw(*(at[f"quaternion.{axis}"] for axis in "xyzw")).normalised(PRECISE)
    measurement = Measurement(vectors["position"], vectors["velocity"], quaternion, vectors["angular_velocity"])
    found = evaluate(measurement, Trajectory().at(mpmath.mpf(START), PRECISE), Gains(), Model(), PRECISE)
    return [
        found.thrust, *found.torque, found.energy, found.theta.x, found.desired_quaternion.scalar,
        found.desired_angular_velocity.y,
    ]  # fmt: skip


def exact_jacobian() -> Matrix:
    """By central differences of 1e-20 in 60 digits: exact to more digits than a double has."""
    step, columns = mpmath.mpf("1e-20"), []
    for i in range(len(MEASUREMENT)):
        sides = []
        for sign in (1, -1):
            values = [mpmath.mpf(value) for value in MEASUREMENT.values()]
            values[i] += sign * step
            sides.append(exact_outputs(values))
        columns.append([float((a - b) / (2 * step)) for a, b in zip(*sides)])
    return np.array(columns).T


def test_derivatives_while_initialising_are_those_of_the_law_in_sixty_digits(controller: Path) -> None:
    with mpmath.workdps(60):
        exact = exact_jacobian()
    found = jacobian(controller)
    scale = np.abs(exact).max(axis=1, keepdims=True)
    assert np.abs(found - exact).max() > 0.0  # one is not computed from the other
    np.testing.assert_allclose(found / scale, exact / scale, rtol=0.0, atol=1e-12)


def test_directional_derivatives_are_differences_of_the_outputs(controller: Path) -> None:
    found, step = jacobian(controller), 1e-6

    def outputs(name: str, change: float) -> Matrix:
        instance = initialising(controller, {**MEASUREMENT, name: MEASUREMENT[name] + change})
        values = np.array(instance.get(*OUTPUTS))
        instance.free()
        return values

    differences = np.array([(outputs(name, step) - outputs(name, -step)) / (2 * step) for name in MEASUREMENT]).T
    scale = np.abs(differences).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / scale, differences / scale, rtol=0.0, atol=1e-6)


def test_between_steps_no_output_moves_with_an_input(controller: Path) -> None:
    instance = initialising(controller, MEASUREMENT)
    instance.fmu.exitInitializationMode()
    before = instance.everything()
    outputs = [instance.variables[name].valueReference for name in OUTPUTS]
    moved = instance.fmu.getDirectionalDerivative(outputs, [instance.variables["position.x"].valueReference], [1.0])
    assert moved == [0.0] * len(OUTPUTS)
    assert instance.everything() == before
    instance.free()


def test_asking_for_them_leaves_the_instance_as_it_was(controller: Path) -> None:
    plain, asked = initialising(controller, MEASUREMENT), initialising(controller, MEASUREMENT)
    asked.fmu.getDirectionalDerivative([asked.variables["thrust"].valueReference], [0], [1.0])
    for instance in (plain, asked):
        instance.fmu.exitInitializationMode()
        instance.step(START, 0.01)
    assert asked.everything() == plain.everything()
    plain.free()
    asked.free()
