"""Peculiarities of pythonfmu 0.7.0, with which FMUs in Python are built, that matter when one is loaded."""

import ctypes
from pathlib import Path

import fmpy

from fmu_kit import loader
from orchestration.foundation.basics.errors import QuadcosimError

ENTRY = "resources/slavemodule.txt"
"""The file of its FMU that has the name of the script to run."""
_BANNER = "Fatal py exception"


def is_made_by_it(folder: Path) -> bool:
    """Whether the FMU unpacked in `folder` was built by pythonfmu."""
    return (folder / ENTRY).is_file()


def logged(message: bytes) -> bytes:
    """The message of the slave: pythonfmu doubles its percent signs."""
    return message.replace(b"%%", b"%")


def without_banner(text: str) -> str:
    """The slave's own text of an error, without the line that pythonfmu prepends."""
    return text.partition("\n")[2] if text.startswith(_BANNER) else text


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
    if is_made_by_it(folder) and not decoded and not uri_is_read(folder):
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
