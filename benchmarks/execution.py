"""Execution times of the laws on a flight controller's processor: `python -m benchmarks.execution [--out FOLDER]`.

For each law and each redesign the instructions of every step of a flight of 10 s at 100 Hz are counted under QEMU, in
the C that `export-c` writes, at -O2: the counts are reproducible. In seconds, at CYCLES cycles per instruction and the
processor's clock, they are traces for `execution` of a task: a CSV file for each processor, a column for each
law. The model has no caches, no wait states of the flash and no interrupts.
"""

import argparse
import statistics
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.embedded import count_instructions
from benchmarks.mathematics import table
from fmu_kit.bundle import Target
from fmu_kit.compiler.pack.embedded_files import write
from orchestration.components.building.models import MODELS
from tests.fmu_kit.compiler.embedded import M4F, M7

FOLDER = Path(__file__).parents[1] / "examples" / "autopilot" / "execution"
CYCLES = 1.0
"""Cycles per instruction; the M7 executes up to two per cycle, and waits for its memory"""


@dataclass(frozen=True)
class Processor:
    """A processor of flight controllers."""

    flags: tuple[str, ...]
    clock: float
    """Clock [Hz]"""
    single: bool
    """whether the law is computed in single precision"""


PROCESSORS = {
    "m7": Processor(M7, 216e6, single=False),  # STM32F765, of the Pixhawk 4
    "m4f": Processor(M4F, 168e6, single=True),  # STM32F427, of the Pixhawk 1
}
REDESIGNS = ("explicit", "semi_implicit", "midpoint", "mean", "match")
LAWS = {
    **{f"unified_{name}": ("UnifiedController", k) for k, name in enumerate(REDESIGNS, 1)},
    "geometric": ("GeometricController", 1),
    "geometric_mean": ("GeometricController", 4),
    "cascaded": ("CascadedController", 0),
}
"""The controller and its discretisation, if it has any, by name of the column"""


def step_counts(model: str, discretisation: int, processor: Processor, folder: Path) -> list[int]:
    """Instructions of each step; raises `subprocess.CalledProcessError` where one fails."""
    sources = [
        write(Target.parse(MODELS[name]), folder / name, single=processor.single and name == model)
        for name in (model, "QuadrotorPlant")
    ]
    prepared = f"c.par.discretisation = {discretisation};" if discretisation else ""
    flags = (f"-DCONTROLLER={model}", f"-DPREPARED={prepared}", "-O2")
    return count_instructions(sources, folder, processor.flags, *flags)[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=FOLDER)
    folder: Path = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for machine, processor in PROCESSORS.items():
        traces = {}
        for name, (model, discretisation) in LAWS.items():
            with tempfile.TemporaryDirectory() as temporary:
                counts = step_counts(model, discretisation, processor, Path(temporary))
            traces[name] = [count * CYCLES / processor.clock for count in counts]
            numbers = (f"{round(statistics.median(counts)):,}", f"{max(counts):,}", f"{max(traces[name]) * 1e6:.1f}")
            rows.append([machine, name, *numbers])
        lines = [",".join(f"{time:.9f}" for time in row) for row in zip(*traces.values())]
        (folder / f"{machine}.csv").write_text("\n".join([",".join(traces), *lines]) + "\n", encoding="utf-8")
    print(table(["processor", "law", "instructions a step", "most", "longest [us]"], rows))


if __name__ == "__main__":
    main()
