"""FMUs with one thing changed, and machines that have just what an FMU needs."""

import dataclasses
import io
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from elftools.elf.elffile import ELFFile

from orchestration.components.checks.doctor.binaries import LINUX
from orchestration.components.checks.doctor.dependencies import needed
from orchestration.components.checks.doctor.fmu import InspectedFmu
from orchestration.components.checks.doctor.machine import Library, Machine
from orchestration.components.checks.doctor.pythons import PythonLibrary

AARCH64 = 183
"""e_machine of ELF."""

LINUX64, WIN64 = "binaries/linux64/QuadrotorPlant.so", "binaries/win64/QuadrotorPlant.dll"


def files_of(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def changed(fmu: Path, path: Path, files: Mapping[str, bytes | None]) -> Path:
    """A copy of an FMU with some files added or replaced, or left out where there is None."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in {**files_of(fmu), **files}.items():
            if content is not None:
                archive.writestr(name, content)
    return path


def described(fmu: Path, path: Path, old: str, new: str) -> Path:
    """A copy of an FMU with a text of its description replaced, wherever it occurs."""
    description = files_of(fmu)["modelDescription.xml"].decode()
    assert old in description
    return changed(fmu, path, {"modelDescription.xml": description.replace(old, new).encode()})


def requiring(fmu: Path, path: Path, requires: str) -> Path:
    """A copy of an FMU that declares which Python it needs."""
    annotation = f'<Tool name="quadcosim"><Python requires="{requires}"/></Tool>'
    files = files_of(fmu)
    text = files["modelDescription.xml"].decode()
    start, end = text.find("<VendorAnnotations>"), text.find("</VendorAnnotations>")
    if start >= 0:
        text = text[:start] + text[end + len("</VendorAnnotations>") :]
    text = text.replace("<ModelVariables>", f"<VendorAnnotations>{annotation}</VendorAnnotations><ModelVariables>")
    return changed(fmu, path, {"modelDescription.xml": text.encode()})


def for_machine(elf: bytes, machine: int) -> bytes:
    """An ELF library whose header speaks of another machine."""
    return elf[:18] + struct.pack("<H", machine) + elf[20:]


def with_run_path(elf: bytes, tag: int, folder: str) -> bytes:
    """A 64-bit ELF library whose entry for its own name has become a run path."""
    section = ELFFile(io.BytesIO(elf)).get_section_by_name(".dynamic")
    entries = range(section["sh_offset"], section["sh_offset"] + section["sh_size"], 16)
    (place,) = (offset for offset in entries if struct.unpack_from("<q", elf, offset)[0] == 14)  # DT_SONAME
    changed = bytearray(elf)
    struct.pack_into("<q", changed, place, tag)
    name = b"libpythonfmu-export.so\0"
    assert changed.count(name) == 1
    return bytes(changed.replace(name, folder.encode().ljust(len(name), b"\0")))


def machine_for(fmu: InspectedFmu, **changes: Any) -> Machine:
    """A Linux machine that has just what the FMU needs, but for `changes`."""
    libraries = {
        dependency.name: Library(path=Path("/lib", dependency.name), versions=dependency.versions)
        for part in fmu.platforms
        for dependency in needed(part)
    }
    python = PythonLibrary(path=Path("/lib/libpython3.11.so.1.0"), version="3.11", found_by="the loader")
    machine = Machine(
        system=LINUX,
        architecture="x86-64",
        python="3.11.7",
        executable="/usr/bin/python3",
        temp_folder=Path("/tmp"),
        python_libraries=(python,),
        found=libraries,
        found_by_python=libraries,
    )
    return dataclasses.replace(machine, **changes)
