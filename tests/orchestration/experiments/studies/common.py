"""Shared parts of the tests of studies: short studies, the command as a process, and observation of processes."""

import contextlib
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from orchestration.experiments.studies import sweep as sweeping
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import Store, open_for_reading
from orchestration.experiments.studies.store_columns import metrics_with
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.swept import Swept
from orchestration.quadrotor.scenarios.translation import paths_of, quadrotor
from orchestration.simulation.workers.row import Outcome, Results, Rows
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import value_at
from orchestration.systems.system.request import Request
from quadcosim import QuadcosimError, Scenario, Timing
from tests.commands import Done
from tests.native import NATIVE
from tests.patience import PATIENCE

SCRIPT = shutil.which("quadcosim", path=str(Path(sys.executable).parent))

# Everything random is on: a run that took another seed or an order of its own would show in its bits.
NOISY = Path(__file__).with_name("noisy.toml").read_text(encoding="utf-8")
RUNS = 16
OBJECTIVES = tuple(quadrotor().objectives)
METRICS = metrics_with(OBJECTIVES)

GRID = """
[base]
stop_time = 0.1
[base.timing]
plant_interval = 0.005
[[axes]]
name = "period"
sets = ["timing.period"]
values = [0.02, 0.01]
[[axes]]
name = "delay"
sets = ["timing.delay"]
values = [0.0, 0.01, 0.005]
"""


def short(stop_time: float = 0.1, **timing: Any) -> Scenario:
    """The paper's flight, its first moments only, on a coarse grid, by the FMUs that fly fastest."""
    return dataclasses.replace(NATIVE, stop_time=stop_time, timing=Timing(**{"plant_interval": 0.005, **timing}))


def axis(target: str, *values: Any) -> Axis:
    """An axis of listed values, named after its target."""
    return Axis(name=target, targets=(target,), values=values)


FAILS = 0.0
"""A mass that the description of the plant allows and the plant does not"""
PERIODS = axis("timing.period", 0.01, 0.02)
POLL = 0.02
"""[s] between two checks of another process, each of which costs milliseconds"""
STORE = Path("results") / "study" / "study.sqlite"
"""Where the command keeps the study of `study.toml`"""


def study(*axes: Axis, base: Request | None = None, **fields: Any) -> Study:
    return Study(name="study", base=base or short(), axes=axes, **fields)


def sweep(chosen: Study, **options: Any) -> Swept:
    """Sweep with the FMUs as they are, unless a test requests another engine: rows then equal those of `run`."""
    return sweeping.sweep(chosen, **{"engine": "compiled", **options})


def swept(chosen: Study, folder: Path, **options: Any) -> Path:
    """The store of a study after its sweep."""
    return sweep(chosen, out=folder, **options).path


def starts() -> dict[str, dict[str, float]]:
    return files_in().start_values


def files_in(scenario: Scenario | None = None) -> Files:
    """The files that a flight needs, default: the paper's."""
    return files_of((scenario or short()).as_system())


def at(system: System, target: str) -> Any:
    """The value in a system at `timing.KEY`, `controller.NAME` or `plant.NAME` of a scenario."""
    found = [value_at(system, path) for path in paths_of(target)]
    assert found.count(found[0]) == len(found)
    return found[0]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    """One row, with the value of each axis."""

    index: int
    key: str
    settings: Mapping[str, Any]
    seed: int
    outcome: Outcome


def row(index: int = 0, **fields: Any) -> Row:
    """A row that was never run."""
    metrics = {"outcome": "settled", "good": True, "position_rmse": 0.5, "diverged": False, "steps": 3}
    outcome = {"metrics": metrics, "message": None, "duration": 0.1}
    given = {"index": index, "key": f"key {index}", "settings": {"timing.period": 0.001 * index}, "seed": index}
    of_run = {name: value for name, value in fields.items() if name not in given}
    own = {name: value for name, value in fields.items() if name in given}
    return Row(**{**given, **own, "outcome": Outcome(**{**outcome, **of_run})})


def add(store: Store, rows: Iterable[Row]) -> None:
    """Write rows, and points of the design for them beside those that are there."""
    rows = list(rows)
    points = {
        index: (index, key, settings) for index, key, settings, _ in store._connection.execute("SELECT * FROM design")
    }
    points |= {each.index: (each.index, each.key, json.dumps(each.settings)) for each in rows}
    store.describe({}, points.values())
    results = Results.of([each.outcome for each in rows])
    index, key, seed = ([getattr(each, name) for each in rows] for name in ("index", "key", "seed"))
    store.add(Rows(index=index, key=key, seed=seed, results=results))


