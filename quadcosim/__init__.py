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
from importlib import import_module
from pathlib import Path

from orchestration.foundation.basics.errors import in_python, set_wording
from orchestration.foundation.basics.extras import explains_missing

set_wording(in_python)

_IMPORTS = [
    node
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
]
"""Those of the stub, which type checkers read: it has every public name once"""
_HOMES = {alias.asname: (node.module, alias.name) for node in _IMPORTS for alias in node.names}
"""The module of each public name, and its name there"""
__all__ = sorted(_HOMES)


@explains_missing
def __getattr__(name):
    """Load only what is used: the command line answers `--help` without numpy."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    module, its_name = _HOMES[name]
    return getattr(import_module(module), its_name)


if "gymnasium" in sys.modules:  # from 1.0 on it looks for no plugins: who has imported it finds the environment
    import_module("quadcosim.gym")


def __dir__():
    return __all__
