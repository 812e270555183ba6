"""The cost of a controller in C in the SIMD lanes of a batch: `python -m benchmarks.wrapped`.

The law that `quadcosim new controller` writes, in Python, which is traced to lanes, and in C, which is called once for
each lane: a step of the law alone, and of the plant in whole flights at 10 ms / 2 ms with events and objectives. CPU
time of one core, the smallest of several repetitions in turns.
"""

import os
import tempfile
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.batch import REPETITIONS, X, batch_step
from benchmarks.native import output_of, program
from fmu_kit.compiler.pack.lanes import compiled_lanes
from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import read_model
from orchestration.components.scaffold.folder import write
from orchestration.simulation.engines.batch.batch import Batch
from orchestration.simulation.engines.batch.kernels import preferred_lanes, sources_of
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.systems.schedule.schedule_cache import ScheduleCache
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed

MOVING = {"position.x": 0.3, "quaternion.x": 0.1, "quaternion.w": 0.99, "velocity.y": 0.2, "angular_velocity.z": 0.1}
STEPS = 100_000


def systems(folder: Path, *, in_c: bool) -> tuple[Shape, list[System]]:
    """The flight of the new controller from as many initial positions as there are lanes."""
    folder.mkdir()
    write("controller", "hover", folder, author="benchmark", license="", in_c=in_c)
    one = fmus.native_twins(load_system(folder / "hover" / "system.toml"))
    models = {name: read_model(path) for name, path in fmus.of_components(one.fmus).items()}
    one = replace(check_against_fmus(one, models).system, stop_time=20.0)
    places = np.linspace(0.0, 1.0, preferred_lanes()).tolist()
    return Shape(system=one, models=models, lanes=preferred_lanes()), [changed(one, {X: place}) for place in places]


def law_in_lanes(shape: Shape, library: Path) -> list[str]:
    """The arguments of lane_steps for the law of a system, whose lanes are compiled to `library`."""
    model = shape.models["controller"]
    library.write_bytes(compiled_lanes(sources_of("controller", model), shape.lanes))
    given = [f"{model.variables[name].reference}={value}" for name, value in MOVING.items()]
    return [str(library), "0.01", str(STEPS // shape.lanes), *given]


def main() -> None:
    """Print what a step costs in a lane, and how many times that of the traced law."""
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        timer = program("lane_steps", folder)
        cases = {case: systems(folder / case, in_c=case == "c") for case in ("python", "c")}
        laws = {case: law_in_lanes(shape, folder / f"{case}.so") for case, (shape, _) in cases.items()}
        batches = {case: Batch(shape, ScheduleCache()) for case, (shape, _) in cases.items()}
        for _ in range(REPETITIONS):
            for case, (_, runs) in cases.items():
                found[case, "law"].append(float(output_of(timer, *laws[case])))
                found[case, "flight"].append(1e9 * batch_step(batches[case], runs))
    print(f"load {os.getloadavg()[0]:.1f}; {preferred_lanes()} lanes; the smallest of {REPETITIONS}, in turns")
    for what in ("law", "flight"):
        traced, wrapped = (min(found[case, what]) for case in ("python", "c"))
        print(f"a step of the {what} in a lane: traced {traced:.1f} ns, in C {wrapped:.1f} ns: {wrapped / traced:.2f}")


if __name__ == "__main__":
    main()
