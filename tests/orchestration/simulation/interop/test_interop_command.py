"""`quadcosim interop` as it is called: what it prints, what fails, and with which message."""

import functools
import importlib.metadata
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestration.components.building import fmus
from orchestration.components.building.models import MODELS
from orchestration.simulation.interop.catalogue import COFMUPY, TOOLS, chosen
from orchestration.simulation.requests.ssp import writing
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from tests.commands import Main
from tests.native import NATIVE
from tests.orchestration.experiments.studies.common import error_line, quadcosim
from tests.orchestration.simulation.interop.common import LOOP

SHORT = ("--plant-interval", "0.01", "--stop-time", "0.1")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the paper's flight, by the FMUs that other masters load fastest."""
    path = tmp_path_factory.mktemp("flight") / "flight.toml"
    path.write_text(NATIVE.to_toml(), encoding="utf-8")
    return path


@pytest.fixture
def interop(main: Main, flight: Path) -> Main:
    """The command for its first steps."""
    return functools.partial(main, "interop", flight, *SHORT)


@pytest.fixture
def libcosim_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Puts a package before libcosimpy that does something else as it is imported."""

    def does(what: str) -> None:
        package = tmp_path / "instead" / "libcosimpy"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text(what)
        monkeypatch.setenv("PYTHONPATH", str(package.parent), prepend=os.pathsep)

    return does


def messages_of(done: subprocess.CompletedProcess[str]) -> list[str]:
    """Its lines on standard error but for those that a slow machine has, about how far it is."""
    return [line for line in done.stderr.splitlines() if not line.startswith("running other masters: ")]


# -- what it prints ---------------------------------------------------------------------------------------


def test_a_tool_by_name_is_run_alone_and_its_row_printed(tmp_path: Path) -> None:
    for model in MODELS:
        fmus.locate(model)  # a build would be announced
    done = quadcosim("interop", *SHORT, "--tool", "fmucontainer -sequential", cwd=tmp_path)
    answer, *rows = done.stdout.splitlines()
    assert answer == "1 tool agrees with this project's master, within 1e-09"
    assert len(rows) == 3
    assert rows[2].startswith("| fmucontainer -sequential | gauss-seidel | exchanged")
    assert messages_of(done) == []
    assert list(tmp_path.iterdir()) == []


def test_json_has_each_tool_once_and_the_chart_goes_to_out(tmp_path: Path, temporary: Path, interop: Main) -> None:
    names = ("ecos, SSP", "fmpy, controller alone", "ecos, SSP")
    chosen = [text for name in names for text in ("--tool", name)]
    done = interop(*chosen, "--json", "--out", tmp_path / "drawn")
    found = json.loads(done.stdout)["tools"]
    assert [row["tool"] for row in found] == ["ecos, SSP", "fmpy, controller alone"]
    assert [row["agrees"] for row in found] == [True, True]
    assert found[0]["as_it_comes"].keys() >= {"plant.position.x", "controller.thrust"}
    assert messages_of(done) == [str(tmp_path / "drawn" / f"interop.{ending}") for ending in ("png", "svg")]
    assert (tmp_path / "drawn" / "interop.png").read_bytes().startswith(b"\x89PNG")
    assert list(temporary.iterdir()) == [], "tools that unpack have left nothing"


# -- what is noticed --------------------------------------------------------------------------------------


def test_a_tool_that_flies_with_another_gain_is_noticed(interop: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    write = writing.write

    def with_another_gain(system: System, path: Path) -> Path:
        return write(changed(system, {"components.controller.parameters.gain.eta": 14.9999}), path)

    monkeypatch.setattr(writing, "write", with_another_gain)
    chosen = ("--tool", "libcosim", "--tool", "libcosim, SSP", "--tool", "fmpy, SSP")
    done = interop(*chosen, "--json", code=1)
    assert [row["agrees"] for row in json.loads(done.stdout)["tools"]] == [True, False, False]
    assert messages_of(done) == ["farther than 1e-09 from this project's master: libcosim, SSP; fmpy, SSP"]


# -- what fails -------------------------------------------------------------------------------------------


def test_a_tool_that_there_is_none_of_is_wrong_usage_and_the_names_are_listed(main: Main) -> None:
    line = error_line(main("interop", "--tool", "ecos", "--tool", "simulink", code=2))
    assert line == f"--tool simulink: expected one of {'; '.join(TOOLS)}"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--delay", "0.01"), "timing.delay = 0.01: an SSP cannot express that"),
        (("--jitter", "0.001"), "timing.jitter = 0.001: an SSP cannot express that"),
        (("--period", "0.0105"), "timing.period = 0.0105: expected a multiple of the common step of 0.001 s"),
        (("--set", "plant.mass=true"), "plant.mass = True: expected a number"),
        (("--set", "controller.use_reference_inputs=true"), "controller.use_reference_inputs: expected [reference]"),
        (("nowhere.toml",), "nowhere.toml: expected a readable system or scenario file"),
    ],
)
def test_a_scenario_that_others_cannot_run_is_wrong_usage(
    main: Main, arguments: tuple[str, ...], expected: str
) -> None:
    assert error_line(main("interop", *arguments, code=2)).startswith(expected)


def test_a_parameter_that_an_fmu_refuses_is_wrong_usage(interop: Main) -> None:
    line = error_line(interop("--set", "plant.mass=0", code=2))
    assert line == "plant.mass = 0.0: expected a finite value > 0"


@pytest.mark.parametrize("package", ["libcosimpy", "ecospy", "tbb", "fmu-manipulation-toolbox"])
def test_a_tool_that_is_not_installed_is_named_with_the_way_to_install_it(
    package: str, interop: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    version = importlib.metadata.version

    def without(name: str) -> str:
        if name == package:
            raise importlib.metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(importlib.metadata, "version", without)
    line = error_line(interop(code=1))
    assert line == f"{package} is not installed; this needs: pip install 'quadcosim[interop]'"


@pytest.mark.parametrize("python", [None, "", "nowhere/python", sys.executable])
def test_a_tool_with_an_environment_of_its_own_is_asked_for_by_its_variable(
    python: str | None, interop: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(COFMUPY, raising=False)
    if python is not None:
        monkeypatch.setenv(COFMUPY, python)
    line = error_line(interop("--tool", "cofmupy", code=2))
    assert line == (
        f"--tool cofmupy: expected in {COFMUPY} the path of a Python in a separate environment, "
        "with cofmupy installed there by pip"
    )


def test_a_tool_with_an_environment_of_its_own_is_left_out_where_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(COFMUPY, raising=False)
    assert [tool.name for tool in chosen(None, LOOP.ports)] == [
        name for name in TOOLS if not name.startswith("cofmupy")
    ]
    monkeypatch.setenv(COFMUPY, "/some/python")
    assert [tool.name for tool in chosen(None, LOOP.ports)] == list(TOOLS)


def test_a_tool_that_raises_is_named_with_its_last_words(interop: Main, libcosim_that: Callable[[str], None]) -> None:
    libcosim_that("raise RuntimeError('no licence\\nfor this')")
    line = error_line(interop("--tool", "libcosim", code=1))
    assert line == "libcosim: for this"


def test_a_tool_that_ends_the_process_is_named_with_the_code(
    interop: Main, libcosim_that: Callable[[str], None]
) -> None:
    libcosim_that("import os; os._exit(3)")
    assert error_line(interop("--tool", "libcosim, SSP", code=1)) == "libcosim, SSP: exit code 3"


def test_a_tool_works_and_unpacks_in_a_folder_of_its_own(
    interop: Main, libcosim_that: Callable[[str], None], temporary: Path
) -> None:
    """Not where this process is: fmpy goes to a folder and removes it while it loads an FMU, in another thread."""
    libcosim_that("import os, tempfile; raise RuntimeError(os.getcwd() + ' ' + tempfile.gettempdir())")
    line = error_line(interop("--tool", "libcosim", code=1))
    works, unpacks = line.removeprefix("libcosim: RuntimeError: ").split(" ")
    assert works == unpacks
    assert temporary in Path(works).parents
    assert list(temporary.iterdir()) == []


def test_a_tool_that_stops_early_does_not_pass_for_one_that_agrees(
    interop: Main, libcosim_that: Callable[[str], None]
) -> None:
    libcosim_that(f"""{IS_LIBCOSIM}
