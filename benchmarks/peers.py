"""The cost of a step of the closed loop in third-party masters: `python -m benchmarks.peers`.

The same native FMUs of FMI 2.0, both stepped every 10 ms, in each installed tool and in this project's engines; each
records all connected signals. CPU time, from two flights of different length, so that the start of a tool does not
count. Interleaved, the smallest of several; only ratios within one run of this program can be compared.
"""

import os
import resource
import tempfile
from collections import defaultdict
from dataclasses import fields
from pathlib import Path

from benchmarks.mathematics import table
from orchestration.components.building.fmus import native_twins
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes.subprocesses import Module
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.interop.catalogue import TOOLS, Tool
from orchestration.simulation.interop.tool_runs import ToolRuns
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.model import System

STEP = 0.01
"""Step [s]"""
STOPS = (5.0, 25.0)
"""Stop times [s]"""
REPETITIONS = 3
LEFT_OUT = {
    "PyFMI, OMSimulator": "pip found neither where this was measured; OMSimulator reads the SSP",
    "FMPy's simulate_fmu": "runs one FMU, not two: in the table as plant or controller alone",
    "crazyflow, rotorpy": "simulate their own vehicle and controller, no FMUs",
}
"""Other simulators, and why they are not in the table"""
OWN = ("python", "compiled")


def scenario(stop: float) -> System:
    """The paper's flight with one step for all."""
    return native_twins(Scenario(timing=Timing(period=STEP, plant_interval=STEP), stop_time=stop).as_system())


class NewProcess(Tool):
    """A tool that starts a new Python: the time of a forked process would be that of the fork server."""

    def command(self, job: Path, rows: Path) -> list[str]:
        command = super().command(job, rows)
        return command.command if isinstance(command, Module) else command


def by_tool(tool: Tool, stop: float) -> float:
    """CPU time of a flight in a tool's process, including its start [s]."""
    with tempfile.TemporaryDirectory() as folder, ToolRuns(scenario(stop), Path(folder), None) as runs:
        before = _of_children()
        runs.run(NewProcess(**{each.name: getattr(tool, each.name) for each in fields(tool)}))
        return _of_children() - before


def by_engine(name: str, stop: float) -> float:
    """CPU time of a flight by an engine of this project, in this process [s]."""
    with prepared(scenario(stop), engine=name) as flight:  # type: ignore[arg-type]
        flight.master.initialise()
        before = _of_this_process()
        flight.master.run()
        return _of_this_process() - before


def main() -> None:
    """Print a row for each, the cheapest first."""
    installed = {}
    for name, tool in TOOLS.items():
        try:
            installed[name] = (tool, ", ".join(f"{k} {v}" for k, v in tool.versions().items()))
        except (ModuleNotFoundError, UsageError) as error:
            print(f"left out {name}: {error}")
    found: dict[tuple[str, float], list[float]] = defaultdict(list)
    for _ in range(REPETITIONS):
        for stop in STOPS:
            for engine in OWN:
                found[engine, stop].append(by_engine(engine, stop))
            for name, (tool, _version) in installed.items():
                found[name, stop].append(by_tool(tool, stop))
    short, long = STOPS
    steps = (long - short) / STEP
    cost = {name: (min(found[name, long]) - min(found[name, short])) / steps * 1e6 for name in (*OWN, *installed)}
    rows = [
        [
            f"this project, {name}" if name in OWN else name,
            "" if name in OWN else installed[name][1],
            f"{cost[name]:.2f}",
            f"{cost[name] / cost['compiled']:.1f}",
        ]
        for name in sorted(cost, key=lambda one: cost[one])
    ]
    print(f"load {os.getloadavg()[0]:.1f}; the smallest of {REPETITIONS}, in turns")
    print(table(["master", "version", "us a step", "times the compiled loop"], rows))
    for name, why in LEFT_OUT.items():
        print(f"not run: {name}: {why}")


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _of_this_process() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
