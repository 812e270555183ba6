"""quadcosim: fly a quadrotor controller FMU and a plant FMU under a realistic digital clock.

import quadcosim

result = quadcosim.run(quadcosim.Scenario(timing=quadcosim.Timing(period=0.02)))
print(result.metrics["ultimate_bound"])
quadcosim.save_run(result, "results/20ms")

Any FMUs are a `System`: of `load_system`, or made of `Component`, `Connection` and so on; `run` takes it too.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orchestration.errors import QuadcosimError, SimulatorError, UsageError
    from orchestration.quadrotor.scenario import FmuChoice, Record, Scenario
    from orchestration.quadrotor.scenario_file import load_scenario
    from orchestration.quadrotor.signals import DisturbanceChoice, ReferenceChoice
    from orchestration.quadrotor.timing import Timing
    from orchestration.report.writing import report
    from orchestration.results.pause import fly_until, resume
    from orchestration.results.result import Result
    from orchestration.results.run_directory import load_run, save_run
    from orchestration.simulation import RunInterrupted, run
    from orchestration.system.model import Component, Connection, Criterion, Sampling, Source, System
    from orchestration.system.paths import changed
    from orchestration.system.system_file import load_system

_HOMES = {
    "QuadcosimError": "orchestration.errors",
    "SimulatorError": "orchestration.errors",
    "UsageError": "orchestration.errors",
    "RunInterrupted": "orchestration.simulation",
    "run": "orchestration.simulation",
    "Result": "orchestration.results.result",
    "load_run": "orchestration.results.run_directory",
    "save_run": "orchestration.results.run_directory",
    "fly_until": "orchestration.results.pause",
    "resume": "orchestration.results.pause",
    "FmuChoice": "orchestration.quadrotor.scenario",
    "Record": "orchestration.quadrotor.scenario",
    "DisturbanceChoice": "orchestration.quadrotor.signals",
    "ReferenceChoice": "orchestration.quadrotor.signals",
    "Scenario": "orchestration.quadrotor.scenario",
    "load_scenario": "orchestration.quadrotor.scenario_file",
    "Timing": "orchestration.quadrotor.timing",
    "Component": "orchestration.system.model",
    "Connection": "orchestration.system.model",
    "Criterion": "orchestration.system.model",
    "Sampling": "orchestration.system.model",
    "Source": "orchestration.system.model",
    "System": "orchestration.system.model",
    "changed": "orchestration.system.paths",
    "load_system": "orchestration.system.system_file",
    "report": "orchestration.report.writing",
}

__all__ = [
    "Component",
    "Connection",
    "Criterion",
    "DisturbanceChoice",
    "FmuChoice",
    "QuadcosimError",
    "Record",
    "ReferenceChoice",
    "Result",
    "RunInterrupted",
    "Sampling",
    "Scenario",
    "SimulatorError",
    "Source",
    "System",
    "Timing",
    "UsageError",
    "changed",
    "fly_until",
    "load_run",
    "load_scenario",
    "load_system",
    "report",
    "resume",
    "run",
    "save_run",
]


def __getattr__(name: str) -> Any:
    """Load what is asked for and no more: the command line answers `--help` without numpy."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
