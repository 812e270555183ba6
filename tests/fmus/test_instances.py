"""Several FMUs, instances and versions in one process: each is alone with its own code."""

import sys
from pathlib import Path

import pytest

from tests.extent import sample
from tests.fmus.expected import law_command
from tests.fmus.instance import Instance
from tests.fmus.making import PAIR, Making
from tests.fmus.process import run_script
from tests.fmus.source_tree import build, copy_sources, replace


@pytest.mark.parametrize("unpacked", sample(["shared", "apart"], 1))
def test_two_instances_of_both_fmus_at_once_fly_as_if_alone(
    unpacked: str, built: dict[str, Path], alone: dict[str, list[list[str]]]
) -> None:
    together = run_script("at_once", built["QuadrotorPlant"], built["UnifiedController"], unpacked)
    assert together == alone
    assert alone["plant"][-1] != alone["plant with lag and wind"][-1]  # or the instances could not be told apart
    assert alone["controller"][-1] != alone["controller between samples"][-1]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc, which is Linux's")
@pytest.mark.parametrize("model", sample([*PAIR], 1))
def test_instances_one_after_another_leave_path_and_memory_as_they_were(
    model: str, making: Making, built: dict[str, Path]
) -> None:
    result = run_script("many_instances", built[model], "50", "10")
    assert result["path kept"]
    assert result["different flights"] == 1
    assert (result["slaves seen at most"], result["slaves left"]) == (making.slaves, 0)
    assert result["references lost"] == 0
    assert result["growth per instance in kB"] < making.kilobytes


THRUST = "thrust = model.mass * n  #"


def changed_controller(folder: Path, factor: str) -> Path:
    """A controller whose law commands `factor` times the thrust."""
    sources = copy_sources(folder / "sources")
    replace(sources / "controller_fmu" / "sliding_mode" / "law.py", THRUST, f"thrust = {factor} * model.mass * n  #")
    return build(sources, folder, "UnifiedController")


@pytest.fixture(scope="module")
def versions(built: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[float, Path]:
    """Three builds of the controller, by the factor on the thrust of their law."""
    others = {factor: changed_controller(tmp_path_factory.mktemp("version"), str(factor)) for factor in (2.0, 3.0)}
    return {1.0: built["UnifiedController"], **others}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Packages with the names of the project and of pythonfmu, of content that would stop any FMU."""
    folder = tmp_path_factory.mktemp("installed")
    for package in ("fmu_kit", "controller_fmu", "plant_fmu", "pythonfmu"):
        (folder / package).mkdir()
        (folder / package / "__init__.py").touch()
    wrong = folder / "controller_fmu" / "sliding_mode"
    wrong.mkdir()
    (wrong / "__init__.py").touch()
    (wrong / "law.py").write_text("def evaluate(*arguments):\n    raise SystemExit('wrong law')\n")
    (wrong / "slave.py").write_text("class UnifiedController:\n    pass\n")
    return folder


@pytest.mark.usefixtures("python_inside")
@pytest.mark.parametrize("imported", sample(["before", "after"], 1))
def test_each_version_runs_its_own_law(imported: str, versions: dict[float, Path], installed: Path) -> None:
    order = (3.0, 2.0, 1.0, 2.0)
    result = run_script("two_versions", installed, imported, *(versions[factor] for factor in order))
    thrust, *torque = law_command(0.02)
    for factor, command in zip(order, result["commands"], strict=True):
        assert command == pytest.approx([factor * thrust, *torque], rel=1e-12)
    assert result["installed is the user's"]


@pytest.mark.usefixtures("python_inside")
def test_a_module_of_the_entrys_name_in_the_working_directory_is_not_used(
    built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("UnifiedController", "slave", "law", "algebra"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('wrong module')\n")
    monkeypatch.syspath_prepend(tmp_path)
    with Instance(built["UnifiedController"]) as controller:
        controller.initialise({})
