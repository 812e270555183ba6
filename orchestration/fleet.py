"""FMUs loaded once in a process and reset between runs."""

import weakref
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol

from orchestration.errors import SimulatorError
from orchestration.fmpy_adapter import FmuSimulator


class Loader(Protocol):
    """Gives an instance of an FMU for one run."""

    def __call__(self, path: Path, instance_name: str) -> AbstractContextManager[FmuSimulator]:
        """An instance with all parameters at their defaults."""


class Fleet:
    """Keeps one instance of each FMU and name; an instance that has failed is left and made anew."""

    def __init__(self) -> None:
        self._instances: dict[tuple[Path, str], FmuSimulator] = {}
        self.close = weakref.finalize(self, _free, self._instances)
        """Free all instances; done in any case when the fleet is no longer used or the process ends."""

    @contextmanager
    def load(self, path: Path, instance_name: str) -> Iterator[FmuSimulator]:
        """The instance of the FMU at `path`, fresh or reset."""
        key = (path, instance_name)
        fmu = self._instances.pop(key, None)
        if fmu is None or not _is_reset(fmu):
            fmu = FmuSimulator(path, instance_name)
        try:
            yield fmu
        finally:
            if fmu.failed:
                fmu.close()
            else:
                self._instances[key] = fmu


def _is_reset(fmu: FmuSimulator) -> bool:
    """Whether the instance could be reset; one that could not is given up, which is not the next run's failure."""
    try:
        fmu.reset()
    except SimulatorError:
        fmu.close()
        return False
    return True


def _free(instances: dict[tuple[Path, str], FmuSimulator]) -> None:
    while instances:
        instances.popitem()[1].close()
