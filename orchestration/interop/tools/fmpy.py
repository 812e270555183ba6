"""fmpy: its SSP simulation, and `simulate_fmu` on each FMU alone, fed with what the other one sent."""

import math

import numpy as np
from fmpy import simulate_fmu
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv

from orchestration.interop.job import SIGNALS, Job, Rows
from orchestration.ssp.writing import SYSTEM_PARAMETERS


def fly_ssp(job: Job) -> Rows:
    """From the SSP, with the set in which parameters carry the name of their component."""
    table = simulate_ssp(
        str(job.ssp), stop_time=job.stop, step_size=job.step, parameter_set=read_ssv(str(job.ssp), SYSTEM_PARAMETERS)
    )
    # fmpy puts the time at which a step began beside the values at its end.
    return [[row["time"] + job.step, *(row[signal] for signal in SIGNALS)] for row in table]


def fly_plant(job: Job) -> Rows:
    """The plant alone, fed with recorded commands."""
    return _fly_alone(job, "plant", "controller")


def fly_controller(job: Job) -> Rows:
    """The controller alone, fed with recorded measurements."""
    return _fly_alone(job, "controller", "plant")


def _fly_alone(job: Job, component: str, other: str) -> Rows:
    recorded = np.load(job.recorded)
    inputs = {name: i for i, name in enumerate(SIGNALS, start=1) if name.startswith(f"{other}.")}
    signals = np.zeros(
        len(recorded), dtype=[("time", np.float64), *((name.partition(".")[2], np.float64) for name in inputs)]
    )
    # fmpy's own points: an input is interpolated where its rows lie a last bit beside them.
    signals["time"] = job.step * np.arange(len(recorded))
    for name, column in inputs.items():
        signals[name.partition(".")[2]] = recorded[:, column]
    outputs = [name.partition(".")[2] for name in SIGNALS if name not in inputs]
    table = simulate_fmu(
        str(job.fmus[component]),
        stop_time=job.stop,
        step_size=job.step,
        output_interval=job.step,
        start_values=job.parameters[component],
        input=signals,
        output=outputs,
    )
    names = ["time", *(None if name in inputs else name.partition(".")[2] for name in SIGNALS)]
    return [[math.nan if name is None else row[name] for name in names] for row in table[1:]]
