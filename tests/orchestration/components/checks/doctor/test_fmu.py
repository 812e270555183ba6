"""What an .fmu file says of its needs."""

import math
from importlib.metadata import version
from pathlib import Path

import pytest

from orchestration.components.checks.doctor.fmu import inspected
from orchestration.components.fmi.archive import UnreadableFmuError
from tests.orchestration.components.checks.doctor.common import (
    AARCH64,
    LINUX64,
    WIN64,
    changed,
    described,
    files_of,
    for_machine,
    requiring,
    with_run_path,
)

RUNPATH = 29


@pytest.fixture
def plant(built: dict[str, Path]) -> Path:
    return built["QuadrotorPlant"]


def test_the_fmus_of_this_project_need_the_standard_library_only(built: dict[str, Path]) -> None:
    for path in built.values():
        fmu = inspected(path)
        assert [part.platform for part in fmu.platforms] == ["linux64", "win64"]
        assert [part.problem for part in fmu.platforms] == [None, None]
        assert fmu.kinds == ("CoSimulation",)
        assert fmu.needs_tool is None
        assert fmu.python is not None
        assert (fmu.python.imports, fmu.python.problems) == ((), ())


def test_the_declared_python_is_read(plant: Path, tmp_path: Path) -> None:
    assert inspected(requiring(plant, tmp_path / "a.fmu", "&gt;=3.10,&lt;4")).requires_python == ">=3.10,<4"
    undeclared = described(requiring(plant, tmp_path / "b.fmu", "3"), tmp_path / "c.fmu", "<Python ", "<Java ")
    assert inspected(undeclared).requires_python is None


def test_an_execution_tool_is_named(plant: Path, tmp_path: Path) -> None:
    old, new = 'needsExecutionTool="false"', 'needsExecutionTool="true"'
    assert inspected(described(plant, tmp_path / "a.fmu", old, new)).needs_tool == f"quadcosim {version('quadcosim')}"


# -- binaries -------------------------------------------------------------------------------------------------


def test_a_header_that_contradicts_its_folder_is_a_problem(plant: Path, tmp_path: Path) -> None:
    files = files_of(plant)
    elsewhere = {LINUX64: for_machine(files[LINUX64], AARCH64), WIN64: files[LINUX64]}
    linux, windows = inspected(changed(plant, tmp_path / "a.fmu", elsewhere)).platforms
    assert linux.problem == "a binary for Linux, aarch64, expected Linux, x86-64 in this folder"
    assert windows.problem == "a binary for Linux, x86-64, expected Windows, x86-64 in this folder"


def test_a_folder_without_the_library_of_the_model_is_a_problem(plant: Path, tmp_path: Path) -> None:
    files = {LINUX64: None, "binaries/linux64/Other.so": files_of(plant)[LINUX64]}
    linux, _ = inspected(changed(plant, tmp_path / "a.fmu", files)).platforms
    assert (linux.binary, linux.problem) == (None, f"expected {LINUX64}")


def test_a_library_that_is_none_is_a_problem(plant: Path, tmp_path: Path) -> None:
    linux, _ = inspected(changed(plant, tmp_path / "a.fmu", {LINUX64: b"version https://"})).platforms
    assert linux.problem == f"{LINUX64}: begins with b'vers', expected an ELF, PE or Mach-O file"


def test_a_folder_that_the_standard_does_not_name_is_read_as_well(plant: Path, tmp_path: Path) -> None:
    other = "binaries/x86_64-linux/QuadrotorPlant.so"
    fmu = inspected(changed(plant, tmp_path / "a.fmu", {other: files_of(plant)[LINUX64]}))
    (part,) = (part for part in fmu.platforms if part.platform == "x86_64-linux")
    assert part.problem is None
    assert part.binary is not None
    assert part.binary.target == "Linux, x86-64"


def test_for_other_processors_the_folders_are_those_of_fmi_3(plant: Path, tmp_path: Path) -> None:
    arm = for_machine(files_of(plant)[LINUX64], AARCH64)
    files = {"binaries/aarch64-linux/QuadrotorPlant.so": arm, "binaries/aarch32-linux/QuadrotorPlant.so": arm}
    parts = inspected(changed(plant, tmp_path / "a.fmu", files)).platforms
    assert {part.platform: part.problem for part in parts if part.platform.startswith("aarch")} == {
        "aarch64-linux": None,
        "aarch32-linux": "a binary for Linux, aarch64, expected Linux, arm in this folder",
    }


