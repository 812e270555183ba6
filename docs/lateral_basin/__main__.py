"""Proves a basin of attraction of the paper's vehicle about hover, in its lateral plane, and prints its extents.

`python -m docs.lateral_basin 0.01` proves the ellipsoid stored in `data/ellipsoids.json` for a period of 0.01 s;
`--search` first searches an ellipsoid, proves the largest share of it that can be proved, and stores that. `--fly`
simulates from increasing distances along each coordinate instead, and prints where flights first do not come to rest.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from docs.lateral_basin.ellipsoids import read_ellipsoid, write_ellipsoid
from docs.lateral_basin.period import STATES, UNITS, Loop
from docs.lateral_basin.proof import NotProven, prove, refuted_factor
from docs.lateral_basin.search import largest_ellipsoid
from orchestration.foundation.basics.simulator import Floats

SHARES = (0.75, 0.6, 0.45)
"""shares of the ellipsoid found that are tried"""
MAX_BOXES = 10_000_000
"""boxes"""
EVALUATIONS = 120
"""shapes evaluated by the search"""
MAX_INITIAL = {"y": 40.0, "vy": 40.0, "φ": 3.1, "p": 80.0, "z": 40.0, "vz": 40.0}
"""largest initial value of each coordinate"""
STARTS = 400
"""initial values along each coordinate"""
FLIGHT = 60.0
"""Duration of a flight [s]"""
LOST = 1e3
"""Bound of every coordinate at all times [m, m/s, rad, rad/s]"""
RESTS = 1e-3
"""Bound of all coordinates at the end [m, m/s, rad, rad/s]"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m docs.lateral_basin", description=__doc__)
    parser.add_argument("period", type=float, help="[s]")
    parser.add_argument("--search", action="store_true", help="search an ellipsoid, and store what is proved")
    parser.add_argument("--fly", action="store_true", help="simulate, instead of proving")
    options = parser.parse_args(arguments)
    loop = Loop(period=options.period)
    if options.fly:
        print(_row(options.period, first_losses(loop)))
        return
    began = time.process_time()
    R = search_and_prove(loop) if options.search else read_ellipsoid(options.period)
    boxes = prove(loop, R, MAX_BOXES)
    if options.search:
        write_ellipsoid(options.period, R)
    print(_row(options.period, extents(R)))
    print(f"{boxes} boxes, {time.process_time() - began:.0f} s of computing")
    print(f"{refuted_factor(loop, R):.2f} times as large, it is refused")


def extents(R: Floats) -> Floats:
    """The extents of the ellipsoid |R x| ≤ 1 along each coordinate, with the others at 0."""
    along: Floats = 1.0 / np.linalg.norm(R, axis=0)
    return along


def search_and_prove(loop: Loop) -> Floats:
    """Search an ellipsoid, and return R of its largest share that is proved."""
    largest = largest_ellipsoid(loop, EVALUATIONS)
    for share in SHARES:
        try:
            prove(loop, largest / share, MAX_BOXES)
        except NotProven as error:
            print(f"{share:g} of what was found: {error}")
        else:
            return largest / share
    raise NotProven(f"nothing down to {SHARES[-1]:g} of what was found")


def first_losses(loop: Loop) -> Floats:
    """The least value of each coordinate from which a flight does not come to rest; nan: there is none."""
    shares = np.arange(1, STARTS + 1) / STARTS
    states = np.concatenate([np.outer(row, shares) for row in np.diag([*MAX_INITIAL.values()])], axis=1)
    lost = np.zeros(states.shape[1], bool)
    for _ in range(round(FLIGHT / loop.period)):
        states = loop.after(states)
        lost |= ~(np.abs(states) < LOST).all(axis=0)
        states[:, lost] = 0.0
    lost = (lost | ~(np.abs(states) < RESTS).all(axis=0)).reshape(len(MAX_INITIAL), STARTS)
    first = np.where(lost.any(axis=1), shares[lost.argmax(axis=1)], np.nan)
    limits: Floats = first * np.array([*MAX_INITIAL.values()])
    return limits


def _row(period: float, values: Floats) -> str:
    texts = [f"{name} {value:.3g} {unit}" for name, value, unit in zip(STATES, values, UNITS)]
    return f"{period:g} s: " + ", ".join(texts)


if __name__ == "__main__":
    main()
