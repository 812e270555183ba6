"""The process of a run: `python -m orchestration.simulation.runs.apart_process ROOM` has one order."""

import logging
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.crashes import report_crashes
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.opening import open_instance
from orchestration.foundation.processes.channel import Parent
from orchestration.foundation.recording.recording import About, Chunk, InMemory, Recording
from orchestration.simulation.engines.memory import FolderMemory
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.run_in_process import Order

_MESSAGES = logging.getLogger("quadcosim")


class _Reporter(logging.Handler):
    """Reports log messages and recorded chunks of this process to the process that waits for the run."""

    def __init__(self, parent: Parent) -> None:
        super().__init__()
        self._parent = parent
        self.is_over = False
        """whether the outcome of the run has been reported"""

    def report(self, name: str, *content: Any) -> None:
        """Send one message, by the name of the method that handles it."""
        self._parent.send((name, *content))

    def emit(self, record: logging.LogRecord) -> None:
        """As any handler."""
        self.report("message", record.levelno, record.getMessage())

    def describe(self, about: About) -> None:
        """As `Recorder`."""
        self.report("describe", {name: dict(known) for name, known in about.items()})

    def begin(self, columns: tuple[str, ...]) -> None:
        """As `Recorder`."""
        self.report("begin", columns)

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""
        self.report("take", chunk)

    def finish(self) -> Recording:
        """As `Recorder`; the rows are not kept here."""
        return InMemory()

    @contextmanager
    def load(self, path: Path, instance_name: str, access: Access = USUAL) -> Iterator[Instance]:
        """As `Loader`."""
        self.report("stage", "loading", [instance_name])
        with open_instance(path, instance_name, access) as instance:
            yield instance


def main(folder: str) -> None:
    """Run what is ordered."""
    tempfile.tempdir = folder  # what FMUs are unpacked in goes with it, however this process ends
    parent = Parent(interrupt=signal.default_int_handler)
    order: Order = parent.receive()
    reporter = _Reporter(parent)
    _MESSAGES.handlers[:] = [reporter]
    _MESSAGES.setLevel(order.level)
    report_crashes(lambda place: reporter.report("crash", place))
    try:
        _simulate(order, reporter, Path(folder))
    except BaseException as error:
        if not reporter.is_over:
            reporter.report("error", error)
    reporter.report("end")


def _simulate(order: Order, reporter: _Reporter, folder: Path) -> None:
    """Run, and report the outcome before any instance is freed."""
    with prepared(
        order.request, recorder=reporter, engine=order.engine, load=reporter.load, allocate=FolderMemory(folder)
    ) as simulation:  # fmt: skip
        reporter.report("stage", "initialising", list(simulation.instances))
        is_over = simulation.follow(order.course, lambda share: reporter.report("share", share))
        reporter.report("outcome", is_over, simulation.outcome())
        reporter.is_over = True


if __name__ == "__main__":
    main(*sys.argv[1:])
