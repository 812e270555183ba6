"""What a source does in a run: sets inputs of one component whenever that component is stepped."""

from collections.abc import Callable, Sequence

from orchestration.simulator import Floats, Transfer


class Feed:
    """A source at work on some inputs of one component."""

    def __init__(self, component: str, at: Callable[[float], Sequence[float]], into: Floats, write: Transfer) -> None:
        self._component, self._at, self._into, self._write = component, at, into, write

    def feeds(self, component: str) -> bool:
        """Whether it sets inputs of this component."""
        return component == self._component

    def write(self, t: float) -> None:
        """Set the inputs to the values at `t` [s]."""
        self._into[:] = self._at(t)
        self._write()
