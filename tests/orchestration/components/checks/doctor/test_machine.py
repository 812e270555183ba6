"""Looking at machines of other kinds, as far as they can be pretended: what cannot be had is unknown."""

import os
import platform
import sys
from pathlib import Path

import pytest

from orchestration.components.checks.doctor.as_lines import as_text
from orchestration.components.checks.doctor.binaries import LINUX, MACOS, WINDOWS
from orchestration.components.checks.doctor.fmu import inspected
from orchestration.components.checks.doctor.machine import this_machine
from orchestration.components.checks.doctor.report import DoctorReport, as_tables
from orchestration.components.checks.doctor.verdict import judge


@pytest.mark.parametrize(
    ("name", "machine", "system", "architecture", "folders"),
    [
        ("Linux", "x86_64", LINUX, "x86-64", (("linux64",), ("x86_64-linux",))),
        ("Linux", "aarch64", LINUX, "aarch64", (("aarch64-linux", "linux64"), ("aarch64-linux",))),
        ("Windows", "AMD64", WINDOWS, "x86-64", (("win64",), ("x86_64-windows",))),
        ("Darwin", "arm64", MACOS, "aarch64", (("aarch64-darwin", "darwin64"), ("aarch64-darwin",))),
    ],
)
def test_every_system_is_called_as_binaries_call_it(
    name: str,
    machine: str,
    system: str,
    architecture: str,
    folders: tuple[tuple[str, ...], tuple[str, ...]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(platform, "system", lambda: name)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    looked_at = this_machine(())
    assert (looked_at.system, looked_at.architecture) == (system, architecture)
    assert (looked_at.platforms(2), looked_at.platforms(3)) == folders


@pytest.mark.parametrize("name", ["Windows", "Darwin", "FreeBSD", ""])
def test_where_nothing_can_be_had_there_is_still_a_report(
    name: str, built: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, "system", lambda: name)
    monkeypatch.setattr(sys, "executable", "")
    monkeypatch.delattr(os, "confstr")
    fmu = inspected(built["QuadrotorPlant"])
    machine = this_machine([fmu])
    assert machine.glibc is None
    assert machine.shared is (True if name == "Windows" else None)
    report = DoctorReport(machine=machine, verdicts=(judge(fmu, machine, "not tried"),))
    assert not report.good
    assert as_tables(report)["machine"]["python_libraries"] == []
    assert "libpython    none for a host that is not Python" in as_text(report)


def test_libraries_are_looked_for_under_the_names_that_binaries_give(built: dict[str, Path]) -> None:
    machine = this_machine([inspected(path) for path in built.values()])
    assert set(machine.found) == {"libstdc++.so.6", "libgcc_s.so.1", "libc.so.6"}
    for library in machine.found.values():
        assert library is not None
        assert library.path.is_file()
    assert set(machine.found_by_python) == set(machine.found)


def test_a_process_of_32_bits_is_one_on_a_machine_of_64(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    monkeypatch.setattr("struct.calcsize", lambda kind: 4)
    assert (this_machine(()).platforms(2), this_machine(()).platforms(3)) == (("linux32",), ("x86-linux",))
