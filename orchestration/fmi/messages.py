"""What FMUs log, collected for each instance.

FMI 2.0 has an FMU log as C prints: a text with places for arguments, and the arguments. What a Python function
called from C cannot see, fmpy's compiled logger can; it gives the text that comes of it on to one function for the
whole process, and that one finds the instance.
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

from orchestration.fmi import pythonfmu

Message: TypeAlias = tuple[int, bytes | None, bytes]
"""Status, category and text of what an FMU logged"""

WARNING: int = fmi2.fmi2Warning


class Messages(list[Message]):
    """Those that have not been heard, and how many they are where C sees it."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting = ctypes.c_int64(0)

    def append(self, message: Message) -> None:
        """One more."""
        super().append(message)
        self.waiting.value = len(self)

    def clear(self) -> None:
        """They have been heard."""
        super().clear()
        self.waiting.value = 0


_environments = itertools.count(1)
_by_environment: dict[int, list[Message]] = {}
_by_name: dict[bytes, list[Message]] = {}


def collecting_callbacks(messages: list[Message], name: str, folder: Path) -> fmi2.fmi2CallbackFunctions:
    """Callbacks that collect in `messages` what the instance `name` of the FMU unpacked in `folder` logs.

    What pythonfmu logs is taken as it comes, since the compiled logger would cut it off after 2047 bytes.
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
    add_formatting(ctypes.byref(callbacks))  # once more for each: whoever else uses fmpy may have put in another
    return callbacks


def words(messages: Sequence[Message], otherwise: str) -> tuple[str, str]:
    """The first line of the first message of a failure, and what follows it; `otherwise` if there is none."""
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
    """By the environment that the FMU was given; by the name where it does not give it back."""
    messages = _by_environment.get(environment or 0, _by_name.get(instance or b""))
    if messages is None:  # an FMU that another user of fmpy has loaded
        printLogMessage(environment, instance or b"", status, category, message or b"")
    else:
        messages.append((status, category, message or b""))


_DISPATCHER = fmi2.fmi2CallbackLoggerTYPE(_dispatch)


def _forget(environment: int, name: bytes, messages: list[Message]) -> None:
    _by_environment.pop(environment, None)
    if _by_name.get(name) is messages:
        del _by_name[name]
