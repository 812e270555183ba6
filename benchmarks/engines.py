"""The cost of a step of the closed loop in each engine, with everything recorded: `python -m benchmarks.engines`.

CPU time of the run alone, after initialisation, the smallest of several interleaved repetitions; it grows under other
load, so that only ratios within one run of this program can be compared.
"""

import os
import time
from collections import defaultdict
from typing import get_args

from orchestration.components.building.fmus import native_twin
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.runs.prepared import prepared

REPETITIONS = 9
CASES = {
    "native FMUs, both at 1 kHz": (0.001, True, {"python": 2.0, "compiled": 20.0}),
    "native FMUs, 10 ms / 1 ms": (0.01, True, {"python": 4.0, "compiled": 30.0}),
    "pythonfmu FMUs, both at 1 kHz": (0.001, False, {"python": 0.5, "compiled": 0.5}),
}
"""Period [s], whether native, stop time [s] by engine"""


def scenario(period: float, stop_time: float, *, native: bool) -> Scenario:
    """The paper's flight with this sample period."""
    flight = Scenario(timing=Timing(period=period), stop_time=stop_time)
    if not native:
        return flight
    return flight.with_fmus(plant=native_twin(flight.plant.fmu), controller=native_twin(flight.controller.fmu))


def step(flight: Scenario, engine: Engine) -> float:
    """CPU time of a step of the plant [us]."""
    with prepared(flight, engine=engine) as run:
        run.master.initialise()
        start = time.process_time()
        run.master.run()
        return (time.process_time() - start) / run.master.running.steps * 1e6


def main() -> None:
    """Print a line for each case and engine, and how many times as fast the compiled loop is."""
    found: dict[tuple[str, Engine], list[float]] = defaultdict(list)
    for _ in range(REPETITIONS):
        for case, (period, native, stops) in CASES.items():
            for engine in get_args(Engine):
                found[case, engine].append(step(scenario(period, stops[engine], native=native), engine))
    print(f"load {os.getloadavg()[0]:.1f}; the smallest of {REPETITIONS}, in turns")
    for case in CASES:
        python, compiled = (min(found[case, engine]) for engine in get_args(Engine))
        for engine, cost in (("python", python), ("compiled", compiled)):
            print(f"{case}, {engine:<9} {cost:8.3f} us a step   {1e6 / cost:9.0f} steps/s")
        print(f"{case}: compiled is {python / compiled:.1f} times as fast")


if __name__ == "__main__":
    main()
