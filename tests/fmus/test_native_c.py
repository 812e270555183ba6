"""A native FMU as C: its sources compile anywhere, its library needs nothing, its life leaves nothing behind."""

import shutil
import zipfile
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from fmu_kit.bundle import Target
from orchestration.components.building import fmus
from orchestration.components.building.models import MODELS
from orchestration.components.checks.validation.validator import validate
from tests.extent import in_test_all, sample
from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.making import PAIR
from tests.fmus.process import run
from tests.fmus.test_c_host import GUIDE_HOST, NOT_PYTHON, STEPS, H, arguments, compiled
from tests.native import natives
from tests.places import EXAMPLES

LIFE = Path(__file__).with_name("life.c")
OF_LIBC = {"__cxa_finalize", "__stack_chk_fail", "calloc", "free", "malloc", "memcmp", "memcpy", "memmove", "memset"}
OF_LIBC |= {"strcmp", "strcpy", "strlen"}
"""All that a native FMU asks of another library."""


@pytest.fixture(params=sample([*MODELS], 1))
def fmu(request: pytest.FixtureRequest) -> Path:
    """Each of this project's native FMUs."""
    return fmus.locate(f"native/{request.param}")


@pytest.fixture
def sources(fmu: Path, tmp_path: Path) -> Path:
    """Its sources, unpacked."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(tmp_path / "unpacked")
    return tmp_path / "unpacked" / "sources"


def tool(name: str) -> str:
    """The path of a program; without it the test is skipped by name."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"no {name}: install it (Debian and Ubuntu: apt install {name})")
    return path


def life(sources: Path, *options: str) -> Path:
    """The program that goes through the life of instances, compiled with the sources of an FMU."""
    program = sources.parent / "life"
    done = run(tool("gcc"), "-std=c11", "-g", f"-I{sources}", *options, str(LIFE), "-o", str(program), "-pthread")
    assert done.returncode == 0, done.stderr
    return program


@in_test_all
@pytest.mark.parametrize("fmu", sample([*PAIR], 1), indirect=True)
def test_the_whole_life_of_an_instance_is_silent_under_sanitizers(sources: Path) -> None:
    """States, bytes that were damaged, failures, resets and two threads; and no step asks for memory."""
    done = run(str(life(sources, "-fsanitize=address,undefined", "-fno-sanitize-recover=all")))
    assert (done.returncode, done.stderr) == (0, "")


@in_test_all
@pytest.mark.parametrize("fmu", ["QuadrotorPlant"], indirect=True)
def test_the_whole_life_of_an_instance_is_silent_under_valgrind(sources: Path) -> None:
    valgrind = (tool("valgrind"), "-q", "--error-exitcode=9", "--leak-check=full", "--show-leak-kinds=all")
    done = run(*valgrind, str(life(sources, "-O1")))
    assert (done.returncode, done.stderr) == (0, "")


def test_a_c_program_flies_it_without_python_or_another_library(tmp_path: Path) -> None:
    host = compiled(GUIDE_HOST, tmp_path)
    done = run(str(host), NOT_PYTHON, *arguments(fmus.locate("native/UnifiedController"), tmp_path / "it", MEASUREMENT))
    assert (done.returncode, done.stderr) == (0, "")
    command = [float(line) for line in done.stdout.splitlines()]
    assert command == pytest.approx(law_command((STEPS - 1) * H), rel=1e-9, abs=1e-9)
    assert len(command) == len(COMMAND)


def test_its_library_needs_the_c_library_only_and_of_that_no_mathematics(fmu: Path, sources: Path) -> None:
    (library,) = sources.parent.glob("binaries/*/*.so")
    with library.open("rb") as file:
        elf = ELFFile(file)
        needed = [tag.needed for tag in elf.get_section_by_name(".dynamic").iter_tags("DT_NEEDED")]
        symbols = list(elf.get_section_by_name(".dynsym").iter_symbols())
    asked = {symbol.name for symbol in symbols if symbol["st_shndx"] == "SHN_UNDEF"} - {""}
    weak = {symbol.name for symbol in symbols if symbol["st_info"]["bind"] == "STB_WEAK"}
    given = {symbol.name for symbol in symbols if symbol["st_shndx"] != "SHN_UNDEF"}
    assert needed in (["libc.so.6"], [])
    assert asked - weak <= OF_LIBC
    assert given
    assert all(name.startswith("fmi2") for name in given)


def test_its_sources_are_plain_c_of_1999_without_a_warning(fmu: Path, sources: Path) -> None:
    level = "-O1" if fmu.stem == "QuadrotorPlant" else "-O0"  # that which finds what is used unset takes thrice as long
    strict = ("-std=c99", level, "-Wall", "-Wextra", "-Wpedantic", "-Werror")
    done = run(tool("gcc"), *strict, "-c", str(sources / "fmi2.c"), "-o", str(sources / "it.o"))
    assert (done.returncode, done.stderr) == (0, "")


@in_test_all
def test_two_builds_in_two_folders_have_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = []
    for name in ("one", "another folder"):
        root = tmp_path / name
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / f"cache of {name}"))  # it is compiled twice
        shutil.copytree(EXAMPLES / "water_tank", root, ignore=shutil.ignore_patterns("*.fmu", "native", "__pycache__"))
        built.append(natives([Target("tank", "Tank", root)], "own", root / "made")["Tank"].read_bytes())
    assert built[0] == built[1]


def test_validation_finds_nothing_in_it(fmu: Path) -> None:
    assert [finding for finding in validate(fmu) if not finding.note] == []
