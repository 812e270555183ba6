"""Where the C of an FMU crashes, or is when its time is over: line and function, found by the ending process.

On Linux with glibc.
"""

import contextlib
import ctypes
import platform
import signal
import subprocess
from collections.abc import Callable
from typing import Any

_SIGNALS = ("SIGSEGV", "SIGFPE", "SIGILL", "SIGTRAP", "SIGPROF")
"""The last one is sent to a process that is out of time, as `limit_enforcement` does"""
_OF_CHECKS = " (index, overflow, division, shift or conversion that C leaves undefined)"
"""Checks that may have failed where code with checks ends itself: the signal does not tell which"""
_MEANING = {"SIGFPE": " (integer division by zero)", "SIGILL": _OF_CHECKS, "SIGTRAP": _OF_CHECKS}
_WITH_CONTEXT = 4
"""SA_SIGINFO of signal.h"""
_COUNTER = {"x86_64": 168, "aarch64": 440}
"""Offsets in a `ucontext_t` of glibc of the address of the failing instruction, by machine"""
_BACK: dict[str, Callable[[int], int]] = {
    "x86_64": lambda context: _word(_word(context + 160)),
    "aarch64": lambda context: _word(context + 424),
}
"""Addresses to which a function returns that has just been called: on top of the stack, or in the link register"""
_DEPTH = 64
"""Most frames that are looked at"""
_PATIENCE = 10
"""Time for the search [s]: it waits for ever if the crash is of `malloc`; then SIGALRM ends the process"""
_KEPT: list[Any] = []
"""Functions that C calls, which must not be collected"""


class _Action(ctypes.Structure):
    """`struct sigaction` of glibc."""

    _fields_ = (
        ("handler", ctypes.c_void_p),
        ("mask", ctypes.c_ulong * 16),
        ("flags", ctypes.c_int),
        ("restorer", ctypes.c_void_p),
    )


class _Symbol(ctypes.Structure):
    """`Dl_info` of dlfcn.h."""

    _fields_ = (
        ("library", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


def report_crashes(report: Callable[[str], None]) -> None:
    """Pass the line in an FMU to `report`, if it is known, when its C crashes or its time is over.

    The process ends as without this.

    A handler in Python is not called in time, therefore this is one of C, which ctypes makes of a function.
    """
    libc = ctypes.CDLL(None)
    if platform.machine() not in _COUNTER or not hasattr(libc, "backtrace"):
        return

    def crashed(number: int, _: int, context: int) -> None:
        libc.signal(number, None)
        libc.alarm(_PATIENCE)
        with contextlib.suppress(Exception):
            place = _place(libc, context)
            if place:
                report(place + _MEANING.get(signal.Signals(number).name, ""))
        signal.raise_signal(number)  # it ends the process when this returns

    handler = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(crashed)
    _KEPT.append(handler)
    action = _Action(handler=ctypes.cast(handler, ctypes.c_void_p), flags=_WITH_CONTEXT)
    for name in _SIGNALS:
        libc.sigaction(getattr(signal, name), ctypes.byref(action), None)


def _word(address: int) -> int:
    return ctypes.c_size_t.from_address(address).value


def _place(libc: ctypes.CDLL, context: int) -> str:
    """The innermost place in the library of an FMU; empty if there is none."""
    failing, frames = _word(context + _COUNTER[platform.machine()]), (ctypes.c_size_t * _DEPTH)()
    found = frames[: libc.backtrace(frames, _DEPTH)]
    callers = found[found.index(failing) + 1 :] if failing in found else []
    # Frames end at an address that is no instruction, as after a call of a null pointer.
    callers = callers or [_BACK[platform.machine()](context)]
    for address in (failing, *(after - 1 for after in callers)):  # a return address is behind the call
        symbol = _Symbol()
        libc.dladdr(ctypes.c_void_p(address), ctypes.byref(symbol))
        if b"/binaries/" in (symbol.library or b""):
            return _line(symbol.library.decode(), address - symbol.base)
    return ""


def _line(library: str, offset: int) -> str:
    command = ["addr2line", "-f", "-C", "-s", "-e", library, hex(offset)]
    function, line = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    line = line.partition(" ")[0]  # a discriminator may follow
    if "?" in line:
        return ""
    return line if function.startswith("quadcosim_") else f"{line} ({function})"
