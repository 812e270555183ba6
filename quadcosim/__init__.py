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
- `bode` computes gain, phase and delay margins of a sampled loop with its delays, `step` how it takes back a step,
  `locus` its poles over a quantity; `plant_at_start` has the matrices of one FMU;
- `sweep` runs a `Study` over axes, `compare` compares controllers, `tune` searches for gains: stored runs are not
  repeated, and results become a table with `to_pandas`;
- `Simulation` stops a run at each sample, where your code takes the place of a controller or any other component;
- `live` makes one HTML file in which a system runs while its numbers are changed;
- `report` writes one HTML file of runs, with a replay;
- `read_model` reads the variables and properties of an FMU, which is built first if need be.

All times are in seconds, all values in the units that the FMUs declare. All errors are `QuadcosimError`s; a
`UsageError` is an invalid request. Studies and tables need `pip install 'quadcosim[studies]'`.
"""

import ast
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.foundation.basics.errors import in_python, set_wording

set_wording(in_python)

if TYPE_CHECKING:  # also what `__getattr__` finds public names by
    from orchestration.components.building.fmus import model_of as read_model
    from orchestration.components.fmi.read_description import Model
    from orchestration.experiments.comparison.design import Comparison
    from orchestration.experiments.comparison.file import load_comparison
    from orchestration.experiments.comparison.run import Compared, compare
    from orchestration.experiments.limits.limit import find as limit
    from orchestration.experiments.limits.limit_result import Limit
    from orchestration.experiments.live.live import Live, live
    from orchestration.experiments.report.writing import report
    from orchestration.experiments.studies.axes import Axis
    from orchestration.experiments.studies.study import Study
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.studies.sweep import sweep
    from orchestration.experiments.studies.swept import Swept
    from orchestration.experiments.tuning.exact import ExactTuning
    from orchestration.experiments.tuning.tune import Tuned, tune
    from orchestration.experiments.tuning.tuning import Tuning
    from orchestration.experiments.tuning.tuning_file import load_tuning
    from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
    from orchestration.quadrotor.scenarios.file import load_scenario
    from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice, Record
    from orchestration.quadrotor.scenarios.scenario import Scenario
    from orchestration.quadrotor.scenarios.timing import Timing
    from orchestration.quadrotor.scenarios.translation import DisturbanceChoice, ReferenceChoice
    from orchestration.quadrotor.scenarios.vehicle import load_vehicle
    from orchestration.simulation.runs.flights import Flights
    from orchestration.simulation.runs.outcome import RunInterrupted, RunLost
    from orchestration.simulation.runs.pause import resume
    from orchestration.simulation.runs.pause import run_until as fly_until
    from orchestration.simulation.runs.result import Result
    from orchestration.simulation.runs.run_directory import load_run, save_run
    from orchestration.simulation.runs.scheduling import Scheduled, schedule
    from orchestration.simulation.runs.simulation import run
    from orchestration.simulation.runs.stepping import Simulation
    from orchestration.simulation.workers.many_runs import fly
    from orchestration.systems.system.component import Component, Sampling, SamplingOnArrival
    from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
    from orchestration.systems.system.connection import Connection, Source
    from orchestration.systems.system.distribution import Distribution
    from orchestration.systems.system.file import load_system
    from orchestration.systems.system.model import Criterion, System
    from orchestration.systems.system.paths import changed
    from orchestration.systems.system.vehicle import Vehicle
    from orchestration.theory.certificates.basin import Basin, basin
    from orchestration.theory.certificates.certificate import Checked
    from orchestration.theory.certificates.check_file import check as check_certificate
    from orchestration.theory.certificates.margin import Certified, margin
    from orchestration.theory.certificates.region import Region
    from orchestration.theory.certificates.region import region as margin_region
    from orchestration.theory.exact.expect import Expected, expect
    from orchestration.theory.stability.frequency import Bode, bode
    from orchestration.theory.stability.linearise import Linearised, linearise
    from orchestration.theory.stability.plant_at_start import PlantAtStart, plant_at_start
    from orchestration.theory.stability.root_locus import RootLocus, locus
    from orchestration.theory.stability.state_space import StateSpace
    from orchestration.theory.stability.step_response import Step, step

__all__ = [
    "Arrivals",
    "Axis",
    "Basin",
    "Bode",
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
    "Live",
    "Message",
    "Model",
    "Network",
    "PlantAtStart",
    "QuadcosimError",
    "Record",
    "ReferenceChoice",
    "Region",
    "Result",
    "RootLocus",
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
    "Step",
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
    "bode",
    "changed",
    "check_certificate",
    "compare",
    "expect",
    "fly",
    "fly_until",
    "limit",
    "linearise",
    "live",
    "load_comparison",
    "load_run",
    "load_scenario",
    "load_study",
    "load_system",
    "load_tuning",
    "load_vehicle",
    "locus",
    "margin",
    "margin_region",
    "plant_at_start",
    "read_model",
    "report",
    "resume",
    "run",
    "save_run",
    "schedule",
    "step",
    "sweep",
    "tune",
]

if not TYPE_CHECKING:  # else every name would seem to be there, of type Any

    def __getattr__(name):
        """Load only what is used: the command line answers `--help` without numpy."""
        if name not in __all__:
            raise AttributeError(f"module {__name__} has no attribute {name}")
        module, its_name = _homes()[name]
        return getattr(import_module(module), its_name)


@cache
def _homes() -> dict[str, tuple[str, str]]:
    """The module of each public name, and its name there, by the imports above, which are not executed."""
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name: (node.module or "", alias.name) for node in imports for alias in node.names}


if "gymnasium" in sys.modules:  # from 1.0 on it looks for no plugins: who has imported it finds the environment
    import_module("quadcosim.gym")


def __dir__() -> list[str]:
    return sorted(__all__)
