"""A worker process: flies the runs that come through its pipe, one by one or in chunks, and ends when the pipe does."""

import os
import pickle
import queue
import shutil
import signal
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any, BinaryIO

from orchestration.basics import scratch
from orchestration.processes.subprocesses import private_pipes
from orchestration.workers.provenance import machine, versions
from orchestration.workers.task import Broken, BrokenPlaceError, Chunk, Hangar, Outcome, Ready, Task


def main() -> None:
    """Serve until the other end of the pipe is closed, or its process has died."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an FMU must not be blamed for an interrupt
    own_folder = Path(sys.argv[1])
    tempfile.tempdir = str(own_folder)  # and no other if it is full
    tasks, answers = private_pipes()
    waiting: queue.SimpleQueue[Task | Chunk] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(tasks, waiting, own_folder), daemon=True).start()
    _send(answers, Ready(versions=versions(), machine=machine()))
    hangar = Hangar(machine())
    while True:
        _send(answers, _fly(hangar, waiting.get()))


def _fly(hangar: Hangar, task: Task | Chunk) -> Outcome | list[Outcome] | Broken:
    try:
        return hangar.fly_chunk(task) if isinstance(task, Chunk) else hangar.fly(task)
    except BrokenPlaceError as error:
        return Broken(message=str(error))


def _listen(tasks: BinaryIO, waiting: "queue.SimpleQueue[Task | Chunk]", own_folder: Path) -> None:
    """Hand on what comes; the end of the pipe is the end of the process, also in the middle of a flight."""
    try:
        while True:
            waiting.put(pickle.load(tasks))
    except (EOFError, OSError, pickle.UnpicklingError):
        for folder in scratch.dead(iter([own_folder.parent])):  # the coordinator has been killed
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        os._exit(0)


def _send(answers: BinaryIO, answer: Any) -> None:
    try:
        pickle.dump(answer, answers)
        answers.flush()
    except OSError:  # nobody listens
        sys.exit(1)


if __name__ == "__main__":
    main()
