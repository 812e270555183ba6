"""Which library a host's loader takes, and which Python a host that is not Python finds."""

import dataclasses
import os
import shutil
import sys
from pathlib import Path

import pytest

from orchestration.components.checks.doctor.binaries import LINUX, MACOS, WINDOWS, read
from orchestration.components.checks.doctor.machine import this_machine
from orchestration.components.checks.doctor.pythons import (
    ON_PATH,
    PRELOADED,
    THIS_PYTHON,
    DynamicLoader,
    PythonLibrary,
    loader_of_programs,
    loader_of_this_python,
    python_libraries,
)
from tests.orchestration.components.checks.doctor.common import (
    AARCH64,
    LINUX64,
    WIN64,
    files_of,
    for_machine,
    with_run_path,
)

RPATH = 15


@pytest.fixture(scope="module")
def elf(built: dict[str, Path]) -> bytes:
    """A library for x86-64, whatever its name."""
    return files_of(built["QuadrotorPlant"])[LINUX64]


@pytest.fixture(scope="module")
def dll(built: dict[str, Path]) -> bytes:
    return files_of(built["QuadrotorPlant"])[WIN64]


def put(content: bytes, *parts: str | Path) -> Path:
    path = Path(*parts)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def linux(*first: Path, **others: tuple[Path, ...]) -> DynamicLoader:
    return DynamicLoader(system=LINUX, architecture="x86-64", first=first, **others)  # type: ignore[arg-type]


# -- libraries ------------------------------------------------------------------------------------------------


def test_folders_are_searched_in_order(elf: bytes, tmp_path: Path) -> None:
    paths = [put(elf, tmp_path, folder, "lib.so") for folder in ("first", "requested", "cached", "last")]
    loader = DynamicLoader(
        system=LINUX,
        architecture="x86-64",
        first=(tmp_path / "first",),
        cache={"lib.so": (tmp_path / "cached" / "lib.so",)},
        last=(tmp_path / "last",),
    )
    for path in paths:
        assert loader.find("lib.so", [str(tmp_path / "requested")]) == path
        path.unlink()
    assert loader.find("lib.so") is None


def test_a_library_for_another_machine_is_passed_over(elf: bytes, dll: bytes, tmp_path: Path) -> None:
    put(for_machine(elf, AARCH64), tmp_path, "arm", "lib.so")
    put(dll, tmp_path, "windows", "lib.so")
    put(b"GROUP ( lib.so.6 )", tmp_path, "script", "lib.so")
    right = put(elf, tmp_path, "right", "lib.so")
    assert linux(*(tmp_path / name for name in ("arm", "windows", "script", "right"))).find("lib.so") == right


def test_the_loader_of_this_machine_finds_the_c_library_and_what_is_on_its_path(
    elf: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(elf, tmp_path, "libmine.so")
    monkeypatch.setenv("LD_LIBRARY_PATH", f"/nowhere:{tmp_path}")
    loader = loader_of_programs(LINUX, this_machine(()).architecture)
    assert loader.find("libc.so.6") is not None
    assert loader.find("libmine.so") == tmp_path / "libmine.so"
    assert loader.find("libnone.so") is None
    assert dataclasses.replace(loader, cache={}).find("libc.so.6") is not None


def test_without_ldconfig_the_cache_is_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda *arguments, **options: None)
    assert loader_of_programs(LINUX, "x86-64").cache == {}


