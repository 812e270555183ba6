"""The FMUs in a host that is not Python, as in Simulink or a Modelica tool."""

import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest

from orchestration.components.checks.doctor.dependencies import needed
from orchestration.components.checks.doctor.fmu import inspected
from orchestration.components.checks.doctor.machine import this_machine
from orchestration.components.checks.doctor.pythons import BY_LOADER, THIS_PYTHON, PythonLibrary
from orchestration.components.checks.doctor.verdict import INSTALL_LIBPYTHON, other_host, satisfies
from tests.extent import sample
from tests.fmus.archive import without_loader
from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.instance import Instance
from tests.fmus.loop import MOTION
from tests.fmus.process import run

STEPS, H = 100, 0.01
GUIDE_HOST = Path(__file__).parent.parent.parent / "docs" / "guides" / "host.c"


def compiled(source: Path, folder: Path) -> Path:
    """The program of a source."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: install one that is called cc (Debian and Ubuntu: apt install gcc libc6-dev)")
    program = folder / "host"
    options = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-pthread", "-I", str(GUIDE_HOST.parent))
    done = run(compiler, *options, str(source), "-o", str(program), "-ldl")
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled host."""
    return compiled(GUIDE_HOST, tmp_path_factory.mktemp("host"))


@pytest.fixture(scope="module")
def threads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled host that has threads."""
    return compiled(Path(__file__).with_name("threads.c"), tmp_path_factory.mktemp("threads"))


@pytest.fixture(scope="module")
def library() -> PythonLibrary:
    """A shared libpython."""
    for found in this_machine(()).python_libraries:
        if satisfies(found.version, ">=3.10"):
            return found
    pytest.skip(f"no shared libpython of 3.10 or later: {INSTALL_LIBPYTHON}")


@pytest.fixture
def environment(tmp_path: Path, library: PythonLibrary) -> dict[str, str]:
    """For the embedded interpreter: a numpy that betrays its import, and the standard library that fits."""
    trap = tmp_path / "trap" / "numpy"
    trap.mkdir(parents=True)
    (trap / "__init__.py").write_text(
        "import pathlib\npathlib.Path(__file__).with_name('imported').touch()\nraise ImportError('numpy in an FMU')\n"
    )
    variables = {"PYTHONPATH": str(trap.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    if library.home is not None:
        variables["PYTHONHOME"] = str(library.home)
    return variables


def unpacked(fmu: Path, folder: Path) -> list[str]:
    """Library, resources and GUID of the FMU, unpacked into `folder`."""
    fmpy.extract(str(fmu), str(folder))
    description = fmpy.read_model_description(str(fmu))
    library = folder / "binaries" / fmpy.platform / f"{description.coSimulation.modelIdentifier}.so"
    return [str(library), (folder / "resources").as_uri(), description.guid]


def references(fmu: Path) -> dict[str, int]:
    """Value references by name."""
    return {v.name: v.valueReference for v in fmpy.read_model_description(str(fmu)).modelVariables}


def listed(fmu: Path, names: Sequence[str]) -> str:
    """Their value references, as the hosts take outputs."""
    return ",".join(str(references(fmu)[name]) for name in names)


def arguments(fmu: Path, folder: Path, inputs: dict[str, float]) -> list[str]:
    """What the host wants to know of the controller."""
    given = [f"{references(fmu)[name]}={value!r}" for name, value in inputs.items()]
    return [*unpacked(fmu, folder), str(STEPS), repr(H), listed(fmu, COMMAND), *given]


@pytest.mark.parametrize("folder", ["unpacked", "folder with spaces"])
def test_a_c_program_gets_the_command_of_the_law_without_numpy(
    folder: str, host: Path, library: PythonLibrary, environment: dict[str, str], built: dict[str, Path], tmp_path: Path
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / folder, MEASUREMENT)
    done = run(str(host), str(library.path), *given, environment=environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    command = [float(line) for line in done.stdout.splitlines()]
    assert command == pytest.approx(law_command((STEPS - 1) * H), rel=1e-12, abs=1e-12)
    assert not list(tmp_path.glob("trap/numpy/imported"))


NOT_PYTHON = "libc.so.6"
"""What the host opens in place of a libpython: what it then lacks is to be found without it."""


@pytest.mark.usefixtures("library")
def test_a_c_program_that_knows_nothing_of_python_flies_the_fmu(
    host: Path, built: dict[str, Path], tmp_path: Path
) -> None:
    done = run(str(host), NOT_PYTHON, *arguments(built["UnifiedController"], tmp_path / "unpacked", MEASUREMENT))
    assert (done.returncode, done.stderr) == (0, "")
    command = [float(line) for line in done.stdout.splitlines()]
    assert command == pytest.approx(law_command((STEPS - 1) * H), rel=1e-12, abs=1e-12)


def test_a_libpython_that_is_told_is_taken(
    host: Path, library: PythonLibrary, environment: dict[str, str], built: dict[str, Path], tmp_path: Path
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / "unpacked", MEASUREMENT)
    done = run(str(host), NOT_PYTHON, *given, environment={**environment, "QUADCOSIM_LIBPYTHON": str(library.path)})
    assert (done.returncode, done.stderr) == (0, "")


OLD = r"""
const char *Py_GetVersion(void) { return "3.9.18 (main)"; }
"""


def test_without_a_python_that_will_do_the_host_is_told_which_one_would(
    host: Path, built: dict[str, Path], tmp_path: Path
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / "unpacked", {})
    old = tmp_path / "libpython3.9.so"
    (tmp_path / "old.c").write_text(OLD)
    assert run("cc", "-shared", "-fPIC", str(tmp_path / "old.c"), "-o", str(old)).returncode == 0
    too_old = "is Python 3.9.18: expected 3.10 or newer"
    for variables, library, words in (
        ({"QUADCOSIM_LIBPYTHON": str(old)}, NOT_PYTHON, f"{old} {too_old}"),
        ({}, str(old), f"this process {too_old}"),
        ({"QUADCOSIM_LIBPYTHON": "/no/such.so"}, NOT_PYTHON, "/no/such.so: cannot open shared object file"),
        ({"PYTHONHOME": "/no/such"}, NOT_PYTHON, "no shared library of Python 3.10 or newer that fits PYTHONHOME, "),
    ):
        done = run(str(host), library, *given, environment=variables)
        assert done.returncode == 3
        assert done.stderr.startswith(f"controller, status 3, category none: {words}")
        assert done.stderr.count("\n") == 1


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(
    ("place", "text", "words"),
    [
        (2, "{another}", "GUID = {another}: expected "),
        (
            1,
            "file:///no/such/folder",
            "fmuResourceLocation = file:///no/such/folder: expected the URI",
        ),
        (1, "", "fmuResourceLocation = : expected the URI"),
        (1, "100%s%n", "fmuResourceLocation = 100%s%n: expected the URI"),
    ],
)
def test_what_does_not_belong_to_the_fmu_is_refused(
    place: int, text: str, words: str, host: Path, built: dict[str, Path], tmp_path: Path
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / "unpacked", {})
    given[place] = text
    done = run(str(host), NOT_PYTHON, *given)
    assert done.returncode == 3
    assert done.stderr.startswith(f"controller, status 3, category none: {words}")


@pytest.fixture
def plain(built: dict[str, Path], tmp_path: Path) -> Path:
    """The controller as pythonfmu's library makes it, without the loader: as where there was no compiler."""
    return without_loader(built["UnifiedController"], tmp_path)


