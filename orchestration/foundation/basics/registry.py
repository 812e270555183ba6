"""Registries of what higher packages know about a kind of request, loaded on first use."""

from collections.abc import Iterator
from pkgutil import resolve_name
from typing import Any, Generic, TypeVar

Entry = TypeVar("Entry")


class Registry(Generic[Entry]):
    """Entries by kind of request."""

    def __init__(self) -> None:
        self._places: dict[str, str] = {}

    def register(self, kind: str, place: str) -> None:
        """Make what is at `place`, as `package.module:name`, the entry of a kind."""
        self._places[kind] = place

    def __contains__(self, kind: str) -> bool:
        """Whether a kind has an entry, without loading it."""
        return kind in self._places

    def of(self, kind: str) -> Entry | None:
        """The entry of a kind; None if it has none."""
        found: Any = resolve_name(self._places[kind]) if kind in self._places else None
        return found  # type: ignore[no-any-return]

    def all(self) -> Iterator[Entry]:
        """All entries, in the order of registration."""
        return map(resolve_name, self._places.values())
