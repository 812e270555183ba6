"""The controller FMU in a host that is not Python, as in Simulink or a Modelica tool."""

import shutil
import sys
from pathlib import Path

import fmpy
import pytest

from orchestration.doctor.archive import open_fmu
from orchestration.doctor.machine import this_machine
from orchestration.doctor.pythons import PythonLibrary
from orchestration.doctor.verdict import INSTALL_LIBPYTHON, other_host, satisfies
from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.process import run

STEPS, H = 100, 0.01


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled host."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: install one that is called cc (Debian and Ubuntu: apt install gcc libc6-dev)")
    program = tmp_path_factory.mktemp("host") / "host"
    source = Path(__file__).parent.parent.parent / "docs" / "guides" / "host.c"
    done = run(compiler, "-std=c11", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(program), "-ldl")
    assert done.returncode == 0, done.stderr
    return program


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


def arguments(fmu: Path, folder: Path, inputs: dict[str, float]) -> list[str]:
    """What the host wants to know of the FMU, unpacked into `folder`."""
    fmpy.extract(str(fmu), str(folder))
    description = fmpy.read_model_description(str(fmu))
    references = {v.name: v.valueReference for v in description.modelVariables}
    return [
        str(folder / "binaries" / fmpy.platform / f"{description.coSimulation.modelIdentifier}.so"),
        (folder / "resources").as_uri(),
        description.guid,
        str(STEPS),
        repr(H),
        ",".join(str(references[name]) for name in COMMAND),
        *(f"{references[name]}={value!r}" for name, value in inputs.items()),
    ]


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


@pytest.mark.usefixtures("library")
def test_a_c_program_started_as_the_doctor_says_finds_python(
    host: Path, built: dict[str, Path], tmp_path: Path
) -> None:
    """The host opens the C library in place of Python: what it then lacks is what doctor must give."""
    fmu = open_fmu(built["UnifiedController"])
    given = arguments(fmu.path, tmp_path / "unpacked", MEASUREMENT)
    alone = run(str(host), "libc.so.6", *given)
    assert alone.returncode == 1
    assert "undefined symbol: " in alone.stderr
    *variables, tool = (other_host(fmu, this_machine([fmu])).start or "").split(" ")
    assert tool == "TOOL"
    done = run(str(host), "libc.so.6", *given, environment=dict(pair.split("=", 1) for pair in variables))
    assert done.returncode == 0, done.stderr
    assert [float(line) for line in done.stdout.splitlines()] == pytest.approx(law_command((STEPS - 1) * H), rel=1e-12)


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
