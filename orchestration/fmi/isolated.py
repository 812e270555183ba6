"""An instance of an FMU in a process of its own, for what cannot be in one process twice.

Both sides exchange frames over the child's standard streams: a list of commands there, what came of them back.
What is written waits for the next step and goes with it, and the values of all readers come back with its answer,
so that a step of the master costs one round trip.
"""

import contextlib
import pickle
import struct
import subprocess
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from orchestration.basics.errors import SimulatorError, StoppedStepError
from orchestration.basics.simulator import Floats, Transfer
from orchestration.fmi.instance import Instance
from orchestration.fmi.model import read_model
from orchestration.fmi.values import Value
from orchestration.processes import subprocesses
from orchestration.processes.confined import ended

Command = tuple[Any, ...]
"""`("write", index, bytes)`, `("reader" or "writer", names)`, `("read",)` or the name of a method and its arguments"""

_HEADER = struct.Struct("<Q")
_PATIENCE = 5.0
"""[s] in which a process that was told to end must have ended"""
_ENDING = 60.0
"""[s] for one that says no more, and so is about to end: why it did is asked for"""


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
        self._process = subprocess.Popen(
            subprocesses.command("orchestration.fmi.isolated_process", path.absolute(), instance_name),
            env=subprocesses.environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the master, which ends the process when it is done
        )  # fmt: skip
        self._end = weakref.finalize(self, _ended, self._process)
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
        self._end()

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
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        try:
            send(requests, commands)
            result, error, self.failed, self.warnings = receive(answers)
        except (EOFError, OSError):
            self.failed = True
            raise SimulatorError(f"{self.name} ({self.model.name}): its process {self._ending()}") from None
        except BaseException:  # whose answer this would be is no longer known
            self.failed = True
            raise
        if error is not None:
            self.stopped |= isinstance(error, StoppedStepError)
            raise error
        return result

    def _ending(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            return ended(self._process.wait(_ENDING))
        return "does not answer"


def send(stream: IO[bytes], content: object) -> None:
    """A frame."""
    data = pickle.dumps(content, pickle.HIGHEST_PROTOCOL)
    stream.write(_HEADER.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """The next frame; raises `EOFError` if there is none."""
    header = stream.read(_HEADER.size)
    if len(header) < _HEADER.size:
        raise EOFError
    return pickle.loads(stream.read(*_HEADER.unpack(header)))


def _ended(process: subprocess.Popen[bytes]) -> None:
    """Let the process end as its requests do, or end it."""
    assert process.stdin is not None
    assert process.stdout is not None
    with contextlib.suppress(OSError):
        process.stdin.close()
    try:
        process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()
