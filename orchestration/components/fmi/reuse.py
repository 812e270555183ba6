"""Reuse of instances: an FMU is loaded once in a process and reset between runs, if that has been shown to be safe."""

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from orchestration.components.fmi import opening, trust
from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.opening import open_instance
from orchestration.foundation.basics.errors import SimulatorError


class Instances:
    """Provides an instance for each run: a kept one, reset, or else a fresh one.

    It keeps one instance of each FMU and name if a run after a reset equals that of a fresh instance to the bit;
    one that has failed, or ended its run, is replaced.
    """

    def __init__(self, *, foreign_apart: bool = False) -> None:
        """`foreign_apart`: an FMU that was not built here from this project's sources has a process of its own."""
        self._foreign_apart = foreign_apart
        self._kept: dict[tuple[Path, str, Access], Instance] = {}
        self.close = weakref.finalize(self, _free, self._kept)
        """Free all instances; called automatically when this object is garbage or the process ends."""

    @contextmanager
    def load(self, path: Path, instance_name: str, access: Access = USUAL) -> Iterator[Instance]:
        """An instance of the FMU at `path` for one run."""
        key = (path, instance_name, access)
        instance = self._kept.pop(key, None)
        if instance is None or not _is_reset(instance):
            instance = self._open(*key)
        try:
            yield instance
        finally:
            if instance.failed or instance.stopped or not opening.repeatability_of(path, access).reset:
                instance.close()
            else:
                self._kept[key] = instance

    def _open(self, path: Path, instance_name: str, access: Access) -> Instance:
        if self._foreign_apart and not trust.is_own(path):
            from orchestration.components.fmi.isolated_instance import IsolatedInstance  # loads what starts processes

            return IsolatedInstance(path, instance_name, access)
        return open_instance(path, instance_name, access)


def _is_reset(instance: Instance) -> bool:
    """Whether the instance could be reset; one that could not is closed, so that the next run does not fail."""
    try:
        instance.reset()
    except SimulatorError:
        instance.close()
        return False
    return True


def _free(instances: dict[tuple[Path, str, Access], Instance]) -> None:
    while instances:
        instances.popitem()[1].close()
