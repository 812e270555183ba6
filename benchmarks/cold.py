"""The cost of commands from a cold start, as a user runs them: `python -m benchmarks.cold`.

CPU time, user and system, of a new process and of all that it starts, the smallest of several interleaved repetitions;
it grows under other load. FMUs are built before, except for `build` itself. The sweep runs without flags into an empty
store: flights of 20 s and of 1 s at 50 Hz, the plant at 1 ms, each with its own jitter. With an empty cache it also
compiles, and builds FMUs: the cache vouches for them. The cost of a run and the fixed cost of a sweep follow from two
sizes, and so does the coordinator's part of both. `python -m benchmarks.cold FOLDER` measures the sweeps in turns with
those of the tree in FOLDER.
"""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestration.foundation.processes import subprocesses

REPETITIONS = 3
SWEEPS = {20.0: (2048, 256), 1.0: (100_000, 10_000)}
"""Numbers of runs, many and few, by their length [s]"""
STUDY = """name = "cold"
[base]
stop_time = {length}
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
    open("own", "w").write(f"{used.ru_utime + used.ru_stime} {used.ru_maxrss}")
atexit.register(own)
main()"""


@dataclass(frozen=True)
class Cost:
    """What a command costs."""

    all: float
    """CPU time of all its processes [s]"""
    own: float
    """CPU time of the first one alone [s]"""
    memory: float
    """most memory of the first one [MB]"""


def cost(*arguments: str, tree: Path | None = None, **environment: str) -> Cost:
    """What a command costs in an empty folder, of this tree or of another."""
    with tempfile.TemporaryDirectory() as folder:
        for length, sizes in SWEEPS.items():
            for runs in sizes:
                study = STUDY.format(runs=runs, length=length)
                (Path(folder) / f"{runs}.toml").write_text(study, encoding="utf-8")
        before = _used()
        users = subprocesses.environment(**environment)
        if tree is not None:
            users["PYTHONPATH"] = str(tree)
        users.pop("PYTHONDONTWRITEBYTECODE", None)  # else modules are compiled anew in each process
        subprocess.run(
            [sys.executable, "-c", _START, *arguments],
            check=True, cwd=folder, env=users, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        own, memory = map(float, (Path(folder) / "own").read_text(encoding="utf-8").split())
        return Cost(_used() - before, own, memory / 1024.0)


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def sweeps(name: str, costs: Mapping[int, Sequence[Cost]], length: float, compiling: float) -> None:
    """Print what sweeps of runs of this length cost."""
    many, few = SWEEPS[length]
    smallest = {
        part: [min(getattr(each, part) for each in costs[runs]) for runs in (many, few)] for part in ("all", "own")
    }
    once = f"; with an empty cache {many / compiling:.0f}" if compiling else ""
    whole, memory = smallest["all"][0], max(each.memory for each in costs[many])
    print(f"{name}: sweep of {many} runs of {length:g} s: {whole:.2f} s, {many / whole:.0f} runs/s{once}")
    for what, part in (("a run", "all"), ("the coordinator's part of it", "own")):
        all_runs, few_runs = smallest[part]
        each = (all_runs - few_runs) / (many - few)
        print(f"  {what}: {1e3 * each:.3f} ms, and once {few_runs - few * each:.2f} s")
    print(f"  most memory of the coordinator: {memory:.0f} MB")


def main(other: Path | None = None) -> None:
    """Print a line for each."""
    trees = {"here": None} if other is None else {"here": None, str(other): other}
    sizes = [runs for pair in SWEEPS.values() for runs in pair]
    found: dict[str, dict[int, list[Cost]]] = {name: {runs: [] for runs in sizes} for name in trees}
    commands: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for tree in trees.values():
        cost("sweep", f"{sizes[1]}.toml", tree=tree)  # builds FMUs and compiles
    for _ in range(REPETITIONS):
        for runs in sizes:
            for name, tree in trees.items():
                found[name][runs].append(cost("sweep", f"{runs}.toml", tree=tree))
        for name, arguments in COMMANDS.items():
            commands[name].append(cost(*arguments).all)
    print(f"load {os.getloadavg()[0]:.1f}; the smallest of {REPETITIONS}, in turns")
    for name, tree in trees.items():
        with tempfile.TemporaryDirectory() as cache:
            compiling = cost("sweep", f"{sizes[0]}.toml", tree=tree, XDG_CACHE_HOME=cache).all
        for length in SWEEPS:
            sweeps(name, found[name], length, compiling if length == 20.0 else 0.0)
    for name, taken in commands.items():
        print(f"{name}: {min(taken):.2f} s")
    with tempfile.TemporaryDirectory() as cache:
        building = cost("build", "--native", "--out", "fmus", XDG_CACHE_HOME=cache).all
    print(f"build --native with an empty cache: {building:.1f} s")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
