"""Ctrl-C while FMUs are loaded: it is heard between two of their calls, so that none is blamed for it."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupted(KeyboardInterrupt):
    """Ctrl-C was heard; the text says how far the work was."""


class Interrupt:
    """A handler of SIGINT that takes note; the second time it does not wait."""

    def __init__(self) -> None:
        self.requested = False
        self._hear: Callable[[], None] | None = None

    def tell(self, hear: Callable[[], None]) -> None:
        """Have it heard elsewhere too, once: now, if it was heard before."""
        self._hear = hear
        if self.requested:
            self._pass_on()

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Hear the signal."""
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
        self._pass_on()

    def _pass_on(self) -> None:
        hear, self._hear = self._hear, None
        if hear is not None:
            hear()


@contextmanager
def interrupts_held_back() -> Iterator[Interrupt]:
    """Ctrl-C is noted while the block runs, and raised as `KeyboardInterrupt` when it ends.

    In place of whatever error the block ends with: a slave that is Python takes the signal for one of its own.
    Where Python's own handler is not in place, or in another thread than the main one, nothing changes.
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
