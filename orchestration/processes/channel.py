"""What a process and the one that started it say to each other: frames, over the child's standard streams."""

import math
import os
import pickle
import signal
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import IO, Any

_HEADER = struct.Struct("<Q")
_POLL = 0.5
"""[s] between two looks at whether the parent lives"""


class LongError(EOFError):
    """A frame is longer than it may be."""


def framed(content: object) -> bytes:
    """As a frame; raises what `pickle` does for what cannot be one."""
    data = pickle.dumps(content, pickle.HIGHEST_PROTOCOL)
    return _HEADER.pack(len(data)) + data


def sayable(error: BaseException) -> BaseException:
    """An error as a frame takes it: itself, or its name and its words where it cannot be pickled or read again."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def send(stream: IO[bytes], frame: bytes) -> None:
    """To who receives it; raises `OSError` if nobody reads, `ValueError` if the stream is closed."""
    stream.write(frame)
    stream.flush()


def receive(stream: IO[bytes], most: float = math.inf) -> Any:
    """What the next frame says; raises `EOFError` if there is none, or if what comes is none that can be understood.

    Raises `LongError`, before it is read, if it has more than `most` bytes.
    """
    try:
        (length,) = _HEADER.unpack(stream.read(_HEADER.size))
        if length > most:
            raise LongError
        return pickle.loads(stream.read(length))
    except EOFError:
        raise
    except Exception as error:  # what is cut off, or written by somebody else, may raise anything
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
        """One frame; raises what `pickle` does for what cannot be one."""
        frame = framed(content)
        try:
            send(self._answers, frame)
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
