"""The process of an isolated instance.

`python -m orchestration.components.fmi.isolated_process FMU NAME ACCESS` obeys.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.components.fmi.access import Access
from orchestration.components.fmi.isolated_instance import Command
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.opening import open_here
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.processes.channel import Parent


class _Server:
    """The instance and the arrays of its transfers."""

    def __init__(self, path: Path, name: str, access: Access) -> None:
        self.instance: NativeInstance | None = None
        self._how = path, name, access
        self._readers: list[tuple[Transfer, Floats]] = []
        self._writers: list[tuple[Transfer, Floats]] = []

    def execute(self, commands: list[Command]) -> Any:
        """The result of the last command."""
        if self.instance is None:
            self.instance = open_here(*self._how)
        result = None
        for name, *arguments in commands:
            local: Callable[..., Any] | None = getattr(self, f"_{name}", None)
            result = (local or getattr(self.instance, name))(*arguments)
        return result

    def _set_clock(self, period: float, offset: float, late: bool) -> None:
        assert self.instance is not None
        self.instance.set_clock(period, offset, late=late)

    def _follow(self, inputs: tuple[str, ...], times: bytes, values: bytes) -> None:
        assert self.instance is not None
        self.instance.follow(inputs, np.frombuffer(times), np.frombuffer(values).reshape(-1, len(inputs)))

    def _take_events(self) -> bytes:
        assert self.instance is not None
        return self.instance.take_events().tobytes()

    def _slopes(self, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> bytes | None:
        assert self.instance is not None
        found = self.instance.slopes(outputs, inputs)
        return None if found is None else found.tobytes()

    def _reader(self, names: tuple[str, ...]) -> None:
        assert self.instance is not None
        values: Floats = np.zeros(len(names))
        self._readers.append((self.instance.reader(names, values), values))

    def _writer(self, names: tuple[str, ...]) -> None:
        assert self.instance is not None
        values: Floats = np.zeros(len(names))
        self._writers.append((self.instance.writer(names, values), values))

    def _write(self, index: int, content: bytes) -> None:
        write, values = self._writers[index]
        values[:] = np.frombuffer(content)
        write()

    def _read(self) -> bytes:
        for read, _ in self._readers:
            read()
        return b"".join(values.tobytes() for _, values in self._readers)


def main(path: str, name: str, access: str) -> None:
    """Serve one instance."""
    parent, server = Parent(), _Server(Path(path), name, Access.of(access))
    for commands in parent:
        result = error = None
        try:
            result = server.execute(commands)
        except Exception as raised:
            error = raised
        instance = server.instance
        parent.send((result, error, instance is None or instance.failed, [] if instance is None else instance.warnings))
    if server.instance is not None:
        server.instance.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
