"""Registries of what higher packages know about a kind of request, loaded on first use."""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Entry = TypeVar("Entry")


class Registry(Generic[Entry]):
    """Entries by kind of request."""

    def __init__(self) -> None:
        self._loaders: dict[str, Callable[[], Entry]] = {}

    def register(self, kind: str, load: Callable[[], Entry]) -> None:
        """Make the result of `load` the entry of a kind."""
        self._loaders[kind] = load

    def __contains__(self, kind: str) -> bool:
        """Whether a kind has an entry, without loading it."""
        return kind in self._loaders

    def of(self, kind: str) -> Entry | None:
        """The entry of a kind; None if it has none."""
        load = self._loaders.get(kind)
        return None if load is None else load()

    def all(self) -> Iterator[Entry]:
        """All entries, in the order of registration."""
        for load in self._loaders.values():
            yield load()
