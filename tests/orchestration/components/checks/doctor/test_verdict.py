"""What an FMU needs against machines that are made up: nothing here looks at the machine of the test."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from orchestration.components.checks.doctor.as_lines import as_text
from orchestration.components.checks.doctor.binaries import MACOS, WINDOWS, Dependency
from orchestration.components.checks.doctor.dependencies import missing_versions
from orchestration.components.checks.doctor.fmu import InspectedFmu, inspected
from orchestration.components.checks.doctor.machine import Library, Machine
from orchestration.components.checks.doctor.pythons import ON_PATH, PRELOADED, THIS_PYTHON, PythonLibrary
from orchestration.components.checks.doctor.report import DoctorReport, as_tables
from orchestration.components.checks.doctor.verdict import Verdict, judge
from tests.orchestration.components.checks.doctor.common import (
    AARCH64,
    LINUX64,
    changed,
    files_of,
    for_machine,
    machine_for,
    requiring,
    with_run_path,
)

PRELOAD = "LD_PRELOAD=/lib/libpython3.11.so.1.0 TOOL"


@pytest.fixture
def plant(built: dict[str, Path]) -> Path:
    return built["QuadrotorPlant"]


@pytest.fixture
def fmu(plant: Path) -> InspectedFmu:
    return inspected(plant)


def judged(fmu: InspectedFmu, **changes: Any) -> Verdict:
    """The FMU on a machine that has all it needs but for `changes`, and where loading it went well."""
    return judge(fmu, machine_for(fmu, **changes), None)


def needs(verdict: Verdict) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What the Python host and the other host lack."""
    return verdict.python_host.needs, verdict.other_host.needs


def without(machine: Machine, name: str, *versions: str) -> dict[str, Library | None]:
    """The machine's libraries, one of them with these versions only, or not there at all."""
    library = Library(path=Path("/lib", name), versions=versions) if versions else None
    return {**machine.found, name: library}


def pythons(*libraries: tuple[str, str, str]) -> tuple[PythonLibrary, ...]:
    return tuple(PythonLibrary(path=Path(path), version=version, found_by=by) for path, version, by in libraries)


def marked(verdict: Verdict, machine: Machine) -> list[str]:
    """What the text marks as wrong: the first word of each such line."""
    lines = as_text(DoctorReport(machine=machine, verdicts=(verdict,))).splitlines()
    return [line[2:15].strip() or line.split()[2] for line in lines if line.startswith("!")]


def test_a_machine_with_all_that_is_needed_is_ready(fmu: InspectedFmu) -> None:
    verdict = judged(fmu)
    assert verdict.good
    assert needs(verdict) == ((), ())
    assert (verdict.python_host.start, verdict.other_host.start) == (None, PRELOAD)
    assert marked(verdict, machine_for(fmu)) == []


def test_a_failed_attempt_is_a_problem_whatever_else_is_said(fmu: InspectedFmu) -> None:
    verdict = judge(fmu, machine_for(fmu), "took its process down")
    assert not verdict.good
    assert needs(verdict) == ((), ())
    assert marked(verdict, machine_for(fmu)) == ["tried here"]


# -- binaries and libraries ---------------------------------------------------------------------------------


def test_a_machine_without_a_binary_is_told_so(fmu: InspectedFmu) -> None:
    for system, architecture in ((MACOS, "aarch64"), ("Linux", "aarch64"), ("Linux", "x86")):
        verdict = judged(fmu, system=system, architecture=architecture)
        assert not verdict.good
        text = f"an FMU with a binary for {system}, {architecture}"
        assert needs(verdict) == ((text,), (text,))


def test_the_header_decides_not_the_folder(plant: Path, tmp_path: Path) -> None:
    files = {LINUX64: for_machine(files_of(plant)[LINUX64], AARCH64)}
    fmu = inspected(changed(plant, tmp_path / "arm.fmu", files))
    assert needs(judged(fmu))[0] == ("an FMU with a binary for Linux, x86-64",)
    on_arm = judged(fmu, architecture="aarch64")
    assert needs(on_arm) == ((), ())
    assert on_arm.problems == ("linux64: a binary for Linux, aarch64, expected Linux, x86-64 in this folder",)
    assert not on_arm.good


