"""What flights of the paper's law cost in C written by hand, and how far this project is behind: `python -m
benchmarks.floor`.

The flight of `floor.c` has no generality: one law, one plant, no objectives, events, checks or store; its sampling
instants are drawn before. It is compared with `fly`, first for what it computes and then for CPU time of one core, in
turns, the smallest of several; only ratios within one run of this program can be compared.
"""

import ctypes
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import quadcosim
from fmu_kit.compiler.pack import c_compiler, lanes
from orchestration.foundation.basics.c_structures import address

RUNS, REPETITIONS = 256, 3
STOP, GRID = 20.0, 0.001
"""Stop time and step of the plant [s]"""
CASES = {"20 ms, jitter 4 ms": (0.02, 0.004), "10 ms": (0.01, 0.0), "1 ms": (0.001, 0.0)}
"""Period and jitter [s]"""
LAST = [f"plant.{vector}.{axis}" for vector in ("position", "velocity") for axis in "xyz"]
TOLERANCE = 1e-9
"""Largest difference at the end [m, m/s]"""


def by_hand(*options: str) -> ctypes.CDLL:
    """The library of floor.c, for this processor."""
    runtime = Path(c_compiler.__file__).parent.parent / "runtime"
    headers = {name: (runtime / name).read_bytes() for name in ("lanes.h", "mathematics.h")}
    sources = {**headers, "floor.c": Path(__file__).with_suffix(".c").read_bytes()}
    width = f"-DQUADCOSIM_LANES={lanes.preferred_lanes()}"
    options = (*c_compiler.FOR_THIS_PROCESSOR, width, "-Wno-psabi", *options)
    library = c_compiler.compiled_here(sources, "floor.c", options=options)
    with tempfile.NamedTemporaryFile(suffix=".so") as file:
        file.write(library)
        file.flush()
        return ctypes.CDLL(file.name)


def samples(period: float, jitter: float) -> np.ndarray:
    """The sampling instants of each run [ns], int64, of shape (runs, samples), as docs/timing.md says."""
    period_ns, jitter_ns = round(period * 1e9), round(jitter * 1e9)
    nominal = np.arange(round(STOP / period), dtype=np.int64) * period_ns
    late = [
        np.floor(
            np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed).spawn(5)[0])).random(len(nominal))
            * jitter_ns
        )
        for seed in range(RUNS)
    ]
    return nominal + np.array(late, dtype=np.int64)


def flown_by_hand(
    library: ctypes.CDLL, starts: np.ndarray, instants: np.ndarray, grid: float = GRID, stop: float = STOP
) -> np.ndarray:
    """The last values of each run in steps of `grid` [s], of shape (runs, 6)."""
    width, ends = lanes.preferred_lanes(), np.empty((RUNS // lanes.preferred_lanes(), 6, lanes.preferred_lanes()))
    whole = ctypes.c_int64
    for i in range(RUNS // width):
        group = slice(i * width, (i + 1) * width)
        library.fly(
            ctypes.c_void_p(address(starts[group])),
            ctypes.c_void_p(address(instants[group])),
            whole(instants.shape[1]),
            whole(round(grid * 1e9)),
            whole(round(stop * 1e9)),
            ctypes.c_void_p(address(ends[i])),
        )
    return np.asarray(ends.transpose(0, 2, 1).reshape(RUNS, 6))


def main() -> None:
    """Print, for each case, steps a second by hand and by `fly`, and how far the latter is behind."""
    library, starts = by_hand(), np.linspace(0.0, 1.0, RUNS)
    print(f"load {os.getloadavg()[0]:.1f}; {lanes.preferred_lanes()} lanes; the smallest of {REPETITIONS}, in turns")
    for case, (period, jitter) in CASES.items():
        instants = samples(period, jitter)
        flight = quadcosim.Scenario(
            timing=quadcosim.Timing(period=period, jitter=jitter, plant_interval=GRID), stop_time=STOP
        )
        values = {"plant.initial.position.x": starts, "seed": np.arange(RUNS)}
        recorded = quadcosim.fly(flight, {name: of[:8] for name, of in values.items()}, record=LAST)
        rows = np.isfinite(recorded["time"]).sum(axis=1)
        by_us = np.stack([recorded[name][np.arange(8), rows - 1] for name in LAST], axis=1)
        apart = np.abs(flown_by_hand(library, starts, instants)[:8] - by_us).max()
        if not apart < TOLERANCE:
            raise SystemExit(f"{case}: the flights end {apart:.2g} apart, expected less than {TOLERANCE:g}")
        taken: dict[str, list[float]] = {"by hand": [], "fly": []}
        for _ in range(REPETITIONS):
            begin = time.process_time()
            flown_by_hand(library, starts, instants)
            between = time.process_time()
            quadcosim.fly(flight, values, outputs=["good"])
            taken["by hand"].append(between - begin)
            taken["fly"].append(time.process_time() - between)
        hand, ours = (RUNS * STOP / GRID / min(each) / 1e6 for each in taken.values())
        print(
            f"{case:<20} by hand {hand:6.1f} M steps/s, fly {ours:6.1f}: behind by {hand / ours:.1f} "
            f"(ends within {apart:.1g})"
        )


if __name__ == "__main__":
    main()
