"""An instance of an FMU in a process of its own, for what cannot be in one process twice.

A list of commands goes there, what came of them comes back. What is written waits for the next step and goes with it,
and the values of all readers come back with its answer, so that a step of the master costs one round trip.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.basics.errors import SimulatorError, StoppedStepError
from orchestration.basics.simulator import Floats, Transfer
from orchestration.fmi.instance import Instance
from orchestration.fmi.model import read_model
from orchestration.fmi.values import Value
from orchestration.processes import subprocesses
from orchestration.processes.child import Child, Died

Command = tuple[Any, ...]
"""`("write", index, bytes)`, `("reader" or "writer", names)`, `("read",)` or the name of a method and its arguments"""

_PATIENCE = 5.0
"""[s] in which a process that is asked no more must have ended"""


class IsolatedInstance(Instance):
    """The instance of a process that was started for it, and ends with it or with this process."""

    def __init__(self, path: Path, instance_name: str) -> None:
        self.path = path
        self.name = instance_name
        self.model = read_model(path)
        self.warnings: list[str] = []
        self.failed = self.stopped = False
        self._waiting: list[Command] = []  # writes
        self._values: list[Floats] = []  # of each reader
        self._fresh = False  # whether these are the values of now
        self._writers = 0
        self._child = Child(subprocesses.command("orchestration.fmi.isolated_process", path.absolute(), instance_name))
        try:
            self._ask()
        except Exception:
            self.close()
            raise

    # -- a run ---------------------------------------------------------------------------------------------------

    def enter_initialization(self, start: float, stop: float) -> None:
        """As any instance."""
        self._ask("enter_initialization", start, stop)

    def exit_initialization(self) -> None:
        """As any instance."""
        self._ask("exit_initialization")

    def step(self, t: float, h: float) -> None:
        """As any instance; all readers have their values with it."""
        self._waiting.append(("step", t, h))
        self._refresh()

    def reset(self) -> None:
        """As any instance."""
        self._ask("reset")

    def save(self) -> bytes:
        """As any instance."""
        return bytes(self._ask("save"))

    def restore(self, state: bytes) -> None:
        """As any instance."""
        self._ask("restore", state)

    def set(self, name: str, value: Value) -> None:
        """As any instance."""
        self._ask("set", name, value)

    def set_tolerance(self, tolerance: float) -> None:
        """As any instance."""
        self._ask("set_tolerance", tolerance)

    def get(self, name: str) -> Value:
        """As any instance."""
        value: Value = self._ask("get", name)
        return value

    def close(self) -> None:
        """End the process."""
        self.failed = True
        self._child.close(_PATIENCE)

    # -- values --------------------------------------------------------------------------------------------------

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As any instance."""
        self._ask("reader", tuple(names))
        index = len(self._values)
        self._values.append(np.zeros(len(names)))

        def read() -> None:
            if not self._fresh:
                self._refresh()
            into[:] = self._values[index]

        return read

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As any instance, but that a failure shows in the next step or read."""
        self._ask("writer", tuple(names))
        index, self._writers = self._writers, self._writers + 1

        def write() -> None:
            self._fresh = False
            self._waiting.append(("write", index, source.tobytes()))

        return write

    def _refresh(self) -> None:
        values = np.frombuffer(self._exchange([("read",)]))
        start = 0
        for known in self._values:
            known[:] = values[start : start + len(known)]
            start += len(known)
        self._fresh = True

    def _ask(self, *command: Any) -> Any:
        """What a command gives, once all that waits is done."""
        self._fresh = False
        return self._exchange([command] if command else [])

    def _exchange(self, commands: list[Command]) -> Any:
        if self.failed:
            raise SimulatorError(f"{self.name}: the FMU has failed and is not called again")
        commands, self._waiting = [*self._waiting, *commands], []
        try:
            self._child.send(commands)
            result, error, self.failed, self.warnings = self._child.receive()
        except Died as death:
            self.failed = True
            raise SimulatorError(f"{self.name} ({self.model.name}): its process {death}") from None
        except BaseException:  # whose answer this would be is no longer known
            self.failed = True
            raise
        if error is not None:
            self.stopped |= isinstance(error, StoppedStepError)
            raise error
        return result
