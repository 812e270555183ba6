"""Where the progress of a study is reported: to a bar, to a function, or nowhere."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Literal, TypeAlias, TypeVar

from orchestration.foundation.basics.terminal import Count, Share, progress_bar, runs_bar

Reporter = TypeVar("Reporter")
ShareProgress: TypeAlias = Share | Literal["bar"] | None
"""`bar`: a bar on a terminal, occasional lines elsewhere and in notebooks; a function: called with the share done"""
CountProgress: TypeAlias = Count | Literal["bar"] | None
"""Likewise, but a function is called with the number of runs done and the total"""


def share_reporter(progress: ShareProgress, what: str) -> AbstractContextManager[Share]:
    """The function to call with the share of the work done."""
    return _reporter(progress, lambda: progress_bar(what), lambda share: None)


def runs_reporter(progress: CountProgress) -> AbstractContextManager[Count]:
    """The function to call with the number of runs done and the total."""
    return _reporter(progress, runs_bar, lambda done, total: None)


def _reporter(
    progress: Reporter | Literal["bar"] | None, bar: Callable[[], AbstractContextManager[Reporter]], silent: Reporter
) -> AbstractContextManager[Reporter]:
    if isinstance(progress, str):
        return bar()
    return nullcontext(silent if progress is None else progress)
