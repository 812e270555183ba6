"""What is known of a process that this one has started."""

from typing import IO, Protocol


class Process(Protocol):
    """A `subprocess.Popen`, as far as it is used here."""

    pid: int
    stdin: IO[bytes] | None
    stdout: IO[bytes] | None
    stderr: IO[bytes] | None

    def poll(self) -> int | None:
        """Its exit code; None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, when it has ended; raises `subprocess.TimeoutExpired` after `timeout` [s]."""

    def send_signal(self, sig: int) -> None:
        """Send it a signal, unless it has ended."""
