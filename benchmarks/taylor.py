"""What a Taylor step over a whole hold would cost and change, in place of Runge-Kutta steps of 1 ms: `python -m
benchmarks.taylor`.

The flights of `floor.c`, whose plant is stepped from sample to sample by the series of its solution. Each order is
compared with the highest one for positions and velocities early and at the end, and with Runge-Kutta for CPU time of
one core, law and loop included, in turns, the smallest of several; only ratios within one run of this program can be
compared.
"""

import os
import time

import numpy as np

from benchmarks.floor import CASES, GRID, RUNS, STOP, by_hand, flown_by_hand, samples

REPETITIONS = 5
ORDERS = (4, 6, 8, 10, 12)
REFERENCE = 15
"""The order of which values are taken for exact"""
EARLY = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Times at which the vehicle still turns fast [s]"""


def main() -> None:
    """Print, for each case and order, the largest error early and at the end, and how many times as fast it is."""
    starts = np.linspace(0.0, 1.0, RUNS)
    libraries = {order: by_hand("-O3", f"-DORDER={order}") for order in (*ORDERS, REFERENCE)}
    ways = {"Runge-Kutta, 1 ms": (by_hand("-O3"), GRID), **{f"Taylor {x}": (libraries[x], STOP) for x in ORDERS}}
    print(f"load {os.getloadavg()[0]:.1f}; the smallest of {REPETITIONS}, in turns")
    for case, (period, jitter) in CASES.items():
        if period <= GRID:
            continue  # a step of Runge-Kutta is a hold there
        instants = samples(period, jitter)
        found: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(REPETITIONS):
            for way, (library, grid) in ways.items():
                begin = time.process_time()
                flown_by_hand(library, starts, instants, grid)
                found[way].append(time.process_time() - begin)
        slowest = min(found["Runge-Kutta, 1 ms"])
        exact = {stop: flown_by_hand(libraries[REFERENCE], starts, instants, STOP, stop) for stop in (*EARLY, STOP)}
        for way, (library, grid) in ways.items():
            errors = {
                stop: float(np.abs(flown_by_hand(library, starts, instants, grid, stop) - values).max())
                for stop, values in exact.items()
            }
            early, last = max(errors[stop] for stop in EARLY), errors[STOP]
            faster = slowest / min(found[way])
            print(f"{case:<18} {way:<18} error {early:.1e}, at the end {last:.1e}; {faster:.2f} times as fast")


if __name__ == "__main__":
    main()
