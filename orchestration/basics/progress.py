"""Who hears how far a study is: a bar, a function, or nobody."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Literal, TypeAlias, TypeVar

from orchestration.basics.terminal import Count, Share, progress_bar, runs_bar

Heard = TypeVar("Heard")
ShareHeard: TypeAlias = Share | Literal["bar"] | None
"""`bar`: one on a terminal, elsewhere and in notebooks a line now and then; a function: hears the share that is done"""
CountHeard: TypeAlias = Count | Literal["bar"] | None
"""Likewise, but a function hears how many of how many runs are done"""


def of_share(progress: ShareHeard, what: str) -> AbstractContextManager[Share]:
    """What is to be told the share of the work that is done."""
    return _heard(progress, lambda: progress_bar(what), lambda share: None)


def of_runs(progress: CountHeard) -> AbstractContextManager[Count]:
    """What is to be told how many of how many runs are done."""
    return _heard(progress, runs_bar, lambda done, total: None)


def _heard(
    progress: Heard | Literal["bar"] | None, bar: Callable[[], AbstractContextManager[Heard]], nobody: Heard
) -> AbstractContextManager[Heard]:
    if isinstance(progress, str):
        return bar()
    return nullcontext(nobody if progress is None else progress)
