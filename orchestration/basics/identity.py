"""What follows from objects that many have in common is found once."""

from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Found = TypeVar("Found")
MOST = 256
"""Findings that are kept"""


class OfSame(Generic[Found]):
    """What a function says of objects, kept for as long as they are the same ones: runs of a study share most parts.

    Objects are told by what they are, not by what they hold: they have no hash, and comparing them takes as long. They
    are held, so they should be small.
    """

    def __init__(self, find: Callable[..., Found]) -> None:
        self._find = find
        self._known: dict[Hashable, tuple[tuple[Any, ...], Found]] = {}

    def __call__(self, *objects: Any) -> Found:
        """What the function says of them."""
        key = tuple(map(id, objects))  # of no others, for those that are known are held
        if key not in self._known:
            if len(self._known) >= MOST:
                self._known.clear()
            self._known[key] = objects, self._find(*objects)
        return self._known[key][1]
