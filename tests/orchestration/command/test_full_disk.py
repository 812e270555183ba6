"""Where a file cannot be written, a command says which and why, leaves old files as they were, and nothing else."""

import re
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import quadcosim
from tests.commands import Main
from tests.native import native
from tests.places import EXAMPLES

TANK = EXAMPLES / "water_tank"
CONTROLLER = TANK / "TankController"
CASES = {
    "report": (("report", "run", "--out", "a.html"), 10_000, "a.html", ["a.html"]),
    "csv": (("export", "run", "--out", "csv"), 1000, "csv", ["csv/signals.csv", "csv/events.csv"]),
    "mat": (("export", "run", "--out", ".", "--format", "mat"), 1000, "run.mat", ["run.mat"]),
    "plot": (("plot", "run", "--out", ".", "--figure", "errors"), 10_000, "errors.png", ["errors.png", "errors.svg"]),
    "show": (("show", str(TANK / "system.toml"), "--out", "a.png"), 1000, "a.png", ["a.png"]),
    "ssp": (("ssp", "--native", "--out", "a.ssp"), 10_000, "a.ssp", ["a.ssp", "a.timing.toml"]),
    "export-c": (
        ("export-c", str(CONTROLLER), "--out", "."), 2500, "TankController.c", ["TankController.c", "TankController.h"]
    ),
    "build": (("build", str(CONTROLLER), "--out", "."), 5000, "TankController.fmu", ["TankController.fmu"]),
    "new": (("new", "controller", "hover"), 300, "hover/hover.py", []),
    "examples": (("examples",), 300, "examples/README.md", []),
}  # fmt: skip
"""The words of a command, the most bytes that a file may have, what cannot be written then, and files that are there"""


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a run."""
    folder = tmp_path_factory.mktemp("flight") / "run"
    return quadcosim.save_run(quadcosim.run(native(stop_time=0.05)), folder, figures=False)


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """A context in which no file can have more bytes, as where the disk is full, also in child processes.

    No bytecode is kept there: Python would keep what it could write of it, and fail wherever it is loaded.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        patch.setenv("PYTHONDONTWRITEBYTECODE", "1")
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}


@pytest.mark.parametrize("case", CASES)
def test_a_file_that_cannot_be_written_is_named_and_all_is_as_before(
    case: str, flight: Path, main: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words, size, named, old = CASES[case]
    (tmp_path / "run").symlink_to(flight)
    for name in old:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("years of work")
    before = contents(tmp_path)
    with files_of_at_most(size):
        done = main(*words, code=1)
    assert re.search(rf"[ /]{re.escape(named)}: could not be written: File too large$", done.stderr)
    assert "Traceback" not in done.stderr
    assert contents(tmp_path) == before
