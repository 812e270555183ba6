"""`quadcosim doctor` on this machine, with FMUs that load and FMUs that do not."""

import json
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import pytest

from orchestration.components.building.models import MODELS
from orchestration.components.checks.doctor import loading
from orchestration.components.checks.doctor.as_lines import as_text
from orchestration.components.checks.doctor.report import DoctorReport, as_tables, examine
from orchestration.foundation.processes.resource_limits import Limits
from tests.commands import Main
from tests.fmus.foreign import lag, needs_compiler
from tests.fmus.process import run
from tests.orchestration.components.checks.doctor.common import (
    AARCH64,
    LINUX64,
    changed,
    files_of,
    for_machine,
    requiring,
)
from tests.orchestration.components.fmi.exchange import exchange
from tests.places import ROOT


@pytest.fixture
def plant(built: dict[str, Path]) -> Path:
    return built["QuadrotorPlant"]


@pytest.fixture(scope="module")
def report(built: dict[str, Path]) -> DoctorReport:
    """What is found of an FMU that loads."""
    return examine([built["QuadrotorPlant"]], Limits())


def examined(fmu: Path) -> dict[str, Any]:
    """The report on one FMU."""
    return only(as_tables(examine([fmu], Limits())))


def examined_in(folder: Path, fmu: Path, code: int, main: Main, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the command says as JSON where temporary files go to a folder; the exit code must agree with it."""
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    done = main("doctor", fmu, "--json", code=code)
    assert done.stderr == ""
    report = json.loads(done.stdout)
    assert report["good"] == (code == 0)
    return only(report)


def only(report: dict[str, Any]) -> dict[str, Any]:
    (table,) = report["fmus"]
    assert report["good"] == table["good"]
    return {"machine": report["machine"], **table}


def code_of(report: DoctorReport) -> int:
    """With which the command ends for an FMU that loads."""
    return 0 if report.machine.python_libraries else 1


def test_all_fmus_of_the_project_load_here(report: DoctorReport, main: Main) -> None:
    document = json.loads(main("doctor", "--json", code=code_of(report)).stdout)
    assert [Path(table["path"]).name for table in document["fmus"]] == [f"{model}.fmu" for model in MODELS]
    for table in document["fmus"]:
        assert table["loads"]
        assert table["problems"] == []
        assert table["hosts"]["python"] == {"ready": True, "needs": [], "start": None, "note": None}
        assert table["hosts"]["other"]["ready"] == bool(document["machine"]["python_libraries"])


def test_the_text_has_a_block_for_the_machine_and_one_for_the_fmu(plant: Path, report: DoctorReport) -> None:
    machine, block = "\n".join(as_text(report).splitlines()).split("\n\n")
    assert [each.splitlines()[0] for each in (machine, block)] == ["this machine", str(plant)]
    assert "Linux, x86-64" in block
    assert "fmpy and others: ready" in block
    assert block.splitlines()[-1].split() == ["tried", "here", "loads"]


def test_the_machine_is_this_one(report: DoctorReport) -> None:
    machine = as_tables(report)["machine"]
    assert machine["executable"] == sys.executable
    assert machine["python"] == ".".join(map(str, sys.version_info[:3]))
    # of a process of its own: a test before this one may have loaded a libpython into this one
    command = [sys.executable, "-c", "print('libpython' in open('/proc/self/maps').read())"]
    assert str(machine["shared"]) == subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_a_binary_for_another_machine_is_found_out(plant: Path, tmp_path: Path) -> None:
    files = {LINUX64: for_machine(files_of(plant)[LINUX64], AARCH64)}
    table = examined(changed(plant, tmp_path / "arm.fmu", files))
    assert table["problems"] == ["linux64: a binary for Linux, aarch64, expected Linux, x86-64 in this folder"]
    assert table["hosts"]["python"]["needs"] == ["an FMU with a binary for Linux, x86-64"]
    assert not table["loads"]
    assert "cannot open shared object file" in table["failure"]


def test_a_binary_that_asks_for_a_newer_glibc_is_found_out_before_the_loader_does(plant: Path, tmp_path: Path) -> None:
    elf = files_of(plant)[LINUX64]
    assert elf.count(b"\0GLIBC_2.32\0") == 1
    files = {LINUX64: elf.replace(b"\0GLIBC_2.32\0", b"\0GLIBC_9.32\0")}
    table = examined(changed(plant, tmp_path / "new.fmu", files))
    for host in table["hosts"].values():
        (need,) = (need for need in host["needs"] if need.startswith("libc.so.6"))
        assert need.startswith("libc.so.6 with GLIBC_9.32, here GLIBC_2.")
    assert "GLIBC_9.32' not found" in table["failure"]


def test_an_fmu_without_a_binary_for_this_platform_is_found_out(plant: Path, tmp_path: Path) -> None:
    table = examined(
        changed(plant, tmp_path / "none.fmu", dict.fromkeys(n for n in files_of(plant) if n.startswith("binaries/")))
    )
    assert table["platform_here"] is None
    assert table["failure"] == "has no binary for linux64, nor for any other platform"


def test_an_unsatisfied_requirement_is_found_out_though_it_loads(plant: Path, tmp_path: Path) -> None:
    table = examined(requiring(plant, tmp_path / "future.fmu", "&gt;=4"))
    assert table["loads"]
    assert not table["good"]
    assert table["hosts"]["python"]["needs"][0].startswith("Python >=4; this is 3.")


def test_a_package_that_is_not_here_is_found_out(plant: Path, tmp_path: Path) -> None:
    source = {"resources/extra.py": b"import numpy, quadcosim_none"}
    table = examined(changed(plant, tmp_path / "numpy.fmu", source))
    assert table["python"]["imports"] == ["numpy", "quadcosim_none"]
    assert table["machine"]["modules"] == {"numpy": True, "quadcosim_none": False}
    assert table["hosts"]["python"]["needs"] == ["quadcosim_none where this Python can import it"]


def test_a_temp_folder_that_is_not_ascii_is_found_out(
    plant: Path, tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = examined_in(tmp_path / "café", plant, 1, main, monkeypatch)
    for host in table["hosts"].values():
        assert any("a temp folder" in need and "café" in need for need in host["needs"])
    assert not table["loads"]


def test_a_temp_folder_with_a_space_is_none_of_pythonfmus_troubles(
    plant: Path, tmp_path: Path, report: DoctorReport, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = examined_in(tmp_path / "with space", plant, code_of(report), main, monkeypatch)
    assert table["loads"]
    assert table["hosts"]["python"]["ready"]


def test_an_fmu_that_fails_to_initialise_is_told_in_its_own_words(plant: Path, tmp_path: Path) -> None:
    files = files_of(plant)
    (interface,) = (name for name in files if name.endswith("/plant_fmu/interface.py"))
    light = files[interface].replace(b'"kg", _BODY.mass', b'"kg", -1.0')
    table = examined(changed(plant, tmp_path / "light.fmu", {interface: light}))
    text = "fmi2ExitInitializationMode: mass = -1.0: expected a finite value > 0"
    assert table["failure"] == text


@needs_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_for_model_exchange_alone_is_loaded(fmi: int, tmp_path: Path) -> None:
    table = examined(exchange(tmp_path, "ball", fmi=fmi))
    assert (table["kinds"], table["failure"]) == (["ModelExchange"], None)
    assert [host["ready"] for host in table["hosts"].values()] == [True, True]


def failure(path: Path, **limits: float) -> str | None:
    return loading.try_loading(path, Limits(**limits)).failure


def test_an_fmu_that_takes_its_process_down_does_not_take_the_doctor_along(plant: Path, tmp_path: Path) -> None:
    crash = b"import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n"
    (entry,) = (name for name in files_of(plant) if name.endswith("_entry.py"))
    assert failure(changed(plant, tmp_path / "a.fmu", {entry: crash})) == ("took its process down: it ended by SIGSEGV")


@needs_compiler
def test_an_fmu_that_ends_its_process_in_good_order_does_not_load(tmp_path: Path) -> None:
    assert failure(lag(tmp_path / "lag.fmu")) is None
    assert failure(lag(tmp_path / "lag.fmu", "EXIT_AT_ONCE")) == "took its process down: it ended with exit code 0"


@needs_compiler
def test_an_fmu_that_takes_too_much_is_stopped(tmp_path: Path) -> None:
    talks, hoards = (lag(tmp_path / f"{macro}.fmu", macro) for macro in ("TALKS", "HOARDS"))
    start = "its process was stopped: it "
    assert failure(talks, output=1.0) == f"{start}writes more than the limit of 1 MB to its standard output and error"
    assert failure(hoards, memory=500.0) == f"{start}takes more memory than the limit of 500 MB"


@needs_compiler
def test_what_loading_does_not_need_may_be_odd(tmp_path: Path) -> None:
    odd = {
        'stopTime="1"': 'stopTime="late"',
        '<Real start="1"/>': '<Real start="1" nominal="large"/>',
        'causality="output"><Real/>': 'causality="result"><Real derivative="x"/>',
        '<Unknown index="2"/></Outputs>': '<Unknown index="seven"/></Outputs>',
    }
    assert failure(lag(tmp_path / "lag.fmu", described=odd)) is None


@needs_compiler
def test_a_wrong_file_for_another_platform_is_said_and_is_no_fault_here(tmp_path: Path) -> None:
    path = lag(tmp_path / "lag.fmu")
    table = examined(changed(path, tmp_path / "a.fmu", {"binaries/win64/Lag.dll": b"version https://"}))
    assert table["problems"] == []
    assert table["elsewhere"] == [
        "win64: binaries/win64/Lag.dll: begins with b'vers', expected an ELF, PE or Mach-O file"
    ]
    assert table["good"]


@needs_compiler
def test_an_fmu_of_another_version_of_fmi_is_said_and_the_others_are_looked_at(tmp_path: Path, main: Main) -> None:
    one = lag(tmp_path / "one.fmu", described={'fmiVersion="2.0"': 'fmiVersion="1.0"'})
    why = "fmiVersion = 1.0: expected 2.0 or 3.0; an FMU of FMI 1.0 is not checked here"
    both = one, lag(tmp_path / "two.fmu")
    done = main("doctor", *both, code=1)
    answer, _, rest = done.stdout.partition("\n")
    assert answer == f"1 of 2 FMUs load here, with nothing missing; one.fmu does not load: {why}"
    assert main("doctor", one, code=1).stdout.partition("\n")[0] == f"one.fmu does not load: {why}"
    blocks = rest.rstrip("\n").split("\n\n")
    assert [block.splitlines()[0] for block in blocks] == ["this machine", *map(str, both)]
    assert blocks[1].splitlines()[1:] == [f"! file         {why}"]
    assert blocks[2].splitlines()[-1].split() == ["tried", "here", "loads"]
    document = json.loads(main("doctor", *both, "--json", code=1).stdout)
    assert document["fmus"][0] == {"path": str(one), "failure": why, "loads": False, "good": False}
    assert [table["loads"] for table in document["fmus"]] == [False, True]
    assert not document["good"]


@needs_compiler
def test_a_foreign_pythonhome_or_pythonpath_is_what_the_doctor_finds(tmp_path: Path) -> None:
    path = lag(tmp_path / "lag.fmu")
    for module in ("typer", "pydantic"):
        (tmp_path / f"{module}.py").write_text("raise ImportError('of another Python')")
    environment = {"PYTHONPATH": f"{tmp_path}:{ROOT}"}
    start = (sys.executable, "-m", "orchestration.command.start")
    done = run(*start, "doctor", str(path), environment=environment)
    assert done.returncode == 1, done.stderr
    last_line = done.stdout.splitlines()[-1]
    assert last_line.startswith(f"! tried here   loads without PYTHONPATH={tmp_path}:{ROOT}, not with it: ")
    assert last_line.endswith("ImportError: of another Python")
    done = run(*start, "--help", environment=environment)
    assert (done.returncode, done.stderr) == (
        1, f"quadcosim: it does not start with PYTHONPATH={tmp_path}:{ROOT}: ImportError: of another Python\n",
    )  # fmt: skip


def test_an_archive_of_zeros_is_refused_before_it_is_unpacked(plant: Path, tmp_path: Path, main: Main) -> None:
    path = changed(plant, tmp_path / "a.fmu", {})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/zeros", bytes(20_000_000))
    done = main("doctor", path, "--size-limit", "10", code=2)
    assert done.stderr == f"quadcosim: {path}: unpacks to 21 MB: expected at most 10 MB (--size-limit)\n"


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "no such file"),
        (b"no zip", "expected a zip archive that is whole: File is not a zip file"),
    ],
)
def test_what_is_no_fmu_is_wrong_usage_in_one_line(
    content: bytes | None, text: str, tmp_path: Path, main: Main
) -> None:
    path = tmp_path / "a.fmu"
    if content is not None:
        path.write_bytes(content)
    done = main("doctor", path, code=2)
    assert done.stdout == ""
    assert done.stderr == f"quadcosim: {path}: {text}\n"


def test_an_archive_without_a_description_is_wrong_usage_in_one_line(plant: Path, tmp_path: Path, main: Main) -> None:
    done = main("doctor", changed(plant, tmp_path / "a.fmu", {"modelDescription.xml": None}), code=2)
    assert done.stderr.splitlines() == [
        f"quadcosim: {tmp_path / 'a.fmu'}: expected an FMU, with modelDescription.xml at the top of the archive"
    ]
