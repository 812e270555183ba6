"""Messages and progress of the commands on standard error, where also goes what FMUs print."""

import contextlib
import ctypes
import logging
import math
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, Literal, TextIO, TypeAlias, TypeVar

Share = Callable[[float], None]
"""Called with the share of the work done."""
Count = Callable[[int, int], None]
"""Called with the number of runs done and the total."""

SPARSE = 10.0
"""Time between two progress lines where no bar can be drawn [s]"""
SILENCE = 30.0
"""Time without a line there, after which one says that the work goes on [s]"""


class _Screen(logging.Handler):
    """The current standard error; warnings and errors in colour on a terminal."""

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(BrokenPipeError):  # the reader has closed it
            print(_painted(record), file=sys.stderr, flush=True)


_MESSAGES = logging.getLogger("quadcosim")
_SCREEN = _Screen(logging.INFO)
_MESSAGES.propagate = False
_MESSAGES.setLevel(logging.INFO)
_MESSAGES.addHandler(_SCREEN)


def configure(level: int, log: Path | None) -> None:
    """Show messages from `level` on; append all of them, with times, to the file `log`.

    Raises `OSError` if it cannot be written.
    """
    for handler in [handler for handler in _MESSAGES.handlers if handler is not _SCREEN]:
        _MESSAGES.removeHandler(handler)
        handler.close()
    _SCREEN.setLevel(level)
    _MESSAGES.setLevel(level if log is None else logging.DEBUG)
    if log is not None:
        log.parent.mkdir(parents=True, exist_ok=True)
        file = logging.FileHandler(log, encoding="utf-8")
        file.setFormatter(logging.Formatter("%(asctime)s.%(msecs)03d %(levelname)-7s %(message)s", "%Y-%m-%dT%H:%M:%S"))
        _MESSAGES.addHandler(file)


def detail(text: str) -> None:
    """Print one line if verbose."""
    _MESSAGES.debug("%s", text)


def inform(text: str) -> None:
    """Print one line about the progress of work, unless quiet."""
    _MESSAGES.info("%s", text)


_BARS: list[Callable[[str], None]] = []
"""Functions that set the text of the bars, or lines, of progress, the innermost last; an empty one: its own"""


def inform_in_passing(text: str) -> None:
    """Show one line about the progress of work in the text of a bar, with which it goes; verbose: print it."""
    for bar in _BARS[-1:]:
        bar(text)
    detail(text)


@contextmanager
def stated_beside_bar(text: str) -> Iterator[None]:
    """Text of the innermost bar, or line of progress, while the block runs; nothing without one."""
    for bar in _BARS[-1:]:
        bar(text)
    yield
    for bar in _BARS[-1:]:
        bar("")


def warn(text: str) -> None:
    """Print one line about a likely mistake."""
    _MESSAGES.warning("warning: %s", text)


def report_error(text: str, error: BaseException | None = None) -> None:
    """Print one line about a failure; its traceback goes to the log file."""
    _MESSAGES.error("quadcosim: %s", text)
    if error is not None:
        note("".join(traceback.format_exception(error)).rstrip())


def note(text: str) -> None:
    """Write to the log file only."""
    for handler in _MESSAGES.handlers:
        if handler is not _SCREEN:
            handler.handle(_MESSAGES.makeRecord(_MESSAGES.name, logging.DEBUG, "", 0, text, (), None))