def test_on_arm_the_folder_of_fmi_3_goes_before_that_of_x86(plant: Path, tmp_path: Path) -> None:
    elf = files_of(plant)[LINUX64]
    files = {"binaries/aarch64-linux/QuadrotorPlant.so": for_machine(elf, AARCH64)}
    fmu = inspected(changed(plant, tmp_path / "both.fmu", files))
    on_arm = judged(fmu, architecture="aarch64")
    assert needs(on_arm) == ((), ())
    assert on_arm.problems == ()
    assert judged(fmu).good


def test_an_old_glibc_is_told_what_is_wanted(fmu: InspectedFmu) -> None:
    machine = machine_for(fmu)
    old = without(machine, "libc.so.6", "GLIBC_2.2.5", "GLIBC_2.4", "GLIBC_2.14", "GLIBC_2.31")
    machine = dataclasses.replace(machine, found=old, found_by_python=old)
    verdict = judge(fmu, machine, None)
    text = "libc.so.6 with GLIBC_2.32, here GLIBC_2.31"
    assert needs(verdict) == ((text,), (text,))
    assert marked(verdict, machine) == ["libc.so.6", "Python host", "other host"]
    assert "needs libc.so.6 GLIBC_2.32; here GLIBC_2.31" in as_text(DoctorReport(machine=machine, verdicts=(verdict,)))


def test_a_library_that_is_not_there_is_named(fmu: InspectedFmu) -> None:
    gone = without(machine_for(fmu), "libstdc++.so.6")
    assert needs(judged(fmu, found=gone, found_by_python=gone)) == (("libstdc++.so.6",), ("libstdc++.so.6",))


def test_each_host_is_judged_by_what_its_own_loader_finds(fmu: InspectedFmu) -> None:
    old = without(machine_for(fmu), "libstdc++.so.6", "GLIBCXX_3.4.29")
    python, other = needs(judged(fmu, found=old))
    assert python == ()
    assert other == ("libstdc++.so.6 with GLIBCXX_3.4.30 CXXABI_1.3.9, here GLIBCXX_3.4.29",)


def test_versions_without_a_number_count_as_well() -> None:
    dependency = Dependency(name="libc.so.6", versions=("GLIBC_2.34", "GLIBC_ABI_DT_RELR"))
    assert missing_versions(dependency, Library(path=Path("/lib/libc.so.6"), versions=("GLIBC_2.34",))) == (
        "GLIBC_ABI_DT_RELR",
    )


def test_a_library_without_versions_is_taken_as_it_is(fmu: InspectedFmu) -> None:
    bare = {name: Library(path=library.path) for name, library in machine_for(fmu).found.items() if library}
    assert judged(fmu, found=bare, found_by_python=bare).good


def test_what_the_fmu_brings_along_need_not_be_there(plant: Path, tmp_path: Path) -> None:
    elf = with_run_path(files_of(plant)[LINUX64], 29, "$ORIGIN")
    files = {LINUX64: elf, "binaries/linux64/libgcc_s.so.1": b""}
    fmu = inspected(changed(plant, tmp_path / "a.fmu", files))
    assert "libgcc_s.so.1" not in machine_for(fmu).found
    assert judged(fmu).good


# -- Python -------------------------------------------------------------------------------------------------


def test_a_python_that_is_too_old_is_told_which_is_wanted(plant: Path, tmp_path: Path) -> None:
    fmu = inspected(requiring(plant, tmp_path / "a.fmu", "&gt;=3.12"))
    python, other = needs(judged(fmu))
    assert python == ("Python >=3.12; this is 3.11.7",)
    (text,) = other
    assert text.startswith("a shared libpython of Python >=3.12: apt install ")
    newer = pythons(("/lib/libpython3.11.so", "3.11", "the loader"), ("/opt/libpython3.12.so", "3.12", "the loader"))
    verdict = judged(fmu, python="3.12.0", python_libraries=newer)
    assert verdict.good
    assert verdict.other_host.start == "LD_PRELOAD=/opt/libpython3.12.so TOOL"


