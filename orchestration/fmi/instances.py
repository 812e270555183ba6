"""Opens instances of FMUs: in this process, or in one of their own where one process does not hold two of them."""

from pathlib import Path

from orchestration.fmi import repeatability
from orchestration.fmi.fmi2 import Fmi2Instance
from orchestration.fmi.fmi3 import Fmi3Instance
from orchestration.fmi.instance import Instance
from orchestration.fmi.isolated import IsolatedInstance
from orchestration.fmi.model import read_model
from orchestration.fmi.native import NativeInstance
from orchestration.fmi.repeatability import content_hash

_opened: set[str] = set()
"""Hashes of the FMUs of which this process has had an instance"""


def open_instance(path: Path, instance_name: str) -> Instance:
    """An instance of the FMU at `path`, of FMI 2.0 or 3.0, that is like the first one of a process.

    The second one of a process is in a process of its own if the FMU says that a process can have one only, or
    has not been shown to be the same again.
    """
    content = content_hash(path)
    if content in _opened and not repeatability.of(path).second_instance:
        return IsolatedInstance(path, instance_name)
    _opened.add(content)
    return open_here(path, instance_name)


def open_here(path: Path, instance_name: str) -> NativeInstance:
    """An instance in this process, whatever else is in it."""
    kind = Fmi3Instance if read_model(path).version == 3 else Fmi2Instance
    return kind(path, instance_name)
