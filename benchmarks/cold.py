"""The cost of commands from a cold start, as a user runs them: `python -m benchmarks.cold`.

CPU time, user and system, of a new process and of all that it starts, the smallest of several interleaved repetitions;
it grows under other load. FMUs are built before, except for `build` itself. The sweep runs without flags into an empty
store: flights of 20 s at 50 Hz, the plant at 1 ms, each with its own jitter. With an empty cache it also compiles.
The cost of a run and the fixed cost of a sweep follow from two sizes, and so does the coordinator's part of both.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from orchestration.foundation.processes import subprocesses

REPETITIONS = 3
RUNS, FEWER_RUNS = 2048, 256
STUDY = """name = "cold"
[base]
stop_time = 20.0
timing = {{ period = 0.02, jitter = 0.004 }}
[[axes]]
name = "x"
sets = ["plant.initial.position.x"]
start = 0.0
stop = 1.0
[design]
method = "random"
samples = {runs}
vary_seed = true
"""
COMMANDS = {
    "--version": ("--version",),
    "--help": ("--help",),
    "run --native, 30 s": ("run", "--native"),
    "run --native --out, without figures": ("run", "--native", "--out", "run", "--no-figures"),
    "run --native --out, with four figures": ("run", "--native", "--out", "run"),
}
_START = """import atexit, resource
from orchestration.command.start import main
def own():
    used = resource.getrusage(resource.RUSAGE_SELF)
    open("own", "w").write(str(used.ru_utime + used.ru_stime))
atexit.register(own)
main()"""


def cost(*arguments: str, **environment: str) -> tuple[float, float]:
    """CPU time of a command [s], of all its processes and of the first one alone, in an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        for runs in (RUNS, FEWER_RUNS):
            (Path(folder) / f"{runs}.toml").write_text(STUDY.format(runs=runs), encoding="utf-8")
        before = _used()
        users = subprocesses.environment(**environment)
        users.pop("PYTHONDONTWRITEBYTECODE", None)  # else modules are compiled anew in each process
        subprocess.run(
            [sys.executable, "-c", _START, *arguments],
            check=True, cwd=folder, env=users, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        return _used() - before, float((Path(folder) / "own").read_text(encoding="utf-8"))


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Print a line for each."""
    sweeps: dict[int, list[tuple[float, float]]] = {RUNS: [], FEWER_RUNS: []}
    commands: dict[str, list[float]] = {name: [] for name in COMMANDS}
    cost("sweep", f"{FEWER_RUNS}.toml")  # builds FMUs and compiles
    for _ in range(REPETITIONS):
        for runs, costs in sweeps.items():
            costs.append(cost("sweep", f"{runs}.toml"))
        for name, arguments in COMMANDS.items():
            commands[name].append(cost(*arguments)[0])
    with tempfile.TemporaryDirectory() as cache:
        compiling = cost("sweep", f"{RUNS}.toml", XDG_CACHE_HOME=cache)[0]
    with tempfile.TemporaryDirectory() as cache:
        building = cost("build", "--native", "--out", "fmus", XDG_CACHE_HOME=cache)[0]
    print(f"load {os.getloadavg()[0]:.1f}; the smallest of {REPETITIONS}, in turns")
    (many, own), (few, own_few) = (tuple(map(min, zip(*costs))) for costs in (sweeps[RUNS], sweeps[FEWER_RUNS]))
    print(f"sweep of {RUNS} runs: {many:.2f} s, {RUNS / many:.0f} runs/s; with an empty cache {RUNS / compiling:.0f}")
    for what, all_runs, few_runs in (("a run", many, few), ("the coordinator's part of it", own, own_few)):
        each = (all_runs - few_runs) / (RUNS - FEWER_RUNS)
        print(f"  {what}: {1e3 * each:.2f} ms, and once {few_runs - FEWER_RUNS * each:.2f} s")
    for name, taken in commands.items():
        print(f"{name}: {min(taken):.2f} s")
    print(f"build --native with an empty cache: {building:.1f} s")


if __name__ == "__main__":
    main()
