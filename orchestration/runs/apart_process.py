"""The process of a run.

`python -m orchestration.runs.apart_process ROOM` takes one order, and says what comes of it.
"""

import logging
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestration.engines.room import Shared
from orchestration.fmi.instance import Instance
from orchestration.fmi.instances import open_instance
from orchestration.processes.channel import Parent, sayable
from orchestration.recording.recording import About, Chunk, InMemory, Recording
from orchestration.runs.apart import Order
from orchestration.runs.simulation import looked_after, prepared

_MESSAGES = logging.getLogger("quadcosim")


class _Said(logging.Handler):
    """Says what is said in this process, and takes what it records, where the run is waited for."""

    def __init__(self, parent: Parent) -> None:
        super().__init__()
        self._parent = parent
        self.is_over = False
        """whether it has been said what has come of the run"""

    def say(self, name: str, *content: Any) -> None:
        """One frame, by the name of what hears it."""
        self._parent.say((name, *content))

    def emit(self, record: logging.LogRecord) -> None:
        """As any handler."""
        self.say("message", record.levelno, record.getMessage())

    def describe(self, about: About) -> None:
        """As `Recorder`."""
        self.say("describe", {name: dict(known) for name, known in about.items()})

    def begin(self, columns: tuple[str, ...]) -> None:
        """As `Recorder`."""
        self.say("begin", columns)

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""
        self.say("take", chunk)

    def finish(self) -> Recording:
        """As `Recorder`; the rows are not here."""
        return InMemory()

    @contextmanager
    def load(self, path: Path, instance_name: str) -> Iterator[Instance]:
        """An instance, as any loader gives it."""
        self.say("stage", "loading", [instance_name])
        with open_instance(path, instance_name) as instance:
            yield instance


def main(room: Path) -> None:
    """Fly what is ordered."""
    parent = Parent(interrupt=signal.default_int_handler)
    order: Order = parent.hear()
    said = _Said(parent)
    _MESSAGES.handlers[:] = [said]
    _MESSAGES.setLevel(order.level)
    try:
        _fly(order, said, room)
    except BaseException as error:
        if not said.is_over:
            said.say("error", sayable(error))
    said.say("end")


def _fly(order: Order, said: _Said, room: Path) -> None:
    """What comes of the run is said before any instance is freed."""
    with prepared(
        order.asked, recorder=said, engine=order.engine, load=said.load, room=Shared(room)
    ) as simulation:  # fmt: skip
        said.say("stage", "initialising", list(simulation.instances))
        over = order.course(simulation, looked_after(simulation, lambda share: said.say("share", share)))
        said.say("come_to", over, simulation.flown())
        said.is_over = True


if __name__ == "__main__":
    main(Path(sys.argv[1]))
