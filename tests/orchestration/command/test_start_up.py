"""Commands load what they use: of the large packages none that the command at hand does without."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from orchestration.command import cli

LARGE = {"dask", "distributed", "fmpy.ssp", "matplotlib", "pandas", "pyarrow", "scipy", "xarray"}
RUN_AND_TELL = """
import json, sys
from orchestration.command.start import main
try:
    main()
finally:
    print(json.dumps(list(sys.modules)), file=sys.stderr)
"""


def loaded(*arguments: str) -> set[str]:
    """The modules of a fresh process after a command."""
    done = subprocess.run([sys.executable, "-c", RUN_AND_TELL, *arguments], capture_output=True, text=True, check=True)
    return set(json.loads(done.stderr.splitlines()[-1]))


def test_a_run_that_keeps_nothing_loads_no_large_package() -> None:
    assert not (LARGE | {"pydantic"}) & loaded("run", "--stop-time", "0.01", "--period", "0.02")


def test_a_run_without_figures_loads_of_them_what_writes_its_files(tmp_path: Path) -> None:
    kept = loaded("run", "--stop-time", "0.01", "--out", str(tmp_path / "run"), "--no-figures")
    assert LARGE & kept == {"pyarrow"}
    assert "signals.parquet" in {path.name for path in (tmp_path / "run").iterdir()}


def test_a_system_is_shown_as_text_without_any_large_package() -> None:
    assert not LARGE & loaded("show")


def test_processes_that_run_load_only_what_runs_need() -> None:
    imports = (
        "import json, sys, orchestration.simulation.workers.worker_process, orchestration.simulation.runs.apart_process"
    )
    code = f"{imports}; print(json.dumps(list(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    unused = {"pydantic", "orchestration.simulation.requests.request", "orchestration.simulation.engines.batch.batch"}
    assert not (LARGE | unused) & set(json.loads(found))


def test_the_version_is_printed_without_loading_the_command_line() -> None:
    assert not (LARGE | {"numpy", "pydantic", "typer"}) & loaded("--version")


ENDED = """
import sys

class Ends:
    def find_spec(self, name, *_):
        if name == "{module}":
            raise {error}

sys.argv = ["/usr/bin/quadcosim", "run"]
sys.meta_path.insert(0, Ends())
from orchestration.command.start import main
main()
"""


@pytest.mark.parametrize("module", ["orchestration.quadrotor.flight", "orchestration.command.cli"])
@pytest.mark.parametrize(
    ("error", "codes", "line"),
    [
        ("KeyboardInterrupt", (130, -signal.SIGINT), ""),
        ("MemoryError", (1,), "quadcosim: there is not enough memory\n"),
    ],
)
def test_what_ends_the_start_of_the_command_prints_no_traceback(
    module: str, error: str, codes: tuple[int, ...], line: str
) -> None:
    program = ENDED.format(module=module, error=error)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode in codes
    assert done.stderr == line


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (MemoryError("Unable to allocate 3 GiB"), "there is not enough memory: Unable to allocate 3 GiB"),
        (
            RuntimeError(cli.NO_THREAD),
            "there is not enough memory, or there are too many processes: can't start new thread",
        ),
    ],
)
def test_a_lack_of_memory_is_no_error_of_this_project(
    error: Exception, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli._report(error) == 1
    assert capsys.readouterr().err == f"quadcosim: {line}\n"
