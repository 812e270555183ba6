"""Global state of the process that an FMU may change: the rounding mode, the current folder, limits of resources."""

import ctypes
import os
from collections.abc import Sequence
from contextlib import suppress

from orchestration.foundation.processes.resource_limits import own_limits, set_again

ROUNDING, FOLDER, LIMITS = "the floating-point mode", "the current folder", "a limit of resources"
_ONE, _LITTLE, _SMALLEST, _HALF, _TINY = 1.0, 2.0**-60, 2.0**-1022, 0.5, 2.0**-1074
_ENVIRONMENT = 512
"""Upper bound on the size of the floating-point environment [byte]"""


class Surroundings:
    """The global state when this object is created; callers of FMUs restore it."""

    def __init__(self) -> None:
        self._mode, self._folder, self._limits = _mode(), current_folder(), own_limits()
        self._environment = ctypes.create_string_buffer(_ENVIRONMENT)
        self._library = _mathematics()
        if self._library is not None:
            self._library.fegetenv(self._environment)

    def restore_rounding(self) -> bool:
        """Restore the rounding mode and the handling of subnormal numbers; returns whether they had changed."""
        if _mode() == self._mode or self._library is None:
            return False
        self._library.fesetenv(self._environment)
        return True

    def restore_folder(self) -> bool:
        """Restore the current folder; returns whether it had changed."""
        if self._folder is None or current_folder() == self._folder:
            return False
        with suppress(OSError):  # it no longer exists
            os.chdir(self._folder)
        return True

    def restore_limits(self) -> bool:
        """Restore the limits of resources; returns whether they had changed."""
        return set_again(self._limits)


def current_folder() -> str | None:
    """That of this process; None if it no longer exists."""
    try:
        return os.getcwd()
    except OSError:
        return None


def sentence(names: Sequence[str], what: str) -> str:
    """The warning for what one of some FMUs has changed."""
    fmu = names[0] if len(names) == 1 else f"one of {', '.join(names)}"
    return f"{fmu}: the FMU has changed {what} of the whole process, which was restored"


def _mode() -> tuple[bool, ...]:
    """The rounding mode of this thread, and whether it flushes subnormal numbers, as observed in results."""
    return (
        _ONE + _LITTLE != _ONE,
        _ONE - _LITTLE != _ONE,
        -_ONE - _LITTLE != -_ONE,
        _SMALLEST * _HALF == 0.0,
        _TINY * _ONE == 0.0,
    )


def _mathematics() -> ctypes.CDLL | None:
    """The C library with the functions of the floating-point environment; None if it is not found."""
    for name in (None, "libm.so.6"):  # usually Python itself is linked to it
        with suppress(OSError, AttributeError, TypeError):
            library = ctypes.CDLL(name)
            assert library.fegetenv
            return library
    return None
