"""FMUs of FMI 3.0: what differs from those of FMI 2.0 is where their libraries lie, and how they are called."""

from pathlib import Path

import fmpy
import pytest

from orchestration.components.checks.doctor.as_lines import as_text
from orchestration.components.checks.doctor.fmu import InspectedFmu, inspected
from orchestration.components.checks.doctor.loading import try_loading
from orchestration.components.checks.doctor.report import DoctorReport, examine
from orchestration.components.checks.doctor.verdict import judge
from orchestration.foundation.processes.resource_limits import Limits
from tests.commands import Main
from tests.orchestration.components.checks.doctor.common import (
    AARCH64,
    changed,
    described,
    files_of,
    for_machine,
    machine_for,
)
from tests.orchestration.components.fmi.small import needs_compiler, small

pytestmark = needs_compiler

HERE = f"binaries/{fmpy.platform_tuple}/Small{fmpy.sharedLibraryExtension}"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small(tmp_path_factory.mktemp("three"), fmi=3)


def problems(path: Path) -> dict[str, str | None]:
    """What is wrong with the binaries, by folder."""
    return {part.platform: part.problem for part in inspected(path).platforms}


def lines(read: InspectedFmu) -> list[str]:
    machine = machine_for(read)
    return as_text(DoctorReport(machine=machine, verdicts=(judge(read, machine, None),))).splitlines()


def test_one_that_is_sound_loads_and_needs_nothing_more(fmu: Path) -> None:
    report = examine([fmu], Limits())
    (verdict,) = report.verdicts
    assert report.good, as_text(report)
    assert (verdict.fmu.version, verdict.fmu.guid) == (3, "small")  # type: ignore[union-attr]
    assert [part.platform for part in verdict.fmu.platforms] == [fmpy.platform_tuple]  # type: ignore[union-attr]


def test_a_library_in_a_folder_of_fmi_2_is_none_of_fmi_3(fmu: Path, tmp_path: Path) -> None:
    path = changed(fmu, tmp_path / "a.fmu", {HERE: None, "binaries/linux64/Small.so": files_of(fmu)[HERE]})
    assert try_loading(path, Limits()).failure == f"has no binary for {fmpy.platform_tuple}, only for linux64"
    assert any(line.endswith("; FMI 3.0 has no such platform") for line in lines(inspected(path)))


def test_a_header_that_contradicts_its_folder_is_a_problem(fmu: Path, tmp_path: Path) -> None:
    elf = files_of(fmu)[HERE]
    arm = for_machine(elf, AARCH64)
    files = {
        "binaries/aarch64-linux/Small.so": arm,
        "binaries/riscv64-linux/Small.so": for_machine(elf, 243),
        "binaries/x86-linux/Small.so": arm,
        "binaries/x86_64-windows/Small.dll": elf,
        "binaries/x86_64-linux-gnu12/Small.a": b"a library for linking",
    }
    assert problems(changed(fmu, tmp_path / "a.fmu", files)) == {
        "aarch64-linux": None,
        "riscv64-linux": None,
        "x86-linux": "a binary for Linux, aarch64, expected Linux, x86 in this folder",
        "x86_64-linux": None,
        "x86_64-windows": "a binary for Linux, x86-64, expected Windows, x86-64 in this folder",
    }


def test_a_folder_without_the_library_of_the_model_is_a_problem(fmu: Path, tmp_path: Path) -> None:
    files = {HERE: None, "binaries/x86_64-darwin/Other.dylib": b"", "binaries/x86_64-windows/Other.dll": b""}
    assert problems(changed(fmu, tmp_path / "a.fmu", files)) == {
        "x86_64-darwin": "expected binaries/x86_64-darwin/Small.dylib",
        "x86_64-windows": "expected binaries/x86_64-windows/Small.dll",
    }


def test_what_is_for_scheduled_execution_is_not_tried(fmu: Path, tmp_path: Path) -> None:
    trial = try_loading(described(fmu, tmp_path / "a.fmu", "<CoSimulation ", "<ScheduledExecution "), Limits())
    assert trial.fmu.kinds == ("ScheduledExecution",)
    assert trial.failure == "not tried: it is for scheduled execution only"


def test_a_library_without_the_functions_of_fmi_3_does_not_load_and_nothing_says_that_it_is_ready(
    fmu: Path, tmp_path: Path, main: Main
) -> None:
    two = files_of(small(tmp_path))[f"binaries/{fmpy.platform}/Small{fmpy.sharedLibraryExtension}"]
    said = main("doctor", changed(fmu, tmp_path / "a.fmu", {HERE: two}), code=1).stdout
    assert f"loading: {HERE}: undefined symbol: fmi3" in said, "not by the folder in which it was unpacked"
    assert ": ready" not in said
