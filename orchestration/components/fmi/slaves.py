"""fmpy's instances of FMUs for co-simulation, loaded alike for both versions of FMI, and what they log.

In FMI 2.0 an FMU logs like printf, with a format and variable arguments, which a Python callback cannot read. fmpy's
compiled logger formats the text and passes it to one function for the whole process, which finds the instance.

pythonfmu 0.7.0, with which FMUs in Python are built, has peculiarities that matter when one is loaded.
"""

import ctypes
import itertools
import os
import re
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import fmpy
from fmpy import fmi2, fmi3
from fmpy.fmi1 import printLogMessage

from fmu_kit import loader
from orchestration.components.fmi.access import SCHEDULED, Interface
from orchestration.foundation.basics.errors import QuadcosimError

ENTRY = "resources/slavemodule.txt"
"""The file of its FMU that has the name of the script to run."""
_BANNER = "Fatal py exception"


def is_made_by_pythonfmu(folder: Path) -> bool:
    """Whether the FMU unpacked in `folder` was built by pythonfmu."""
    return (folder / ENTRY).is_file()


def logged(message: bytes) -> bytes:
    """The message of the slave: pythonfmu doubles its percent signs."""
    return message.replace(b"%%", b"%")


def uri_is_read(folder: Path) -> bool:
    """Whether pythonfmu finds an FMU that is unpacked in `folder`; it crashes if it does not.

    It receives the folder as a URI, of whose escapes it decodes only that of the space.
    """
    return "%" not in folder.as_uri().replace("%20", "")


def expect_readable_place(folder: Path) -> None:
    """Raise `QuadcosimError` if pythonfmu would crash on the folder in which its FMU was unpacked.

    With the loader of this project it does not, because that decodes the URI.
    """
    decoded = fmpy.platform == "linux64" and (folder / loader.BESIDE).is_file()
    if is_made_by_pythonfmu(folder) and not decoded and not uri_is_read(folder):
        raise QuadcosimError(
            f"unpacked in {folder}; pythonfmu reads no path with other characters than ASCII letters, digits, "
            "spaces and - . _ ~: set TMPDIR (on Windows TEMP) to such a folder"
        )


def release_interpreter_state(library: ctypes.CDLL) -> None:
    """Have pythonfmu release what it would otherwise free twice when its library is unloaded.

    Unloading releases a static pointer after its destructor has run, which sometimes corrupts the heap when the
    process ends. If it is released before, both do nothing. It holds a thread that initialises Python in a host
    without Python, so that a host in Python does not need it. FMUs of this project release it themselves; those that
    pythonfmu's own builder packed do not.
    """
    release = getattr(library, "finalizePythonInterpreter", None)
    if release is not None:
        release()


Message: TypeAlias = tuple[int, bytes | None, bytes]
"""Status, category and text of a message"""

WARNING: int = fmi2.fmi2Warning


class Messages(list[Message]):
    """Messages that have not been processed, and their number in memory that C reads."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting = ctypes.c_int64(0)

    def append(self, message: Message) -> None:
        """Add a message."""
        super().append(message)
        self.waiting.value = len(self)

    def clear(self) -> None:
        """Remove all messages."""
        super().clear()
        self.waiting.value = 0


_environments = itertools.count(1)
_by_environment: dict[int, list[Message]] = {}
_by_name: dict[bytes, list[Message]] = {}


def collecting_callbacks(messages: list[Message], name: str, folder: Path) -> fmi2.fmi2CallbackFunctions:
    """Callbacks that collect in `messages` the log of the instance `name` of the FMU unpacked in `folder`.

    Messages of pythonfmu are not formatted, since the compiled logger would cut them off after 2047 bytes.
    """
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    add_formatting = getattr(fmi2, "addLoggerProxy", None)  # fmpy has none for some platforms
    if add_formatting is None or is_made_by_pythonfmu(folder):
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(_logger_of_fmi2(messages))
        return callbacks
    environment = next(_environments)
    _by_environment[environment] = _by_name[name.encode()] = messages
    weakref.finalize(callbacks, _forget, environment, name.encode(), messages)
    callbacks.componentEnvironment = environment
    callbacks.logger = _DISPATCHER
    add_formatting(ctypes.byref(callbacks))  # again for each: other users of fmpy may have set another
    return callbacks


def status_name(version: int, status: int) -> str:
    """The name of the status of a call in a version of FMI."""
    names = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")[: 5 if version == 3 else 6]
    prefix = "fmi" if version == 1 else f"fmi{version}"
    return f"{prefix}{names[status]}" if 0 <= status < len(names) else f"{status}, which is no status of FMI"


def failure_text(messages: Sequence[Message], otherwise: str) -> tuple[str, str]:
    """The first line of the first message of a failure, and the rest of it; `otherwise` if there is none."""
    bad = [message for message in messages if message[0] > WARNING]
    text = bad[0][2].decode("utf-8", "replace") if bad else otherwise
    own = text.partition("\n")[2] if text.startswith(_BANNER) else text  # without the line that pythonfmu prepends
    summary, _, details = own.partition("\n")
    return summary, details


def _logger_of_fmi2(messages: list[Message]) -> Any:
    def log(environment: Any, instance: bytes, status: int, category: bytes | None, message: bytes | None) -> None:
        messages.append((status, category, logged(message or b"")))

    return log


def _dispatch(
    environment: int | None, instance: bytes | None, status: int, category: bytes | None, message: bytes | None
) -> None:
    """Find the instance by the environment that the FMU received, or by its name if the FMU does not pass that back."""
    messages = _by_environment.get(environment or 0, _by_name.get(instance or b""))
    if messages is None:  # an FMU that was loaded by another user of fmpy
        printLogMessage(environment, instance or b"", status, category, message or b"")
    else:
        messages.append((status, category, message or b""))


_DISPATCHER = fmi2.fmi2CallbackLoggerTYPE(_dispatch)


def _forget(environment: int, name: bytes, messages: list[Message]) -> None:
    _by_environment.pop(environment, None)
    if _by_name.get(name) is messages:
        del _by_name[name]


_IS_X86 = fmpy.platform_tuple.startswith("x86")
FOLDERS: Mapping[int, tuple[str, ...]] = {
    1: (fmpy.platform,),
    2: (fmpy.platform,) if _IS_X86 else (fmpy.platform_tuple, fmpy.platform),
    3: (fmpy.platform_tuple,),
}
"""The folders in `binaries/` for this machine, by the version of FMI: the first that exists is used.

