"""The instance that takes the place of a component whose outputs the caller computes."""

from collections.abc import Callable, Sequence

import numpy as np

from orchestration.components.fmi.instance import Instance, Value
from orchestration.foundation.basics.simulator import Floats, Transfer


class Abandoned(BaseException):
    """The caller computes no more outputs: the run is to be left where it is."""


class Substitute(Instance):
    """Initialises with the FMU of the component and does not call it after: the caller computes its outputs."""

    def __init__(
        self, instance: Instance, measured: Sequence[str], commanded: Sequence[str], await_command: Callable[[], None]
    ) -> None:
        """`await_command` is called at each step: `measurement` is up to date then, and it fills in `command`."""
        self._instance, self._await_command = instance, await_command
        self._measured, self._commanded = list(measured), list(commanded)
        self._has_begun = self._has_command = False
        self.path, self.name, self.model = instance.path, instance.name, instance.model
        self.measurement: Floats = np.zeros(len(measured))
        self.command: Floats = np.zeros(len(commanded))
        self.failed = self.stopped = False

    @property
    def warnings(self) -> list[str]:  # type: ignore[override]
        """Those of the instance."""
        return self._instance.warnings

    def begin(self) -> None:
        """From here on the caller computes each step; before, the FMU is stepped to its first sample."""
        self._has_begun = True

    def set(self, name: str, value: Value) -> None:
        """As any instance."""
        self._instance.set(name, value)

    def set_tolerance(self, tolerance: float) -> None:
        """As any instance."""
        self._instance.set_tolerance(tolerance)

    def get(self, name: str) -> Value:
        """As any instance; after initialisation the value of then."""
        return self._instance.get(name)

    def reset(self) -> None:
        """As any instance."""
        self._instance.reset()

    def close(self) -> None:
        """As any instance."""
        self._instance.close()

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As any instance; once there is a command, of the command."""
        read, places = self._instance.reader(names, into), [self._commanded.index(name) for name in names]

        def transfer() -> None:
            if self._has_command:
                into[:] = self.command[places]
            else:
                read()

        return transfer

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As any instance; a reference that the FMU follows is no measurement."""
        write, kept = (
            self._instance.writer(names, source),
            [i for i, name in enumerate(names) if name in self._measured],
        )
        places = [self._measured.index(names[i]) for i in kept]

        def transfer() -> None:
            self.measurement[places] = source[kept]
            if not self._has_begun:
                write()

        return transfer

    def enter_initialization(self, start: float, stop: float) -> None:
        """As any instance."""
        self._instance.enter_initialization(start, stop)

    def exit_initialization(self) -> None:
        """As any instance."""
        self._instance.exit_initialization()

    def step(self, t: float, h: float) -> None:
        """Wait for the outputs of the caller."""
        if not self._has_begun:
            self._instance.step(t, h)
            return
        self._has_command = True
        self._await_command()

    def save(self) -> bytes:
        """Not supported: the state of the caller's code is unknown."""
        raise NotImplementedError

    def restore(self, state: bytes) -> None:
        """Not supported: the state of the caller's code is unknown."""
        raise NotImplementedError
