"""CoFmuPy, formerly CoFMPy: run as a program by a Python that has it and not this project.

`python -I cofmupy.py FUNCTION JOB ROWS`
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from cofmupy import Coordinator

Rows = list[list[float]]


def run_jacobi(job: dict[str, Any]) -> Rows:
    """All FMUs step, then all values are exchanged."""
    return _run(job, "jacobi")


def run_gauss_seidel(job: dict[str, Any]) -> Rows:
    """One FMU after the other, in the order of the job."""
    return _run(job, "gauss_seidel")


def _run(job: dict[str, Any], method: str) -> Rows:
    coordinator = Coordinator()
    coordinator.start(
        {
            "fmus": [
                {"id": name, "name": name, "path": job["fmus"][name], "initialization": parameters}
                for name, parameters in job["parameters"].items()
            ],
            "connections": [
                {"source": _end(*output), "target": [_end(*target)]} for output, target in job["connections"]
            ],
            "cosim_method": method,
            "iterative": False,
        }
    )
    # By default it takes the FMUs of a loop in the order of a set of names, which differs from process to process.
    coordinator.master.sequence_order = [list(job["fmus"])]
    coordinator.run_simulation(step_size=job["step"], end_time=job["stop"])
    found = coordinator.get_results()
    columns = [found[tuple(signal.split(".", 1))] for signal in job["signals"]]
    # It records the time at which a step began with the values at its end.
    return [[time + job["step"], *values] for time, *values in zip(found["time"], *columns)]


def _end(component: str, variable: str) -> dict[str, str]:
    return {"type": "fmu", "id": component, "variable": variable, "unit": ""}


if __name__ == "__main__":
    function, job, rows = sys.argv[1:]
    np.save(rows, np.array(globals()[function](json.loads(Path(job).read_text(encoding="utf-8")))))
