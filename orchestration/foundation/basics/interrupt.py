"""Ctrl-C while FMUs are loaded: it is acted on between two of their calls, so that no FMU is blamed for it."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupted(KeyboardInterrupt):
    """Ctrl-C was received; the text states how far the work was."""


class Interrupt:
    """A handler of SIGINT that records the first signal and raises `KeyboardInterrupt` at the second."""

    def __init__(self) -> None:
        self.requested = False
        self._callback: Callable[[], None] | None = None

    def forward(self, callback: Callable[[], None]) -> None:
        """Call `callback` once at the signal; immediately, if it was received before."""
        self._callback = callback
        if self.requested:
            self._call_back()

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal."""
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
        self._call_back()

    def _call_back(self) -> None:
        callback, self._callback = self._callback, None
        if callback is not None:
            callback()


@contextmanager
def deferred_interrupts() -> Iterator[Interrupt]:
    """Record Ctrl-C while the block runs, and raise `KeyboardInterrupt` when it ends.

    It replaces any error of the block, since a slave in Python may take the signal for its own failure. Without
    effect in threads other than the main one, and where Python's default handler is not installed.
    """
    interrupt = Interrupt()
    ours = threading.current_thread() is threading.main_thread() and (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if ours:
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield interrupt
    except Exception:
        if not interrupt.requested:
            raise
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
    if interrupt.requested:
        raise KeyboardInterrupt
