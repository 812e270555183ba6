"""What the commands say beside their results, on standard error."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Share = Callable[[float], None]
"""Hears the share of the work that is done."""
Count = Callable[[int, int], None]
"""Hears how many of how many runs are done."""

SPARSE = 10.0
"""[s] between two lines about work that goes on, where no bar can be drawn"""


def say(text: str) -> None:
    """One line."""
    print(text, file=sys.stderr, flush=True)


@contextmanager
def progress_bar(what: str) -> Iterator[Share]:
    """A bar while the work goes on, on a terminal that can draw it; else a line now and then."""
    if not _draws():
        tell = _now_and_then()
        yield lambda share: tell(f"{what}: {share:.0%}")
        return
    from rich.progress import Progress

    with Progress(console=_console(), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def runs_bar() -> Iterator[Count]:
    """A bar with rate and time left, on a terminal that can draw it; else a line now and then."""
    if not _draws():
        tell = _now_and_then()
        yield lambda done, total: tell(f"{done} of {total} runs")
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


def _now_and_then() -> Callable[[str], None]:
    """Says what it is told, but not within `SPARSE` seconds of the start or of what it said before."""
    last = time.monotonic()

    def tell(text: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= SPARSE:
            last = now
            say(text)

    return tell


def _draws() -> bool:
    """Whether standard error is a terminal on which lines can be drawn over; without colours is no hindrance."""
    return sys.stderr.isatty() and os.environ.get("TERM", "").lower() not in ("dumb", "unknown")


def _console() -> Any:
    from rich.console import Console

    return Console(stderr=True)
