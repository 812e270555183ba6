"""The controller FMU in a host that is not Python, as in Simulink or a Modelica tool."""

import shutil
import sys
from pathlib import Path

import fmpy
import pytest

from tests.fmus.expected import COMMAND, MEASUREMENT, law_command
from tests.fmus.process import run
from tests.fmus.python_library import other_libraries, own_library

STEPS, H = 100, 0.01


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled host."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: install one that is called cc (Debian and Ubuntu: apt install gcc libc6-dev)")
    program = tmp_path_factory.mktemp("host") / "host"
    source = Path(__file__).with_name("host.c")
    done = run(compiler, "-std=c11", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(program), "-ldl")
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module")
def library() -> str:
    """A shared libpython."""
    found = own_library() or next(other_libraries(), None)
    if found is None:
        pytest.skip(
            "no shared libpython of 3.10 or later: install one "
            "(Debian and Ubuntu: apt install libpython3-dev; Fedora: dnf install python3-libs)"
        )
    return str(found)


@pytest.fixture
def environment(tmp_path: Path, library: str) -> dict[str, str]:
    """For the embedded interpreter: a numpy that betrays its import, and the standard library that fits."""
    trap = tmp_path / "trap" / "numpy"
    trap.mkdir(parents=True)
    (trap / "__init__.py").write_text(
        "import pathlib\npathlib.Path(__file__).with_name('imported').touch()\nraise ImportError('numpy in an FMU')\n"
    )
    variables = {"PYTHONPATH": str(trap.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    if library == str(own_library()):
        variables["PYTHONHOME"] = sys.base_prefix
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
    folder: str, host: Path, library: str, environment: dict[str, str], built: dict[str, Path], tmp_path: Path
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / folder, MEASUREMENT)
    done = run(str(host), library, *given, environment=environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    command = [float(line) for line in done.stdout.splitlines()]
    assert command == pytest.approx(law_command((STEPS - 1) * H), rel=1e-12, abs=1e-12)
    assert not list(tmp_path.glob("trap/numpy/imported"))


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
    library: str,
    environment: dict[str, str],
    built: dict[str, Path],
    tmp_path: Path,
) -> None:
    given = arguments(built["UnifiedController"], tmp_path / "unpacked", inputs)
    done = run(str(host), library, *given, environment=environment)
    assert done.returncode == 3, done.stderr
    assert message in done.stderr
    assert f"{call}: status 4" in done.stderr