@pytest.mark.usefixtures("library")
def test_a_c_program_started_as_the_doctor_says_finds_python(host: Path, plain: Path, tmp_path: Path) -> None:
    """Without the loader the host must have Python: what it lacks is what doctor must give."""
    fmu = inspected(plain)
    given = arguments(fmu.path, tmp_path / "unpacked", MEASUREMENT)
    alone = run(str(host), "libc.so.6", *given)
    assert alone.returncode == 1
    assert "undefined symbol: " in alone.stderr
    *variables, tool = (other_host(fmu, this_machine([fmu])).start or "").split(" ")
    assert tool == "TOOL"
    done = run(str(host), "libc.so.6", *given, environment=dict(pair.split("=", 1) for pair in variables))
    assert done.returncode == 0, done.stderr
    assert [float(line) for line in done.stdout.splitlines()] == pytest.approx(law_command((STEPS - 1) * H), rel=1e-12)


@pytest.mark.parametrize("found_by", [BY_LOADER, THIS_PYTHON])
def test_the_doctor_knows_what_the_loader_finds_and_what_it_must_be_told(
    found_by: str, built: dict[str, Path], plain: Path
) -> None:
    fmu = inspected(built["UnifiedController"])
    python = PythonLibrary(path=Path("/a/libpython3.11.so.1.0"), version="3.11", found_by=found_by)
    machine = replace(this_machine([fmu]), python_libraries=(python,), temp_folder=Path("/tmp/Jürgen"))
    host = other_host(fmu, machine)
    assert host.start == (None if found_by == BY_LOADER else f"QUADCOSIM_LIBPYTHON={python.path} TOOL")
    assert host.needs == ()
    assert other_host(fmu, replace(machine, python_libraries=())).needs[0].startswith("a shared libpython")
    (mine, plains) = (
        {d.name: d.versions for part in one.platforms if part.platform == "linux64" for d in needed(part)}
        for one in (fmu, inspected(plain))
    )
    assert mine.keys() >= plains.keys() >= {"libstdc++.so.6"}
    assert all(set(mine[name]) >= set(versions) for name, versions in plains.items())


