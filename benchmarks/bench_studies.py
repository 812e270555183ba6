"""The overhead of a study beside its flights: run as part of `make bench`. Takes some minutes."""

import dataclasses
import statistics
import tempfile
import time
from pathlib import Path

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.sweep import sweep
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.workers.task import Runner, RunTask
from orchestration.systems.system.files import files_of, with_files

RUNS, SECONDS = 200, 10.0
"""Runs and duration of the study with which two workers are compared"""
MANY = 2000
"""runs over which memory is measured"""


def runs_per_second(workers: int) -> float:
    """Runs per second of a study of `RUNS` runs of `SECONDS` seconds."""
    axis = Axis(name="period", targets=("timing.period",), low=0.005, high=0.03)
    study = Study(name="bench", base=Scenario(stop_time=SECONDS), axes=(axis,), method="random", samples=RUNS)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        sweep(study, out=Path(folder), workers=workers)
        return RUNS / (time.perf_counter() - start)


def many_short_runs() -> tuple[float, float]:
    """Median time of a run of one plant step [ms], FMUs loaded, and growth of memory over the last half [KiB]."""
    system = Scenario(stop_time=0.001).as_system()
    system = with_files(system, files_of(system).fmus)
    task = RunTask(index=0, key="", system=system)
    durations, memory, runner = [], [], Runner()
    for i in range(MANY):
        durations.append(float(runner.run(dataclasses.replace(task, index=i)).durations[0]))
        memory.append(resident())
    return statistics.median(durations) * 1e3, memory[-1] - memory[MANY // 2]


def resident() -> float:
    """Memory of this process [KiB], on Linux."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4.0


def main() -> None:
    """Print the figures."""
    overhead, growth = many_short_runs()
    print(f"overhead a run, FMUs loaded (one step of 1 ms)  {overhead:8.2f} ms   aim: under 20")
    print(f"growth of memory from run {MANY // 2} to {MANY}          {growth:8.0f} KiB")
    one, two = runs_per_second(1), runs_per_second(2)
    print(f"{RUNS} runs of {SECONDS:g} s, one worker                {one:8.2f} runs/s")
    print(
        f"{RUNS} runs of {SECONDS:g} s, two workers               {two:8.2f} runs/s   {two / one:.2f} times; aim: 1.8"
    )


if __name__ == "__main__":
    main()
