"""Log messages of FMUs, collected for each instance.

In FMI 2.0 an FMU logs like printf, with a format and variable arguments, which a Python callback cannot read. fmpy's
compiled logger formats the text and passes it to one function for the whole process, which finds the instance.
"""

import ctypes
import itertools
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import printLogMessage

from orchestration.components.fmi import pythonfmu

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
    if add_formatting is None or pythonfmu.is_made_by_it(folder):
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(_logger_of(messages))
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
    names = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")[: 6 if version == 2 else 5]
    return f"fmi{version}{names[status]}" if 0 <= status < len(names) else f"{status}, which is no status of FMI"


def failure_text(messages: Sequence[Message], otherwise: str) -> tuple[str, str]:
    """The first line of the first message of a failure, and the rest of it; `otherwise` if there is none."""
    bad = [message for message in messages if message[0] > WARNING]
    text = bad[0][2].decode("utf-8", "replace") if bad else otherwise
    summary, _, details = pythonfmu.without_banner(text).partition("\n")
    return summary, details


def _logger_of(messages: list[Message]) -> Any:
    def log(environment: Any, instance: bytes, status: int, category: bytes | None, message: bytes | None) -> None:
        messages.append((status, category, pythonfmu.logged(message or b"")))

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
