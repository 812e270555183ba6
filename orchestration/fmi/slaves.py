"""fmpy's instances of FMUs for co-simulation, of either version of FMI: what begins alike is one text here."""

import ctypes
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import fmpy
from fmpy import fmi2, fmi3

from orchestration.basics.errors import QuadcosimError
from orchestration.fmi.messages import Message, collecting_callbacks
from orchestration.fmi.pythonfmu import release_interpreter_state

_IS_X86 = fmpy.platform_tuple.startswith("x86")
FOLDERS: Mapping[int, tuple[str, ...]] = {
    2: (fmpy.platform,) if _IS_X86 else (fmpy.platform_tuple, fmpy.platform),
    3: (fmpy.platform_tuple,),
}
"""The folders in `binaries/` that are for this machine, by the version of FMI: the first that there is.

For other processors than x86, FMI 2.0 takes the names of FMI 3.0 (FMI 2.0.4, section 2.3), and tools take `linux64`.
"""


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


def binary_folders(path: Path) -> list[str]:
    """The folders with binaries of an FMU."""
    with zipfile.ZipFile(path) as archive:
        parts = [name.split("/") for name in archive.namelist()]
    return sorted({part[1] for part in parts if part[0] == "binaries" and len(part) > 2 and part[2]})


def folder_here(version: int, found: Sequence[str]) -> str:
    """Of the folders with binaries that an FMU has, the one for this machine; raises `QuadcosimError` for none."""
    for folder in FOLDERS[version]:
        if folder in found:
            return folder
    raise QuadcosimError(f"has no binary for {' or '.join(FOLDERS[version])}, only for {', '.join(found) or 'none'}")


def loaded(version: int, folder: Path, *, token: str, identifier: str, name: str) -> Any:
    """The library of an FMU that is unpacked in `folder`, for an instance of that name; `token` is its GUID."""
    known = {"guid": token, "unzipDirectory": str(folder), "modelIdentifier": identifier, "instanceName": name}
    if version == 3:
        return FMU3Slave(**known)
    here = folder_here(version, sorted(each.name for each in (folder / "binaries").iterdir()))
    library = folder / "binaries" / here / f"{identifier}{fmpy.sharedLibraryExtension}"
    return FMU2Slave(**known, libraryPath=str(library))


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
