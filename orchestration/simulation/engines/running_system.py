"""The state of a system during one run: its components, connections and sources with their values and times.

It is shared by the master (`master.py`) and the loops (`instants.py`, `compiled.py`).
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.foundation.basics.errors import SimulatorError, StoppedStepError
from orchestration.foundation.basics.simulator import Floats, Simulator, Transfer
from orchestration.foundation.basics.times import seconds
from orchestration.simulation.engines.algebraic_loops import closing_of
from orchestration.simulation.engines.condition import NEVER, Condition
from orchestration.simulation.engines.initial import Dependencies
from orchestration.simulation.engines.sources import Feed, SourceValues
from orchestration.simulation.engines.wiring_by_index import Channel, Wires
from orchestration.systems.schedule.instant_arrays import Cursor, Schedule
from orchestration.systems.schedule.streams import NOISE, Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.connection import variable_of
from orchestration.systems.system.model import System

Sources = Sequence[tuple[Sequence[str], SourceValues]]
"""Signals of each source, and their values"""


class Diverged(Exception):
    """The condition of divergence of the system holds, or a value is not finite."""


class Terminated(Exception):
    """An FMU has ended the run."""


@dataclass(kw_only=True)
class _RunningComponent:
    """A component during a run."""

    step: Callable[[float, float], None]
    read: Transfer
    outputs: Floats
    """the connected ones, in the row"""
    names: tuple[str, ...]
    """Names of those"""
    feeds: list[Feed]
    held: list[Channel]
    """Channels into it with a first-order hold"""

    def expect_finite(self, t: float) -> None:
        """Raise `Diverged` for an output that is not finite, before it is passed on."""
        outputs = self.outputs.ravel().tolist()
        if not math.isfinite(sum(outputs)):
            for name, value in zip(self.names, outputs):  # of many runs the first may be finite
                if not math.isfinite(value):
                    raise Diverged(f"{name} = {value} at t = {t:g} s, expected a finite value")


@dataclass(kw_only=True)
class SampledComponent(_RunningComponent):
    """A sampled component during a run."""

    ratio: float
    by_itself: bool
    """whether it has its own clock and is stepped at every instant"""


@dataclass(kw_only=True)
class ContinuousComponent(_RunningComponent):
    """A component in continuous time during a run."""

    ahead: list[Channel]
    """wires from components that are stepped before it, which carry their new values"""
    behind: list[Channel]
    """wires from other components, which carry the values at the beginning of its step"""
    now: int = 0


class RunningSystem:
    """A system whose components are instantiated and have their parameters."""

    def __init__(
        self,
        system: System,
        simulators: Mapping[str, Simulator],
        *,
        timetable: Timetable,
        streams: Streams,
        recorded: Mapping[str, Sequence[str]],
        sources: Sources = (),
        feeds: Sequence[Feed] = (),
        interrupted: Callable[[], bool] = lambda: False,
        condition: Condition = NEVER,
        at_once: Dependencies = lambda component, output: (),
        runs: tuple[int, ...] = (),
    ) -> None:
        """`at_once`: the inputs that an output of a component follows before its next step.

        `runs` is the shape of runs that simulators of arrays, shape (n, *runs), carry out together.
        """
        self.system, self.simulators, self.stop = system, simulators, timetable.stop
        self.wires = wires = Wires(system, recorded, runs)
        self.closing = closing_of(wires, at_once)
        self.board = board = wires.board
        self.sources, self.feeds = list(sources), list(feeds)
        self.columns = (*board.columns, *(signal for signals, _ in sources for signal in signals))
        """Columns of every row: those of the board, then the signals of the sources"""
        self.cursor, self.first_samples = Cursor(timetable), timetable.first_samples
        self.interrupted = interrupted
        self.pace: Pace | None = None
        """Pace that the loop keeps; None: as fast as it can"""
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
        self.condition, self._watch = condition, condition.watch(board)

    def outputs(self, name: str) -> Floats:
        """The outputs of a component that are read, in the row."""
        return self.board.of([f"{name}.{output}" for output in self.board.outputs[name]])

    def component(self, index: int) -> SampledComponent | ContinuousComponent:
        """A component by its index."""
        return self.continuous[index] if index in self.continuous else self.sampled[index]

    def check_divergence(self, t: float) -> None:
        """Raise `Diverged` if the values of the row at t [s] have diverged."""
        divergence = self._watch(t)
        if divergence is not None:
            raise Diverged(divergence)

    def handle_failed_step(self, error: SimulatorError, until: int) -> None:
        """Raise the error of a step to `until` [ns], unless the step was completed and ends the run.

        Then the instant is processed, and is the last one. The same holds for a discarded step at the end of the run.
        """
        if not isinstance(error, StoppedStepError) or not (error.ends or until == self.stop):
            raise error
        if not error.whole:
            raise Terminated(str(error))
        self.termination = self.termination or str(error)

    def skip(self, schedule: Schedule) -> None:
        """Move past these instants, with the state of times, counts and noise that they lead to."""
        self.now = int(schedule.times[-2])
        reached = np.repeat(schedule.times[:-1], np.diff(schedule.stepped_at))
        self.steps += int(np.count_nonzero(reached))  # no step ends at time 0
        for index, component in self.continuous.items():
            component.now = max(component.now, int(reached[schedule.stepped == index].max(initial=0)))
        for index, channel in enumerate(self.channels):
            taken, _ = schedule.of(index, self.wires.table(index))
            channel.skip(taken)

    # -- construction --------------------------------------------------------------------------------------------

    def _channel(self, index: int, streams: Streams) -> Channel:
        x = self.system.connections[index]
        inputs = [variable_of(end) for end in x.end]
        sampled = self.system.components[x.receiver].sampling is not None
        received: Floats = np.zeros((len(inputs), *self.board.row.shape[1:])) if sampled else self.board.of(x.end)
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
            **self._running_component(name),
            ahead=[self.channels[i] for i in into.ahead],
            behind=[self.channels[i] for i in into.behind],
        )

    def _sampled(self, name: str) -> SampledComponent:
        sampling = self.system.components[name].sampling
        assert sampling is not None
        return SampledComponent(
            **self._running_component(name), ratio=sampling.clock_ratio, by_itself=self.wires.is_by_itself(name)
        )

    def _running_component(self, name: str) -> dict[str, Any]:
        names = self.wires.connected(name)
        return {
            "step": self.simulators[name].step,
            "read": self.readers[name],
            "outputs": self.outputs(name)[: len(names)],
            "names": names,
            "feeds": [feed for feed in self.feeds if feed.feeds(name)],
            "held": [self.channels[i] for i in self.wires.into(name).held],
        }


LONGEST_SLEEP = 0.1
"""The longest time between two looks for an interruption [s]"""


class Pace:
    """Waits for instants; times of the run pass `rate` times as fast as those of the clock, from its start."""

    def __init__(
        self,
        rate: float,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._rate, self._now, self._sleep = rate, now, sleep
        self._begin: float | None = None
        self.largest_lateness = 0.0
        """The longest time by which an instant began too late [s]"""

    def wait(self, instant: int, interrupted: Callable[[], bool]) -> None:
        """Return at the time of an instant [ns], or at once if that is over, or after an interruption."""
        due = seconds(instant) / self._rate
        if self._begin is None:
            self._begin = self._now() - due
        while (left := self._begin + due - self._now()) > 0.0 and not interrupted():
            self._sleep(min(left, LONGEST_SLEEP))
        self.largest_lateness = max(self.largest_lateness, -left)
