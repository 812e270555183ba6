"""What the program for cofmupy does, with a Python that has numpy and a few lines in place of cofmupy."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.simulation.interop import tools
from orchestration.simulation.interop.catalogue import TOOLS
from orchestration.simulation.interop.job import Job
from orchestration.simulation.interop.tool_runs import parameters_for
from orchestration.simulation.requests.ssp.export import Part, export_of
from quadcosim import Scenario, UsageError
from tests.orchestration.simulation.interop.common import LOOP

COORDINATOR = """
import json

class Coordinator:
    def start(self, configuration):
        self.configuration, self.master = configuration, self

    def run_simulation(self, step_size, end_time):
        self.times = [k * step_size for k in range(round(end_time / step_size))]

    def get_results(self):
        print(json.dumps([self.configuration, self.sequence_order]))
        outputs = {(c["source"]["id"], c["source"]["variable"]) for c in self.configuration["connections"]}
        return {"time": self.times, **{output: [7.0] * len(self.times) for output in outputs}}
"""
"""A stub of cofmupy's: it prints its configuration."""

RUN = "import runpy, sys; sys.path.insert(0, sys.argv.pop(1)); runpy.run_path(sys.argv.pop(1), run_name='__main__')"


def run_by(name: str, folder: Path) -> tuple[dict[str, Any], list[list[str]], Any]:
    """The configuration, the order of the FMUs, and the rows."""
    (folder / "cofmupy.py").write_text(COORDINATOR)
    job = Job(
        fmus={name: folder / name for name in LOOP.ports},
        ssp=folder / "ssp",
        recorded=folder / "recorded",
        folder=folder / "folder",
        connections=LOOP.connections,
        signals=LOOP.signals,
        step=0.01,
        stop=0.1,
        parameters={"controller": {"gain.eta": 9.0}, "plant": {}},
    )
    (folder / "job.json").write_text(job.to_json())
    script, function = Path(str(tools.__path__[0])) / "cofmupy.py", TOOLS[name].call.partition(":")[2]
    arguments = [folder, script, function, folder / "job.json", folder / "rows.npy"]
    done = subprocess.run(
        [sys.executable, "-I", "-c", RUN, *map(str, arguments)], capture_output=True, text=True, check=True
    )
    configuration, order = json.loads(done.stdout)
    return configuration, order, np.load(folder / "rows.npy")


@pytest.mark.parametrize(("name", "method"), [("cofmupy", "jacobi"), ("cofmupy gauss_seidel", "gauss_seidel")])
def test_cofmupy_is_given_the_whole_loop_and_steps_the_controller_first(name: str, method: str, tmp_path: Path) -> None:
    configuration, order, _ = run_by(name, tmp_path)
    assert configuration["cosim_method"] == method
    assert order == [["controller", "plant"]]
    assert {fmu["id"]: (fmu["path"], fmu["initialization"]) for fmu in configuration["fmus"]} == {
        "controller": (str(tmp_path / "controller"), {"gain.eta": 9.0}),
        "plant": (str(tmp_path / "plant"), {}),
    }
    made = {
        ((connection["source"]["id"], connection["source"]["variable"]), (end["id"], end["variable"]))
        for connection in configuration["connections"]
        for end in connection["target"]
    }
    assert made == set(LOOP.connections)


def test_its_rows_have_the_time_at_the_end_of_each_step(tmp_path: Path) -> None:
    _, _, rows = run_by("cofmupy", tmp_path)
    assert rows.shape == (10, 1 + len(LOOP.signals))
    assert rows[:, 0] == pytest.approx(0.01 * np.arange(1, 11))
    assert (rows[:, 1:] == 7.0).all()


def part(name: str, **parameters: float) -> Part:
    """A component of the paper's flight, with some parameters of its own."""
    scenario = Scenario().with_changes(
        parameters={f"{name}.{variable}": value for variable, value in parameters.items()}
    )
    return next(part for part in export_of(scenario).parts if part.name == name)


def test_a_parameter_that_is_no_real_is_left_where_it_starts() -> None:
    controller = part("controller", coupling=2.0)
    assert controller.parameters["stages"] == 3
    assert parameters_for(TOOLS["ecos"], controller) == controller.parameters
    reals = parameters_for(TOOLS["cofmupy"], controller)
    assert controller.parameters.keys() - reals.keys() == {
        "stages",
        "discretisation_index",
        "gain_scaling_index",
        "frame_index",
    }
    assert reals["coupling"] == 2.0


def test_a_parameter_that_is_no_real_and_is_changed_is_refused() -> None:
    with pytest.raises(UsageError, match=r"cofmupy: controller.stages = 2: it sets .* type Real only; expected 3"):
        parameters_for(TOOLS["cofmupy"], part("controller", stages=2))
