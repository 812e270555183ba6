"""A connection during a run: passes values from sender to receiver, with noise, quantisation, and a hold."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.systems.system.connection import Connection

Indices: TypeAlias = npt.NDArray[np.intp]


class Channel:
    """One connection of a run: takes values from the board, and sets the receiver's inputs."""

    def __init__(
        self,
        connection: Connection,
        *,
        row: Floats,
        places: slice | Indices,
        received: Floats,
        write: Transfer,
        noise: np.random.Generator,
    ) -> None:
        self.received = received
        """the values that the receiver has, in place"""
        self._row, self._places = row, places
        self.write = write
        """sets the receiver's inputs"""
        self._sigma = of_each(connection, connection.noise)
        self._quantum = of_each(connection, connection.quantisation)
        self._noisy = bool(self._sigma.any())
        self._rounded = np.flatnonzero(self._quantum)
        self._quantum = self._quantum[self._rounded]
        self._rounds = len(self._rounded) > 0
        self._noise: Floats = np.zeros(len(connection.start))
        self.stream = noise
        """Stream of the noise"""
        self._scale, self._offset = connection.scale, connection.offset
        self._plain = not connection.converts
        self._extrapolates = connection.hold == "first"
        self.in_flight: dict[int, Floats] = {}
        """messages on their way"""
        self.applied: list[tuple[int, Floats]] = []
        """the last two values of a first-order hold, with their times [ns]"""
        self._received, self._sent = received.data, None
        if isinstance(places, slice) and self._plain and not (self._noisy or self._rounds or self._extrapolates):
            self._sent = row[places].data  # a view of what is sent, which arrives unchanged

    def pass_on(self) -> None:
        """Pass the current values of the sender on to the receiver: at initialisation, and over a plain wire."""
        self.received[:] = self._row[self._places]
        if not self._plain:
            self._convert(self.received)
        self.write()

    def start(self) -> None:
        """Take the value of initialisation as the first that was applied."""
        self.applied = [(0, self.received.copy())]

    def take(self) -> Floats:
        """A message with the current values of the sender."""
        value: Floats = self._row[self._places].copy()
        if self._noisy:
            self.skip()
            self._noise *= self._sigma
            value += self._noise
        if self._rounds:
            multiples = value[self._rounded] / self._quantum
            np.rint(multiples, out=multiples)
            value[self._rounded] = multiples * self._quantum
        if not self._plain:
            self._convert(value)
        return value

    def hand_over(self, time: int, *, lost: bool) -> None:
        """Send a message that, unless it is lost, arrives at the time at which it is sent [ns]."""
        if lost:
            self.skip()
        elif self._sent is not None:
            self._received[:] = self._sent
            self.write()
        else:
            self.apply(self.take(), time)

    def skip(self, messages: int = 1) -> None:
        """Draw the noise of lost messages too, so that losses do not shift the random numbers of other messages."""
        if self._noisy:
            for _ in range(messages):
                self.stream.standard_normal(out=self._noise)

    def send(self, k: int, *, lost: bool) -> None:
        """Keep message `k` until it arrives."""
        if lost:
            self.skip()
        else:
            self.in_flight[k] = self.take()

    def deliver(self, k: int, time: int) -> None:
        """Deliver message `k` at `time` [ns]."""
        self.apply(self.in_flight.pop(k), time)

    def apply(self, value: Floats, time: int) -> None:
        """Set the receiver's inputs; of several messages at one time the last one counts."""
        if self._extrapolates:
            before = [past for past in self.applied if past[0] < time]
            self.applied = [*before[-1:], (time, value)]
        self.received[:] = value
        self.write()

    def extrapolate(self, time: int) -> None:
        """First-order hold: the line through the last two values that arrived, held over the receiver's next step."""
        if len(self.applied) < 2:
            return
        (t0, before), (t1, last) = self.applied
        if t0 == t1 or time == t1:
            return
        share = (time - t1) / (t1 - t0)
        self.received[:] = last + share * (last - before)
        self.write()

    def held(self) -> list[Floats]:
        """The values that determine later ones, in place: received, in flight, and of the hold."""
        past = [value for _, value in self.applied] if self._extrapolates else []
        return [self.received, *self.in_flight.values(), *past]

    def state(self) -> dict[str, Any]:
        """The state in JSON types, without that of the noise."""
        return {
            "received": self.received.tolist(),
            "in_flight": [(k, value.tolist()) for k, value in self.in_flight.items()],
            "applied": [(time, value.tolist()) for time, value in self.applied],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue where `state` was taken."""
        self.received[:] = state["received"]
        self.in_flight = {k: np.array(value) for k, value in state["in_flight"]}
        self.applied = [(time, np.array(value)) for time, value in state["applied"]]

    def _convert(self, value: Floats) -> None:
        value *= self._scale
        value += self._offset


def of_each(connection: Connection, values: Mapping[str, float]) -> Floats:
    """One value for each variable of a message, 0 by default; the name of a vector applies to all its components."""
    result = np.zeros(len(connection.start))
    for name, value in values.items():
        result[connection.places(name)] = value
    return result
