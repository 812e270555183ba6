"""Proves a basin of the paper's vehicle about hover, in its lateral plane, and prints how far it goes.

`python -m docs.lateral_basin 0.01` proves what is kept in `data/ellipsoids.json` for a period of 0.01 s; `--search`
first looks for an ellipsoid, proves the largest share of it that is seen to be one, and keeps that. `--fly` flies from
ever farther along each coordinate instead, and prints from where on a flight does not come to rest.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from docs.lateral_basin.kept import keep, kept
from docs.lateral_basin.period import STATES, UNITS, Loop
from docs.lateral_basin.proof import NotProven, prove, refused_from
from docs.lateral_basin.search import found
from orchestration.basics.simulator import Floats

SHARES = (0.75, 0.6, 0.45)
"""of what the search finds, which are tried"""
MOST = 10_000_000
"""boxes"""
EVALUATIONS = 120
"""of the search: shapes"""
FLOWN = {"y": 40.0, "vy": 40.0, "φ": 3.1, "p": 80.0, "z": 40.0, "vz": 40.0}
"""how far along each coordinate is flown from"""
STARTS = 400
"""of them, along each"""
FLIGHT = 60.0
"""[s]"""
LOST = 1e3
"""[m, m/s, rad, rad/s], any coordinate at any time"""
RESTS = 1e-3
"""[m, m/s, rad, rad/s], all coordinates then"""


def main(arguments: Sequence[str] | None = None) -> None:
    """What the command line asks."""
    parser = argparse.ArgumentParser(prog="python -m docs.lateral_basin", description=__doc__)
    parser.add_argument("period", type=float, help="[s]")
    parser.add_argument("--search", action="store_true", help="look for an ellipsoid, and keep what is proved")
    parser.add_argument("--fly", action="store_true", help="fly, instead of proving")
    asked = parser.parse_args(arguments)
    loop = Loop(period=asked.period)
    if asked.fly:
        print(_row(asked.period, flown(loop)))
        return
    began = time.process_time()
    R = searched(loop) if asked.search else kept(asked.period)
    boxes = prove(loop, R, MOST)
    if asked.search:
        keep(asked.period, R)
    print(_row(asked.period, reach(R)))
    print(f"{boxes} boxes, {time.process_time() - began:.0f} s of computing")
    print(f"{refused_from(loop, R):.2f} times as large, it is refused")


def reach(R: Floats) -> Floats:
    """How far along each coordinate, the others at 0, the ellipsoid |R x| ≤ 1 goes."""
    along: Floats = 1.0 / np.linalg.norm(R, axis=0)
    return along


def searched(loop: Loop) -> Floats:
    """R of an ellipsoid of which a proof is at hand."""
    largest = found(loop, EVALUATIONS)
    for share in SHARES:
        try:
            prove(loop, largest / share, MOST)
        except NotProven as error:
            print(f"{share:g} of what was found: {error}")
        else:
            return largest / share
    raise NotProven(f"nothing down to {SHARES[-1]:g} of what was found")


def flown(loop: Loop) -> Floats:
    """Along each coordinate the least start from which a flight does not come to rest; nan: there is none."""
    shares = np.arange(1, STARTS + 1) / STARTS
    states = np.concatenate([np.outer(row, shares) for row in np.diag([*FLOWN.values()])], axis=1)
    lost = np.zeros(states.shape[1], bool)
    for _ in range(round(FLIGHT / loop.period)):
        states = loop.after(states)
        lost |= ~(np.abs(states) < LOST).all(axis=0)
        states[:, lost] = 0.0
    lost = (lost | ~(np.abs(states) < RESTS).all(axis=0)).reshape(len(FLOWN), STARTS)
    first = np.where(lost.any(axis=1), shares[lost.argmax(axis=1)], np.nan)
    limits: Floats = first * np.array([*FLOWN.values()])
    return limits


def _row(period: float, values: Floats) -> str:
    told = [f"{name} {value:.3g} {unit}" for name, value, unit in zip(STATES, values, UNITS)]
    return f"{period:g} s: " + ", ".join(told)


if __name__ == "__main__":
    main()
