"""What stands in the place of a component whose outputs somebody else says."""

from collections.abc import Callable, Sequence

import numpy as np

from orchestration.basics.simulator import Floats, Transfer
from orchestration.fmi.instance import Instance
from orchestration.fmi.values import Value


class Left(BaseException):
    """Whoever is asked for the outputs says no more."""


class InPlace(Instance):
    """An instance that takes part in initialisation, and is not called after: what it is told then, others answer."""

    def __init__(
        self, instance: Instance, measured: Sequence[str], commanded: Sequence[str], ask: Callable[[], None]
    ) -> None:
        """`ask` is called where it is to be stepped: `measurement` is then there, and `command` is there after it."""
        self._instance, self._ask = instance, ask
        self._measured, self._commanded = list(measured), list(commanded)
        self._has_begun = self._is_asked = False
        self.path, self.name, self.model = instance.path, instance.name, instance.model
        self.measurement: Floats = np.zeros(len(measured))
        self.command: Floats = np.zeros(len(commanded))
        self.failed = self.stopped = False

    @property
    def warnings(self) -> list[str]:  # type: ignore[override]
        """Those of the instance."""
        return self._instance.warnings

    def begin(self) -> None:
        """From here on its steps are asked for; before, it is stepped to its first sample without one."""
        self._has_begun = True

    def set(self, name: str, value: Value) -> None:
        """As any instance."""
        self._instance.set(name, value)

    def set_tolerance(self, tolerance: float) -> None:
        """As any instance."""
        self._instance.set_tolerance(tolerance)

    def get(self, name: str) -> Value:
        """As any instance; after initialisation what it was then."""
        return self._instance.get(name)

    def reset(self) -> None:
        """As any instance."""
        self._instance.reset()

    def close(self) -> None:
        """As any instance."""
        self._instance.close()

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As any instance; of what was said once it was."""
        read, places = self._instance.reader(names, into), [self._commanded.index(name) for name in names]

        def transfer() -> None:
            if self._is_asked:
                into[:] = self.command[places]
            else:
                read()

        return transfer

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As any instance."""
        write, places = self._instance.writer(names, source), [self._measured.index(name) for name in names]

        def transfer() -> None:
            self.measurement[places] = source
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
        """Ask for the outputs."""
        if not self._has_begun:
            self._instance.step(t, h)
            return
        self._is_asked = True
        self._ask()

    def save(self) -> bytes:
        """It has no state that is known."""
        raise NotImplementedError

    def restore(self, state: bytes) -> None:
        """It has no state that is known."""
        raise NotImplementedError
