"""The headers of shared libraries in ELF, PE and Mach-O: their machine and dependencies.

Headers and tables only, so that a library for any machine can be read on any other.
"""

import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import BinaryIO

from orchestration.foundation.processes.passable import passable

LINUX, WINDOWS, MACOS = "Linux", "Windows", "macOS"

_ELF_SYSTEMS = {"ELFOSABI_SYSV": LINUX, "ELFOSABI_LINUX": LINUX}
_ELF_MACHINES = {
    **{"EM_386": "x86", "EM_X86_64": "x86-64", "EM_ARM": "arm", "EM_AARCH64": "aarch64"},
    **{"EM_PPC": "ppc32", "EM_PPC64": "ppc64"},
}
_PE_MACHINES = {0x14C: "x86", 0x8664: "x86-64", 0x1C4: "arm", 0xAA64: "aarch64"}
_MACH_MACHINES = {7: "x86", 0x01000007: "x86-64", 12: "arm", 0x0100000C: "aarch64"}
_MACH_O = {b"\xce\xfa\xed\xfe": "<", b"\xcf\xfa\xed\xfe": "<", b"\xfe\xed\xfa\xce": ">", b"\xfe\xed\xfa\xcf": ">"}
_FAT_MACH_O = {b"\xca\xfe\xba\xbe": 20, b"\xca\xfe\xba\xbf": 32}
"""Magic number -> size of the entry of one architecture."""

_WEAK_VERSION = 2
"""VER_FLG_WEAK: the loader only warns if such a version is missing."""

_PYTHON_SYMBOL = re.compile(r"_?Py[A-Z_]")
_NUMBERED = re.compile(r"(.+)_(\d+(?:\.\d+)*)")


class UnreadableError(Exception):
    """A file is no shared library of a known format, or damaged."""


@passable
@dataclass(frozen=True, kw_only=True)
class Dependency:
    """A library that must be found, and the versions of symbols that it must define."""

    name: str
    versions: tuple[str, ...] = ()


@passable
@dataclass(frozen=True, kw_only=True)
class Binary:
    """A shared library or program."""

    system: str
    architectures: tuple[str, ...]
    """More than one in a universal Mach-O file."""
    dependencies: tuple[Dependency, ...] | None = None
    """None: unknown; the tables of Mach-O are not read, and an ELF file can be stripped of them."""
    python_symbols: tuple[str, ...] = ()
    """Undefined symbols of Python, to be provided by its host (ELF)."""
    defined_versions: tuple[str, ...] = ()
    """Versions of symbols that it defines (ELF)."""
    run_path: tuple[str, ...] = ()
    """Folders in which the loader searches its dependencies (ELF)."""
    inherited_run_path: tuple[str, ...] = ()
    """Those that apply to the dependencies of its dependencies, too: DT_RPATH without DT_RUNPATH."""

    @property
    def dependency_names(self) -> tuple[str, ...]:
        """The names alone; empty if unknown."""
        return tuple(dependency.name for dependency in self.dependencies or ())

    @property
    def target(self) -> str:
        """The machines that it is for, as text."""
        return f"{self.system}, {' and '.join(self.architectures)}"

    def fits(self, system: str, architecture: str) -> bool:
        """Whether a process of this kind can load it."""
        return self.system == system and architecture in self.architectures


def combined(first: Binary, second: Binary) -> Binary:
    """The needs of `first` and of `second`, which it loads, both for the same machine."""
    versions: dict[str, set[str]] = {}
    for dependency in (*(first.dependencies or ()), *(second.dependencies or ())):
        versions.setdefault(dependency.name, set()).update(dependency.versions)
    dependencies = tuple(Dependency(name=name, versions=tuple(sorted(found))) for name, found in versions.items())
    return replace(first, dependencies=dependencies, python_symbols=second.python_symbols)


def read(stream: BinaryIO, *, symbols: bool = True) -> Binary:
    """Read a shared library or program; raises `UnreadableError` with the reason.

    `symbols`: whether symbols of Python are searched, which takes long in a library with many.
    """
    magic = stream.read(4)
    stream.seek(0)
    try:
        if magic == b"\x7fELF":
            return _read_elf(stream, symbols)
        if magic[:2] == b"MZ":
            return _read_pe(stream)
        if magic in _MACH_O or magic in _FAT_MACH_O:
            return Binary(system=MACOS, architectures=_mach_architectures(stream.read(4096)))
    except Exception as error:  # the parsers fail on damage in various ways
        raise UnreadableError(f"damaged: {error}") from error
    raise UnreadableError(f"begins with {magic!r}, expected an ELF, PE or Mach-O file")


