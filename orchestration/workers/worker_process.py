"""A worker process: flies the runs that it is asked for, one by one or in chunks."""

import shutil
import signal
import sys
import tempfile
from pathlib import Path

from orchestration.basics import scratch
from orchestration.processes.channel import Parent
from orchestration.workers.provenance import Sources, machine, software
from orchestration.workers.task import (
    Chunk,
    EnvironmentFailure,
    Outcome,
    Ready,
    Runner,
    RunTask,
    WorkerEnvironmentError,
)


def main(own_folder: Path) -> None:
    """Serve as long as somebody asks."""
    tempfile.tempdir = str(own_folder)  # and no other if it is full

    def orphaned() -> None:
        for folder in scratch.abandoned(iter([own_folder.parent])):
            shutil.rmtree(folder, ignore_errors=True)

    # An FMU must not be blamed for an interrupt.
    parent = Parent(interrupt=signal.SIG_DFL, on_orphaned=orphaned)
    told: Sources = parent.receive()
    parent.send(Ready(versions=software(told.now()), machine=machine()))
    runner = Runner(machine())
    for task in parent:
        parent.send(_fly(runner, task))
    parent.leave()  # the coordinator ends a process otherwise


def _fly(runner: Runner, task: RunTask | Chunk) -> Outcome | list[Outcome] | EnvironmentFailure:
    try:
        return runner.fly_chunk(task) if isinstance(task, Chunk) else runner.fly(task)
    except WorkerEnvironmentError as error:
        return EnvironmentFailure(message=str(error))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
