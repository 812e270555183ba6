"""How a tool steps the FMUs, from the logs of traced copies."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT
from orchestration.simulation.interop.trace import Trace, log_of, read_trace, traced_copy
from quadcosim import QuadcosimError, Result, Scenario, load_run, run
from tests.orchestration.experiments.studies.common import quadcosim
from tests.orchestration.simulation.interop.common import LOOP

Values = list[float]
STEP = 0.1


class Logs:
    """Logs of a loop in which every value of a command or a measurement is a number of its own."""

    def __init__(self, folder: Path, fmus: dict[str, Path]) -> None:
        self.folder = folder
        self.fmus = fmus
        self.commands = [[100.0 + k] * 4 for k in range(6)]
        """before the first step, then after each"""
        self.measurements = [[float(k + 1)] * 13 for k in range(6)]
        self.times = [STEP * k for k in range(5)]

    def read(self, controller: list[Values] | None = None, plant: list[Values] | None = None) -> Trace:
        """The trace of steps with these inputs; default: each has what the other has computed before it."""
        controller = controller or self.measurements[:-1]
        plant = plant or self.commands[1:]
        self.write("controller", controller, self.commands)
        self.write("plant", plant, self.measurements)
        return read_trace(self.folder, self.fmus, LOOP, STEP)

    def write(self, component: str, inputs: list[Values], outputs: list[Values]) -> None:
        lines: list[dict[str, Any]] = [{"inputs": [7.0] * len(inputs[0]), "outputs": outputs[0]}]
        for t, values, put in zip(self.times, inputs, outputs[1:]):
            lines.append({"t": t, "h": STEP, "inputs": values, "outputs": put})
        log_of(component, self.folder).write_text("".join(json.dumps(line) + "\n" for line in lines))


@pytest.fixture
def logs(tmp_path: Path, built: dict[str, Path]) -> Logs:
    return Logs(tmp_path, {"controller": built["UnifiedController"], "plant": built["QuadrotorPlant"]})


# -- order ------------------------------------------------------------------------------------------------


def test_a_command_in_the_step_of_its_sample_is_gauss_seidel(logs: Logs) -> None:
    assert logs.read().order == "gauss-seidel"


def test_a_command_in_the_step_after_is_jacobi(logs: Logs) -> None:
    assert logs.read(plant=logs.commands[:-1]).order == "jacobi"


def test_the_first_step_does_not_tell_the_order(logs: Logs) -> None:
    """Zeros and start values there are another matter."""
    zeros = [[0.0] * 13, *logs.measurements[1:-1]]
    assert logs.read(controller=zeros, plant=[[0.0] * 4, *logs.commands[2:]]).order == "gauss-seidel"
    assert logs.read(controller=zeros, plant=[[0.0] * 4, *logs.commands[1:-1]]).order == "jacobi"


def test_a_command_that_is_later_still_is_another_order(logs: Logs) -> None:
    late = [logs.commands[0], logs.commands[0], *logs.commands[:3]]
    assert logs.read(plant=late).order == "other"


def test_a_measurement_that_comes_late_is_another_order(logs: Logs) -> None:
    late = [logs.measurements[0], *logs.measurements[:4]]
    assert logs.read(controller=late).order == "other"


def test_a_component_without_the_other_is_alone(logs: Logs) -> None:
    for component in ("controller", "plant"):
        logs.read()
        trace = read_trace(logs.folder, {component: logs.fmus[component]}, LOOP, STEP)
        assert trace.order == "alone"
        assert trace.first_exchange == {component: "exchanged"}
        assert trace.first_inputs.keys() == trace.initial_inputs.keys() == {component}


# -- first inputs -----------------------------------------------------------------------------------------


def test_what_the_other_one_computed_is_exchanged(logs: Logs) -> None:
    jacobi, gauss_seidel = logs.read(plant=logs.commands[:-1]), logs.read()
    assert jacobi.first_exchange == gauss_seidel.first_exchange == {"controller": "exchanged", "plant": "exchanged"}
    assert jacobi.first_inputs == {"controller": (1.0,) * 13, "plant": (100.0,) * 4}
    assert gauss_seidel.first_inputs == {"controller": (1.0,) * 13, "plant": (101.0,) * 4}


def test_the_inputs_as_initialisation_ends_are_told_apart(logs: Logs) -> None:
    assert logs.read().initial_inputs == {"controller": (7.0,) * 13, "plant": (7.0,) * 4}


def test_zeros_are_zeros(logs: Logs) -> None:
    trace = logs.read(
        controller=[[0.0] * 13, *logs.measurements[1:-1]], plant=[[0.0, 0.0, 0.0, -0.0], *logs.commands[2:]]
    )
    assert trace.first_exchange == {"controller": "zeros", "plant": "zeros"}


def test_the_start_values_of_the_fmu_are_start_values(logs: Logs) -> None:
    hover = [0.0] * 6 + [0.0, 0.0, 0.0, 1.0] + [0.0] * 3
    trace = logs.read(controller=[hover, *logs.measurements[1:-1]], plant=[[9.81, 0.0, 0.0, 0.0], *logs.commands[2:]])
    assert trace.first_exchange == {"controller": "start values", "plant": "start values"}


def test_anything_else_is_other(logs: Logs) -> None:
    trace = logs.read(plant=[[5.0] * 4, *logs.commands[2:]])
    assert trace.first_exchange == {"controller": "exchanged", "plant": "other"}


# -- time -------------------------------------------------------------------------------------------------


def test_points_on_the_grid_do_not_drift(logs: Logs) -> None:
    logs.times = [0.0, 0.1, 0.2, 0.3, 0.4]  # 0.3 is not 3 * 0.1
    trace = logs.read()
    assert (trace.steps, trace.drift, trace.end) == (5, 0.0, 0.5)


def test_a_time_that_is_added_up_drifts(logs: Logs) -> None:
    logs.times = [0.0, 0.1, 0.2, 0.1 + 0.1 + 0.1, 0.4 + 1e-12]
    trace = logs.read()
    assert trace.drift == pytest.approx(1e-12, rel=1e-3)
    assert trace.end == pytest.approx(0.5)
    logs.times[4] = 0.4 - 3e-12
    assert logs.read().drift == pytest.approx(3e-12, rel=1e-3)


@pytest.mark.parametrize("missing", ["the file", "the steps"])
def test_a_component_that_took_no_step_is_an_error(missing: str, logs: Logs) -> None:
    logs.read()
    log = log_of("plant", logs.folder)
    if missing == "the file":
        log.unlink()
    else:
        log.write_text(log.read_text().splitlines()[0] + "\n")
    with pytest.raises(
        QuadcosimError, match=r"^plant: the tool did not step it; expected at least one step in .*plant.jsonl$"
    ):
        read_trace(logs.folder, logs.fmus, LOOP, STEP)


# -- traced copies ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def traced(short: Scenario, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A folder with traced copies, and a flight of them in a process of its own, where nothing else has their names."""
    folder = tmp_path_factory.mktemp("it's {a} folder, ü")
    paths = {side: traced_copy(Path(getattr(short, side).fmu), side, LOOP.ports[side], folder) for side in LOOP.ports}
    scenario = short.with_fmus(**paths).with_changes(timing={"clock": "fmu"})
    (folder / "flight.toml").write_text(scenario.to_toml(), encoding="utf-8")
    quadcosim("run", "flight.toml", "--out", "recorded", "--no-figures", cwd=folder)
    return folder, load_run(folder / "recorded")


def test_a_traced_copy_flies_to_the_same_bits(short: Scenario, traced: tuple[Path, Result]) -> None:
    expected = run(short.with_changes(timing={"clock": "fmu"}))
    assert traced[1].columns == expected.columns
    assert traced[1].rows.tobytes() == expected.rows.tobytes()


def test_a_traced_copy_writes_down_what_it_is_given_and_what_it_gives(traced: tuple[Path, Result]) -> None:
    folder, result = traced
    motion = np.column_stack([result.signals[f"plant.{name}"] for name in MEASUREMENT])
    command = np.column_stack([result.signals[f"controller.{name}"] for name in COMMAND])
    recorded = {"controller": (motion[:-1], command[:-1]), "plant": (command[:-1], motion[1:])}
    for component, (inputs, outputs) in recorded.items():
        start, *steps = map(json.loads, log_of(component, folder).read_text().splitlines())
        assert [(step["t"], step["h"]) for step in steps] == [(k / 100, 0.01) for k in range(20)]
        assert np.array([step["inputs"] for step in steps]).tobytes() == inputs.tobytes()
        assert np.array([step["outputs"] for step in steps]).tobytes() == outputs.tobytes()
        assert start["inputs"] == inputs[0].tolist()
