"""The tables of `tests/data`: what each holds, and how to compute it anew."""

import csv
from pathlib import Path
from typing import Any

import numpy as np

from tests.reference.flight import fly
from tests.reference.law import Parameters, evaluate

Array = Any
DATA = Path(__file__).parent.parent / "data"

GENERAL = Parameters(
    m=1.3,
    J=np.array([[0.8, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.4]]),
    k_t=np.array([2.0, 1.5, 3.0]),
    beta=0.4,
    k_s=3.0,
    beta_t=0.8,
    epsilon=2e-3,
    k_eta=10.0,
    k_theta=12.0,
    k_q=8.0,
)
LAWS = {"law_paper.csv": Parameters(), "law_general.csv": GENERAL}
"""Points of the law, by file: state and reference in the first 28 columns, then the results."""
FLIGHTS = {
    "closed_loop_10ms.csv": (0.01, 0.0),
    "closed_loop_50ms.csv": (0.05, 0.0),
    "closed_loop_20ms_delay_5ms.csv": (0.02, 0.005),
}
"""Period and delay [s] of a flight, by file."""
INPUTS = 28


def read(path: Path) -> tuple[list[str], Array]:
    """Header and rows."""
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def write(path: Path, header: list[str], rows: Array) -> None:
    """A table that `read` gives back to the bit."""
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *([repr(float(x)) for x in row] for row in rows)])


def law_at(inputs: Array, p: Parameters) -> dict[str, Array]:
    """The law at the first `INPUTS` columns of a row."""
    return evaluate(inputs[:3], inputs[3:6], inputs[6:10], inputs[10:13], inputs[13:INPUTS].reshape(5, 3), p)


def law_table(header: list[str], inputs: Array, p: Parameters) -> Array:
    """The results for the columns of `header`, beside their inputs."""
    names = list(dict.fromkeys(column.partition(".")[0] for column in header[INPUTS:]))
    results = [np.hstack([now[name] for name in names]) for now in (law_at(row, p) for row in inputs[:, :INPUTS])]
    return np.hstack([inputs[:, :INPUTS], np.array(results)])


def table(name: str, stop: float = 30.0) -> tuple[list[str], Array]:
    """Header and rows of one table, computed anew; a flight up to `stop` [s]."""
    header, rows = read(DATA / name)
    if name in LAWS:
        return header, law_table(header, rows, LAWS[name])
    return header, fly(*FLIGHTS[name], stop=stop)


def difference(computed: Array, given: Array) -> float:
    """The largest, of values above 1 relative to them."""
    return float(np.max(np.abs(computed - given) / np.maximum(1.0, np.abs(given))))
