"""All FMUs in one: a container of fmu-manipulation-toolbox, simulated by fmpy."""

import json
import shutil

from fmpy import simulate_fmu
from fmu_manipulation_toolbox.assembly import Assembly

from orchestration.simulation.interop.job import Job, Rows


def run_jacobi(job: Job) -> Rows:
    """The container's own order: all FMUs step, then all values are exchanged."""
    return _run(job, sequential=False)


def run_sequential(job: Job) -> Rows:
    """One FMU after the other, in the order of the job."""
    return _run(job, sequential=True)


def _run(job: Job, *, sequential: bool) -> Rows:
    # New file names: it accepts no spaces, and names components after files.
    files = {name: f"{name}_fmu.fmu" for name in job.fmus}
    description = {
        "name": "loop.fmu",
        "fmu": list(files.values()),
        "sequential": sequential,
        "step_size": job.step,
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "link": [[files[start], output, files[end], target] for (start, output), (end, target) in job.connections],
        "output": [[files[signal.partition(".")[0]], signal.partition(".")[2], signal] for signal in job.signals],
        "start": [[files[name], key, value] for name, set in job.parameters.items() for key, value in set.items()],
    }
    folder = job.folder / "container"
    folder.mkdir()
    for name, path in job.fmus.items():
        shutil.copyfile(path, folder / files[name])
    (folder / "loop.json").write_text(json.dumps(description), encoding="utf-8")
    Assembly("loop.json", fmu_directory=folder).make_fmu()
    table = simulate_fmu(
        str(folder / "loop.fmu"), stop_time=job.stop, step_size=job.step, output_interval=job.step, output=job.signals
    )
    return [[float(row[name]) for name in ("time", *job.signals)] for row in table[1:]]