def test_a_requirement_that_cannot_be_understood_is_a_problem(plant: Path, tmp_path: Path) -> None:
    verdict = judged(inspected(requiring(plant, tmp_path / "a.fmu", "newest")))
    assert verdict.problems == ("Python requires = newest: expected a version specifier such as >=3.10",)
    assert not verdict.good


def test_without_a_shared_libpython_only_a_python_host_is_ready(fmu: InspectedFmu) -> None:
    verdict = judged(fmu, python_libraries=())
    assert verdict.python_host.ready
    assert not verdict.other_host.ready
    assert not verdict.good


def test_the_start_of_another_host_hangs_on_where_its_python_is(fmu: InspectedFmu) -> None:
    preloaded = pythons(("/a/libpython3.11.so", "3.11", PRELOADED))
    assert judged(fmu, python_libraries=preloaded).other_host.start is None
    own = PythonLibrary(
        path=Path("/p/lib/libpython3.11.so"), version="3.11", found_by=THIS_PYTHON, home=Path("/p")
    )  # fmt: skip
    start = judged(fmu, python_libraries=(own,)).other_host.start
    assert start == "PYTHONHOME=/p LD_PRELOAD=/p/lib/libpython3.11.so TOOL"


def test_packages_that_the_sources_import_must_be_there(plant: Path, tmp_path: Path) -> None:
    source = {"resources/extra.py": b"import numpy, scipy"}
    fmu = inspected(changed(plant, tmp_path / "a.fmu", source))
    verdict = judged(fmu, modules={"numpy": True, "scipy": False})
    assert verdict.python_host.needs == ("scipy where this Python can import it",)
    assert verdict.other_host.start == PRELOAD
    assert verdict.other_host.note == "Python 3.11 must be able to import numpy, scipy"
    machine = machine_for(fmu, modules={"numpy": True, "scipy": False})
    assert "numpy, scipy (not here)" in as_text(DoctorReport(machine=machine, verdicts=(verdict,)))
    assert judged(fmu, modules={"numpy": True, "scipy": True}).good


def test_an_fmu_without_python_needs_none(plant: Path, tmp_path: Path) -> None:
    """A binary that is not pythonfmu's: any library of this machine that does without Python."""
    files = {LINUX64: _library_without_python(), "resources/slavemodule.txt": None}
    fmu = inspected(changed(plant, tmp_path / "a.fmu", files))
    verdict = judged(fmu, python_libraries=(), temp_folder=Path("/tmp/é"))
    assert needs(verdict) == ((), ())
    assert verdict.other_host.start is None


def _library_without_python() -> bytes:
    with Path("/proc/self/maps").open(encoding="utf-8") as maps:
        return Path(next(line.split()[-1] for line in maps if line.rstrip().endswith("/libc.so.6"))).read_bytes()


@pytest.mark.parametrize(
    ("folder", "good"),
    [("/tmp", True), ("/tmp/with space", True), ("/tmp/a-b_c.d~", True), ("/tmp/café", False), ("/tmp/a+b", False)],
)
def test_pythonfmu_needs_a_temp_folder_that_its_uri_does_not_escape(folder: str, good: bool, fmu: InspectedFmu) -> None:
    verdict = judged(fmu, temp_folder=Path(folder))
    assert verdict.good == good
    for host in needs(verdict):
        assert [folder in text for text in host] == ([] if good else [True])


# -- Windows, macOS -----------------------------------------------------------------------------------------