def test_the_trap_would_have_caught_an_import_of_numpy(environment: dict[str, str], tmp_path: Path) -> None:
    environment.pop("PYTHONHOME", None)
    done = run(sys.executable, "-c", "import numpy", environment=environment)
    assert "ImportError: numpy in an FMU" in done.stderr
    assert list(tmp_path.glob("trap/numpy/imported"))


@pytest.mark.parametrize(
    ("inputs", "call", "message"),
    [
        ({"mass": -1.0}, "fmi2ExitInitializationMode", "mass = -1.0: expected a finite value > 0"),
        ({"position.x": float("nan")}, "fmi2SetReal", "position.x = nan: expected a finite value"),
        ({"position.x": 1.0, "velocity.x": 1e200}, "fmi2ExitInitializationMode", "category divergence: "),
    ],
)
def test_a_c_program_is_told_why_a_call_failed(
    inputs: dict[str, float],
    call: str,
    message: str,
    host: Path,
    library: PythonLibrary,
    environment: dict[str, str],
    built: dict[str, Path],
    tmp_path: Path,
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / "unpacked", inputs)
    done = run(str(host), str(library.path), *given, environment=environment)
    assert done.returncode == 3, done.stderr
    assert message in done.stderr
    assert f"{call}: status 4" in done.stderr


@pytest.mark.parametrize(
    "order", sample([("QuadrotorPlant", "UnifiedController"), ("UnifiedController", "QuadrotorPlant")], 1)
)
def test_fmus_step_in_threads_of_a_c_program_and_survive_that_the_first_is_unloaded(
    order: tuple[str, ...],
    threads: Path,
    library: PythonLibrary,
    environment: dict[str, str],
    built: dict[str, Path],
    tmp_path: Path,
) -> None:
    outputs = {"QuadrotorPlant": MOTION, "UnifiedController": COMMAND}
    models = order * 2  # two instances of each, every one with a library of its own
    given = [
        argument
        for number, model in enumerate(models)
        for argument in (*unpacked(built[model], tmp_path / str(number)), listed(built[model], outputs[model]))
    ]
    done = run(str(threads), str(library.path), str(STEPS), repr(H), *given, environment=environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    rows = [[float(value) for value in line.split()] for line in done.stdout.splitlines()]
    for number, (model, row) in enumerate(zip(models, rows, strict=True)):
        with Instance(built[model]) as instance:
            instance.initialise({})
            for k in range(STEPS if number else STEPS // 2):
                instance.step(k * H, H)
            assert row == pytest.approx(instance.get(*outputs[model]), rel=1e-12, abs=1e-12)
