"""An instance of an FMU in a separate process, for FMUs that a process cannot have twice.

A list of commands is sent, and a result comes back. Writes wait for the next step and are sent with it, and the values
of all readers come back with its result, so that a step of the master costs one round trip.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.instance import Instance, Value
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import SimulatorError, StoppedStepError
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.child import Child, Died

Command = tuple[Any, ...]
"""`("write", index, bytes)`, `("reader" or "writer", names)`, `("read",)` or the name of a method and its arguments"""

_Answer = tuple[Value | bytes | None, Exception | None, bool, list[str]]
"""Result and error of the last command, whether the instance has failed, and its warnings"""
_PATIENCE = 5.0
"""Time in which a process must end after its last command [s]"""


class IsolatedInstance(Instance):
    """An instance in a process that is started for it, and ends with it or with this process."""

    def __init__(self, path: Path, instance_name: str, access: Access = USUAL) -> None:
        self.path = path
        self.name = instance_name
        self.model = read_model(path, access)
        self.warnings: list[str] = []
        self.failed = self.stopped = False
        self._waiting: list[Command] = []  # writes that have not been sent
        self._values: list[Floats] = []  # of each reader
        self._fresh = False  # whether these values are current
        self._writers = 0
        self._child = Child(
            subprocesses.Module.of(
                "orchestration.components.fmi.isolated_process", path.absolute(), instance_name, str(access)
            )
        )
        try:
            self._request()
        except Exception:
            self.close()
            raise

    # -- a run ---------------------------------------------------------------------------------------------------

    def enter_initialization(self, start: float, stop: float) -> None:
        """As any instance."""
        self._request("enter_initialization", start, stop)

    def exit_initialization(self) -> None:
        """As any instance."""
        self._request("exit_initialization")

    def step(self, t: float, h: float) -> None:
        """As any instance; updates the values of all readers."""
        self._waiting.append(("step", t, h))
        self._refresh()

    def reset(self) -> None:
        """As any instance."""
        self._request("reset")

    def save(self) -> bytes:
        """As any instance."""
        return bytes(self._request("save"))

    def restore(self, state: bytes) -> None:
        """As any instance."""
        self._request("restore", state)

    def set(self, name: str, value: Value) -> None:
        """As any instance."""
        self._request("set", name, value)

    def set_tolerance(self, tolerance: float) -> None:
        """As any instance."""
        self._request("set_tolerance", tolerance)

    def get(self, name: str) -> Value:
        """As any instance."""
        value: Value = self._request("get", name)
        return value

    def set_clock(self, period: float, offset: float, *, late: bool) -> None:
        """As any instance."""
        self._request("set_clock", period, offset, late)

    def follow(self, inputs: Sequence[str], times: Floats, values: Floats) -> None:
        """As any instance."""
        self._request("follow", tuple(inputs), times.tobytes(), values.tobytes())

    def take_events(self) -> Floats:
        """As any instance; without asking one that has none."""
        if not self.has_events or self.failed:
            return super().take_events()
        return np.frombuffer(self._exchange([("take_events",)]))

    def slopes(self, outputs: Sequence[str], inputs: Sequence[str]) -> Floats | None:
        """As any instance."""
        content = self._request("slopes", tuple(outputs), tuple(inputs)) if self.model.has_slopes else None
        return None if content is None else np.frombuffer(content).reshape(len(outputs), len(inputs))

    def close(self) -> None:
        """End the process."""
        self.failed = True
        self._child.close(_PATIENCE)

    # -- values --------------------------------------------------------------------------------------------------

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As any instance."""
        self._request("reader", tuple(names))
        index = len(self._values)
        self._values.append(np.zeros(len(names)))

        def read() -> None:
            if not self._fresh:
                self._refresh()
            into[:] = self._values[index]

        return read

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As any instance, except that a failure is raised by the next step or read."""
        self._request("writer", tuple(names))
        index, self._writers = self._writers, self._writers + 1

        def write() -> None:
            self._fresh = False
            self._waiting.append(("write", index, source.tobytes()))

        return write

    def _refresh(self) -> None:
        content = self._exchange([("read",)])
        if not isinstance(content, bytes) or len(content) != 8 * sum(map(len, self._values)):
            self.failed = True
            raise SimulatorError(f"{self.name} ({self.model.name}): its process sends other values than were asked for")
        values = np.frombuffer(content)
        start = 0
        for each in self._values:
            each[:] = values[start : start + len(each)]
            start += len(each)
        self._fresh = True

    def _request(self, *command: Any) -> Any:
        """The result of a command, after all waiting writes."""
        self._fresh = False
        return self._exchange([command] if command else [])

    def _exchange(self, commands: list[Command]) -> Any:
        if self.failed:
            raise SimulatorError(f"{self.name}: the FMU has failed and is not called again")
        commands, self._waiting = [*self._waiting, *commands], []
        try:
            self._child.send(commands)
            result, error, self.failed, self.warnings = self._child.receive(_Answer)
        except Died as death:
            self.failed = True
            raise SimulatorError(f"{self.name} ({self.model.name}): its process {death}") from None
        except BaseException:  # the next result would be that of these commands
            self.failed = True
            raise
        if error is not None:
            self.stopped |= isinstance(error, StoppedStepError)
            raise error
        return result
