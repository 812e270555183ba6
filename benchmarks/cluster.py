"""The cost of a dask cluster compared with worker processes on one machine: `python -m benchmarks.cluster [RUNS]`.

The same study in turns by two processes and by two workers of a dask cluster over TCP, on the same cores of this
machine, so that only the cluster differs. Native FMUs, run one by one and in chunks of SIMD lanes. Wall time, the
smaller of two: CPU time of other processes is not available.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.sweep import sweep
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.workers.choice import EngineChoice

RUNS = 400
WORKERS = 2
ENGINES: dict[str, EngineChoice] = {"one by one": "compiled", "in lanes": "batch"}
STOP_TIME = 10.0
"""Stop time of a flight [s]"""


def study(runs: int) -> Study:
    """Flights from `runs` initial positions at 100 Hz."""
    axis = Axis(name="x", targets=("plant.initial.position.x",), low=-1.0, high=1.0)
    return Study(
        name="cluster", base=Scenario(stop_time=STOP_TIME), axes=(axis,), method="random", samples=runs, native=True
    )


@contextmanager
def cluster() -> Iterator[str]:
    """The address of a scheduler with `WORKERS` workers of one thread, over TCP."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        dask = (sys.executable, "-m", "dask")
        quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
        scheduler = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        worker = ["worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard"]
        started = [subprocess.Popen((*dask, *scheduler), **quiet)]
        try:
            while not file.is_file():
                time.sleep(0.1)
            started += [subprocess.Popen((*dask, *worker), **quiet) for _ in range(WORKERS)]
            from distributed import Client

            with Client(scheduler_file=str(file)) as client:
                client.wait_for_workers(WORKERS)
                yield client.scheduler.address
        finally:
            for process in reversed(started):
                process.terminate()
                process.wait()


def seconds(chosen: Study, engine: EngineChoice, dask: str | None) -> float:
    """Wall time of a sweep [s], the smaller of two, each into its own store."""
    found = []
    for _ in range(2):
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            sweep(chosen, out=Path(folder), workers=1 if dask else WORKERS, dask=dask, engine=engine)
            found.append(time.perf_counter() - start)
    return min(found)


def main(runs: int) -> None:
    """Print the figures."""
    chosen = study(runs)
    print(f"{runs} flights of {STOP_TIME:g} s at 100 Hz, {WORKERS} workers; wall time")
    with cluster() as address:
        for how, engine in ENGINES.items():
            here, there = seconds(chosen, engine, None), seconds(chosen, engine, address)
            print(f"{how:<12} processes here {here:6.2f} s   dask over TCP {there:6.2f} s   "
                  f"{(there - here) / runs * 1e3:6.2f} ms more a run")  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else RUNS)
