"""Run FMUs under a realistic digital clock, a quadrotor's controller or any system, and find which clock it tolerates.

One run, here the paper's flight, sampled every 20 ms::

    import quadcosim
    from quadcosim import Scenario, Timing

    result = quadcosim.run(Scenario(timing=Timing(period=0.02)))
    result.metrics["ultimate_bound"]    # [m]; result.units has the units
    result.signals["plant.position.x"]  # an array; result.to_pandas() a table
    result.plot("errors")               # figures of matplotlib, which a notebook shows
    quadcosim.save_run(result, "results/20ms")

Where to begin:

- `run` takes a `Scenario` of the quadrotor, with its `Timing`, or a `System` of any FMUs, and returns a `Result`;
- `load_scenario` and `load_system` read them from files; constructors reject invalid values as files do, in one line;
- `fly` takes arrays of initial conditions, or of any other value, and returns arrays: many runs at once, not stored;
- `limit` finds the largest period, delay, loss or other value that is still good;
- `expect` computes expectations of mean squares exactly, of the loop about its operating point, without a run;
- `margin` certifies how far a delay, a jitter or a run of losses may vary without making the linear loop unstable;
- `schedule` computes which task or message has each computer and network when, and bounds on response times;
- `linearise` opens a loop about its operating point, sampled, held and delayed as it is: two state-space systems;
- `sweep` runs a `Study` over axes, `compare` compares controllers, `tune` searches for gains: stored runs are not
  repeated, and results become a table with `to_pandas`;
- `Simulation` stops a run at each sample, where your code takes the place of a controller or any other component;
- `report` writes one HTML file of runs, with a replay;
- `read_model` reads the variables and properties of an FMU.

All times are in seconds, all values in the units that the FMUs declare. All errors are `QuadcosimError`s; a
`UsageError` is an invalid request. Studies and tables need `pip install 'quadcosim[studies]'`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from orchestration.basics.errors import in_python, set_wording

set_wording(in_python)

if TYPE_CHECKING:
    from orchestration.basics.errors import QuadcosimError, SimulatorError, UsageError
    from orchestration.certificates.basin import Basin, basin
    from orchestration.certificates.check import Checked
    from orchestration.certificates.check import check as check_certificate
    from orchestration.certificates.margin import Certified, margin
    from orchestration.certificates.region import Region
    from orchestration.certificates.region import region as margin_region
    from orchestration.comparison.design import Comparison
    from orchestration.comparison.file import load_comparison
    from orchestration.comparison.run import Compared, compare
    from orchestration.exact.expect import Expected, expect
    from orchestration.fmi.model import Model, read_model
    from orchestration.limits.limit import Limit
    from orchestration.limits.limit import find as limit
    from orchestration.quadrotor.fmu_choice import FmuChoice, Record
    from orchestration.quadrotor.scenario import Scenario
    from orchestration.quadrotor.scenario_file import load_scenario
    from orchestration.quadrotor.signals import DisturbanceChoice, ReferenceChoice
    from orchestration.quadrotor.timing import Timing
    from orchestration.quadrotor.vehicle import Vehicle, load_vehicle
    from orchestration.report.writing import report
    from orchestration.runs.many_runs import Flights
    from orchestration.runs.many_runs import run_many as fly
    from orchestration.runs.outcome import RunInterrupted, RunLost
    from orchestration.runs.pause import resume
    from orchestration.runs.pause import run_until as fly_until
    from orchestration.runs.result import Result
    from orchestration.runs.run_directory import load_run, save_run
    from orchestration.runs.scheduling import Scheduled, schedule
    from orchestration.runs.simulation import run
    from orchestration.runs.stepping import Simulation
    from orchestration.stability.linearise import Linearised, linearise
    from orchestration.stability.state_space import StateSpace
    from orchestration.studies.axes import Axis
    from orchestration.studies.study import Study
    from orchestration.studies.study_file import load_study
    from orchestration.studies.sweep import sweep
    from orchestration.studies.swept import Swept
    from orchestration.system.component import Component
    from orchestration.system.computers import Arrivals, Computer, Message, Network, Task
    from orchestration.system.connection import Connection
    from orchestration.system.criterion import Criterion
    from orchestration.system.distribution import Distribution
    from orchestration.system.model import System
    from orchestration.system.paths import changed
    from orchestration.system.sampling import Sampling, SamplingOnArrival
    from orchestration.system.source import Source
    from orchestration.system.system_file import load_system
    from orchestration.tuning.exact import ExactTuning
    from orchestration.tuning.tune import Tuned, tune
    from orchestration.tuning.tuning import Tuning
    from orchestration.tuning.tuning_file import load_tuning

_HOMES = {
    # run
    "run": "orchestration.runs.simulation",
    "Result": "orchestration.runs.result",
    "save_run": "orchestration.runs.run_directory",
    "load_run": "orchestration.runs.run_directory",
    "Simulation": "orchestration.runs.stepping",
    "fly_until": "orchestration.runs.pause",
    "resume": "orchestration.runs.pause",
    "report": "orchestration.report.writing",
    # a flight of the quadrotor
    "Scenario": "orchestration.quadrotor.scenario",
    "Timing": "orchestration.quadrotor.timing",
    "FmuChoice": "orchestration.quadrotor.fmu_choice",
    "ReferenceChoice": "orchestration.quadrotor.signals",
    "DisturbanceChoice": "orchestration.quadrotor.signals",
    "Record": "orchestration.quadrotor.fmu_choice",
    "Vehicle": "orchestration.quadrotor.vehicle",
    "load_vehicle": "orchestration.quadrotor.vehicle",
    "load_scenario": "orchestration.quadrotor.scenario_file",
    # any system
    "System": "orchestration.system.model",
    "Component": "orchestration.system.component",
    "Sampling": "orchestration.system.sampling",
    "SamplingOnArrival": "orchestration.system.sampling",
    "Connection": "orchestration.system.connection",
    "Source": "orchestration.system.source",
    "Distribution": "orchestration.system.distribution",
    "Criterion": "orchestration.system.criterion",
    "Computer": "orchestration.system.computers",
    "Task": "orchestration.system.computers",
    "Network": "orchestration.system.computers",
    "Message": "orchestration.system.computers",
    "Arrivals": "orchestration.system.computers",
    "load_system": "orchestration.system.system_file",
    "changed": "orchestration.system.paths",
    "schedule": "orchestration.runs.scheduling",
    "Scheduled": "orchestration.runs.scheduling",
    "read_model": "orchestration.fmi.model",
    "Model": "orchestration.fmi.model",
    # many runs
    "fly": "orchestration.runs.many_runs",
    "Flights": "orchestration.runs.many_runs",
    "limit": "orchestration.limits.limit",
    "Limit": "orchestration.limits.limit",
    "expect": "orchestration.exact.expect",
    "Expected": "orchestration.exact.expect",
    "linearise": "orchestration.stability.linearise",
    "Linearised": "orchestration.stability.linearise",
    "StateSpace": "orchestration.stability.state_space",
    "basin": "orchestration.certificates.basin",
    "Basin": "orchestration.certificates.basin",
    "margin": "orchestration.certificates.margin",
    "Certified": "orchestration.certificates.margin",
    "margin_region": "orchestration.certificates.region",
    "Region": "orchestration.certificates.region",
    "check_certificate": "orchestration.certificates.check",
    "Checked": "orchestration.certificates.check",
    "sweep": "orchestration.studies.sweep",
    "Study": "orchestration.studies.study",
    "Axis": "orchestration.studies.axes",
    "Swept": "orchestration.studies.swept",
    "load_study": "orchestration.studies.study_file",
    "compare": "orchestration.comparison.run",
    "Comparison": "orchestration.comparison.design",
    "Compared": "orchestration.comparison.run",
    "load_comparison": "orchestration.comparison.file",
    "tune": "orchestration.tuning.tune",
    "Tuning": "orchestration.tuning.tuning",
    "ExactTuning": "orchestration.tuning.exact",
    "Tuned": "orchestration.tuning.tune",
    "load_tuning": "orchestration.tuning.tuning_file",
    # errors
    "QuadcosimError": "orchestration.basics.errors",
    "UsageError": "orchestration.basics.errors",
    "SimulatorError": "orchestration.basics.errors",
    "RunInterrupted": "orchestration.runs.outcome",
    "RunLost": "orchestration.runs.outcome",
}
_OTHERWISE = {
    "limit": "find",
    "check_certificate": "check",
    "margin_region": "region",
    "fly": "run_many",
    "fly_until": "run_until",
}
"""Names that differ in their modules"""

__all__ = [
    "Arrivals",
    "Axis",
    "Basin",
    "Certified",
    "Checked",
    "Compared",
    "Comparison",
    "Component",
    "Computer",
    "Connection",
    "Criterion",
    "Distribution",
    "DisturbanceChoice",
    "ExactTuning",
    "Expected",
    "Flights",
    "FmuChoice",
    "Limit",
    "Linearised",
    "Message",
    "Model",
    "Network",
    "QuadcosimError",
    "Record",
    "ReferenceChoice",
    "Region",
    "Result",
    "RunInterrupted",
    "RunLost",
    "Sampling",
    "SamplingOnArrival",
    "Scenario",
    "Scheduled",
    "Simulation",
    "SimulatorError",
    "Source",
    "StateSpace",
    "Study",
    "Swept",
    "System",
    "Task",
    "Timing",
    "Tuned",
    "Tuning",
    "UsageError",
    "Vehicle",
    "basin",
    "changed",
    "check_certificate",
    "compare",
    "expect",
    "fly",
    "fly_until",
    "limit",
    "linearise",
    "load_comparison",
    "load_run",
    "load_scenario",
    "load_study",
    "load_system",
    "load_tuning",
    "load_vehicle",
    "margin",
    "margin_region",
    "read_model",
    "report",
    "resume",
    "run",
    "save_run",
    "schedule",
    "sweep",
    "tune",
]

if not TYPE_CHECKING:  # else every name would seem to be there, of type Any

    def __getattr__(name):
        """Load only what is used: the command line answers `--help` without numpy."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__} has no attribute {name}")
        return getattr(import_module(_HOMES[name]), _OTHERWISE.get(name, name))


def __dir__() -> list[str]:
    return sorted(__all__)
