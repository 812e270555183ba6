"""Redirects what FMUs print from standard output to standard error, so that it does not corrupt the output."""

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

    Output of C code, and of processes that are started meanwhile, goes to standard error. The descriptors are set once,
    so that a step costs nothing; they apply to all threads, so that this is for a whole command.
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
                _flush(theirs, kept)
        finally:
            _set_output(kept)
            os.close(kept)


def _flush(stream: TextIO, descriptor: int) -> None:
    """Raise `BrokenPipeError` if the reader is gone; the rest is then discarded, so that it is raised only once."""
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
    """Set the descriptor of standard output; what C code has buffered before goes to the previous one."""
    with contextlib.suppress(AttributeError, OSError):
        library = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
        library.fflush(None)
    os.dup2(target, _OUT)