def in_columns(rows: Sequence[Sequence[str]], *, right: bool = False) -> Iterator[str]:
    """Lines of cells in columns: left-aligned, or with `right` only the first."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        aligned = (cell.rjust(w) if right and i else cell.ljust(w) for i, (cell, w) in enumerate(zip(row, widths)))
        yield "  ".join(aligned).rstrip()


def _painted(record: logging.LogRecord) -> str:
    text = record.getMessage()
    colour = {logging.WARNING: 33, logging.ERROR: 31, logging.DEBUG: 2}.get(record.levelno)
    if colour is None or not _draws() or os.environ.get("NO_COLOR"):
        return text
    return f"\x1b[{colour}m{text}\x1b[0m"


@contextmanager
def progress_bar(what: str, *, steady: bool = True) -> Iterator[Share]:
    """A progress bar on a terminal that can draw it; else occasional lines. `steady`: the rate tells the time left."""
    if not _draws():
        left = _TimeLeft()
        with _occasional_lines(what) as report:
            yield lambda share: report(f"{what}: {share:.0%}", left.after(share) if steady else "")
        return
    from rich.progress import Progress

    columns = Progress.get_default_columns()
    with Progress(*(columns if steady else columns[:-1]), console=_console(), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        _BARS.append(lambda text: bar.update(task, description=text or what))
        try:
            yield lambda share: bar.update(task, completed=share)
        finally:
            _BARS.pop()


@contextmanager
def runs_bar() -> Iterator[Count]:
    """A progress bar with rate and time left on a terminal that can draw it; else occasional lines."""
    if not _draws():
        left = _TimeLeft()
        with _occasional_lines("runs") as report:
            yield lambda done, total: report(f"{done} of {total} runs", left.after(done / max(total, 1)))
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    started = time.monotonic()
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn())
    with Progress(*columns, console=_console()) as bar:
        task = bar.add_task("runs", total=None, rate="")
        first: list[int] = []

        def update(done: int, total: int) -> None:
            first[:] = first or [done]
            rate = (done - first[0]) / max(time.monotonic() - started, 1e-9)
            bar.update(task, completed=done, total=total, rate=f"{rate:.1f} runs/s")

        yield update


@contextmanager
def _occasional_lines(what: str) -> Iterator[Callable[[str, str], None]]:
    """Prints its argument, but not within `SPARSE` seconds of the start or of the last line.

    Where it is not called, or in vain, a thread repeats it after `SILENCE` seconds with how long the work has taken.
    """
    began = last = time.monotonic()
    told, details, over, lock = what, "", threading.Event(), threading.Lock()

    def show(line: str, silence: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= silence:
            last = now
            inform(line)

    def report(text: str, left: str) -> None:
        nonlocal told
        with lock:
            told = text
            show(f"{text}{left}", SPARSE)

    def detailed(text: str) -> None:
        nonlocal details
        details = text and f", {text}"

    def go_on() -> None:
        while not over.wait(max(0.0, last + SILENCE - time.monotonic())):
            with lock:
                show(f"{told}{details}, {_duration(time.monotonic() - began)} so far", SILENCE)

    thread = threading.Thread(target=go_on, name="progress", daemon=True)
    thread.start()
    _BARS.append(detailed)
    try:
        yield report
    finally:
        _BARS.pop()
        over.set()
        thread.join()


class _TimeLeft:
    """Estimates the remaining time from the rate since the start."""

    def __init__(self) -> None:
        self._began, self._first = time.monotonic(), math.nan

    def after(self, share: float) -> str:
        """Text for the end of a line; empty if unknown or zero. The first share was done before the start."""
        if math.isnan(self._first):
            self._first = share
        if not self._first < share < 1.0:
            return ""
        return f", {_duration((time.monotonic() - self._began) * (1.0 - share) / (share - self._first))} left"


def _duration(seconds: float) -> str:
    minutes, hours = seconds / 60.0, seconds / 3600.0
    return f"{seconds:.0f} s" if minutes < 2.0 else f"{minutes:.0f} min" if hours < 2.0 else f"{hours:.1f} h"


def _draws() -> bool:
    """Whether standard error is a terminal that can redraw lines, with colours or without."""
    return sys.stderr.isatty() and os.environ.get("TERM", "").lower() not in ("dumb", "unknown")


def _console() -> Any:
    from rich.console import Console

    return Console(stderr=True)


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


Reporter = TypeVar("Reporter")
ShareProgress: TypeAlias = Share | Literal["bar"] | None
"""`bar`: a bar on a terminal, occasional lines elsewhere and in notebooks; a function: called with the share done"""
CountProgress: TypeAlias = Count | Literal["bar"] | None
"""Likewise, but a function is called with the number of runs done and the total"""


def share_reporter(progress: ShareProgress, what: str, *, steady: bool = True) -> AbstractContextManager[Share]:
    """The function to call with the share of the work done; `steady` as above."""
    return _reporter(progress, lambda: progress_bar(what, steady=steady), lambda share: None)


def runs_reporter(progress: CountProgress) -> AbstractContextManager[Count]:
    """The function to call with the number of runs done and the total."""
    return _reporter(progress, runs_bar, lambda done, total: None)


def _reporter(
    progress: Reporter | Literal["bar"] | None, bar: Callable[[], AbstractContextManager[Reporter]], silent: Reporter
) -> AbstractContextManager[Reporter]:
    if isinstance(progress, str):
        return bar()
    return nullcontext(silent if progress is None else progress)
