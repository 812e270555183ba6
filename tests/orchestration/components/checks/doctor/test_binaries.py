"""What libraries say of themselves, on the ones that pythonfmu ships and on small changes to them."""

import io
import struct
import sys
from pathlib import Path

import pytest

from orchestration.components.checks.doctor.binaries import LINUX, MACOS, WINDOWS, Binary, UnreadableError, newest, read
from orchestration.components.checks.doctor.machine import this_machine
from tests.orchestration.components.checks.doctor.common import (
    AARCH64,
    LINUX64,
    WIN64,
    files_of,
    for_machine,
    with_run_path,
)


@pytest.fixture(scope="module")
def files(built: dict[str, Path]) -> dict[str, bytes]:
    return files_of(built["QuadrotorPlant"])


def read_bytes(content: bytes) -> Binary:
    return read(io.BytesIO(content))


def test_the_linux_library_names_its_libraries_and_their_versions(files: dict[str, bytes]) -> None:
    binary = read_bytes(files[LINUX64])
    assert binary.fits(LINUX, "x86-64")
    assert binary.dependencies is not None
    needed = {dependency.name: newest(dependency.versions) for dependency in binary.dependencies}
    assert needed == {
        "libstdc++.so.6": ("GLIBCXX_3.4.30", "CXXABI_1.3.9"),
        "libgcc_s.so.1": ("GCC_3.0",),
        "libc.so.6": ("GLIBC_2.32",),
    }


def test_the_linux_library_leaves_python_to_its_host(files: dict[str, bytes]) -> None:
    symbols = read_bytes(files[LINUX64]).python_symbols
    assert {"_Py_NoneStruct", "Py_Initialize", "PyImport_ImportModule"} <= set(symbols)
    assert all("Py" in symbol for symbol in symbols)


def test_the_windows_library_imports_python_and_the_c_runtime(files: dict[str, bytes]) -> None:
    binary = read_bytes(files[WIN64])
    assert binary.fits(WINDOWS, "x86-64")
    assert {"python3.dll", "VCRUNTIME140.dll", "KERNEL32.dll"} <= set(binary.dependency_names)


def test_a_library_on_this_machine_defines_what_it_offers() -> None:
    with Path("/proc/self/maps").open(encoding="utf-8") as maps:
        libc = next(line.split()[-1] for line in maps if line.rstrip().endswith("/libc.so.6"))
    versions = read_bytes(Path(libc).read_bytes()).defined_versions
    (glibc,) = (version for version in newest(versions) if version.startswith("GLIBC_"))
    assert f"glibc {glibc.removeprefix('GLIBC_')}" == this_machine(()).glibc


def test_this_python_is_a_binary_of_this_machine() -> None:
    machine = this_machine(())
    assert read_bytes(Path(sys.executable).read_bytes()).fits(machine.system, machine.architecture)


def test_the_header_says_for_which_machine_it_is(files: dict[str, bytes]) -> None:
    assert read_bytes(for_machine(files[LINUX64], AARCH64)).architectures == ("aarch64",)
    assert read_bytes(for_machine(files[LINUX64], 243)).architectures == ("riscv64",)
    assert read_bytes(for_machine(files[LINUX64], 22)).architectures == ("EM_S390",)


@pytest.mark.parametrize(("tag", "inherited"), [(29, ()), (15, ("/opt/lib",))], ids=["DT_RUNPATH", "DT_RPATH"])
def test_only_an_rpath_holds_for_what_is_loaded_later(
    tag: int, inherited: tuple[str, ...], files: dict[str, bytes]
) -> None:
    binary = read_bytes(with_run_path(files[LINUX64], tag, "/opt/lib"))
    assert (binary.run_path, binary.inherited_run_path) == (("/opt/lib",), inherited)


@pytest.mark.parametrize(
    ("header", "architectures"),
    [
        (struct.pack("<II", 0xFEEDFACF, 0x0100000C), ("aarch64",)),
        (struct.pack(">II", 0xFEEDFACF, 0x01000007), ("x86-64",)),
        (struct.pack(">II5I5I", 0xCAFEBABE, 2, 0x01000007, *[0] * 4, 0x0100000C, *[0] * 4), ("x86-64", "aarch64")),
    ],
    ids=["arm64", "big-endian", "universal"],
)
def test_mach_o_headers_are_read(header: bytes, architectures: tuple[str, ...]) -> None:
    binary = read_bytes(header)
    assert (binary.system, binary.architectures, binary.dependencies) == (MACOS, architectures, None)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"#!/bin/sh", "begins with b'#!/b', expected an ELF, PE or Mach-O file"),
        (b"", "begins with b'', expected"),
        (b"\x7fELF" + bytes(8), "damaged: "),
        (b"MZ" + bytes(90), "damaged: "),
        (struct.pack(">II", 0xCAFEBABE, 9), "damaged: "),
    ],
)
def test_what_is_no_library_is_refused(content: bytes, text: str) -> None:
    with pytest.raises(UnreadableError) as refusal:
        read_bytes(content)
    assert str(refusal.value).startswith(text)


def test_versions_are_compared_as_numbers() -> None:
    versions = ("GLIBC_2.4", "GLIBC_2.32", "GLIBC_2.9", "GLIBC_PRIVATE", "GLIBCXX_3.4.9", "GLIBCXX_3.4.30")
    assert newest(versions) == ("GLIBC_2.32", "GLIBCXX_3.4.30")
