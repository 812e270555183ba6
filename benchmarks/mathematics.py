"""The accuracy and speed of the functions of native slaves: `python -m benchmarks.mathematics [--page PAGE]`.

Errors are the largest of many samples, computed with 150 bits; times are CPU time per number of an array that stays in
the cache, the smallest of several repetitions, all in one run. With `--page` the table of accuracy is written there.
"""

import argparse
import ctypes
import tempfile
import time
from pathlib import Path

import numpy as np

from docs.pages import fill
from tests.fmu_kit.compiler.accuracy import STATED, largest_error
from tests.fmu_kit.compiler.compiled import Floats, library, processor, results

SAMPLES = 20_000  # of each set of arguments
NUMBERS = 4096
REPETITIONS = 9
NAMES = ("tanh", "exp", "expm1", "log", "pow", "sin", "cos", "tan", "asin", "atan2", "hypot", "sqrt")
BUILDS = {
    "libm": ("-DQUADCOSIM_LIBM", "-lm"),
    "own": (),
    "4 lanes, AVX2": ("-mavx2", "-DQUADCOSIM_LANES=4"),
    "8 lanes, AVX-512": ("-mavx512f", "-mavx512dq", "-DQUADCOSIM_LANES=8"),
}


def nanoseconds(loops: ctypes.CDLL, name: str, arguments: tuple[Floats, ...]) -> float:
    """CPU time for one number [ns]."""
    shortest = float("inf")
    for _ in range(REPETITIONS):
        start = time.process_time()
        for _ in range(20):
            results(loops, name, *arguments)
        shortest = min(shortest, time.process_time() - start)
    return shortest / 20 / NUMBERS * 1e9


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A table of Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in [heads, ["---"] * len(heads), *rows])


def errors(folder: Path) -> str:
    """The table of the largest errors, with those of this machine's libm."""
    own, libm = library("loops.c", folder), library("loops.c", folder, *BUILDS["libm"])
    rows = []
    for name, stated in STATED.items():
        ours, where = largest_error(own, name, SAMPLES)
        theirs = "" if name in ("sqrt", "hypot") else f"{largest_error(libm, name, SAMPLES)[0]:.3f}"
        rows.append([f"`{name}`", f"{stated:g}", f"{ours:.3f}", ", ".join(f"{x:.4g}" for x in where), theirs])
    return table(["function", "stated", "found", "at about", "libm"], rows)


def speeds(folder: Path) -> str:
    """The table of times per number, for the builds whose instructions the processor has."""
    builds = {
        name: library("loops.c", folder, *flags)
        for name, flags in BUILDS.items()
        if all(flag[2:] in processor() for flag in flags if flag.startswith("-mavx"))
    }
    random = np.random.default_rng(11)
    x, y = random.uniform(0.05, 0.95, NUMBERS), random.uniform(0.1, 3.0, NUMBERS)
    rows = []
    for name in NAMES:
        arguments = (x, y) if name in ("pow", "atan2", "hypot") else (x,) if name == "asin" else (4.0 * x,)
        rows.append([f"`{name}`", *(f"{nanoseconds(loops, name, arguments):.1f}" for loops in builds.values())])
    return table(["ns a number", *builds], rows)


def main() -> None:
    """Print both tables, and write that of the accuracy into a page if there is one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, help="write the table of the accuracy there")
    page = parser.parse_args().page
    with tempfile.TemporaryDirectory() as scratch:
        accuracy = errors(Path(scratch))
        print(accuracy, speeds(Path(scratch)), sep="\n\n")
    if page:
        fill(page, {"errors": accuracy})


if __name__ == "__main__":
    main()
