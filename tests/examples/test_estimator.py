"""Sensors and a Kalman filter in the loop: the filter's derivatives, and flights with its estimate."""

import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import quadcosim
from fmu_kit.algebra import Quaternion, Vec3
from quadcosim import System
from tests.extent import in_test_all
from tests.native import assert_the_same
from tests.orchestration.components.fmi.small import needs_compiler
from tests.places import EXAMPLES

FOLDER = EXAMPLES / "estimator"
QUIET = {
    **{f"connections.inertial.noise.{name}": 0.0 for name in ("specific_force", "angular_velocity", "north")},
    **{f"connections.fixes.noise.{name}": 0.0 for name in ("position", "velocity")},
}


@pytest.fixture(scope="module")
def system() -> System:
    return quadcosim.load_system(FOLDER / "flight.toml")


@pytest.fixture
def law(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The filter, somewhere on its way, and hardly any noise in what it believes."""
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.delitem(sys.modules, "filter", raising=False)
    import filter  # type: ignore[import-not-found]

    made = filter.KalmanFilter()
    made.force_noise = made.rate_noise = 1e-12
    made.position_deviation = made.velocity_deviation = made.attitude_deviation = 1.0
    made.specific_force = Vec3(1.0, -2.0, -9.0)
    yield made
    sys.modules.pop("filter")


START = Quaternion(Vec3(0.2, 0.3, -0.1), 0.9).unit()


def predicted(law: Any, error: np.ndarray) -> tuple[np.ndarray, Quaternion]:
    """Position and velocity, and the attitude, after 5 ms from a start that is off by an error."""
    law.position, law.velocity = Vec3(*error[:3]), Vec3(*error[3:6])
    law.quaternion = (START * Quaternion(0.5 * Vec3(*error[6:]), 1.0)).unit()
    law.initialise(0.0)
    law._predict(Vec3(0.5, 1.0, -0.7), 0.005)
    return np.array([*law.position, *law.velocity]), law.quaternion


def test_the_covariance_follows_the_derivatives_of_the_motion(law: Any) -> None:
    """P = J Jᵀ from an identity, J by differences; what is left out is of second order in the 5 ms."""
    moved, turned = predicted(law, np.zeros(9))
    columns = []
    for unit in 1e-6 * np.eye(9):
        place, attitude = predicted(law, unit)
        rest = turned.inverse() * attitude
        columns.append(np.concatenate([place - moved, 2.0 * np.array([*rest.vector])]) / 1e-6)
    J = np.array(columns).T
    assert np.abs(np.array(law._P) - J @ J.T).max() < 2e-4
    assert np.abs(J - np.eye(9)).max() > 4e-2


@needs_compiler
def test_without_noise_the_estimate_becomes_the_truth(system: System) -> None:
    result = quadcosim.run(quadcosim.changed(system, {**QUIET, "stop_time": 10.0}))
    far = [
        np.linalg.norm(
            [result.signals[f"filter.{of}.{axis}"] - result.signals[f"plant.{of}.{axis}"] for axis in "xyz"], axis=0
        )
        for of in ("position", "velocity")
    ]
    assert far[0][0] > 0.2  # after the first fix, which it believes by half
    assert max(far[0][-1], far[1][-1]) < 0.01


@needs_compiler
def test_the_filter_flies_without_python_as_it_does_with_it(system: System) -> None:
    short = quadcosim.changed(system, {"stop_time": 0.3})
    python = {f"components.{name}.fmu": str(FOLDER / f"{fmu}.fmu") for name, fmu in SLAVES.items()}
    assert_the_same(quadcosim.run(short), quadcosim.run(quadcosim.changed(short, python)))


SLAVES = {"unit": "InertialUnit", "receiver": "Receiver", "filter": "KalmanFilter"}
ROW = re.compile(r"\| .+? \| ([\d.]+) m \| ([\d.]+) m \| ([\d.]+) m \| (\d+) N\.m \|(.*?)\|")


@in_test_all
@needs_compiler
def test_the_page_has_what_its_commands_print(system: System) -> None:
    rows = ROW.findall((FOLDER / "README.md").read_text(encoding="utf-8"))
    assert len(rows) == 5
    for *numbers, added in rows:
        changes = dict(setting.split("=") for setting in re.findall(r"--set (\S+?=[\d.]+)", added))
        simulated = quadcosim.changed(system, {path: float(value) for path, value in changes.items()})
        found: dict[str, Any] = quadcosim.run(simulated).metrics
        names = ("position_rmse", "ultimate_bound", "estimate_rmse")
        assert [f"{found[name]:.3f}" for name in names] == numbers[:3]
        assert f"{found['torque_variation']:.0f}" == numbers[3]