def origin_in(folder: str, origin: str) -> str:
    """A folder of a run path with the folder of its binary for $ORIGIN."""
    return folder.replace("${ORIGIN}", origin).replace("$ORIGIN", origin)


def newest(versions: Iterable[str], *, unnumbered: bool = False) -> tuple[str, ...]:
    """The highest version of each kind, e.g. of all GLIBCXX_*, and if `unnumbered` those without a number."""
    highest: dict[str, tuple[tuple[int, ...], str]] = {}
    for version in versions:
        match = _NUMBERED.fullmatch(version)
        if match:
            number = tuple(map(int, match[2].split(".")))
            highest[match[1]] = max(highest.get(match[1], ((), "")), (number, version))
        elif unnumbered:
            highest[version] = ((), version)
    return tuple(version for _, version in highest.values())


def _read_elf(stream: BinaryIO, symbols: bool) -> Binary:
    from elftools.elf.dynamic import DynamicSection
    from elftools.elf.elffile import ELFFile
    from elftools.elf.gnuversions import GNUVerDefSection, GNUVerNeedSection
    from elftools.elf.sections import SymbolTableSection

    dependencies: list[str] | None = None
    run_path: list[str] = []
    inherited: list[str] = []
    required: dict[str, tuple[str, ...]] = {}
    defined: tuple[str, ...] = ()
    undefined: tuple[str, ...] = ()
    elf = ELFFile(stream)
    for section in elf.iter_sections():
        if isinstance(section, DynamicSection):
            dependencies = [tag.needed for tag in section.iter_tags("DT_NEEDED")]
            inherited = [folder for tag in section.iter_tags("DT_RPATH") for folder in tag.rpath.split(":")]
            run_path = [folder for tag in section.iter_tags("DT_RUNPATH") for folder in tag.runpath.split(":")]
        elif isinstance(section, GNUVerNeedSection):
            for library, versions in section.iter_versions():
                required[library.name] = tuple(v.name for v in versions if not v["vna_flags"] & _WEAK_VERSION)
        elif isinstance(section, GNUVerDefSection):
            defined = tuple(next(names).name for _, names in section.iter_versions())
        elif symbols and isinstance(section, SymbolTableSection) and section.name == ".dynsym":
            undefined = tuple(s.name for s in section.iter_symbols() if s["st_shndx"] == "SHN_UNDEF")
    machine, abi = str(elf["e_machine"]), str(elf["e_ident"]["EI_OSABI"])
    named = f"riscv{elf.elfclass}" if machine == "EM_RISCV" else _ELF_MACHINES.get(machine, machine)
    return Binary(
        system=_ELF_SYSTEMS.get(abi, abi),
        architectures=(named,),
        dependencies=None
        if dependencies is None
        else tuple(Dependency(name=name, versions=required.get(name, ())) for name in dependencies),
        python_symbols=tuple(filter(_PYTHON_SYMBOL.match, undefined)),
        defined_versions=defined,
        run_path=tuple(run_path or inherited),
        inherited_run_path=() if run_path else tuple(inherited),
    )


def _read_pe(stream: BinaryIO) -> Binary:
    import pefile

    pe = pefile.PE(data=stream.read(), fast_load=True)  # no file to close, which takes a collection of all garbage
    pe.parse_data_directories([pefile.DIRECTORY_ENTRY["IMAGE_DIRECTORY_ENTRY_IMPORT"]])
    machine = pe.FILE_HEADER.Machine
    imported = [entry.dll.decode() for entry in getattr(pe, "DIRECTORY_ENTRY_IMPORT", ())]
    return Binary(
        system=WINDOWS,
        architectures=(_PE_MACHINES.get(machine, hex(machine)),),
        dependencies=tuple(Dependency(name=name) for name in imported),
    )


def _mach_architectures(header: bytes) -> tuple[str, ...]:
    order, size = _MACH_O.get(header[:4]), _FAT_MACH_O.get(header[:4])
    if size is None:
        machines = [struct.unpack_from(f"{order}I", header, 4)[0]]
    else:
        count = struct.unpack_from(">I", header, 4)[0]
        machines = [struct.unpack_from(">I", header, 8 + size * i)[0] for i in range(count)]
    return tuple(_MACH_MACHINES.get(machine, hex(machine)) for machine in machines)
