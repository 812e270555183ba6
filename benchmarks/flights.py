"""Runs the flights of `compare` with the master of the checkout on the path, through its public names only."""

import gc
import sys
import time
from typing import Any

STEPS = 3000
MILLISECOND = 1e-3
OURS, EMPTY = ("QuadrotorPlant", "UnifiedController"), ("EmptyPlant", "EmptyController")
ON = {
    "delay": MILLISECOND, "measurement_loss": 1e-9, "command_loss": 1e-9,
    "noise": {"position": 1e-9, "quaternion": 1e-9}, "quantisation": {"position": 1e-9},
}  # fmt: skip
CASES: dict[str, tuple[tuple[str, str], dict[str, Any]]] = {
    "closed loop, sampled at 1 ms": (OURS, {"period": MILLISECOND}),
    "closed loop, sampled at 10 ms": (OURS, {"period": 10 * MILLISECOND}),
    "empty slaves, 1 ms": (EMPTY, {"period": MILLISECOND}),
    "empty slaves, delay, loss, noise, quantisation": (EMPTY, {"period": MILLISECOND, **ON}),
}


def microseconds(case: str, folder: str) -> float:
    """CPU time of one plant step and all that belongs to it [µs]."""
    import quadcosim

    prepared = vars(sys.modules[quadcosim.run.__module__])[
        "prepared"
    ]  # the name of that module may differ between checkouts
    (plant, controller), timing = CASES[case]
    scenario = quadcosim.Scenario(
        stop_time=STEPS * MILLISECOND,
        timing=quadcosim.Timing(**timing),
        plant=quadcosim.FmuChoice(fmu=f"{folder}/{plant}.fmu"),
        controller=quadcosim.FmuChoice(fmu=f"{folder}/{controller}.fmu"),
    )
    with prepared(scenario) as flight:
        flight.master.initialise()
        gc.collect()
        start = time.process_time()
        flight.master.run()
        assert flight.master.running.steps == STEPS
        return (time.process_time() - start) / STEPS * 1e6


if __name__ == "__main__":
    for line in sys.stdin:
        print(microseconds(line.rstrip("\n"), sys.argv[1]), flush=True)
