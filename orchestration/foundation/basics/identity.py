"""A cache of function results by the identity of the arguments."""

from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")
MAX_CACHED = 256
"""Largest number of cached results"""


class IdentityCache(Generic[Result]):
    """A function with its results cached by the identity of its arguments: runs of a study share most parts.

    Arguments are compared by identity, not by content: they have no hash, and comparing them takes as long as the
    function. The cache keeps them alive, so they should be small.
    """

    def __init__(self, function: Callable[..., Result]) -> None:
        self._function = function
        self._cached: dict[Hashable, tuple[tuple[Any, ...], Result]] = {}

    def __call__(self, *objects: Any) -> Result:
        """The result of the function for these objects."""
        key = tuple(map(id, objects))  # ids stay unique: the cache keeps its arguments alive
        if key not in self._cached:
            if len(self._cached) >= MAX_CACHED:
                self._cached.clear()
            self._cached[key] = objects, self._function(*objects)
        return self._cached[key][1]