def test_a_python_host_looks_first_where_its_executable_says(
    elf: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    executable = put(with_run_path(elf, RPATH, "$ORIGIN/../lib"), tmp_path, "bin", "python")
    mine = put(elf, tmp_path, "lib", "libmine.so")
    monkeypatch.setattr(sys, "executable", str(executable))
    found = loader_of_this_python(linux()).find("libmine.so")
    assert found is not None
    assert found.resolve() == mine.resolve()
    monkeypatch.setattr(sys, "executable", "")
    assert loader_of_this_python(linux()) == linux()


def test_a_python_host_on_windows_looks_first_where_python_is(
    dll: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = put(dll, tmp_path, "python", "vcruntime140.dll")
    put(dll, tmp_path, "Windows", "System32", "vcruntime140.dll")
    monkeypatch.setattr(sys, "base_prefix", str(mine.parent))
    monkeypatch.setenv("SYSTEMROOT", str(tmp_path / "Windows"))
    programs = loader_of_programs(WINDOWS, "x86-64")
    assert programs.find("vcruntime140.dll") == tmp_path / "Windows" / "System32" / "vcruntime140.dll"
    assert loader_of_this_python(programs).find("vcruntime140.dll") == mine


# -- Pythons --------------------------------------------------------------------------------------------------


def versions(libraries: tuple[PythonLibrary, ...]) -> list[str]:
    return [library.version for library in libraries if library.found_by != THIS_PYTHON]


def test_the_version_of_this_python_comes_first_then_newer_before_older(elf: bytes, tmp_path: Path) -> None:
    this = f"3.{sys.version_info[1]}"
    for version in ("3.8", "3.9", this, "3.98", "3.99"):
        put(elf, tmp_path, f"libpython{version}.so.1.0")
    assert versions(python_libraries(linux(tmp_path))) == [this, "3.99", "3.98", "3.9", "3.8"]


def test_only_libraries_of_a_version_and_of_the_usual_kind_count(elf: bytes, tmp_path: Path) -> None:
    for name in ("libpython3.so", "libpython3.98t.so.1.0", "libpython2.7.so.1.0", "libpython3.97.a"):
        put(elf, tmp_path, name)
    put(for_machine(elf, AARCH64), tmp_path, "libpython3.96.so.1.0")
    put(elf, tmp_path, "libpython3.7m.so.1.0")
    assert versions(python_libraries(linux(tmp_path))) == ["3.7"]


def test_two_names_of_one_library_are_one(elf: bytes, tmp_path: Path) -> None:
    path = put(elf, tmp_path, "libpython3.99.so.1.0")
    (tmp_path / "libpython3.99.so").symlink_to(path)
    (library,) = (one for one in python_libraries(linux(tmp_path)) if one.version == "3.99")
    assert library.path == path


def test_a_preloaded_python_goes_before_all_others(elf: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = put(elf, tmp_path, "libpython3.9.so.1.0")
    put(elf, tmp_path, f"libpython3.{sys.version_info[1]}.so.1.0")
    monkeypatch.setenv("LD_PRELOAD", f"libother.so {path.name}")
    first = python_libraries(linux(tmp_path))[0]
    assert (first.path, first.version, first.found_by) == (path, "3.9", PRELOADED)


def test_what_is_found_on_this_machine_is_there_and_fits() -> None:
    machine = this_machine(())
    for library in machine.python_libraries:
        assert f"libpython{library.version}" in library.path.name
        with library.path.open("rb") as stream:
            assert read(stream).fits(machine.system, machine.architecture)


def test_a_library_of_this_python_alone_is_told_its_home(
    elf: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = put(elf, tmp_path, "lib", "libpython3.11.so.1.0")
    variables = {"LIBDIR": "/install/lib", "INSTSONAME": path.name}
    monkeypatch.setattr("sysconfig.get_config_var", variables.get)
    monkeypatch.setattr(sys, "base_prefix", str(tmp_path))
    expected = PythonLibrary(path=path, version="3.11", found_by=THIS_PYTHON, home=tmp_path)
    assert python_libraries(linux()) == (expected,)
    (found,) = python_libraries(linux(path.parent))
    assert found.home is None


def test_on_windows_the_python_on_path_comes_before_that_which_runs(
    dll: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, version in (("old", "38"), ("this", "312")):
        put(dll, tmp_path, folder, "python3.dll")
        put(dll, tmp_path, folder, f"python{version}.dll")
    monkeypatch.setattr(sys, "base_prefix", str(tmp_path / "this"))
    monkeypatch.setenv("SYSTEMROOT", str(tmp_path / "Windows"))
    monkeypatch.setenv("PATH", os.pathsep.join(str(tmp_path / name) for name in ("none", "old")))
    found = python_libraries(loader_of_programs(WINDOWS, "x86-64"))
    assert [(library.version, library.found_by) for library in found] == [("3.8", ON_PATH), ("3.12", THIS_PYTHON)]


def test_on_macos_nothing_is_said_of_libraries() -> None:
    loader = loader_of_programs(MACOS, "aarch64")
    assert loader.find("libc.so.6") is None
    assert python_libraries(loader) == ()
