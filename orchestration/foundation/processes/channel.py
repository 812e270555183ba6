"""Messages between a process and its parent, over the child's standard streams.

A process that was started trusts the one that started it, whose messages are pickled. What comes back is typed: foreign
code in that process can write into its streams whatever it likes. Once it has been asked something, its messages begin
with a secret that came with the question, so that what such code writes is not taken for an answer.
"""

import contextlib
import os
import pickle
import select
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from io import BufferedReader
from typing import IO, Any, NoReturn, cast

from orchestration.foundation.processes.typed_frames import FrameError, pack, unpack

_HEADER = struct.Struct("<Q")
_BLOCK = 2**20
"""Most bytes that are read at once: memory grows with what has come, not with what is announced"""
STALL = 60.0
"""Time without a further byte after which a frame that has begun is given up [s]"""
_POLL = 0.5
"""Time between two checks whether the parent lives [s]"""


parent_id = os.getppid()
"""The process that started this one, or the server that forked it: it may end before this one looks"""


class LongError(FrameError):
    """A frame is longer than allowed."""


def to_frame(content: object, secret: bytes) -> bytes:
    """`content`, and the secret of its answers, as a frame for a process that trusts this one.

    Raises what `pickle` raises.
    """
    return _framed(pickle.dumps((secret, content), pickle.HIGHEST_PROTOCOL))


def write_frame(stream: IO[bytes], frame: bytes) -> None:
    """Write a frame; raises `OSError` if the other end is closed, `ValueError` if the stream is."""
    stream.write(frame)
    stream.flush()


def read_frame(stream: IO[bytes], limit: float, secret: bytes) -> Any:
    """The content of the next typed frame; raises `EOFError` if there is none, `FrameError` if it is not one.

    Raises `LongError`, before it is read, if it has more than `limit` bytes. One without the secret is none.
    """
    buffered = cast(BufferedReader, stream)
    (length,) = _HEADER.unpack(_exactly(buffered, _HEADER.size, has_begun=False))
    if length > limit:
        raise LongError
    content = memoryview(_exactly(buffered, length, has_begun=True))
    if content[: len(secret)] != secret:
        raise FrameError("expected the secret of its question")
    return unpack(content[len(secret) :])


def _framed(data: bytes, secret: bytes = b"") -> bytes:
    return _HEADER.pack(len(secret) + len(data)) + secret + data


def _exactly(stream: BufferedReader, count: int, *, has_begun: bool) -> bytes:
    """So many bytes, of a frame that has begun or may begin at any time; none are read into a buffer before."""
    content = bytearray()
    while len(content) < count:
        if (has_begun or content) and not _comes(stream):
            raise FrameError("it ends in the middle")
        block = stream.read1(min(count - len(content), _BLOCK))
        if not block:
            raise EOFError
        content += block
    return bytes(content)


def _comes(stream: BufferedReader) -> bool:
    """Whether something can be read, within `STALL`."""
    if sys.platform == "win32":  # pipes cannot be polled there
        return True
    poll = select.poll()
    poll.register(stream, select.POLLIN)
    return bool(poll.poll(1000.0 * STALL))


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
        self._on_orphaned, self._leaving, self._secret = on_orphaned, threading.Lock(), b""
        threading.Thread(target=self._leave_with_parent, daemon=True).start()

    def send(self, content: object) -> None:
        """Send one message; raises `TypeError` for what is no data."""
        frame = _framed(pack(content), self._secret)
        try:
            write_frame(self._answers, frame)
        except OSError:  # the parent has closed its end
            self.leave()

    def receive(self) -> Any:
        """The next message; this process ends if there is none: its parent has ended, or needs it no more."""
        for message in self:
            return message
        self.leave()

    def __iter__(self) -> Iterator[Any]:
        """All messages, as they come."""
        with contextlib.suppress(EOFError, struct.error, pickle.UnpicklingError):  # the last one may not be whole
            while True:
                (length,) = _HEADER.unpack(self._requests.read(_HEADER.size))
                self._secret, message = pickle.loads(self._requests.read(length))
                yield message

    def leave(self) -> NoReturn:
        """End this process because its parent has ended."""
        self._leaving.acquire()
        self._on_orphaned()
        os._exit(1)

    def _leave_with_parent(self) -> None:
        while os.getppid() == parent_id:
            time.sleep(_POLL)
        self.leave()
