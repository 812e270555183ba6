"""The scenario files with references and disturbances give the results of their page."""

from pathlib import Path

import numpy as np
import pytest

from orchestration.simulation.runs.result import Result
from orchestration.systems.signals.waypoints import read_waypoints
from quadcosim import DisturbanceChoice, ReferenceChoice, Scenario, load_scenario, run
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import located
from tests.places import EXAMPLES

pytestmark = needs_compiler
FOLDER = EXAMPLES / "references"


def simulated(scenario: Scenario) -> Result:
    return run(located(scenario.as_system()))


@pytest.mark.parametrize("name", ["lemniscate", "waypoints"])
def test_a_reference_is_followed_within_a_millimetre_in_the_end(name: str) -> None:
    result = simulated(load_scenario(FOLDER / f"{name}.toml"))
    assert result.metrics["outcome"] == "settled"
    assert result.metrics["ultimate_bound"] < 1e-3


def test_the_way_points_are_reached_and_their_limits_kept() -> None:
    curve, points = (
        read_waypoints(FOLDER / "waypoints.csv", {"acceleration": 1.5}),
        np.loadtxt(FOLDER / "waypoints.csv", delimiter=",", skiprows=1)[:, :3],
    )
    found = curve.at(np.linspace(0.0, curve.knots[-1], 5001))
    for point in points:
        assert np.linalg.norm(found[:, 0] - point, axis=1).min() < 2e-3
    assert np.linalg.norm(found[:, 1], axis=1).max() < 2.0
    assert np.linalg.norm(found[:, 2], axis=1).max() < 1.5 * (1.0 + 1e-6)


def test_gusts_move_the_vehicle_and_a_seed_repeats_them() -> None:
    scenario = load_scenario(FOLDER / "gusts.toml").with_changes(stop_time=4.0)
    once, again, other = (simulated(scenario.with_changes(seed=seed)) for seed in (7, 7, 8))
    assert once.rows.tobytes() == again.rows.tobytes()
    assert once.metrics["ultimate_bound"] != other.metrics["ultimate_bound"]
    assert once.metrics["ultimate_bound"] > 0.01


def test_the_payload_lets_the_acceleration_jump_between_two_rows_and_the_velocity_go_on() -> None:
    result = simulated(load_scenario(FOLDER / "payload.toml").with_changes(stop_time=5.1))
    t, a = result.signals["time"], result.signals["plant.acceleration.z"]
    before, after = np.searchsorted(t, [5.0 - 1e-9, 5.001 - 1e-9])
    lift = 1.2 * (a[before] - 9.81)
    assert a[after] - a[before] == pytest.approx(lift * (1.0 / 1.0 - 1.0 / 1.2), rel=1e-3)
    v = result.signals["plant.velocity.z"]
    assert v[after] - v[before] == pytest.approx(0.0005 * (a[before] + a[after]), abs=1e-6)


def test_files_of_points_with_times_and_of_one_gust_are_flown_together() -> None:
    logged, gust = (Path(FOLDER / name) for name in ("logged.csv", "gust.csv"))
    result = simulated(
        Scenario(
            stop_time=5.0,
            reference=ReferenceChoice(file=logged),
            disturbance=DisturbanceChoice(file=gust, drag=0.2),
        )
    )
    at = int(np.searchsorted(result.signals["time"], 4.6))
    assert result.signals["disturbance.external_force.x"][at] == pytest.approx(1.2)
    assert result.signals["plant.position.x"][at] > result.signals["reference.position.x"][at]
