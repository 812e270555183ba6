"""Sweeps whose processes are killed at random; `python -m tests.orchestration.experiments.studies.kills` does so often.

Whatever is killed, the table is in the end that of an undisturbed sweep to the bit, no process is left, and no file.
"""

import argparse
import random
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.orchestration.experiments.studies.common import (
    NOISY,
    RUNS,
    STORE,
    bits,
    is_running,
    kill,
    reference_store,
    rows_in,
    start,
    wait_until,
    workers_of,
)
from tests.patience import PATIENCE

TEMPORARY = "temporary"
MAX_PAUSE = 1.5
"""[s] from one kill to the next: during the start of workers, their runs and the end"""
WITH_WORKERS = 0.75
"""Share of the starts in which nothing is killed before there are workers"""


class Tally:
    """Counts of kills, and of sweeps that finished and were compared."""

    def __init__(self) -> None:
        self.coordinators = self.workers = self.compared = 0

    @property
    def kills(self) -> int:
        return self.coordinators + self.workers

    def __str__(self) -> str:
        return f"{self.coordinators} coordinators, {self.workers} workers killed; {self.compared} whole tables compared"


def sweep_in(folder: Path, workers: int, engine: str) -> "subprocess.Popen[str]":
    words = ("sweep", "study.toml", "--engine", engine, "--workers", str(workers))
    return start(*words, cwd=folder, temporary=folder / TEMPORARY)


def disturbed(
    folder: Path,
    reference: list[dict[str, Any]],
    *,
    workers: int,
    kills: int,
    engine: str = "compiled",
    seed: int = 0,
) -> Tally:
    """Run the noisy study repeatedly until so many processes have been killed, and once to its end.

    Raises `AssertionError` for a table that differs, a process that is left, a file in the temporary folder, or a
    traceback.
    """
    draw, tally = random.Random(seed), Tally()
    (folder / "study.toml").write_text(NOISY)
    (folder / TEMPORARY).mkdir()
    while tally.kills < kills:
        with sweep_in(folder, workers, engine) as coordinator:
            kill_parts(coordinator, kills, draw, tally)
        if rows_in(folder / STORE):  # one that was killed while it made its store has left none
            assert all(row["status"] == "done" for row in bits(folder / STORE)), "expected no failed row"
        if rows_in(folder / STORE) == RUNS and bits(folder / STORE) == reference:
            tally.compared += 1
            shutil.rmtree(folder / "results")
    with sweep_in(folder, workers, engine) as coordinator:
        out, err = coordinator.communicate(timeout=PATIENCE)
    assert coordinator.returncode == 0, out + err
    assert bits(folder / STORE) == reference
    tally.compared += 1
    wait_until(lambda: processes_in(folder) == [])
    assert list((folder / TEMPORARY).iterdir()) == []
    return tally


def kill_parts(coordinator: "subprocess.Popen[str]", kills: int, draw: random.Random, tally: Tally) -> None:
    """Kill parts of a sweep until it ends, and what is left of it says nothing but lines."""
    if draw.random() < WITH_WORKERS:
        wait_until(lambda: bool(workers_of(coordinator.pid)) or coordinator.poll() is not None)
    while coordinator.poll() is None:
        time.sleep(draw.uniform(0.0, MAX_PAUSE))
        mates = workers_of(coordinator.pid)
        if coordinator.poll() is not None or tally.kills == kills:
            break
        what = draw.random()
        if mates and what < 0.7:
            kill(draw.choice(mates))
            tally.workers += 1
        elif what > 0.7:
            coordinator.kill()
            tally.coordinators += 1
    _, err = coordinator.communicate(timeout=PATIENCE)
    assert "Traceback" not in err, err


def processes_in(folder: Path) -> list[int]:
    """Processes with their temporary files in `folder`: those of its sweeps."""
    found = []
    for process in Path("/proc").iterdir():
        try:
            of_here = process.name.isdigit() and str(folder / TEMPORARY).encode() in (
                process / "environ"
            ).read_bytes()  # fmt: skip
        except OSError:  # has ended meanwhile
            continue
        if of_here and is_running(int(process.name)):
            found.append(int(process.name))
    return found


def main() -> None:
    """Kills of a sweep with one worker, and with two: a hundred each, by default."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", default="compiled")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "reference").mkdir()
        reference = bits(reference_store(folder / "reference", engine=arguments.engine))
        for workers in (1, 2):
            (folder / str(workers)).mkdir()
            tally = disturbed(
                folder / str(workers), reference, workers=workers, kills=arguments.kills, engine=arguments.engine,
                seed=arguments.seed,
            )  # fmt: skip
            print(f"{workers} worker{'s' if workers > 1 else ''}: {tally}", flush=True)


if __name__ == "__main__":
    main()
