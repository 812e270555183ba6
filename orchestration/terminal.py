"""What the commands say beside their results, on standard error."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Share = Callable[[float], None]
"""Hears the share of the work that is done."""
Count = Callable[[int, int], None]
"""Hears how many of how many runs are done."""


def say(text: str) -> None:
    """One line."""
    print(text, file=sys.stderr)


@contextmanager
def progress_bar(what: str) -> Iterator[Share | None]:
    """A bar while the work goes on, on a terminal; else nothing."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def runs_bar() -> Iterator[Count]:
    """A bar with rate and time left, on a terminal; else a line now and then."""
    started = time.monotonic()
    if not sys.stderr.isatty():
        last = [started]

        def tell(done: int, total: int) -> None:
            if time.monotonic() - last[0] > 10.0:
                last[0] = time.monotonic()
                say(f"{done} of {total} runs")

        yield tell
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("runs", total=None, rate="")
        first: list[int] = []

        def update(done: int, total: int) -> None:
            first[:] = first or [done]
            rate = (done - first[0]) / max(time.monotonic() - started, 1e-9)
            bar.update(task, completed=done, total=total, rate=f"{rate:.1f} runs/s")

        yield update
