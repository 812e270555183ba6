import math
from pathlib import Path

import numpy as np
import pytest

from fmu_kit.trajectory import Trajectory
from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.translation import ReferenceChoice
from orchestration.quadrotor.scenarios.wiring import REFERENCE
from orchestration.systems.system.starts import Starts

TRAJECTORY = Trajectory()
PAPER = Scenario()
STARTS = Starts(count=64, position=4.0, velocity=2.0, angle=2.0, rate=3.0)


def vector(start, name, axes="xyz"):
    return np.array([start.values[f"plant.initial.{name}.{axis}"] for axis in axes])


def test_sizes_are_spread_evenly():
    sizes = sorted(start.size for start in PAPER.initial_conditions(STARTS))
    assert sizes == pytest.approx([(i + 1) / 64 for i in range(64)])


def test_every_error_is_its_share_of_the_largest():
    reference = TRAJECTORY.at(0.0)
    for start in PAPER.initial_conditions(STARTS):
        assert np.linalg.norm(vector(start, "position") - [*reference.position]) == pytest.approx(4.0 * start.size)
        assert np.linalg.norm(vector(start, "velocity") - [*reference.velocity]) == pytest.approx(2.0 * start.size)
        assert np.linalg.norm(vector(start, "angular_velocity")) == pytest.approx(3.0 * start.size)
        quaternion = vector(start, "quaternion", "xyzw")
        assert np.linalg.norm(quaternion) == pytest.approx(1.0)
        assert 2.0 * math.acos(quaternion[3]) == pytest.approx(2.0 * start.size)


TABLE = [7.0, -8.0, 9.0, 0.5, -0.25, 0.125]
FOLLOWED = {
    "circle": (
        ReferenceChoice(name="circle", parameters={"radius": 3.0, "x": 50.0, "y": 1.0, "z": -2.0}),
        [50.0, 1.0, -2.0], [0.0] * 3,
    ),
    "paper": (
        ReferenceChoice(name="paper", parameters={"start_z": -10.0}), [0.0, 0.0, -10.0], TRAJECTORY.at(0.0).velocity
    ),
    "points": (ReferenceChoice(file=Path("points.csv")), [1.0, 2.0, 3.0], [0.0] * 3),
    "table": (ReferenceChoice(file=Path("table.csv")), TABLE[:3], TABLE[3:]),
}  # fmt: skip


@pytest.mark.parametrize(("reference", "position", "velocity"), FOLLOWED.values(), ids=FOLLOWED)
def test_starts_lie_around_the_beginning_of_what_is_followed(reference, position, velocity, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text("time,x,y,z\n0,1,2,3\n4,5,2,3\n8,5,6,3\n")
    rows = [[0.0, *TABLE, *[0.0] * 9], [30.0, *[0.0] * 15]]
    lines = [",".join(["time", *REFERENCE]), *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "table.csv").write_text("\n".join(lines))
    for start in Scenario(reference=reference).initial_conditions(Starts(count=8, position=4.0, velocity=2.0)):
        assert np.linalg.norm(vector(start, "position") - position) == pytest.approx(4.0 * start.size)
        assert np.linalg.norm(vector(start, "velocity") - [*velocity]) == pytest.approx(2.0 * start.size)


def test_directions_are_those_of_a_sphere():
    directions = np.array(
        [vector(s, "angular_velocity") / (3.0 * s.size) for s in PAPER.initial_conditions(Starts(count=2000, rate=3.0))]
    )
    assert np.abs(directions.mean(axis=0)).max() < 0.05
    assert np.abs(directions.T @ directions / 2000 - np.eye(3) / 3).max() < 0.03


def test_more_starts_leave_the_first_ones_as_they_are():
    assert PAPER.initial_conditions(Starts(count=100))[:10] == PAPER.initial_conditions(Starts(count=10))
    assert PAPER.initial_conditions(Starts(count=100))[50:60] == PAPER.initial_conditions(Starts(count=10, first=50))


def test_another_seed_gives_other_directions():
    one, other = (PAPER.initial_conditions(Starts(count=1, seed=seed))[0] for seed in (0, 1))
    assert one.size == other.size
    assert one.values != other.values


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"count": 0}, "starts.count = 0: expected a whole number from 1"),
        ({"angle": 4.0}, "starts.angle = 4.0: expected a number from 0 to 3.14159"),
        ({"rate": math.nan}, "starts.rate = nan: expected a number from 0"),
    ],
)
def test_invalid_values_are_refused_by_name(given, named):
    with pytest.raises(UsageError) as error:
        Starts(**given)
    assert str(error.value) == named