from libcosimpy.CosimExecution import CosimExecution
simulate_until = CosimExecution.simulate_until
CosimExecution.simulate_until = lambda self, target_time: simulate_until(self, 60_000_000)
""")
    assert error_line(interop("--tool", "libcosim", code=1)) == "libcosim: ended after 6 steps, expected 10"


def test_a_tool_with_one_signal_that_is_no_number_does_not_pass_for_one_that_agrees(
    interop: Main, libcosim_that: Callable[[str], None]
) -> None:
    libcosim_that(f"""{IS_LIBCOSIM}
from libcosimpy.CosimObserver import CosimObserver
read, seen = CosimObserver.time_series_real_samples, []
def wrong(self, slave, reference, *args, **options):
    times, steps, values = read(self, slave, reference, *args, **options)
    seen.append(reference)
    return times, steps, values if len(seen) != 2 else [float("nan")] * len(values)
CosimObserver.time_series_real_samples = wrong
""")
    done = interop("--tool", "libcosim", code=1)
    assert messages_of(done) == ["farther than 1e-09 from this project's master: libcosim"]


IS_LIBCOSIM = """
import sys
sys.path.remove(next(path for path in sys.path if path.endswith("instead")))
del sys.modules["libcosimpy"]
import libcosimpy
"""
"""Has the package that is there instead be the real one."""
