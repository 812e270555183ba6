"""A worker process: simulates the runs that it receives, one by one or in chunks."""

import shutil
import signal
import sys
import tempfile
from pathlib import Path

from fmu_kit import scratch
from orchestration.components.fmi import trust
from orchestration.foundation.processes.channel import Parent
from orchestration.foundation.processes.resource_limits import own_limits
from orchestration.simulation.workers import task as tasks
from orchestration.simulation.workers.provenance import Sources, machine, software


def main(own_folder: str) -> None:
    """Answer tasks until the coordinator closes the channel."""
    tempfile.tempdir = own_folder  # no fallback to other folders if it is full

    def orphaned() -> None:
        for folder in scratch.abandoned(iter([Path(own_folder).parent])):
            shutil.rmtree(folder, ignore_errors=True)

    # An FMU must not be blamed for an interrupt.
    parent = Parent(interrupt=signal.SIG_DFL, on_orphaned=orphaned)
    coordinator_sources: Sources
    coordinator_sources, own_fmus = parent.receive()
    trust.accept(own_fmus)
    parent.send(tasks.Ready(versions=software(coordinator_sources.current()), machine=machine()))
    runner = tasks.Runner(machine())
    limits = own_limits()
    for task in parent:
        answer = _run(runner, task)
        try:
            parent.send(answer)
        except MemoryError:  # an FMU has left none; this takes less
            parent.send(tasks.EnvironmentFailure(message="MemoryError"))
        if own_limits() != limits:  # an FMU has lowered them for good; the next run gets another process
            return
    parent.leave()


def _run(runner: tasks.Runner, task: tasks.RunTask | tasks.TaskBatch | tasks.LoadTask) -> object:
    try:
        return runner.run(task)
    except tasks.WorkerEnvironmentError as error:
        return tasks.EnvironmentFailure(message=str(error))


if __name__ == "__main__":
    main(*sys.argv[1:])
