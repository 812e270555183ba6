"""Messages between a process and its parent: pickled frames over the child's standard streams."""

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
"""Time between two checks whether the parent lives [s]"""


parent_id = os.getppid()
"""The process that started this one, or the server that forked it: it may end before this one looks"""


class LongError(EOFError):
    """A frame is longer than allowed."""


def to_frame(content: object) -> bytes:
    """`content` as a frame; raises what `pickle` raises."""
    data = pickle.dumps(content, pickle.HIGHEST_PROTOCOL)
    return _HEADER.pack(len(data)) + data


def picklable(error: BaseException) -> BaseException:
    """The error itself, or a `RuntimeError` with its name and text if it cannot be pickled and unpickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def write_frame(stream: IO[bytes], frame: bytes) -> None:
    """Write a frame; raises `OSError` if the other end is closed, `ValueError` if the stream is."""
    stream.write(frame)
    stream.flush()


def read_frame(stream: IO[bytes], limit: float = math.inf) -> Any:
    """The content of the next frame; raises `EOFError` if there is none or it is not a valid frame.

    Raises `LongError`, before it is read, if it has more than `limit` bytes.
    """
    try:
        (length,) = _HEADER.unpack(stream.read(_HEADER.size))
        if length > limit:
            raise LongError
        return pickle.loads(stream.read(length))
    except EOFError:
        raise
    except Exception as error:  # truncated or foreign bytes may raise anything
        raise EOFError from error


class Parent:
    """The process that started this one as a `Child`; when it ends, this process ends, whatever it is doing.

    Redirects standard output to standard error, and standard input to the null device.
    """

    def __init__(self, *, interrupt: Any = signal.SIG_IGN, on_orphaned: Callable[[], None] = lambda: None) -> None:
        """`interrupt` is the handler of SIGINT, which reaches this process only if sent to its id: its session is its
        own. `on_orphaned` is called before this process ends with its parent.
        """
        signal.signal(signal.SIGINT, interrupt)
        self._requests, self._answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.close(nothing)
        os.dup2(2, 1)
        self._on_orphaned, self._leaving = on_orphaned, threading.Lock()
        threading.Thread(target=self._leave_with_parent, daemon=True).start()

    def send(self, content: object) -> None:
        """Send one message; raises what `pickle` raises."""
        frame = to_frame(content)
        try:
            write_frame(self._answers, frame)
        except OSError:  # the parent has closed its end
            self.leave()

    def receive(self) -> Any:
        """The next message; raises `EOFError` if there are no more."""
        return read_frame(self._requests)

    def __iter__(self) -> Iterator[Any]:
        """All messages, as they come."""
        while True:
            try:
                yield self.receive()
            except EOFError:
                return

    def leave(self) -> None:
        """End this process because its parent has ended."""
        self._leaving.acquire()
        self._on_orphaned()
        os._exit(1)

    def _leave_with_parent(self) -> None:
        while os.getppid() == parent_id:
            time.sleep(_POLL)
        self.leave()
