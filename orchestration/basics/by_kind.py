"""Tables into which a room above enters what is known of one kind of request, loaded when it is asked for."""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Known = TypeVar("Known")


class ByKind(Generic[Known]):
    """What is known, by kind of request; a kind that nobody has entered has none."""

    def __init__(self) -> None:
        self._entered: dict[str, Callable[[], Known]] = {}

    def enter(self, kind: str, load: Callable[[], Known]) -> None:
        """From now on what `load` gives is known of a kind."""
        self._entered[kind] = load

    def of(self, kind: str) -> Known | None:
        """What is known of a kind; None for one of which nothing is."""
        load = self._entered.get(kind)
        return None if load is None else load()

    def all(self) -> Iterator[Known]:
        """Of every kind, in the order in which they were entered."""
        for load in self._entered.values():
            yield load()
