"""The cost of flights in the SIMD lanes of a batch: `python -m benchmarks.batch`.

CPU time of one core, the smallest of several interleaved repetitions; it grows under other load, so that only ratios
within one run of this program can be compared. The bare kernels are plant and controller alone, called in turns. End to
end is a sweep into its store, with coordinator, worker process and the sample run by FMUs.
"""

import ctypes
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import read_model
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.sweep import sweep
from orchestration.foundation.basics.c_structures import address
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.batch.batch import Batch, Group
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.engines.batch.kernels import preferred_lanes
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.workers.many_runs import fly
from orchestration.systems.schedule.schedule_cache import ScheduleCache, schedule_key
from orchestration.systems.system.files import located
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed

REPETITIONS = 7
CASES = {"1 kHz both": (0.001, 20.0), "10 ms / 1 ms": (0.01, 20.0), "20 ms / 1 ms": (0.02, 20.0)}
"""Period and stop time [s]"""
RUNS = 2048
"""Runs of the sweeps"""
FEWER_RUNS = 256
"""Runs of the sweeps that separate the fixed cost of a sweep from the cost of each run"""
X = "components.plant.parameters.initial.position.x"


def systems(period: float, stop_time: float) -> tuple[Shape, list[System]]:
    """The paper's flight from as many initial positions as there are lanes."""
    one = fmus.native_twins(Scenario(timing=Timing(period=period), stop_time=stop_time).as_system())
    models = {name: read_model(path) for name, path in fmus.of_components(one.fmus).items()}
    one = check_against_fmus(one, models).system
    places = np.linspace(0.0, 1.0, preferred_lanes()).tolist()
    return Shape(system=one, models=models, lanes=preferred_lanes()), [changed(one, {X: place}) for place in places]


def bare_step(shape: Shape, batch: Batch, period: float, stop_time: float) -> tuple[float, float]:
    """CPU time of a step of the plant [s], with the law where it is due, and nothing else; call it after a run.

    What the calls themselves take comes second, and is to be taken off.
    """
    plant, law = (shape.kernels[name] for name in ("plant", "controller"))
    memory = dict(zip(shape.names, batch.arrays.memories))
    lanes, steps, each = shape.lanes, round(stop_time / 0.001), round(period / 0.001)
    active, status = np.full(lanes, 2**64 - 1, dtype=np.uint64), np.zeros(lanes, dtype=np.int32)
    times, step, longer = np.zeros(lanes), np.full(lanes, 0.001), np.full(lanes, period)
    step_type = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6)
    calls = [step_type(kernel.step) for kernel in (plant, law)]
    read = {name: shape.read(name) for name in shape.names}
    of_plant, of_law = (
        tuple(map(address, (memory[name], active, times, length, status, read[name])))
        for name, length in (("plant", step), ("controller", longer))
    )
    begin = time.process_time()
    for k in range(steps):
        calls[0](*of_plant)
        if k % each == 0:
            calls[1](*of_law)
    called = time.process_time() - begin
    begin = time.process_time()
    empty = step_type(ctypes.cast(ctypes.CDLL(None).abs, ctypes.c_void_p).value or 0)
    for k in range(steps):
        empty(*of_plant)
        if k % each == 0:
            empty(*of_law)
    return called / (steps * lanes), (time.process_time() - begin) / (steps * lanes)


def batch_step(batch: Batch, runs: list[System]) -> float:
    """CPU time of a step of the plant [s], with events and objectives."""
    group = Group(systems=runs, timings=[schedule_key(system) for system in runs])
    begin = time.process_time()
    result = batch.run(group)
    return (time.process_time() - begin) / float(result.steps.sum())


def compiled_step(system: System) -> float:
    """CPU time of a step of the plant [s] in the compiled loop."""
    with prepared(system, engine="compiled") as flight:
        flight.master.initialise()
        begin = time.process_time()
        flight.master.run()
        return (time.process_time() - begin) / flight.master.running.steps


