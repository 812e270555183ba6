"""What a source does in a run: sets inputs of one component whenever that component is stepped."""

from collections.abc import Sequence

from orchestration.basics.simulator import Floats, Transfer
from orchestration.engines.sources import Values


class Feed:
    """A source at work on some inputs of one component: those of its values that are at `places`."""

    def __init__(
        self, component: str, values: Values, places: Sequence[int], into: Floats, transfer: Transfer, *, count: int
    ) -> None:
        self.component, self.into, self.transfer = component, into, transfer
        """whose inputs they are, where their values lie, and what sets them"""
        self.size = len(places)
        self._at, self._values = values.at, values
        self._places = None if len(places) == count else list(places)

    def feeds(self, component: str) -> bool:
        """Whether it sets inputs of this component."""
        return component == self.component

    def write(self, t: float) -> None:
        """Set the inputs to the values at `t` [s]."""
        found = self._at(t)
        self.into[:] = found if self._places is None else [found[i] for i in self._places]
        self.transfer()

    def each(self, t: Floats) -> Floats:
        """To the bit what `write` sets at times `t` [s], shape (n,): an array of shape (n, number of inputs)."""
        found = self._values.each(t)
        return found if self._places is None else found[:, self._places]