def test_what_lies_where_a_library_looks_comes_with_the_fmu(plant: Path, tmp_path: Path) -> None:
    files = files_of(plant)
    libraries = {"binaries/linux64/libgcc_s.so.1": b"", "binaries/lib/libstdc++.so.6": b""}
    for run_path, bundled in (
        ("$ORIGIN", {"libgcc_s.so.1"}),
        ("${ORIGIN}/../lib", {"libstdc++.so.6"}),
        ("/lib", set()),
    ):
        elf = with_run_path(files[LINUX64], RUNPATH, run_path)
        fmu = inspected(changed(plant, tmp_path / "a.fmu", {**libraries, LINUX64: elf}))
        (linux,) = (part for part in fmu.platforms if part.platform == "linux64")
        assert linux.bundled == bundled


# -- sources --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "imports"),
    [
        ("import numpy.linalg as la, os.path", ("numpy",)),
        ("from scipy.linalg import inv\nimport quadcosim_bundled", ("quadcosim_bundled", "scipy")),
        ("def late():\n    import numpy", ("numpy",)),
        ("from . import numpy", ()),
        ("import helper, helpers.more", ()),
        ("try:\n    import numpy\nexcept ImportError:\n    import array as numpy", ()),
        (
            "try:\n    import numpy\nexcept (OSError, ModuleNotFoundError):\n    pass\nelse:\n    import scipy",
            ("scipy",),
        ),
        ("try:\n    import numpy\nexcept OSError:\n    pass", ("numpy",)),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import numpy\nelse:\n    import scipy", ("scipy",)),
    ],
)
def test_imports_are_those_that_are_neither_bundled_nor_standard(
    source: str, imports: tuple[str, ...], plant: Path, tmp_path: Path
) -> None:
    bundled = {"resources/helper.py": b"", "resources/helpers/more.py": b"", "resources/numpy.csv": b""}
    path = changed(plant, tmp_path / "a.fmu", {**bundled, "resources/extra.py": source.encode()})
    python = inspected(path).python
    assert python is not None
    assert python.imports == imports


def test_a_source_that_this_python_cannot_read_is_a_problem(plant: Path, tmp_path: Path) -> None:
    python = inspected(changed(plant, tmp_path / "a.fmu", {"resources/old.py": b"print 'hello'"})).python
    assert python is not None
    assert len(python.problems) == 1
    assert python.problems[0].startswith("resources/old.py: not Python 3.")


def test_an_entry_that_is_not_there_is_a_problem(plant: Path, tmp_path: Path) -> None:
    python = inspected(changed(plant, tmp_path / "a.fmu", {"resources/slavemodule.txt": b"gone\n"})).python
    assert python is not None
    assert python.problems == ("resources/slavemodule.txt names gone, but there is no resources/gone.py",)


def test_an_fmu_without_pythons_entry_has_no_sources(plant: Path, tmp_path: Path) -> None:
    assert inspected(changed(plant, tmp_path / "a.fmu", {"resources/slavemodule.txt": None})).python is None


# -- what is no FMU -------------------------------------------------------------------------------------------


def refusal(path: Path, size_limit: float = math.inf) -> str:
    with pytest.raises(UnreadableFmuError) as error:
        inspected(path, size_limit)
    return str(error.value)


def test_a_file_that_is_no_fmu_is_refused_in_one_line(plant: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.fmu"
    assert refusal(path) == "no such file"
    path.write_text("no zip")
    assert refusal(path) == "expected a zip archive that is whole: File is not a zip file"
    undescribed = changed(plant, path, {"modelDescription.xml": None})
    assert refusal(undescribed) == "expected an FMU, with modelDescription.xml at the top of the archive"
    no_xml = changed(plant, path, {"modelDescription.xml": b"<a>"})
    assert refusal(no_xml).startswith("modelDescription.xml: expected well-formed XML: ")
    one = described(plant, path, 'fmiVersion="2.0"', 'fmiVersion="1.0"')
    assert refusal(one) == "fmiVersion = 1.0: expected 2.0 or 3.0; an FMU of FMI 1.0 is not checked here"
    neither = described(plant, path, "<CoSimulation", "<CoSim")
    assert refusal(neither) == "expected CoSimulation or ModelExchange in modelDescription.xml"


def test_an_archive_is_refused_when_any_file_in_it_is_damaged_or_it_is_too_large(plant: Path, tmp_path: Path) -> None:
    path = changed(plant, tmp_path / "a.fmu", {"resources/data.txt": b"as it was written"})
    path.write_bytes(path.read_bytes().replace(b"as it was written", b"as it never was.."))
    assert refusal(path) == "expected a zip archive that is whole: wrong CRC or header of resources/data.txt"
    assert refusal(plant, size_limit=0.1).endswith("MB: expected at most 0.1 MB (size_limit)")
