"""The guides work: commands and programs are taken out of the pages and run, with nothing but the FMUs beside them.

Of the pages for tools that are not to be had here, the names, the numbers of ports and the connections are checked.
"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import types
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unittest.mock import MagicMock

import fmpy
import numpy as np
import pytest

from orchestration.components.building import fmus
from orchestration.components.checks.doctor.machine import this_machine
from orchestration.components.checks.doctor.verdict import INSTALL_LIBPYTHON, satisfies
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT
from orchestration.simulation.requests.ssp import writing
from quadcosim import run
from tests.extent import in_test_all
from tests.fmus.expected import law_command
from tests.fmus.making import PAIR
from tests.native import NATIVE

GUIDES = Path(__file__).parent.parent.parent / "docs" / "guides"
POSITION = [f"plant.position.{axis}" for axis in "xyz"]


class Block(NamedTuple):
    """A fenced block of a page: its language, the file name after it, its text."""

    language: str
    name: str
    text: str


def blocks(page: str) -> list[Block]:
    """All fenced blocks, in order."""
    text = (GUIDES / page).read_text(encoding="utf-8")
    return [Block(*found) for found in re.findall(r"^```(\w+) ?(\S*)\n(.*?)^```$", text, re.S | re.M)]


BLOCKER = """
import sys

class _Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {packages}:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, _Blocker())
"""
"""A `sitecustomize` that takes this project's packages, and pythonfmu, away from a program."""

HIDDEN = ("fmu_kit", "controller_fmu", "plant_fmu", "orchestration", "pythonfmu")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, built: dict[str, Path]) -> Path:
    """Both FMUs, and nothing else of this project; the plant, which steps most, is the native one."""
    folder = tmp_path_factory.mktemp("guide")
    for path in (fmus.locate("native/QuadrotorPlant"), built["UnifiedController"]):
        shutil.copy(path, folder)
    return folder


