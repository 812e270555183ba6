"""What a process and the one that started it say to each other: frames, over the child's standard streams."""

import os
import pickle
import signal
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import IO, Any

_HEADER = struct.Struct("<Q")
_NO_FRAME = (struct.error, OverflowError, MemoryError, ValueError, pickle.UnpicklingError)
"""What comes of a stream that is cut off or closed, or of bytes that somebody else has written"""
_POLL = 0.5
"""[s] between two looks at whether the parent lives"""


def send(stream: IO[bytes], content: object) -> None:
    """A frame; raises `OSError` if nobody reads."""
    data = pickle.dumps(content, pickle.HIGHEST_PROTOCOL)
    stream.write(_HEADER.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """The next frame; raises `EOFError` if there is none, or if what comes is none."""
    try:
        header = stream.read(_HEADER.size)
        return pickle.loads(stream.read(*_HEADER.unpack(header)))
    except _NO_FRAME as error:
        raise EOFError from error


class Parent:
    """The process that started this one, as a `Child`: where that ends, this one ends, whatever it is doing then.

    From now on what is printed here goes to standard error, and who reads standard input finds nothing.
    """

    def __init__(self, *, interrupt: Any = signal.SIG_IGN, orphaned: Callable[[], None] = lambda: None) -> None:
        """`interrupt` is the handler of Ctrl-C, which nobody sends here but by the process; what was inherited is
        none. `orphaned` is done first where the parent has ended.
        """
        signal.signal(signal.SIGINT, interrupt)
        self._requests, self._answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.close(nothing)
        os.dup2(2, 1)
        self._orphaned, self._leaving = orphaned, threading.Lock()
        threading.Thread(target=self._leave_after, args=(os.getppid(),), daemon=True).start()

    def say(self, content: object) -> None:
        """One frame."""
        try:
            send(self._answers, content)
        except OSError:  # nobody listens
            self.leave()

    def hear(self) -> Any:
        """The next frame; raises `EOFError` if there is none any more."""
        return receive(self._requests)

    def __iter__(self) -> Iterator[Any]:
        """All frames that come."""
        while True:
            try:
                yield self.hear()
            except EOFError:
                return

    def leave(self) -> None:
        """End this process, as its parent has ended."""
        self._leaving.acquire()
        self._orphaned()
        os._exit(1)

    def _leave_after(self, parent: int) -> None:
        while os.getppid() == parent:
            time.sleep(_POLL)
        self.leave()
