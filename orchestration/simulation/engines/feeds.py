"""The feed of a source in a run: sets inputs of one component whenever that component is stepped."""

from collections.abc import Sequence

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.simulation.engines.sources import SourceValues


class Feed:
    """A source that sets some inputs of one component, to those of its values that are at `places`."""

    def __init__(
        self,
        component: str,
        values: SourceValues,
        places: Sequence[int],
        into: Floats,
        transfer: Transfer,
        *,
        count: int,
    ) -> None:
        self.component, self.into, self.transfer = component, into, transfer
        """the component, the array of the inputs, and the call that sets them"""
        self.size = len(places)
        self._at, self._values = values.at, values
        self._places = None if len(places) == count else list(places)

    def feeds(self, component: str) -> bool:
        """Whether it sets inputs of this component."""
        return component == self.component

    def write(self, t: float) -> None:
        """Set the inputs to the values at `t` [s]."""
        values = self._at(t)
        self.into[:] = values if self._places is None else [values[i] for i in self._places]
        self.transfer()

    def at_each(self, t: Floats) -> Floats:
        """The values that `write` sets at times `t` [s], shape (n,), to the bit; shape (n, number of inputs)."""
        values = self._values.at_each(t)
        return values if self._places is None else values[:, self._places]