For other processors than x86, FMI 2.0 uses the names of FMI 3.0 (FMI 2.0.4, section 2.3), and tools use `linux64`.
"""


def instantiates(version: int, interface: Interface) -> str:
    """The name of the function that makes an instance."""
    if version == 2:
        return "fmi2Instantiate"
    names = {"model-exchange": "ModelExchange", SCHEDULED: "ScheduledExecution"}
    return f"fmi3Instantiate{names.get(interface, 'CoSimulation')}"


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


class FMU2Model(_CachedSignatures, fmi2.FMU2Model):  # type: ignore[misc]
    """Of FMI 2.0 for model exchange."""

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}


class _Texts3(_CachedSignatures):
    """Texts of FMI 3.0."""

    component: Any
    instantiate: Any
    fmi3GetString: Any  # noqa: N815

    def getString(self, vr: Sequence[int], nValues: int | None = None) -> list[bytes | None]:  # noqa: N802
        """The raw bytes, which may be missing or no valid text; fmpy's method decodes them."""
        count = len(vr) if nValues is None else nValues
        values = (ctypes.c_char_p * count)()
        self.fmi3GetString(self.component, (ctypes.c_uint * len(vr))(*vr), len(vr), values, count)
        return list(values)


class FMU3Slave(_Texts3, fmi3.FMU3Slave):  # type: ignore[misc]
    """Of FMI 3.0."""

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}


class FMU3Model(_Texts3, fmi3.FMU3Model):  # type: ignore[misc]
    """Of FMI 3.0 for model exchange."""

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}


class FMU3ScheduledExecution(_Texts3, fmi3.FMU3ScheduledExecution):  # type: ignore[misc]
    """Of FMI 3.0 for scheduled execution."""

    _signatures: ClassVar[dict[str, tuple[Any, Any, Any]]] = {}


def binary_folders(files: Iterable[str]) -> list[str]:
    """The folders that have binaries, of the files of an FMU."""
    parts = [name.split("/") for name in files]
    return sorted({part[1] for part in parts if part[0] == "binaries" and len(part) > 2 and part[2]})


def folder_here(version: int, folders: Sequence[str]) -> str:
    """The one for this machine among the folders that have binaries; raises `QuadcosimError` if there is none."""
    for folder in FOLDERS[version]:
        if folder in folders:
            return folder
    here = f"has no binary for {' or '.join(FOLDERS[version])}"
    raise QuadcosimError(f"{here}, only for {', '.join(folders)}" if folders else f"{here}, nor for any other platform")


def load_slave(
    version: int, folder: Path, *, token: str, identifier: str, name: str, interface: Interface = "co-simulation"
) -> Any:
    """Load the library of an FMU that is unpacked in `folder`, for an instance `name`; `token` is its GUID.

    Raises `QuadcosimError` if it cannot be loaded.
    """
    arguments = {"guid": token, "unzipDirectory": str(folder), "modelIdentifier": identifier, "instanceName": name}
    exchange = interface == "model-exchange"
    kind: Callable[..., Any] = FMU2Model if exchange else FMU2Slave
    if version == 3:
        kind = FMU3Model if exchange else FMU3ScheduledExecution if interface == SCHEDULED else FMU3Slave
    else:
        here = folder_here(version, sorted(each.name for each in (folder / "binaries").iterdir()))
        library = folder / "binaries" / here / f"{identifier}{fmpy.sharedLibraryExtension}"
        arguments["libraryPath"] = str(library)
    with in_terms_of_the_archive(folder):
        return kind(**arguments)


@contextmanager
def in_terms_of_the_archive(folder: Path) -> Iterator[None]:
    """Have errors about a library, of which fmpy raises any kind, name it by its place in the FMU, once."""
    try:
        yield
    except Exception as error:
        text = str(error).replace(f"{folder}{os.sep}", "")
        raise QuadcosimError(re.sub(r"^Failed to load shared library (.+)\. (?=\1)", "", text)) from error


def instantiate(slave: Any, messages: list[Message], interface: Interface = "co-simulation") -> None:
    """Make the instance, which logs to `messages`."""
    if isinstance(slave, _Texts3):
        used = {"eventModeUsed": True, "earlyReturnAllowed": True} if interface == "event-mode" else {}
        slave.instantiate(loggingOn=True, logMessage=_logger_of_fmi3(messages), **used)
    else:
        callbacks = collecting_callbacks(messages, slave.instanceName, Path(slave.unzipDirectory))
        slave.instantiate(callbacks=callbacks, loggingOn=True)
    release_interpreter_state(slave.dll)


def _logger_of_fmi3(messages: list[Message]) -> Callable[[Any, int, bytes | None, bytes | None], None]:
    def log(environment: Any, status: int, category: bytes | None, message: bytes | None) -> None:
        messages.append((status, category, message or b""))

    return log
