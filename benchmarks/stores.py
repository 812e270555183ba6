"""The cost of writing, opening, reading, drawing and exporting a store of a million rows.

`python -m benchmarks.stores [ROWS]`. CPU time. The rows are not simulated: they have the columns of a study of the
quadrotor over three sampled axes, with random numbers.
"""

import json
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.drawing import draw_study
from orchestration.experiments.studies.store import Store, open_for_reading, open_for_writing
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.table import export, frame
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.workers.row import Results, Rows

ROWS = 1_000_000
TOGETHER = 1000
"""rows written in one transaction"""
OBJECTIVES = tuple(Scenario().as_system().objectives)
AXES = tuple(
    Axis(name=name, targets=(name,), low=0.0, high=1.0) for name in ("timing.delay", "timing.jitter", "timing.loss")
)
STUDY = Study(name="stores", base=Scenario(), axes=AXES, method="random", samples=1)
Result = TypeVar("Result")


def design(number: int) -> Iterator[tuple[int, str, str]]:
    """The points of the design."""
    draw = random.Random(0)
    for index in range(number):
        yield index, f"{index:064x}", json.dumps({axis.name: draw.random() for axis in AXES})


def rows(first: int) -> Rows:
    """Rows, every tenth of a diverged run."""
    draw, index = np.random.default_rng(first), np.arange(first, first + TOGETHER)
    diverged = index % 10 == 0
    measured = {name: np.where(diverged, np.nan, draw.random(TOGETHER)) for name in OBJECTIVES}
    fate = {"good": ~diverged, "diverged": diverged, "horizon": 30.0 * np.ones(TOGETHER)}
    results = Results(
        numbers={name: 1.0 * values for name, values in (fate | measured).items()},
        texts=["diverged" if is_lost else "settled" for is_lost in diverged], failed=np.zeros(TOGETHER, dtype=np.bool_),
        messages=[None] * TOGETHER, durations=draw.random(TOGETHER), engines=["batch"] * TOGETHER, machine="a machine",
    )  # fmt: skip
    return Rows(index=index.tolist(), key=[f"{i:064x}" for i in index], seed=index.tolist(), results=results)


def write(path: Path, number: int) -> None:
    """Write a store of `number` rows."""
    about: dict[str, object] = {"axes": [axis.name for axis in AXES], "grid": None, "guids": {}, "versions": {}}
    with open_for_writing(path, OBJECTIVES) as store:
        store.describe({name: json.dumps(value) for name, value in about.items()}, design(number))
        for first in range(0, number, TOGETHER):
            store.add(rows(first))


def timed(what: str, do: Callable[[], Result]) -> Result:
    """Print the CPU time of a call, and return its result."""
    start = time.process_time()
    result = do()
    print(f"{what:<28} {time.process_time() - start:8.1f} s", flush=True)
    return result


def main(number: int) -> None:
    """Print the figures."""
    print(f"a store of {number} rows")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.sqlite"
        timed("written", lambda: write(path, number))
        print(f"{'size':<28} {path.stat().st_size / 1e6:8.0f} MB")

        def count(read: Callable[[Store], object]) -> object:
            with open_for_reading(path) as store:
                return read(store)

        timed("opened", lambda: count(lambda store: store.about()))
        timed("counted, every row checked", lambda: count(lambda store: store.counts()))
        timed("read as a pandas DataFrame", lambda: frame(path))
        timed("drawn, reading included", lambda: draw_study(STUDY, Path(folder)))
        timed("exported, reading included", lambda: export(path, path.parent))
    print(f"{'most memory':<28} {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:8.0f} MB")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else ROWS)
