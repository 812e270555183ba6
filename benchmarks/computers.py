"""The cost of causes of timing in each engine: `python -m benchmarks.computers [CASE ENGINE]`.

The paper's flight at 100 Hz, with native FMUs, as CPU time of a run on one core: with a random delay of each command,
with a task of a computer whose execution time is random likewise, and with two tasks of load beside it. All three have
the same number of instants, and each run its own seed. Cases take turns, and a ratio is that of the smallest of the
repetitions. With a case and an engine it runs only this one, for a profiler.
"""

import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace

from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.files import located
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed

REPETITIONS = 9
DURATION = Distribution(uniform=(0.001, 0.002))
"""Duration of a delay, or of the execution of a task [s]"""
DELAY, TASK, LOADED = "a delay", "a task", "a task beside two of load"


def systems() -> dict[str, System]:
    """The flight, by case; engines set the stop time."""
    flight = Scenario().as_system()
    sampled = flight.components["controller"]
    unsampled = {**flight.components, "controller": replace(sampled, sampling=None)}
    control = Task(component="controller", period=0.01, execution=DURATION)
    load = {
        "telemetry": Task(period=0.005, priority=2, execution=Distribution(uniform=(0.0005, 0.001))),
        "logging": Task(period=0.02, priority=3, execution=Distribution(uniform=(0.001, 0.004))),
    }
    tasks = {TASK: {"control": control}, LOADED: {"control": control, **load}}
    found = {DELAY: changed(flight, {"connections.command.delay": DURATION})}
    for case, those in tasks.items():
        found[case] = replace(flight, components=unsampled, computers={"autopilot": Computer(tasks=those)})
    return {case: located(system) for case, system in found.items()}


def one_by_one(engine: str, runs: int, stop_time: float) -> Callable[[System], float]:
    """A function that runs a system by an engine, and returns the CPU time of a run [s]."""

    def cost(system: System) -> float:
        taken = 0.0
        for seed in range(runs):
            with prepared(replace(system, stop_time=stop_time, seed=seed), engine=engine) as flight:  # type: ignore[arg-type]
                flight.master.initialise()
                begin = time.process_time()
                flight.master.run()
                taken += time.process_time() - begin
        return taken / runs

    return cost


def in_lanes(runs: int, stop_time: float) -> Callable[[System], float]:
    """A function that runs a system in SIMD lanes, and returns the CPU time of a run [s]."""
    batches: dict[int, Batches] = defaultdict(Batches)

    def cost(system: System) -> float:
        runs_of_system = [replace(system, stop_time=stop_time, seed=seed) for seed in range(runs)]
        begin = time.process_time()
        batches[len(system.computers)].run(runs_of_system)
        return (time.process_time() - begin) / runs

    return cost


ENGINES = {
    "python": one_by_one("python", 1, 1.0),
    "compiled": one_by_one("compiled", 4, 20.0),
    "lanes": in_lanes(64, 20.0),
}


def main() -> None:
    """Print milliseconds a run and ratios, or run one case alone."""
    flights = systems()
    if len(sys.argv) == 3:
        print(f"{1e3 * ENGINES[sys.argv[2]](flights[sys.argv[1]]):.2f} ms")
        return
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    for engine, cost in ENGINES.items():
        for _ in range(1 + REPETITIONS):  # the first compiles
            for case, system in flights.items():
                found[engine, case].append(cost(system))
    print(f"load {os.getloadavg()[0]:.1f}; the smallest of {REPETITIONS}, in turns")
    for engine in ENGINES:
        least = {case: min(found[engine, case][1:]) for case in flights}
        texts = (f"{case} {1e3 * taken:8.2f} ms, {taken / least[DELAY]:.2f} times" for case, taken in least.items())
        print(f"{engine:<9} {'   '.join(texts)}")


if __name__ == "__main__":
    main()
