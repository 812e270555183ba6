"""fmpy's instances of FMUs for co-simulation, of either version of FMI: what begins alike is one text here."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import fmpy
from fmpy import fmi2, fmi3

from orchestration.fmi.messages import Message, collecting_callbacks
from orchestration.fmi.pythonfmu import release_interpreter_state

FOLDERS: Mapping[int, str] = {2: fmpy.platform, 3: fmpy.platform_tuple}
"""The folder in `binaries/` that is for this machine, by the version of FMI"""


class _Known:
    """As fmpy's, which takes the signatures of all functions apart for each instance: here they are known once.

    A validation makes 150 instances, which took it a third of its time.
    """

    _known: ClassVar[dict[str, tuple[Any, Any, Any]]]
    _functions: dict[str, Any]
    dll: Any

    def _loadFunctions(self) -> None:  # noqa: N802
        if not self._known:
            super()._loadFunctions()  # type: ignore[misc]
            self._known.update({name: (f.argnames, f.argtypes, f.restype) for name, f in self._functions.items()})
        for name, (names, types, result) in self._known.items():
            function = getattr(self.dll, name)
            function.argnames, function.argtypes, function.restype = names, types, result
            self._functions[name] = function


class FMU2Slave(_Known, fmi2.FMU2Slave):  # type: ignore[misc]  # fmpy has no types; by this name it knows the version
    """Of FMI 2.0."""

    _known: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}


class FMU3Slave(_Known, fmi3.FMU3Slave):  # type: ignore[misc]
    """Of FMI 3.0."""

    _known: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}

    def getString(self, vr: Sequence[int], nValues: int | None = None) -> list[bytes | None]:  # noqa: N802
        """As they are, which may be none, or no text: fmpy's decodes them."""
        count = len(vr) if nValues is None else nValues
        values = (ctypes.c_char_p * count)()
        self.fmi3GetString(self.component, (ctypes.c_uint * len(vr))(*vr), len(vr), values, count)
        return list(values)


def loaded(version: int, folder: Path, *, token: str, identifier: str, name: str) -> Any:
    """The library of an FMU that is unpacked in `folder`, for an instance of that name; `token` is its GUID."""
    kind = FMU3Slave if version == 3 else FMU2Slave
    return kind(guid=token, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName=name)


def instantiate(slave: Any, messages: list[Message]) -> None:
    """Make the instance, which logs to `messages`."""
    if isinstance(slave, FMU3Slave):
        slave.instantiate(loggingOn=True, logMessage=_logger_of(messages))
    else:
        callbacks = collecting_callbacks(messages, slave.instanceName, Path(slave.unzipDirectory))
        slave.instantiate(callbacks=callbacks, loggingOn=True)
    release_interpreter_state(slave.dll)


def _logger_of(messages: list[Message]) -> Callable[[Any, int, bytes | None, bytes | None], None]:
    def log(environment: Any, status: int, category: bytes | None, message: bytes | None) -> None:
        messages.append((status, category, message or b""))

    return log
