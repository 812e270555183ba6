"""fmpy: its SSP simulation, and `simulate_fmu` on each FMU alone, fed with what the others sent."""

import math

import numpy as np
from fmpy import simulate_fmu
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv

from orchestration.interop.job import Job, Rows
from orchestration.requests.ssp.names import SYSTEM_PARAMETERS


def fly_ssp(job: Job) -> Rows:
    """From the SSP, with the set in which parameters carry the name of their component."""
    table = simulate_ssp(
        str(job.ssp), stop_time=job.stop, step_size=job.step, parameter_set=read_ssv(str(job.ssp), SYSTEM_PARAMETERS)
    )
    # fmpy puts the time at which a step began beside the values at its end.
    return [[row["time"] + job.step, *(row[signal] for signal in job.signals)] for row in table]


def fly_plant(job: Job) -> Rows:
    """The plant alone, fed with recorded commands."""
    return _fly_alone(job, "plant")


def fly_controller(job: Job) -> Rows:
    """The controller alone, fed with recorded measurements."""
    return _fly_alone(job, "controller")


def _fly_alone(job: Job, component: str) -> Rows:
    recorded = np.load(job.recorded)
    places = {signal: i for i, signal in enumerate(job.signals, start=1)}
    inputs = {name: places[".".join(start)] for start, (owner, name) in job.connections if owner == component}
    signals = np.zeros(len(recorded), dtype=[("time", np.float64), *((name, np.float64) for name in inputs)])
    # fmpy's own points: an input is interpolated where its rows lie a last bit beside them.
    signals["time"] = job.step * np.arange(len(recorded))
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
