"""Libraries for other systems: what the system of each asks of them, and that they are of the same sources."""

import importlib.metadata
import importlib.util
import io
import shutil
import struct
import zipfile
from collections import defaultdict
from pathlib import Path

import fmpy
import pefile
import pytest

from fmu_kit.archive import read_source_hash
from fmu_kit.bundle import PackagingError, Target
from fmu_kit.compiler.pack.c_compiler import compiled_for, targets_of, universal
from fmu_kit.compiler.pack.c_compiler import compiler as compiler_here
from orchestration.components.building import builder, fmus
from orchestration.components.building.models import MODELS
from orchestration.components.checks.doctor.binaries import newest, read
from tests.extent import in_test_all, sample
from tests.native import kept
from tests.places import EXAMPLES

needs_zig = pytest.mark.skipif(
    importlib.util.find_spec("ziglang") is None, reason="no zig: pip install 'quadcosim[cross]'"
)
MODEL = "DoubleIntegrator"
MACH_O, X86_64, ARM64 = 0xFEEDFACF, 0x01000007, 0x0100000C
LIBRARIES = {
    2: {f"linux64/{MODEL}.so", f"aarch64-linux/{MODEL}.so", f"win64/{MODEL}.dll", f"darwin64/{MODEL}.dylib"},
    3: {
        f"x86_64-linux/{MODEL}.so",
        f"aarch64-linux/{MODEL}.so",
        f"x86_64-windows/{MODEL}.dll",
        f"x86_64-darwin/{MODEL}.dylib",
        f"aarch64-darwin/{MODEL}.dylib",
    },
}
PACKINGS = {2: builder.NATIVE, 3: builder.NATIVE_FMI_3}
CROSSED = sample([*PACKINGS], 1)
"""The versions of FMI in which it is built for all systems."""


def built(folder: Path, version: int, systems: str) -> Path:
    slaves = builder.slaves_named(str(EXAMPLES / "double_integrator" / MODEL))
    (path,) = builder.build_slaves(slaves, folder, packing=PACKINGS[version], systems=systems)
    return path


def crossed_once(slave: Target, version: int, systems: str) -> Path:
    """An FMU for other systems, kept until its sources or zig change."""
    folder = kept("crossed", str(slave), str(version), systems, importlib.metadata.version("ziglang"))
    path = folder / f"{slave.model}.fmu"
    if read_source_hash(path) != PACKINGS[version].source_hash(slave):
        builder.build_slaves([slave], folder, packing=PACKINGS[version], systems=systems)
    return path


@pytest.fixture(scope="module")
def crossed() -> dict[int, Path]:
    """A small slave for all systems, by the version of FMI."""
    (slave,) = builder.slaves_named(str(EXAMPLES / "double_integrator" / MODEL))
    return {version: crossed_once(slave, version, "all") for version in CROSSED}


