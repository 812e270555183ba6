"""What an FMU shares with all that its process runs, and may leave changed: how numbers are rounded, and the folder."""

import ctypes
import os
from collections.abc import Sequence
from contextlib import suppress

ROUNDING, FOLDER = "how numbers are rounded", "the current folder"
_ONE, _LITTLE, _SMALLEST, _HALF, _TINY = 1.0, 2.0**-60, 2.0**-1022, 0.5, 2.0**-1074
_ENVIRONMENT = 512
"""[byte] that the C library keeps of how it computes, at most"""


class Surroundings:
    """As they are when this is made; whatever calls an FMU has them put back."""

    def __init__(self) -> None:
        self._mode, self._folder = _mode(), current_folder()
        self._environment = ctypes.create_string_buffer(_ENVIRONMENT)
        self._library = _mathematics()
        if self._library is not None:
            self._library.fegetenv(self._environment)

    def put_back_rounding(self) -> bool:
        """Whether numbers were rounded otherwise, or the smallest ones taken for zero; as before from now on."""
        if _mode() == self._mode or self._library is None:
            return False
        self._library.fesetenv(self._environment)
        return True

    def put_back_folder(self) -> bool:
        """Whether another folder was the current one; it is the one from before again."""
        if self._folder is None or current_folder() == self._folder:
            return False
        with suppress(OSError):  # it is no longer there
            os.chdir(self._folder)
        return True


def current_folder() -> str | None:
    """That of this process; None if it is no longer there."""
    try:
        return os.getcwd()
    except OSError:
        return None


def sentence(names: Sequence[str], what: str) -> str:
    """The warning for what one of some FMUs has changed."""
    who = names[0] if len(names) == 1 else f"one of {', '.join(names)}"
    return f"{who}: the FMU has changed {what} of the whole process, which was put back"


def _mode() -> tuple[bool, ...]:
    """How this thread computes, as far as it can be seen in its results."""
    return (
        _ONE + _LITTLE != _ONE,
        _ONE - _LITTLE != _ONE,
        -_ONE - _LITTLE != -_ONE,
        _SMALLEST * _HALF == 0.0,
        _TINY * _ONE == 0.0,
    )


def _mathematics() -> ctypes.CDLL | None:
    """The library of C that knows how numbers are rounded; None where it is not found."""
    for name in (None, "libm.so.6"):  # Python itself has it, as a rule
        with suppress(OSError, AttributeError, TypeError):
            library = ctypes.CDLL(name)
            assert library.fegetenv
            return library
    return None
