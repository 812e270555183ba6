"""Reporting a failure of a slave: as one readable message, without crashing the host.

All of it works around how the native part of pythonfmu 0.7.0 treats exceptions and references.
"""

import inspect
import traceback
from pathlib import Path
from typing import Any

from pythonfmu.enums import Fmi2Status
from pythonfmu.logmsg import LogMsg

from fmu_kit.errors import DivergenceError, FmuError

_kept_references: list[Any] = []


def restore_reference(module_globals: dict[str, Any]) -> None:
    """Restore the reference to a module's globals that each instantiation drops; called by the entry script.

    Whenever the native part looks up the slave class, it decrements the borrowed reference of the module's
    dictionary. The classes that it leaks may hide this, while they hold more references to the dictionary than
    it drops; the reference restored here does not depend on that.
    """
    _kept_references.append(module_globals)


def keep_alive(slave: Any, *, again: bool) -> None:
    """Keep a slave whose call is about to raise alive for as long as the process.

    After an exception the native part drops its references to the instance, the class and the log queue
    but keeps the pointers, and drops them once more when the instance is freed or reset. So each gets one more
    reference per exception, and another the first time so that the count never reaches zero.
    """
    dropped = [slave, type(slave), slave.log_queue]
    _kept_references.extend(dropped if again else 2 * dropped)


class Failure(Exception):
    """The exception that a callback raises; the native part logs its repr, as a printf format."""

    def __init__(self, error: Exception) -> None:
        message = str(error) if isinstance(error, FmuError) else f"{error!r}{_place_in_fmu(error)}"
        if isinstance(error, DivergenceError) and isinstance(error.__cause__, Exception):
            message += f" ({_place_in_fmu(error.__cause__).strip()})"
        details = "".join(traceback.format_exception(error)).rstrip()
        self.text = printf_safe(f"{message}\n{details}")
        super().__init__(self.text)

    def __repr__(self) -> str:
        return self.text


class DivergenceMessage(LogMsg):  # type: ignore[misc]
    """A message of category `divergence`, read by the native part while the exception is still pending."""

    def __init__(self, failure: Failure) -> None:
        self.status = Fmi2Status.fatal
        self.category = "divergence"
        self._text = failure.text

    @property
    def msg(self) -> str:
        """The text; catching an exception clears the pending one, under which a Python logger would fail.

        The exception caught is a SystemError: under a pending exception, no other can even be created.
        """
        try:
            raise LookupError
        except BaseException:
            return self._text


def printf_safe(text: str) -> str:
    """A printf format that prints `text`, without what UTF-8 cannot encode, on which the native part would crash."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("%", "%%")


def place_of(error: BaseException) -> str:
    """File and line of the statement of the model that failed, as a prefix of the message; empty if there is none.

    For a failure inside the kit, it is the statement that called the kit.
    """
    return next((f"{frame.filename}, line {frame.lineno}: " for frame in reversed(_own_frames(error))), "")


def _place_in_fmu(error: BaseException) -> str:
    """File and line of a failure; the file with its folder, unless that is the bundle of an FMU."""
    frames = _own_frames(error) or traceback.extract_tb(error.__traceback__)
    if not frames:
        return ""
    folder, name = Path(frames[-1].filename).parts[-2:]
    return f" in {name if folder.startswith('quadcosim_') else f'{folder}/{name}'}, line {frames[-1].lineno}"


def _own_frames(error: BaseException) -> list[traceback.FrameSummary]:
    frames = traceback.extract_tb(error.__traceback__)
    return [each for each in frames if is_model_code(each.filename)]


def is_model_code(filename: str) -> bool:
    """Whether a file is Python of a model, and not of the kit or of what lies under every slave."""
    return filename.endswith(".py") and not _KIT & {*Path(filename).parents}


_KIT = {Path(__file__).parent, Path(inspect.getfile(LogMsg)).parent}


def report(slave: Any, error: Exception, *, again: bool) -> Failure:
    """The exception to raise for `error` in a callback of `slave`; `again` if this instance has failed before."""
    keep_alive(slave, again=again)
    failure = Failure(error)
    if isinstance(error, DivergenceError):
        slave.log_queue.append(DivergenceMessage(failure))
    return failure
