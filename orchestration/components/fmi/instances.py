"""Opens instances of FMUs: in this process, or in a separate one if a process cannot have two of them."""

from pathlib import Path

from orchestration.components.fmi import repeatability
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.fmi3 import Fmi3Instance
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.isolated import IsolatedInstance
from orchestration.components.fmi.model import read_model
from orchestration.components.fmi.native import NativeInstance
from orchestration.components.fmi.repeatability import content_hash

_opened: set[str] = set()
"""Hashes of the FMUs that have had an instance in this process"""


def open_instance(path: Path, instance_name: str) -> Instance:
    """An instance of the FMU at `path`, of FMI 2.0 or 3.0, that behaves as the first one of a process.

    A second one has a separate process if the FMU declares that a process can have one only, or if it has not been
    shown to behave as the first.
    """
    content = content_hash(path)
    if content in _opened and not repeatability.of(path).second_instance:
        return IsolatedInstance(path, instance_name)
    _opened.add(content)
    return open_here(path, instance_name)


def open_here(path: Path, instance_name: str) -> NativeInstance:
    """An instance in this process in any case."""
    kind = Fmi3Instance if read_model(path).version == 3 else Fmi2Instance
    return kind(path, instance_name)
