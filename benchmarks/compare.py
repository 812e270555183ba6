"""The cost of a step here and in another checkout of this project: `python -m benchmarks.compare CHECKOUT`.

Both run the same FMUs, those built here, each in a separate process, in turn; the ratio of two consecutive flights is
compared, since the speed of a shared machine is not constant.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.flights import CASES, STEPS
from fmu_kit import packaging
from fmu_kit.bundle import Target
from orchestration.components.building import builder
from orchestration.components.building.models import MODELS

HERE = Path(__file__).parent.parent
PAIRS = 9


class Side:
    """A process that runs flights with the master of one checkout."""

    def __init__(self, checkout: Path, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, HERE / "benchmarks" / "flights.py", folder],
            env={**os.environ, "PYTHONPATH": str(checkout)}, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def microseconds(self, case: str) -> float:
        """CPU time of a step [µs]."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(case, file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())

    def close(self) -> None:
        self._process.communicate()


def main() -> None:
    """Print medians of both, and of the ratios pair by pair."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compare", description=__doc__)
    parser.add_argument("checkout", type=Path, help="a worktree of another commit")
    other = parser.parse_args().checkout.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        builder.build(MODELS, folder)
        for model in ("EmptyPlant", "EmptyController"):
            packaging.build(Target("benchmarks.empty", model), folder)
        here, there = Side(HERE, folder), Side(other, folder)
        print(f"medians of {PAIRS} pairs of {STEPS} plant steps of 1 ms; load {os.getloadavg()[0]:.1f}")
        for case in CASES:
            pairs = [(here.microseconds(case), there.microseconds(case)) for _ in range(PAIRS + 1)][1:]
            mine, theirs = (statistics.median(times) for times in zip(*pairs))
            ratio = statistics.median(a / b for a, b in pairs)
            print(f"{case:<45} here {mine:7.2f} µs   there {theirs:7.2f} µs   ratio {ratio:.3f}", flush=True)
        here.close()
        there.close()


if __name__ == "__main__":
    main()