def bits(path: Path) -> list[dict[str, Any]]:
    """All columns of all rows but the wall-clock duration, floats by their bits."""
    with open_for_reading(path) as store:
        rows = list(store.rows())
    return [
        {
            name: value.hex() if isinstance(value, float) else value
            for name, value in found.items()
            if name != "duration"
        }
        for found in rows
    ]


# -- the command ------------------------------------------------------------------------------------------


def start(*arguments: str | Path, cwd: Path, temporary: Path | None = None) -> "subprocess.Popen[str]":
    """The installed script as a separate process, with its own temporary folder if one is given."""
    assert SCRIPT is not None, "expected the script beside this Python: pip install -e ."
    return subprocess.Popen(
        [SCRIPT, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
        cwd=cwd,
        env={**os.environ, "PYTHONIOENCODING": "utf-8", "COLUMNS": "200", "NO_COLOR": "1"}
        | ({} if temporary is None else {"TMPDIR": str(temporary)}),
    )  # fmt: skip


def quadcosim(*arguments: str | Path, cwd: Path, code: int = 0, temporary: Path | None = None) -> Done:
    with start(*arguments, cwd=cwd, temporary=temporary) as process:
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == code, out + err
    return Done(arguments, process.returncode, out, err)


def error_line(done: Done) -> str:
    """The single line on standard error of a command that fails; nothing on standard output."""
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("quadcosim: ")
    assert "an error of quadcosim itself" not in lines[0]
    return lines[0].removeprefix("quadcosim: ")


def one_line(error: BaseException | str) -> str:
    text = str(error)
    assert len(text.splitlines()) == 1, text
    return text


# -- processes --------------------------------------------------------------------------------------------


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "expected it some time"
        time.sleep(POLL)


def wait_for_rows(path: Path, number: int) -> None:
    """Until another process has written so many rows into the store."""
    wait_until(lambda: rows_in(path) >= number)


def rows_in(path: Path) -> int:
    try:
        with open_for_reading(path) as store:
            return sum(store.counts().values())
    except QuadcosimError:  # not made yet
        return 0


def workers_of(parent: int) -> list[int]:
    """Ids of the worker processes of a coordinator: forked by the server that it started."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            is_forked = folder.name.isdigit() and parent_of(Path(f"/proc/{parent_of(folder)}")) == parent
            if is_forked and b"orchestration.simulation.workers.worker_process" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:  # has ended meanwhile
            continue
    return found


def parent_of(folder: Path) -> int:
    return int((folder / "stat").read_text().rpartition(")")[2].split()[1])


def is_running(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"  # in a container nobody may collect it


def kill(process: int) -> None:
    with contextlib.suppress(ProcessLookupError):  # has ended meanwhile
        os.kill(process, signal.SIGKILL)


class Cluster:
    """A dask scheduler and workers with two threads each, as separate processes on loopback."""

    def __init__(self, folder: Path, workers: int) -> None:
        self._file = folder / "scheduler.json"
        self._log = (folder / "dask.log").open("w")
        arguments = ("--port", "0", "--scheduler-file", str(self._file), "--no-dashboard")
        self.scheduler = self._start("scheduler", *arguments)
        wait_until(self._file_is_written)
        self.address: str = json.loads(self._file.read_text())["address"]
        self.workers = [
            self._start(
                "worker", "--scheduler-file", str(self._file), "--nthreads", "2", "--no-nanny", "--no-dashboard"
            )
            for _ in range(workers)
        ]

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self._log.close()

    def _file_is_written(self) -> bool:
        return self._file.is_file() and self._file.read_text().rstrip().endswith("}")

    def _start(self, *arguments: str) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1"]
        return subprocess.Popen(command, stdout=self._log, stderr=self._log, cwd=self._file.parent)


def reference_store(folder: Path, text: str = NOISY, engine: str = "compiled") -> Path:
    """The store of a study run without interruption by one worker."""
    (folder / "study.toml").write_text(text)
    return swept(load_study(folder / "study.toml"), folder / "results" / "study", engine=engine)
