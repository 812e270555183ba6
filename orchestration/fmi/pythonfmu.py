"""Peculiarities of pythonfmu 0.7.0, by which FMUs in Python are made: what whoever loads one must know of it."""

import ctypes
from pathlib import Path

import fmpy

from fmu_kit import loader
from orchestration.basics.errors import QuadcosimError

_ENTRY = Path("resources", "slavemodule.txt")
_BANNER = "Fatal py exception"


def is_made_by_it(folder: Path) -> bool:
    """Whether the FMU unpacked in `folder` is one of pythonfmu."""
    return (folder / _ENTRY).is_file()


def logged(message: bytes) -> bytes:
    """A message as the slave meant it: pythonfmu passes no arguments, only doubled percent signs."""
    return message.replace(b"%%", b"%")


def without_banner(text: str) -> str:
    """The slave's own text of an error, before which pythonfmu puts a line of its own."""
    return text.partition("\n")[2] if text.startswith(_BANNER) else text


def uri_is_read(folder: Path) -> bool:
    """Whether pythonfmu finds an FMU that is unpacked in `folder`; it crashes where it does not.

    It is given the folder as a URI, of whose escapes it knows that of the space only.
    """
    return "%" not in folder.as_uri().replace("%20", "")


def expect_readable_place(folder: Path) -> None:
    """Raises `QuadcosimError` if pythonfmu would crash on the folder in which its FMU was unpacked.

    Not so behind the loader of this project, which reads the URI before it.
    """
    decoded = fmpy.platform == "linux64" and (folder / loader.BESIDE).is_file()
    if is_made_by_it(folder) and not decoded and not uri_is_read(folder):
        raise QuadcosimError(
            f"unpacked in {folder}; pythonfmu reads no path with other characters than ASCII letters, digits, "
            "spaces and - . _ ~: set TMPDIR (on Windows TEMP) to such a folder"
        )


def release_interpreter_state(library: ctypes.CDLL) -> None:
    """Have pythonfmu let go of what it would otherwise free twice when its library is unloaded.

    The unloading releases a static pointer after its destructor has run, which now and then corrupts the heap as
    the process ends. Released before, both do nothing. It holds a thread that initialises Python where the host
    has not, so a host that is Python has no use for it. FMUs of this project do so themselves; those that
    pythonfmu's own builder packed do not.
    """
    release = getattr(library, "finalizePythonInterpreter", None)
    if release is not None:
        release()
