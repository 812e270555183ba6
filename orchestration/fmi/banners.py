"""What FMUs print to standard output goes to standard error, so that it spoils no output that a program reads."""

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from typing import TextIO

_OUT, _ERR = 1, 2


@contextlib.contextmanager
def banners_to_stderr() -> Iterator[None]:
    """While the block runs, only what Python prints to `sys.stdout` goes to this process's standard output.

    What C code prints, and processes that are started meanwhile, goes to standard error: the descriptors are set
    once, a step costs nothing. For a whole command, as it holds for all threads.
    """
    try:
        kept = os.dup(_OUT)
    except OSError:  # there is no standard output
        yield
        return
    python, theirs = sys.stdout, None
    python.flush()
    if _is_standard(python):
        theirs = open(kept, "w", encoding=python.encoding, errors=python.errors, closefd=False)  # noqa: SIM115
        sys.stdout = theirs
    _set_output(_ERR)
    try:
        yield
    finally:
        try:
            if theirs is not None:
                sys.stdout = python
                _emptied(theirs, kept)
        finally:
            _set_output(kept)
            os.close(kept)


def _emptied(stream: TextIO, descriptor: int) -> None:
    """Raise `BrokenPipeError` if nobody reads any more; what is left then goes nowhere, so that no other asks again."""
    try:
        stream.flush()
    except BrokenPipeError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
        stream.flush()
        raise


def _is_standard(stream: object) -> bool:
    try:
        return int(stream.fileno()) == _OUT  # type: ignore[attr-defined]
    except (AttributeError, OSError, ValueError):
        return False


def _set_output(target: int) -> None:
    """Whatever C code has printed until now and still holds goes where it went until now."""
    with contextlib.suppress(AttributeError, OSError):
        library = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
        library.fflush(None)
    os.dup2(target, _OUT)
