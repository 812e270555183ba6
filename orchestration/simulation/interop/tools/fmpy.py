"""fmpy: its SSP simulation, and `simulate_fmu` on each FMU alone, with recorded outputs of the others as inputs."""

import math

import numpy as np
from fmpy import simulate_fmu
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv

from orchestration.simulation.interop.job import Job, Rows
from orchestration.simulation.requests.ssp.names import SYSTEM_PARAMETERS


def run_ssp(job: Job) -> Rows:
    """From the SSP, with the set in which parameters have the names of their components."""
    table = simulate_ssp(
        str(job.ssp), stop_time=job.stop, step_size=job.step, parameter_set=read_ssv(str(job.ssp), SYSTEM_PARAMETERS)
    )
    # fmpy records the time at which a step began with the values at its end.
    return [[row["time"] + job.step, *(row[signal] for signal in job.signals)] for row in table]


def run_plant(job: Job) -> Rows:
    """The plant alone, with recorded commands."""
    return _run_alone(job, "plant")


def run_controller(job: Job) -> Rows:
    """The controller alone, with recorded measurements."""
    return _run_alone(job, "controller")


def _run_alone(job: Job, component: str) -> Rows:
    recorded = np.load(job.recorded)[[0, *range(job.steps + 1)]]
    places = {signal: i for i, signal in enumerate(job.signals, start=1)}
    inputs = {name: places[".".join(start)] for start, (owner, name) in job.connections if owner == component}
    signals = np.zeros(len(recorded), dtype=[("time", np.float64), *((name, np.float64) for name in inputs)])
    # fmpy's own points: an input is interpolated where its rows differ from them in the last bit. Two rows at 0 are a
    # jump there, which it makes after initialisation if there is a row before.
    signals["time"] = [-job.step, 0.0, *(job.step * np.arange(len(recorded) - 2))]
    for name, column in inputs.items():
        signals[name] = recorded[:, column]
    own = [signal.partition(".")[2] if signal.partition(".")[0] == component else None for signal in job.signals]
    table = simulate_fmu(
        str(job.fmus[component]),
        stop_time=job.stop,
        step_size=job.step,
        output_interval=job.step,
        start_values=job.parameters[component],
        input=signals,
        output=[name for name in own if name is not None],
    )
    return [[math.nan if name is None else row[name] for name in ("time", *own)] for row in table[1:]]