def libraries(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/")]
        return {name.removeprefix("binaries/"): archive.read(name) for name in names}


def slices(library: bytes) -> list[tuple[int, int, bytes]]:
    """Of a universal library: processor, alignment and content of each."""
    magic, count = struct.unpack_from(">II", library)
    assert magic == 0xCAFEBABE
    found = []
    for k in range(count):
        cpu, _, offset, size, alignment = struct.unpack_from(">IIIII", library, 8 + 20 * k)
        assert offset % (1 << alignment) == 0
        found.append((cpu, alignment, library[offset : offset + size]))
    return found


def load_commands(library: bytes) -> dict[int, list[bytes]]:
    """Of a library for macOS, by the number of their kind."""
    count = struct.unpack_from("<I", library, 16)[0]
    found, place = defaultdict[int, list[bytes]](list), 32
    for _ in range(count):
        kind, size = struct.unpack_from("<II", library, place)
        found[kind].append(library[place : place + size])
        place += size
    return found


def test_a_universal_library_has_each_of_its_slices_whole_and_aligned() -> None:
    given = [
        struct.pack("<III", MACH_O, cpu, 0) + bytes([k]) * size for k, cpu, size in [(1, X86_64, 9), (2, ARM64, 99_999)]
    ]
    found = slices(universal(given))
    assert [content for _, _, content in found] == given
    assert [(cpu, alignment) for cpu, alignment, _ in found] == [(X86_64, 14), (ARM64, 14)]


def test_a_system_that_is_not_known_is_refused_with_those_that_are() -> None:
    assert targets_of("all") == ("linux64", "linux-aarch64", "win64", "darwin64")
    assert targets_of("win64,linux64") == ("win64", "linux64")
    with pytest.raises(
        PackagingError, match=r"^target amiga: expected all, or some of linux64, linux-aarch64, win64, "
    ):
        targets_of("linux64,amiga")


def without_zig(monkeypatch: pytest.MonkeyPatch, folder: Path, compiler: str = "") -> None:
    """No zig from now on, and on the path one compiler alone, which is that of this machine under another name."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    if compiler:
        (folder / compiler).symlink_to(compiler_here())
    monkeypatch.setattr(shutil, "which", lambda name: str(path) if (path := folder / name).is_file() else None)


SOURCES = {"main.c": b'__attribute__((visibility("default"))) int answer(void) { return 42; }'}


@pytest.mark.parametrize("version", PACKINGS)
def test_for_linux_on_arm_another_compiler_will_do(
    version: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has the name of FMI 3.0 also in FMI 2.0, which defines none."""
    without_zig(monkeypatch, tmp_path, "aarch64-linux-gnu-gcc")
    found = compiled_for("linux-aarch64", SOURCES, "main.c", version)
    assert [(name, content[:4]) for name, content in found.items()] == [("aarch64-linux", b"\x7fELF")]


@pytest.mark.parametrize(("target", "compiler"), [("linux-aarch64", ""), ("linux64", "aarch64-linux-gnu-gcc")])
def test_without_any_compiler_for_a_system_it_says_what_to_install(
    target: str, compiler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_zig(monkeypatch, tmp_path, compiler)
    with pytest.raises(
        PackagingError, match=r"^--target: expected zig, which compiles for all systems: pip install zig"
    ):
        compiled_for(target, SOURCES, "main.c")


@needs_zig
@pytest.mark.parametrize("version", CROSSED)
def test_for_linux_on_arm_it_needs_what_old_systems_have(version: int, crossed: dict[int, Path]) -> None:
    found = read(io.BytesIO(libraries(crossed[version])[f"aarch64-linux/{MODEL}.so"]))
    assert (found.system, found.architectures) == ("Linux", ("aarch64",))
    assert {library.name: newest(library.versions) for library in found.dependencies or ()} == {
        "libc.so.6": ("GLIBC_2.17",)
    }


@needs_zig
@pytest.mark.parametrize("version", CROSSED)
def test_there_is_a_library_for_each_system_by_its_name_in_the_version(version: int, crossed: dict[int, Path]) -> None:
    assert libraries(crossed[version]).keys() == LIBRARIES[version]


@in_test_all
@needs_zig
def test_two_builds_of_a_library_are_the_same_bytes(crossed: dict[int, Path], tmp_path: Path) -> None:
    again = libraries(built(tmp_path, 2, "win64"))
    assert again.items() <= libraries(crossed[2]).items()
    assert len(again) == 1


@needs_zig
@pytest.mark.parametrize("version", CROSSED)
def test_on_linux_a_plant_flies_to_the_bytes_of_the_one_that_cc_compiles(version: int) -> None:
    plant, packing = "QuadrotorPlant", PACKINGS[version]
    crossed = crossed_once(Target.parse(MODELS[plant]), version, "linux64")
    here = fmus.locate(f"{packing.folder}/{plant}")
    mine, others = (fmpy.simulate_fmu(str(path), stop_time=1.0, output_interval=0.01) for path in (crossed, here))
    assert len(mine) == 101
    assert mine.tobytes() == others.tobytes()


@in_test_all
@needs_zig
def test_for_macos_there_are_both_processors(crossed: dict[int, Path]) -> None:
    found = slices(libraries(crossed[2])[f"darwin64/{MODEL}.dylib"])
    assert [(cpu, alignment) for cpu, alignment, _ in found] == [(X86_64, 14), (ARM64, 14)]
    three = libraries(crossed[3])
    others = [three[f"{system}/{MODEL}.dylib"] for system in ("x86_64-darwin", "aarch64-darwin")]
    for (cpu, _, content), other in zip(found, others, strict=True):
        assert struct.unpack_from("<II", content) == struct.unpack_from("<II", other) == (MACH_O, cpu)


@needs_zig
def test_for_macos_it_needs_the_systems_library_alone_and_is_signed_where_it_must_be(crossed: dict[int, Path]) -> None:
    loads, versions, signature = 0xC, 0x32, 0x1D
    for cpu, _, content in slices(libraries(crossed[2])[f"darwin64/{MODEL}.dylib"]):
        commands = load_commands(content)
        assert [b"/usr/lib/libSystem.B.dylib\0" in each for each in commands[loads]] == [True]
        assert [each[12:16] for each in commands[versions]] == [bytes([0, 0, 11, 0])]  # macOS 11.0
        assert cpu != ARM64 or signature in commands  # macOS loads nothing else on these processors


@needs_zig
@pytest.mark.parametrize("version", CROSSED)
def test_for_windows_it_exports_fmi_and_needs_what_each_has(version: int, crossed: dict[int, Path]) -> None:
    (content,) = (library for name, library in libraries(crossed[version]).items() if name.endswith(".dll"))
    library = pefile.PE(data=content)
    exported = {symbol.name.decode() for symbol in library.DIRECTORY_ENTRY_EXPORT.symbols}
    assert {f"fmi{version}DoStep", f"fmi{version}FreeInstance"} <= exported
    assert all(name.startswith(f"fmi{version}") for name in exported)
    needed = {entry.dll.decode().lower() for entry in library.DIRECTORY_ENTRY_IMPORT}
    assert all(name == "kernel32.dll" or name.startswith("api-ms-win-crt-") for name in needed)