@pytest.fixture
def native_folder(tmp_path: Path) -> Path:
    """Both native FMUs and the SSP of them, and nothing else of this project."""
    for model in PAIR:
        shutil.copy(fmus.locate(f"native/{model}"), tmp_path)
    writing.write(NATIVE, tmp_path / "QuadrotorLoop.ssp")
    return tmp_path


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment with the tools but without this project."""
    site = tmp_path_factory.mktemp("site")
    (site / "sitecustomize.py").write_text(BLOCKER.format(packages=HIDDEN), encoding="utf-8")
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    return {**os.environ, "PYTHONPATH": str(site), "PATH": path, "MPLBACKEND": "Agg"}


def follow(page: str, folder: Path, environment: dict[str, str]) -> dict[str, str]:
    """Follow the page in order; returns the output of each program and command."""
    printed = {}
    for block in blocks(page):
        if block.name:
            (folder / block.name).write_text(block.text, encoding="utf-8")
        commands = {
            "python": [[sys.executable, block.name]],
            "sh": [line.split() for line in block.text.splitlines()],
        }.get(block.language, [])
        for command in commands:
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, errors="replace", check=False
            )
            assert done.returncode == 0, f"{command}:\n{done.stdout}\n{done.stderr}"
            printed[block.name or " ".join(command)] = done.stdout
    return printed


def positions(printed: dict[str, str], program: str) -> list[float]:
    """The numbers after `position:`."""
    line = next(line for line in printed[program].splitlines() if line.startswith("position:"))
    return [float(number) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", line)]


def test_a_program_under_the_blocker_cannot_import_this_project(folder: Path, environment: dict[str, str]) -> None:
    for package in HIDDEN:
        done = subprocess.run(
            [sys.executable, "-c", f"import {package}"], cwd=folder, env=environment, check=False, capture_output=True
        )
        assert done.returncode == 1, package


@in_test_all
def test_the_fmpy_guide_flies_the_papers_scenario(folder: Path, environment: dict[str, str]) -> None:
    printed = follow("fmpy.md", folder, environment)
    assert printed["fly_paper.py"].startswith("position error at the end: 0.00127")
    flight = np.genfromtxt(folder / "flight.csv", delimiter=",", names=True, deletechars="")
    own = run(replace(NATIVE, timing=Timing(clock="fmu"))).signals
    assert len(flight) == 30_000
    assert flight.dtype.names is not None
    for name in flight.dtype.names[1:18]:
        assert np.abs(flight[name] - own[f"plant.{name}"][:-1]).max() < 1e-9, name
    for table, rows in (("fall.csv", 2001), ("heavier.csv", 201), ("step.csv", 2001), ("commands.csv", 501)):
        assert len((folder / table).read_text().splitlines()) == rows + 1, table
    heavier = np.genfromtxt(folder / "heavier.csv", delimiter=",", names=True, deletechars="")
    assert heavier["position.z"][0] == -3.0
    step = np.genfromtxt(folder / "step.csv", delimiter=",", names=True, deletechars="")
    assert step["angular_velocity.x"][500] == 0.0  # the torque comes at 0.5 s, and not before
    assert step["angular_velocity.x"][-1] == pytest.approx(0.01 * 1.5, rel=1e-6)
    assert (folder / "flight.png").is_file()


@in_test_all
def test_the_ssp_guide_flies_the_same_file_in_three_tools_and_the_container(
    native_folder: Path, environment: dict[str, str]
) -> None:
    printed = follow("ssp.md", native_folder, environment)
    late = run(replace(NATIVE, timing=Timing(clock="fmu", delay=0.001)))
    expected = [late.signals[name][-1] for name in POSITION]
    for program in ("libcosim.py", "ecos.py", "fmpy_ssp.py"):
        assert positions(printed, program) == pytest.approx(expected, abs=1e-9), program
    at_once = run(replace(NATIVE, timing=Timing(clock="fmu"))).signals
    container = np.genfromtxt(native_folder / "loop.csv", delimiter=",", names=True, deletechars="")
    for name in POSITION:
        assert np.abs(container[name.removeprefix("plant.")] - at_once[name]).max() < 1e-9, name


def run_c_guide(folder: Path, environment: dict[str, str]) -> list[float]:
    """What its script prints, with the controller that is in the folder."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: install one that is called cc (Debian and Ubuntu: apt install gcc libc6-dev)")
    shutil.copy(GUIDES / "host.c", folder)
    (block,) = (block for block in blocks("c_host.md") if block.name == "fly.sh")
    done = subprocess.run(
        ["bash", "-c", block.text], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return [float(line) for line in done.stdout.splitlines()]


def commanded() -> list[float]:
    """The command of the law at the end of that flight."""
    measurement = {"position.z": 2.0, "velocity.x": 0.6, "quaternion.w": 1.0}
    return law_command(0.99, {name: measurement.get(name, 0.0) for name in MEASUREMENT})


def test_the_c_guide_compiles_and_flies_the_native_controller_without_any_python(
    environment: dict[str, str], tmp_path: Path
) -> None:
    shutil.copy(fmus.locate("native/UnifiedController"), tmp_path)
    assert run_c_guide(tmp_path, environment) == pytest.approx(commanded(), rel=1e-12)


def test_the_c_guide_flies_the_controller_with_python_inside(folder: Path, environment: dict[str, str]) -> None:
    library = next((found for found in this_machine(()).python_libraries if satisfies(found.version, ">=3.10")), None)
    if library is None:
        pytest.skip(f"no shared libpython of 3.10 or later: {INSTALL_LIBPYTHON}")
    host = {**environment, "LIBPYTHON": str(library.path)}
    if library.home is not None:
        host["PYTHONHOME"] = str(library.home)
    assert run_c_guide(folder, host) == pytest.approx(commanded(), rel=1e-12)


# -- tools that are not to be had here --------------------------------------------------------------------

NOT_RUN = "other_tools.md"
CONNECTIONS = {
    *((f"plant.{name}", f"controller.{name}") for name in MEASUREMENT),
    *((f"controller.{name}", f"plant.{name}") for name in COMMAND),
}


def ports(fmu: Path, causality: str) -> list[str]:
    """Names of inputs or outputs, in the order of the description."""
    return [v.name for v in fmpy.read_model_description(str(fmu)).modelVariables if v.causality == causality]


def program(page: str, name: str) -> str:
    """The text of a block."""
    return next(block.text for block in blocks(page) if block.name == name)


def test_a_page_says_at_its_top_that_we_have_not_run_it_and_so_does_the_overview() -> None:
    overview = (GUIDES.parents[1] / "fmus" / "README.md").read_text(encoding="utf-8")
    for page in sorted(path.name for path in GUIDES.glob("*.md")):
        top = (GUIDES / page).read_text(encoding="utf-8").split("\n\n")[1]
        assert top.startswith("**Not run by our tests") == (page == NOT_RUN), page
        (row,) = (line for line in overview.splitlines() if line.startswith("|") and f"/{page})" in line)
        assert row.split("|")[3].strip().startswith("no" if page == NOT_RUN else "yes"), page


def test_the_simulink_script_counts_the_ports_as_they_are(built: dict[str, Path]) -> None:
    text = (GUIDES / "build_loop.m").read_text(encoding="utf-8")
    plant, controller = built["QuadrotorPlant"], built["UnifiedController"]
    spans = {line: (int(a) - 1, int(b)) for line, a, b in re.findall(r"^(for k = (\d+):(\d+))", text, re.M)}
    state, command, force, reference = spans.values()
    assert ports(plant, "output")[slice(*state)] == ports(controller, "input")[slice(*state)] == list(MEASUREMENT)
    assert ports(controller, "output")[slice(*command)] == ports(plant, "input")[slice(*command)] == list(COMMAND)
    assert ports(plant, "input")[slice(*force)] == [f"external_force.{axis}" for axis in "xyz"]
    assert force[1] == len(ports(plant, "input"))
    assert all(name.startswith("reference.") for name in ports(controller, "input")[slice(*reference)])
    assert reference[1] == len(ports(controller, "input"))


def test_the_simulink_gains_are_all_of_them(built: dict[str, Path]) -> None:
    gains = [
        v.name
        for v in fmpy.read_model_description(str(built["UnifiedController"])).modelVariables
        if v.name.startswith("gain.")
    ]
    text = program(NOT_RUN, "set_gain.m")
    read = re.findall(r"[ ,](gain\.[a-z.]+)", text[text.index("set_param") :])
    assert read == gains


def test_the_omsimulator_2_script_makes_every_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    oms = MagicMock()
    module = types.ModuleType("OMSimulator")
    monkeypatch.setattr(module, "OMSimulator", lambda: oms, raising=False)
    monkeypatch.setitem(sys.modules, "OMSimulator", module)
    exec(program(NOT_RUN, "fly_omsimulator_2.py"), {})
    made = {tuple(end.removeprefix("loop.root.") for end in call.args) for call in oms.addConnection.call_args_list}
    assert made == CONNECTIONS


def test_the_omsimulator_3_script_sets_the_step_of_an_instantiated_model_before_it_is_initialised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened = MagicMock()
    module = types.ModuleType("OMSimulator")
    monkeypatch.setattr(module, "SSP", opened, raising=False)
    monkeypatch.setitem(sys.modules, "OMSimulator", module)
    exec(program(NOT_RUN, "fly_omsimulator_3.py"), {})
    opened.assert_called_once_with("QuadrotorLoop.ssp")
    made = opened.return_value.instantiate.return_value.method_calls
    assert [call[0] for call in made][:3] == ["setFixedStepSize", "setResultFile", "initialize"]
    assert made[0].args == (0.01,)


def test_the_modelica_model_gives_every_input_an_equation_once(built: dict[str, Path]) -> None:
    text = (GUIDES / "Loop.mo").read_text(encoding="utf-8")
    flat = {(a.replace(".", "_"), b.replace(".", "_")) for a, b in CONNECTIONS}
    made = [(a.replace(".", "_"), b.replace(".", "_")) for a, b in re.findall(r"connect\((\S+), (\S+)\);", text)]
    assert sorted(made) == sorted(flat)
    zeros = {name.replace(".", "_", 1) for name in re.findall(r"^  (\S+) = 0;", text, re.M)}
    inputs = {
        f"{element}_{name.replace('.', '_')}"
        for element, model in (("plant", "QuadrotorPlant"), ("controller", "UnifiedController"))
        for name in ports(built[model], "input")
    }
    assert zeros == inputs - {end for _, end in flat}