def test_windows_takes_the_python_on_path_if_it_satisfies(plant: Path, tmp_path: Path) -> None:
    fmu = inspected(requiring(plant, tmp_path / "a.fmu", "&gt;=3.10"))

    def start(*libraries: tuple[str, str, str]) -> str | None:
        verdict = judged(fmu, system=WINDOWS, python_libraries=pythons(*libraries))
        assert verdict.good
        return verdict.other_host.start

    own = ("/Python312/python3.dll", "3.12", THIS_PYTHON)
    assert start(("/Python311/python3.dll", "3.11", ON_PATH), own) is None
    assert start(("/Python38/python3.dll", "3.8", ON_PATH), own) == f'set "PATH={Path("/Python312")};%PATH%" && TOOL'
    nowhere = judged(fmu, system=WINDOWS, python_libraries=())
    assert nowhere.other_host.needs == ("python3.dll of Python >=3.10 on PATH",)


def test_windows_is_not_asked_for_its_api_sets_but_for_the_runtime(fmu: InspectedFmu) -> None:
    gone = without(machine_for(fmu), "MSVCP140.dll")
    assert not any(name.startswith("api-ms-") for name in gone)
    python, other = needs(judged(fmu, system=WINDOWS, found=gone, found_by_python=gone))
    assert python == other == ("MSVCP140.dll (the Microsoft Visual C++ Redistributable)",)


def test_python_that_is_not_on_path_is_no_missing_library_of_windows(fmu: InspectedFmu) -> None:
    own = pythons(("/Python312/python3.dll", "3.12", THIS_PYTHON))
    found = without(machine_for(fmu), "python3.dll")
    machine = machine_for(fmu, system=WINDOWS, found=found, python_libraries=own)
    verdict = judge(fmu, machine, None)
    assert verdict.good
    assert marked(verdict, machine) == []


def test_of_a_mach_o_binary_nothing_is_claimed(plant: Path, tmp_path: Path) -> None:
    header = bytes.fromhex("cffaedfe0c000001")
    fmu = inspected(changed(plant, tmp_path / "a.fmu", {"binaries/darwin64/QuadrotorPlant.dylib": header}))
    machine = machine_for(fmu, system=MACOS, architecture="aarch64", python_libraries=())
    verdict = judge(fmu, machine, None)
    assert needs(verdict) == ((), ())
    assert verdict.other_host.note == "the dependencies of its binary are unknown"
    assert "ready; the dependencies of its binary are unknown" in as_text(
        DoctorReport(machine=machine, verdicts=(verdict,))
    )


# -- the two forms of a report --------------------------------------------------------------------------------


def test_json_has_what_the_text_says(fmu: InspectedFmu) -> None:
    machine = machine_for(fmu, glibc="glibc 2.36", shared=False)
    tables = as_tables(DoctorReport(machine=machine, verdicts=(judge(fmu, machine, "no"),)))
    (table,) = tables["fmus"]
    assert tables["good"] is table["good"] is table["loads"] is False
    assert table["failure"] == "no"
    assert table["platform_here"] == "linux64"
    assert table["hosts"]["python"] == {"ready": True, "needs": [], "start": None, "note": None}
    assert table["hosts"]["other"] == {"ready": True, "needs": [], "start": PRELOAD, "note": None}
    assert tables["machine"]["found"]["libc.so.6"] == {"path": "/lib/libc.so.6", "versions": ["GLIBC_2.32"]}
    assert (tables["machine"]["glibc"], tables["machine"]["shared"]) == ("glibc 2.36", False)
    (linux, windows) = table["platforms"]
    assert "Py_Initialize" in linux["binary"]["python_symbols"]
    assert {"name": "python3.dll", "versions": []} in windows["binary"]["dependencies"]


def test_text_names_the_tool_that_an_fmu_asks_for(fmu: InspectedFmu) -> None:
    asking = dataclasses.replace(fmu, needs_tool="Modelotron 3")
    verdict = judged(asking)
    assert verdict.good
    text = as_text(DoctorReport(machine=machine_for(fmu), verdicts=(verdict,)))
    assert "Modelotron 3, declared by the FMU (needsExecutionTool)" in text
