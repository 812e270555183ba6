"""fmpy's instances of FMUs for co-simulation, loaded and instantiated alike for both versions of FMI."""

import ctypes
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import fmpy
from fmpy import fmi2, fmi3

from orchestration.components.fmi.messages import Message, collecting_callbacks
from orchestration.components.fmi.pythonfmu import release_interpreter_state
from orchestration.foundation.basics.errors import QuadcosimError

_IS_X86 = fmpy.platform_tuple.startswith("x86")
FOLDERS: Mapping[int, tuple[str, ...]] = {
    2: (fmpy.platform,) if _IS_X86 else (fmpy.platform_tuple, fmpy.platform),
    3: (fmpy.platform_tuple,),
}
"""The folders in `binaries/` for this machine, by the version of FMI: the first that exists is used.

For other processors than x86, FMI 2.0 uses the names of FMI 3.0 (FMI 2.0.4, section 2.3), and tools use `linux64`.
"""

INSTANTIATES: Mapping[int, str] = {2: "fmi2Instantiate", 3: "fmi3InstantiateCoSimulation"}
"""The function that makes an instance, by the version of FMI."""


class _CachedSignatures:
    """fmpy derives the signatures of all functions for each instance; here that is done once.

    A validation makes 150 instances, and spent a third of its time on that.
    """

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]]
    _functions: dict[str, Any]
    dll: Any

    def _loadFunctions(self) -> None:  # noqa: N802
        if not self._signatures:
            super()._loadFunctions()  # type: ignore[misc]
            self._signatures.update({name: (f.argnames, f.argtypes, f.restype) for name, f in self._functions.items()})
        for name, (names, types, result) in self._signatures.items():
            function = getattr(self.dll, name)
            function.argnames, function.argtypes, function.restype = names, types, result
            self._functions[name] = function


class FMU2Slave(_CachedSignatures, fmi2.FMU2Slave):  # type: ignore[misc]  # fmpy is untyped, and derives the version from this name
    """Of FMI 2.0."""

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}


class FMU3Slave(_CachedSignatures, fmi3.FMU3Slave):  # type: ignore[misc]
    """Of FMI 3.0."""

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}

    def getString(self, vr: Sequence[int], nValues: int | None = None) -> list[bytes | None]:  # noqa: N802
        """The raw bytes, which may be missing or no valid text; fmpy's method decodes them."""
        count = len(vr) if nValues is None else nValues
        values = (ctypes.c_char_p * count)()
        self.fmi3GetString(self.component, (ctypes.c_uint * len(vr))(*vr), len(vr), values, count)
        return list(values)


def binary_folders(files: Iterable[str]) -> list[str]:
    """The folders that have binaries, of the files of an FMU."""
    parts = [name.split("/") for name in files]
    return sorted({part[1] for part in parts if part[0] == "binaries" and len(part) > 2 and part[2]})


def folder_here(version: int, folders: Sequence[str]) -> str:
    """The one for this machine among the folders that have binaries; raises `QuadcosimError` if there is none."""
    for folder in FOLDERS[version]:
        if folder in folders:
            return folder
    raise QuadcosimError(f"has no binary for {' or '.join(FOLDERS[version])}, only for {', '.join(folders) or 'none'}")


def load_slave(version: int, folder: Path, *, token: str, identifier: str, name: str) -> Any:
    """Load the library of an FMU that is unpacked in `folder`, for an instance `name`; `token` is its GUID."""
    arguments = {"guid": token, "unzipDirectory": str(folder), "modelIdentifier": identifier, "instanceName": name}
    if version == 3:
        return FMU3Slave(**arguments)
    here = folder_here(version, sorted(each.name for each in (folder / "binaries").iterdir()))
    library = folder / "binaries" / here / f"{identifier}{fmpy.sharedLibraryExtension}"
    return FMU2Slave(**arguments, libraryPath=str(library))


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
