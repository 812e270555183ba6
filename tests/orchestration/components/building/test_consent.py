"""Nothing of a foreign folder is run without consent, which is asked for once."""

import io
import sys
from pathlib import Path

import pytest

import quadcosim
from tests.commands import Main
from tests.orchestration.components.fmi.small import nothing_known

MODULE = """\
from pathlib import Path

from fmu_kit.interface import Output, Parameter
from fmu_kit.slave import Slave

Path({mark!r}).touch()


class Ramp(Slave):
    \"\"\"Counts.\"\"\"

    y = Output("what it has counted", "1", 0.0)
    rate = Parameter("of it", "1", {rate})

    def step(self, t, h):
        self.y = self.y + h * self.rate
"""
SYSTEM = """\
stop_time = 0.1
[components.it]
fmu = "Ramp.fmu"
step = 0.01
[criterion]
good = "last < 1"
[objectives]
last = "max(it.y)"
"""


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file that is there once the module has run."""
    nothing_known(tmp_path / "cache", monkeypatch)
    return tmp_path / "mark"


@pytest.fixture
def system(tmp_path: Path, mark: Path) -> Path:
    """A system whose FMU is missing, and the module beside it."""
    folder = tmp_path / "foreign"
    folder.mkdir()
    (folder / "ramp.py").write_text(MODULE.format(mark=str(mark), rate=1.0))
    (folder / "system.toml").write_text(SYSTEM)
    return folder / "system.toml"


def changed(system: Path, mark: Path) -> None:
    mark.unlink(missing_ok=True)
    (system.parent / "ramp.py").write_text(MODULE.format(mark=str(mark), rate=2.0))


def test_looking_runs_nothing(system: Path, mark: Path, main: Main) -> None:
    assert "it.y" in main("show", system).stdout
    main("run", system, "--build")
    changed(system, mark)
    main("show", system)
    assert not mark.exists()
    main("show", system, "--build")
    assert mark.exists()


@pytest.mark.parametrize(
    "command", [("run",), ("limit", "--of", "components.it.step", "--from", "0.01", "--to", "0.02"), ("ssp",)]
)
def test_what_would_build_says_what_it_would_run(
    command: tuple[str, ...], system: Path, mark: Path, main: Main
) -> None:
    done = main(command[0], system, *command[1:], code=2)
    assert f"building it runs the code in {system.parent}, which is not of this project" in done.stderr
    assert done.stderr.endswith("expected --build, once for this folder\n")
    assert not mark.exists()


def test_once_is_enough(system: Path, mark: Path, main: Main) -> None:
    main("run", system, "--build")
    assert mark.exists()
    changed(system, mark)
    assert main("run", system).stdout
    assert mark.exists()


def test_who_builds_a_folder_has_agreed(system: Path, mark: Path, main: Main) -> None:
    main("build", system.parent)
    changed(system, mark)
    main("run", system)


@pytest.mark.parametrize(("answer", "code"), [("y\n", 0), ("n\n", 2), ("", 2)])
def test_somebody_at_a_terminal_is_asked(
    answer: str, code: int, system: Path, mark: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, "stdin", Terminal(answer))
    monkeypatch.setattr(sys, "stderr", Terminal())
    main("run", system, "-q", code=code)
    assert mark.exists() == (code == 0)


def test_a_program_that_calls_has_decided(system: Path, mark: Path) -> None:
    assert quadcosim.run(quadcosim.load_system(system)).metrics["last"] == pytest.approx(0.1)
    assert mark.exists()


def test_what_new_has_written_is_built(tmp_path: Path, mark: Path, main: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "work").mkdir()
    with monkeypatch.context() as patch:
        patch.chdir(tmp_path / "work")
        main("new", "filter", "low_pass", "--author", "somebody")
        main("run", "low_pass/system.toml")
