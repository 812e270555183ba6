"""A system at work in one run: its components, connections and sources with their values, and how far they are.

What begins, passes through instants and ends a run shares it: `master.py`, `instants.py` and `compiled.py`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.basics.errors import SimulatorError, StoppedStepError
from orchestration.basics.simulator import Floats, Simulator, Transfer
from orchestration.engines.board import Board
from orchestration.engines.channel import Channel
from orchestration.engines.feeds import Feed
from orchestration.engines.sources import Values
from orchestration.engines.watch import Watch
from orchestration.engines.wires import Wires
from orchestration.schedule.cursor import Cursor
from orchestration.schedule.schedule import Schedule
from orchestration.schedule.streams import NOISE, Streams
from orchestration.schedule.timetable import Timetable
from orchestration.system.model import System
from orchestration.system.variable_names import variable_of

Sources = Sequence[tuple[Sequence[str], Values]]
"""Signals, and what they are"""


class Diverged(Exception):
    """The loop has left the region that counts as running."""


class Terminated(Exception):
    """An FMU has ended the run."""


@dataclass(kw_only=True)
class _Working:
    """A component at work."""

    step: Callable[[float, float], None]
    read: Transfer
    outputs: Floats
    """connected ones, in the row"""
    names: tuple[str, ...]
    """of those"""
    feeds: list[Feed]
    held: list[Channel]
    """into it, with a first-order hold"""

    def expect_finite(self, t: float) -> None:
        """Raise `Diverged` for an output that is not finite, before it is passed on."""
        outputs = self.outputs.tolist()
        if not math.isfinite(sum(outputs)):
            for name, value in zip(self.names, outputs):
                if not math.isfinite(value):
                    raise Diverged(f"{name} = {value} at t = {t:g} s, expected a finite value")


@dataclass(kw_only=True)
class SampledComponent(_Working):
    """A sampled component at work."""

    ratio: float
    by_itself: bool
    """whether it has a clock of its own and is stepped at every instant"""


@dataclass(kw_only=True)
class ContinuousComponent(_Working):
    """A component in continuous time at work."""

    ahead: list[Channel]
    """wires from components that are stepped before it: their new values"""
    behind: list[Channel]
    """wires from others: their values where its step begins"""
    now: int = 0


class AtWork:
    """A system whose components are instantiated and have their parameters."""

    def __init__(
        self,
        system: System,
        simulators: Mapping[str, Simulator],
        *,
        timetable: Timetable,
        streams: Streams,
        recorded: Mapping[str, Sequence[str]],
        sources: Sources,
        feeds: Sequence[Feed],
        interrupted: Callable[[], bool],
        watch: Callable[[Board], Watch] | None,
    ) -> None:
        self.system, self.simulators, self.stop = system, simulators, timetable.stop
        self.wires = wires = Wires(system, recorded)
        self.board = board = wires.board
        self.sources, self.feeds = list(sources), list(feeds)
        self.columns = (*board.columns, *(signal for signals, _ in sources for signal in signals))
        """of every row: those of the board, then the signals of the sources"""
        self.cursor = Cursor(timetable)
        self.interrupted = interrupted
        self.interrupted_at: int | None = None
        self.termination: str | None = None
        self.steps = 0
        self.now = 0
        names = wires.names
        self.channels = [self._channel(i, streams) for i in range(len(system.connections))]
        self.readers = {name: simulators[name].reader(board.outputs[name], self.outputs(name)) for name in names}
        self.continuous = {index: self._continuous(names[index]) for index in wires.continuous}
        self.sampled = {index: self._sampled(names[index]) for index in wires.sampled}
        self.settles = any(x.held or x.behind or x.feeds for x in self.continuous.values())
        self.some_by_themselves = any(x.by_itself for x in self.sampled.values())
        self._watch = watch(board) if watch is not None else lambda t: None

    def outputs(self, name: str) -> Floats:
        """What is read of a component, in the row."""
        return self.board.of([f"{name}.{output}" for output in self.board.outputs[name]])

    def component(self, index: int) -> SampledComponent | ContinuousComponent:
        """A component by its index."""
        return self.continuous[index] if index in self.continuous else self.sampled[index]

    def look(self, t: float) -> None:
        """Raise `Diverged` if the values of the row at t [s] have."""
        complaint = self._watch(t)
        if complaint is not None:
            raise Diverged(complaint)

    def stopped(self, error: SimulatorError, until: int) -> None:
        """A step to `until` [ns] was not simply done: raise what that is, unless it was whole and ends the run.

        Then the instant is gone through, and is the last one. So is that of a discarded step at the end of the run.
        """
        if not isinstance(error, StoppedStepError) or not (error.ends or until == self.stop):
            raise error
        if not error.whole:
            raise Terminated(str(error))
        self.termination = self.termination or str(error)

    def pass_over(self, schedule: Schedule) -> None:
        """These instants are past, and what follows from them alone is as if the run had gone through them."""
        self.now = int(schedule.times[-2])
        reached = np.repeat(schedule.times[:-1], np.diff(schedule.stepped_at))
        self.steps += int(np.count_nonzero(reached))  # nobody steps to the start
        for index, component in self.continuous.items():
            component.now = max(component.now, int(reached[schedule.stepped == index].max(initial=0)))
        for index, channel in enumerate(self.channels):
            taken, _ = schedule.of(index, self.wires.table(index))
            channel.skip(taken)

    # -- how it is made ------------------------------------------------------------------------------------------

    def _channel(self, index: int, streams: Streams) -> Channel:
        x = self.system.connections[index]
        inputs = [variable_of(end) for end in x.end]
        sampled = self.system.components[x.receiver].sampling is not None
        received: Floats = np.zeros(len(inputs)) if sampled else self.board.of(x.end)
        return Channel(
            x,
            row=self.board.row,
            places=self.board.places(x.start),
            received=received,
            write=self.simulators[x.receiver].writer(inputs, received),
            noise=streams.of(f"connections.{x.name}", NOISE),
        )

    def _continuous(self, name: str) -> ContinuousComponent:
        into = self.wires.into(name)
        return ContinuousComponent(
            **self._working(name),
            ahead=[self.channels[i] for i in into.ahead],
            behind=[self.channels[i] for i in into.behind],
        )

    def _sampled(self, name: str) -> SampledComponent:
        sampling = self.system.components[name].sampling
        assert sampling is not None
        return SampledComponent(
            **self._working(name), ratio=sampling.clock_ratio, by_itself=self.wires.is_by_itself(name)
        )

    def _working(self, name: str) -> dict[str, Any]:
        names = self.wires.connected(name)
        return {
            "step": self.simulators[name].step,
            "read": self.readers[name],
            "outputs": self.outputs(name)[: len(names)],
            "names": names,
            "feeds": [feed for feed in self.feeds if feed.feeds(name)],
            "held": [self.channels[i] for i in self.wires.into(name).held],
        }