def end_to_end(period: float, runs: int) -> float:
    """CPU time of a study of `runs` runs [s], each 20 s long, in a process of its own: it waits for its workers."""
    begin = _cpu()
    subprocess.run([sys.executable, "-c", f"import benchmarks.batch as b; b.sweep_runs({period}, {runs})"], check=True)
    return _cpu() - begin


def sweep_runs(period: float, runs: int) -> None:
    """Run such a study."""
    axis = Axis(name="x", targets=("plant.initial.position.x",), low=0.0, high=1.0)
    base = Scenario(timing=Timing(period=period), stop_time=20.0)
    study = Study(name="bench", base=base, axes=(axis,), method="random", samples=runs)
    with tempfile.TemporaryDirectory() as folder:
        sweep(study, out=Path(folder), engine="batch")


def from_arrays(period: float, runs: int) -> tuple[float, float]:
    """CPU time of `runs` flights of 20 s in lanes from their systems, and of `fly` with the same as an array [s]."""
    flight = Scenario(timing=Timing(period=period), stop_time=20.0)
    system, places = located(flight.as_system()), np.linspace(0.0, 1.0, runs)
    systems, batches = [changed(system, {X: place}) for place in places.tolist()], Batches()
    batches.run(systems[: preferred_lanes()])
    begin = time.process_time()
    batches.run(systems)
    between = time.process_time()
    fly(flight, {"plant.initial.position.x": places})
    return between - begin, time.process_time() - between


def _cpu() -> float:
    """CPU time of this process and of those that it has waited for [s]."""
    processes = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(used.ru_utime + used.ru_stime for used in map(resource.getrusage, processes))


def main() -> None:
    """Print steps a second and ratios, then runs a second of sweeps into their stores."""
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    cases = {case: systems(*times) for case, times in CASES.items()}
    batches = {case: Batch(shape, ScheduleCache()) for case, (shape, _) in cases.items()}
    for _ in range(REPETITIONS):
        for case, (period, stop_time) in CASES.items():
            shape, runs = cases[case]
            found[case, "batch"].append(batch_step(batches[case], runs))
            called, empty = bare_step(shape, batches[case], period, stop_time)
            found[case, "called"].append(called)
            found[case, "empty"].append(empty)
            found[case, "compiled"].append(compiled_step(replace(runs[0], stop_time=5.0)))
    print(f"load {os.getloadavg()[0]:.1f}; {preferred_lanes()} lanes; the smallest of {REPETITIONS}, in turns")
    for case in CASES:
        batch, called, empty, loop = (min(found[case, what]) for what in ("batch", "called", "empty", "compiled"))
        kernels = called - empty
        print(
            f"{case:<14} batch {1e-6 / batch:6.2f} M steps/s   bare kernels {1e-6 / kernels:6.2f} M steps/s   "
            f"{100 * kernels / batch:3.0f} % of them   {loop / batch:5.1f} times the compiled loop"
        )
    for period in (0.02, 0.01):
        lanes, arrays = map(min, zip(*(from_arrays(period, RUNS) for _ in range(2))))
        print(
            f"fly with {RUNS} flights of 20 s at {1 / period:.0f} Hz as an array: {RUNS / arrays:6.0f} runs/s of CPU "
            f"time, {100 * (arrays / lanes - 1):+.0f} % against the same lanes with a system for each"
        )
    for case, period in (("20 ms / 1 ms", 0.02), ("10 ms / 1 ms", 0.01)):
        all_runs, few_runs = (min(end_to_end(period, runs) for _ in range(2)) for runs in (RUNS, FEWER_RUNS))
        once = few_runs - FEWER_RUNS * (all_runs - few_runs) / (RUNS - FEWER_RUNS)
        steps = RUNS * 20_000 * min(found[case, "batch"])
        shares = f"{100 * steps / all_runs:.0f} % are steps, {100 * once / all_runs:.0f} % a sweep costs once"
        print(
            f"sweep of {RUNS} flights of 20 s at {1 / period:.0f} Hz: {RUNS / all_runs:6.0f} runs/s of CPU time, end "
            f"to end; of that {shares}"
        )


if __name__ == "__main__":
    main()
