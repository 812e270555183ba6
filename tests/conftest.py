"""Settings and fixtures that all tests share."""

import atexit
import gc
import math
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest
from hypothesis.internal.conjecture import providers

import quadcosim  # noqa: F401 - errors are told in the words of Python, those of the command line in its own
from orchestration.command import cli
from orchestration.components.building import builder, fmus
from orchestration.components.building.models import MODELS
from orchestration.foundation.basics import terminal
from tests.commands import Done, Main
from tests.extent import tries
from tests.fmus.making import MAKINGS, Making
from tests.pictures import blank_pictures

hypothesis.settings.register_profile("ci", derandomize=True, deadline=None, max_examples=tries(60, sampled=10))
hypothesis.settings.register_profile("local", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "local")

# Else the constants of all modules that happen to be loaded are read from their sources, and drawn among others: three
# seconds of each process, and examples that are others with another neighbour.
providers._get_local_constants = lambda: providers._local_constants

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job, from which commands would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)

if not os.access(os.path.expanduser("~"), os.W_OK):  # libraries are kept there, and what matplotlib knows of fonts
    os.environ["HOME"] = tempfile.mkdtemp(prefix="home-of-tests-")
    atexit.register(shutil.rmtree, os.environ["HOME"], ignore_errors=True)

for variable in ("COLUMNS", "FORCE_COLOR", "GITHUB_ACTIONS", "PY_COLORS", "TERMINAL_WIDTH"):
    os.environ.pop(variable, None)  # they ask for what is printed in colours or in another width

DATA = Path(__file__).parent / "data"

LONGEST = (
    "docs/test_comparisons.py",
    "fmu_kit/compiler/test_cross.py",
    "orchestration/command/test_cli.py",
    "orchestration/components/building/test_wrapped_flights.py",
    "orchestration/experiments/studies/test_sweep_killed.py",
    "orchestration/experiments/studies/test_sweep_dask.py",
    "orchestration/simulation/engines/test_compiled.py",
    "orchestration/quadrotor/scenarios/test_signals_table.py",
    "fmu_kit/compiler/test_embedded.py",
    "fmus/test_mutants.py",
    "orchestration/experiments/limits/test_limit.py",
    "orchestration/theory/certificates/test_causes.py",
    "fmus/test_other_masters.py",
    "orchestration/foundation/processes/test_child.py",
    "orchestration/experiments/comparison/test_compare.py",
    "fmus/test_errors.py",
    "orchestration/theory/certificates/test_margin.py",
    "orchestration/components/building/test_variants.py",
    "orchestration/theory/exact/test_periodic_schedule.py",
    "orchestration/components/building/test_fmus.py",
    "orchestration/simulation/runs/test_run_directory.py",
    "orchestration/components/scaffold/test_folder.py",
    "fmus/test_instances.py",
    "examples/test_known_answers.py",
    "orchestration/experiments/studies/test_sweep.py",
    "orchestration/components/scaffold/test_everywhere.py",
    "fmus/test_packaging.py",
    "docs/test_lateral_basin.py",
    "docs/test_notebooks.py",
)
"""Files that take from 25 to 10 s of a core, or more in test-all, or wait: no process is left with one at the end."""

gc.disable()  # while thousands of tests are collected, of which none is garbage


@pytest.hookimpl(tryfirst=True)  # fixtures of the session group what is in one process
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files begin first."""
    rank = {DATA.parent / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))


def pytest_collection_finish() -> None:
    """To save time, garbage is looked for less often than by default, and not in what has been collected."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(5000)


def surroundings() -> dict[str, object]:
    """What all tests of a process share: its environment, its folder, where its temporary files go."""
    variables = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
    return {"environment": variables, "folder": os.getcwd(), "temporary": tempfile.gettempdir()}


@pytest.fixture(autouse=True)
def leaves_its_surroundings() -> Iterator[None]:
    """A test that changes them would be a fault of another one."""
    before = surroundings()
    yield
    assert surroundings() == before


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of reference data."""
    return DATA


@pytest.fixture(scope="session")
def making(request: pytest.FixtureRequest) -> Making:
    """How the FMUs are made: with Python inside, unless a test asks for another."""
    return MAKINGS[getattr(request, "param", "python")]


@pytest.fixture(scope="session")
def built(making: Making) -> dict[str, Path]:
    """The FMUs by model name, of the current sources: built once for all processes, and kept."""
    folder = builder.NATIVE.folder if making.native else ""
    return {model: fmus.locate(Path(folder, model).as_posix()) for model in MODELS}


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, of this process and of its children."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


@pytest.fixture
def blank_figures() -> Iterator[None]:
    """Figures are not drawn, for tests of which files there are."""
    with blank_pictures():
        yield


@pytest.fixture
def main(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Main:
    """The command `quadcosim` in this process, which saves the imports: for what does not hang on the process.

    It does not say how far it is, as it does where work takes long, nor which FMUs it builds: how fast the machine is
    and which test was the first to need an FMU changes no test.
    """
    monkeypatch.setattr(terminal, "SPARSE", math.inf)
    monkeypatch.setattr(fmus, "_announce_build", lambda path, announce: None)

    def call(*arguments: str | Path, code: int = 0) -> Done:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main([*map(str, arguments)])
        out, err = capsys.readouterr()
        assert (end.value.code or 0) == code, out + err
        return Done(arguments, code, out, err)

    return call
