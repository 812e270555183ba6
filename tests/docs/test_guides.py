"""The guides work: commands and programs are taken out of the pages and run, with nothing but the FMUs beside them."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from orchestration import ssp
from orchestration.flight import run
from orchestration.scenario import Scenario
from orchestration.timing import Timing

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
    """Both FMUs and the SSP, and nothing else of this project."""
    folder = tmp_path_factory.mktemp("guide")
    for path in built.values():
        shutil.copy(path, folder)
    ssp.write(
        Scenario().with_fmus(plant=built["QuadrotorPlant"], controller=built["UnifiedController"]),
        folder / "QuadrotorLoop.ssp",
    )
    return folder


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Of somebody who has the tools but not this project."""
    site = tmp_path_factory.mktemp("site")
    (site / "sitecustomize.py").write_text(BLOCKER.format(packages=HIDDEN), encoding="utf-8")
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    return {**os.environ, "PYTHONPATH": str(site), "PATH": path, "MPLBACKEND": "Agg"}


def follow(page: str, folder: Path, environment: dict[str, str]) -> dict[str, str]:
    """Do what the page says, in its order; the output of each program and command."""
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


def test_the_fmpy_guide_flies_the_papers_scenario(folder: Path, environment: dict[str, str]) -> None:
    printed = follow("fmpy.md", folder, environment)
    assert printed["fly_paper.py"].startswith("position error at the end: 0.00127")
    flight = np.genfromtxt(folder / "flight.csv", delimiter=",", names=True, deletechars="")
    own = run(Scenario(timing=Timing(clock="fmu"))).signals
    assert len(flight) == 30_000
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


def test_the_ssp_guide_flies_the_same_file_in_three_tools_and_the_container(
    folder: Path, environment: dict[str, str]
) -> None:
    printed = follow("ssp.md", folder, environment)
    late = run(Scenario(timing=Timing(clock="fmu", delay=0.001)))
    expected = [late.signals[name][-1] for name in POSITION]
    for program in ("libcosim.py", "ecos.py", "fmpy_ssp.py"):
        assert positions(printed, program) == pytest.approx(expected, abs=1e-9), program
    at_once = run(Scenario(timing=Timing(clock="fmu"))).signals
    container = np.genfromtxt(folder / "loop.csv", delimiter=",", names=True, deletechars="")
    for name in POSITION:
        assert np.abs(container[name.removeprefix("plant.")] - at_once[name]).max() < 1e-9, name
