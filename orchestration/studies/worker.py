"""What a worker process does: flies the runs that it is given, with FMUs that it has loaded once."""

import dataclasses
import hashlib
import io
import multiprocessing.util
import os
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.errors import QuadcosimError
from orchestration.fleet import Fleet
from orchestration.flight import prepared
from orchestration.result import Result
from orchestration.scenario import Scenario
from orchestration.studies.store import Row


@dataclass(frozen=True, kw_only=True)
class Task:
    """One run of a study, its FMUs named by their hashes."""

    index: int
    key: str
    settings: dict[str, Any]
    scenario: Scenario
    keep_signals: bool


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The row of a run, and its signals as the bytes of a Parquet file if they are kept."""

    row: Row
    signals: bytes | None = None


class Hangar:
    """The FMUs of this process: unpacked once by content, instantiated once, one run at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._fleet = Fleet()
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def fly(self, task: Task) -> Outcome:
        """Fly one run; whatever goes wrong with it is its row."""
        started = time.perf_counter()
        metrics, message, signals = None, None, None
        with self._lock:  # dask may call from several threads; an FMU has one interpreter
            try:
                with prepared(task.scenario, load=self._fleet.load) as flight:
                    flight.master.initialise()
                    flight.master.run()
                    result = flight.result()
                    metrics, message = result.metrics, result.divergence
                    signals = _parquet(result) if task.keep_signals else None
            except QuadcosimError as error:
                message = str(error)
            except Exception as error:
                message = f"{type(error).__name__}: {error}"
        row = Row(
            index=task.index, key=task.key, settings=task.settings, seed=task.scenario.seed, metrics=metrics,
            message=message, duration=time.perf_counter() - started,
        )  # fmt: skip
        return Outcome(row=row, signals=signals)

    def unpack(self, content: bytes) -> Path:
        """The path of a file with this content, written the first time only."""
        name = f"{hashlib.sha256(content).hexdigest()}.fmu"
        with self._lock:
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix="quadcosim-")
            path = Path(self._folder.name) / name
            if not path.is_file():
                path.write_bytes(content)
            return path

    def close(self) -> None:
        """Free the FMUs and what was unpacked for them."""
        self._fleet.close()
        if self._folder is not None:
            self._folder.cleanup()


HANGAR = Hangar()


def fly_chunk(tasks: Sequence[Task], plant: bytes, controller: bytes) -> list[Outcome]:
    """Fly several runs with the FMUs of this content; called in a worker process."""
    paths = {"plant": HANGAR.unpack(plant), "controller": HANGAR.unpack(controller)}
    return [HANGAR.fly(dataclasses.replace(task, scenario=task.scenario.with_fmus(**paths))) for task in tasks]


def prepare_process(plant: Path, controller: Path) -> None:
    """Start of a local worker process: it will not outlive its parent."""
    _CONTENTS["plant"], _CONTENTS["controller"] = plant.read_bytes(), controller.read_bytes()
    multiprocessing.util.Finalize(HANGAR, HANGAR.close, exitpriority=1)  # worker processes run no atexit
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()


def fly_local_chunk(tasks: Sequence[Task]) -> list[Outcome]:
    """Fly several runs with the FMUs that the process was prepared with."""
    return fly_chunk(tasks, _CONTENTS["plant"], _CONTENTS["controller"])


_CONTENTS: dict[str, bytes] = {}


def _end_with_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def _parquet(result: Result) -> bytes:
    from orchestration import tables  # pyarrow loads only where signals are kept

    buffer = io.BytesIO()
    tables.write_signals(buffer, result.recording)
    return buffer.getvalue()
