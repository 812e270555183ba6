"""What the files around the code say of it is so: versions, make targets, paths, Pythons."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from docs import make_architecture
from orchestration.foundation.basics.documents import read_toml
from tests.conftest import LONGEST
from tests.places import ROOT

SETTINGS = read_toml(ROOT / "pyproject.toml", "project")
PROJECT = SETTINGS["project"]
WORKFLOW = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
JOBS = WORKFLOW["jobs"]
STEPS = [step for job in JOBS.values() for step in job["steps"]]
RUN = " ".join(step.get("run", "") for step in STEPS)
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))


def test_the_version_is_cited_and_has_a_place_in_the_changelog() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == PROJECT["version"]
    assert cited["license"] == PROJECT["license"]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{PROJECT['version']}]" in changes


@pytest.mark.parametrize(
    "named",
    [re.findall(r"\bmake ([a-z-]+)", RUN), re.findall(r"`make ([a-z-]+)`", CONTRIBUTING)],
    ids=["workflow", "contributing"],
)
def test_every_make_target_that_is_named_exists(named: list[str]) -> None:
    assert len(set(named)) >= 3
    assert set(named) <= TARGETS


@pytest.mark.parametrize("text", [RUN, CONTRIBUTING, ARCHITECTURE], ids=["workflow", "contributing", "architecture"])
def test_every_path_that_is_named_exists(text: str) -> None:
    folders = "tests|docs|orchestration|controller_fmu|plant_fmu|fmu_kit|examples"
    named = set(re.findall(rf"(?<![\w/.-])(?:{folders})/[\w./-]*\w", text))
    assert len(named) >= 3
    assert not [path for path in named if not (ROOT / path).exists()]


def test_the_tests_that_begin_first_are_there() -> None:
    assert [name for name in LONGEST if not (ROOT / "tests" / name).is_file()] == []


def test_the_architecture_shows_the_districts_and_rooms_that_there_are() -> None:
    assert make_architecture.page(ARCHITECTURE) == ARCHITECTURE
    for package, floors in make_architecture.layers().items():
        rooms = {path.parent.name for path in (ROOT / package.replace(".", "/")).glob("*/__init__.py")}
        assert {name for floor in floors for name in floor} >= rooms


@pytest.mark.parametrize("broken", ["a folder that is not listed", "a late import upward"])
def test_a_tree_that_breaks_the_contract_does_not_pass(broken: str, tmp_path: Path) -> None:
    """The contract is tried on a copy of the tree that breaks it."""
    for name in ("quadcosim", "fmu_kit", "controller_fmu", "plant_fmu", "orchestration"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    if broken == "a folder that is not listed":
        said = "attic"
        (tmp_path / "orchestration/attic").mkdir()
        (tmp_path / "orchestration/attic/__init__.py").touch()
    else:
        said = "orchestration.simulation is not allowed to import orchestration.quadrotor"
        with (tmp_path / "orchestration/simulation/figures/lines.py").open("a") as file:
            file.write("\n\ndef late() -> None:\n    import orchestration.quadrotor.scenarios.wiring\n")
    done = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert said in done.stdout


def test_the_quick_tests_exist() -> None:
    quick = re.search(r"^QUICK := (.*?)\n\n", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M | re.S)
    assert quick is not None
    groups = re.findall(r"addprefix ([\w/]+),([^)]*)\)", quick[1])
    named = [(prefix + name).partition("::") for prefix, names in groups for name in names.replace("\\", " ").split()]
    assert len(named) > 10
    assert not [path for path, _, _ in named if not (ROOT / path).exists()]
    assert not [test for path, _, test in named if test and f"def {test}(" not in (ROOT / path).read_text("utf-8")]


def test_every_python_from_the_oldest_on_is_tried() -> None:
    oldest = PROJECT["requires-python"].removeprefix(">=")
    tried = JOBS["check"]["strategy"]["matrix"]["python"]
    assert tried[0] == oldest
    assert tried == [f"3.{minor}" for minor in range(int(oldest.partition(".")[2]), 15)]
    said = {line.rpartition(":: ")[2] for line in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", line)}
    assert said == set(tried)


def test_actions_are_pinned_to_commits_and_nothing_may_be_written() -> None:
    used = [step["uses"] for step in STEPS if "uses" in step]
    assert used
    assert all(re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action) for action in used)
    assert WORKFLOW["permissions"] == {"contents": "read"}


def test_hooks_call_the_tools_of_the_environment_as_make_does() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0]["hooks"]
    tools = {hook["entry"].removeprefix(".venv/bin/").partition(" --")[0] for hook in hooks}
    lint = re.search(r"^lint:.*?\n\n", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M | re.S)
    assert lint is not None
    assert tools == set(re.findall(r"\$\(BIN\)/([a-z-]+(?: [a-z]+)?)", lint[0]))
