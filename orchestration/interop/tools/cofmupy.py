"""CoFmuPy, which was called CoFMPy: run as a program by a Python that has it and nothing of this project.

`python -I cofmupy.py FUNCTION JOB ROWS`
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from cofmupy import Coordinator

Rows = list[list[float]]


def fly_jacobi(job: dict[str, Any]) -> Rows:
    """All FMUs step, then all values are exchanged."""
    return _fly(job, "jacobi")


def fly_gauss_seidel(job: dict[str, Any]) -> Rows:
    """One FMU after the other, in the order of the job."""
    return _fly(job, "gauss_seidel")


def _fly(job: dict[str, Any], method: str) -> Rows:
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
    # Of itself it takes the FMUs of a loop in the order of a set of names, which each process has anew.
    coordinator.master.sequence_order = [list(job["fmus"])]
    coordinator.run_simulation(step_size=job["step"], end_time=job["stop"])
    found = coordinator.get_results()
    columns = [found[tuple(signal.split(".", 1))] for signal in job["signals"]]
    # It puts the time at which a step began beside the values at its end.
    return [[time + job["step"], *values] for time, *values in zip(found["time"], *columns)]


def _end(component: str, variable: str) -> dict[str, str]:
    return {"type": "fmu", "id": component, "variable": variable, "unit": ""}


if __name__ == "__main__":
    function, given, rows = sys.argv[1:]
    np.save(rows, np.array(globals()[function](json.loads(Path(given).read_text(encoding="utf-8")))))
