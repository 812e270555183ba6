"""Each FMU alone under the `fmpy` command, as people try an FMU first."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestration.foundation.basics.simulator import Floats
from tests.extent import sample
from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.making import PAIR
from tests.fmus.process import run

LEVEL = {"initial.quaternion.x": 0.0, "initial.quaternion.y": 0.0, "initial.quaternion.z": 0.0}
CALM = {f"wind.amplitude.{axis}": 0.0 for axis in "xyz"}
MOTION = (
    *(f"{name}.{axis}" for name in ("position", "velocity") for axis in "xyz"),
    *(f"quaternion.{axis}" for axis in "xyzw"),
    *(f"angular_velocity.{axis}" for axis in "xyz"),
)


def simulate(
    fmu: Path, folder: Path, outputs: tuple[str, ...], starts: dict[str, float], *options: str
) -> dict[str, Floats]:
    """The columns that `fmpy simulate` writes."""
    table = folder / "out.csv"
    pairs = [text for name, value in starts.items() for text in (name, repr(value))]
    arguments = ["--output-file", str(table), "--output-variables", *outputs, *options]
    if pairs:
        arguments += ["--start-values", *pairs]
    done = run(sys.executable, "-m", "fmpy", "simulate", str(fmu), *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    names = [name.strip('"') for name in table.read_text().splitlines()[0].split(",")]
    return dict(zip(names, np.loadtxt(table, delimiter=",", skiprows=1).T, strict=True))


@pytest.mark.parametrize("model", sample([*PAIR], 1))
def test_fmpy_validate_accepts_the_fmu(model: str, built: dict[str, Path]) -> None:
    done = run(sys.executable, "-m", "fmpy", "validate", str(built[model]))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "No problems found" in done.stdout


@pytest.mark.parametrize(("model", "outputs"), sample([("QuadrotorPlant", MOTION), ("UnifiedController", COMMAND)], 1))
def test_fmpy_simulates_the_default_experiment(
    model: str, outputs: tuple[str, ...], built: dict[str, Path], tmp_path: Path
) -> None:
    table = simulate(built[model], tmp_path, outputs, {})
    assert set(table) == {"time", *outputs}
    assert table["time"][-1] == pytest.approx(30.0)
    assert all(np.isfinite(column).all() for column in table.values())
    assert any(np.ptp(table[name]) > 0.1 for name in outputs)  # it does something


def test_the_controller_follows_its_own_trajectory(built: dict[str, Path], tmp_path: Path) -> None:
    table = simulate(
        built["UnifiedController"], tmp_path, COMMAND, MEASUREMENT, "--stop-time", "5", "--output-interval", "0.05"
    )
    commands = np.column_stack([table[name] for name in COMMAND])
    assert commands[0] == pytest.approx(law_command(0.0), rel=1e-12)
    # The row at t is what was held over the step that ended there: the command of the row before.
    for row in (1, 40, 100):
        assert commands[row] == pytest.approx(law_command(table["time"][row - 1]), rel=1e-12)
    assert np.ptp(commands, axis=0).min() > 1e-3  # a command that stood still would prove nothing


def test_the_controller_holds_its_command_between_samples(built: dict[str, Path], tmp_path: Path) -> None:
    starts = {**MEASUREMENT, "sample_period": 0.5}
    table = simulate(
        built["UnifiedController"], tmp_path, COMMAND, starts, "--stop-time", "2", "--output-interval", "0.1"
    )
    commands = np.column_stack([table[name] for name in COMMAND])
    # Sampled at 0, 0.5, 1, 1.5: the rows after them hold those commands.
    for first, t in ((1, 0.0), (6, 0.5), (11, 1.0), (16, 1.5)):
        for row in range(first, first + 5):
            assert commands[row] == pytest.approx(law_command(t), rel=1e-9), f"row {row}"


def test_the_level_plant_hovers_at_hover_thrust(built: dict[str, Path], tmp_path: Path) -> None:
    starts = {**LEVEL, **CALM, "initial.quaternion.w": 1.0, "mass": 1.5, "thrust": 1.5 * 9.81}
    table = simulate(built["QuadrotorPlant"], tmp_path, MOTION, starts, "--stop-time", "2")
    for name in MOTION:
        assert table[name] == pytest.approx(1.0 if name == "quaternion.w" else 0.0, abs=1e-12), name


def test_the_plant_falls_by_half_g_t_squared_without_thrust(built: dict[str, Path], tmp_path: Path) -> None:
    starts = {**LEVEL, **CALM, "initial.quaternion.w": 1.0, "thrust": 0.0}
    table = simulate(built["QuadrotorPlant"], tmp_path, MOTION, starts, "--stop-time", "2", "--output-interval", "0.1")
    assert len(table["time"]) == 21
    assert table["position.z"] == pytest.approx(0.5 * 9.81 * table["time"] ** 2, rel=1e-12)
    assert table["velocity.z"] == pytest.approx(9.81 * table["time"], rel=1e-12)
    assert table["position.x"] == pytest.approx(0.0, abs=1e-15)


def test_thrust_points_along_minus_z_of_the_body(built: dict[str, Path], tmp_path: Path) -> None:
    # Rolled to the right by 90 degrees: -z of the body is east.
    half = math.sqrt(0.5)
    starts = {**LEVEL, **CALM, "initial.quaternion.x": half, "initial.quaternion.w": half, "thrust": 3.0}
    table = simulate(built["QuadrotorPlant"], tmp_path, MOTION, starts, "--stop-time", "1", "--output-interval", "0.1")
    assert table["position.y"] == pytest.approx(0.5 * 3.0 * table["time"] ** 2, rel=1e-12, abs=1e-12)
    assert table["position.x"] == pytest.approx(0.0, abs=1e-12)


def test_fmpy_simulate_fails_and_tells_why_when_a_parameter_is_out_of_range(
    built: dict[str, Path], tmp_path: Path
) -> None:
    arguments = ["--fmi-logging", "--debug-logging", "--start-values", "mass", "-1"]
    done = run(sys.executable, "-m", "fmpy", "simulate", str(built["QuadrotorPlant"]), *arguments)
    assert done.returncode == 1
    assert "mass = -1.0: expected a finite value > 0" in done.stdout + done.stderr
