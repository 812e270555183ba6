"""The master of one run: begins it, has a loop pass through its instants, pauses it, and says how it has ended."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from orchestration.basics.errors import SimulatorError
from orchestration.basics.simulator import Booleans, Floats, Simulator
from orchestration.engines import initial
from orchestration.engines.at_work import AtWork, Diverged, Sources, Terminated
from orchestration.engines.backlog import Backlog
from orchestration.engines.board import Board
from orchestration.engines.channel import Channel
from orchestration.engines.feeds import Feed
from orchestration.engines.instants import PythonLoop
from orchestration.engines.watch import Watch
from orchestration.engines.wires import clock_of
from orchestration.recording.recording import Chunk, Recorder
from orchestration.schedule.streams import Streams
from orchestration.schedule.timetable import Timetable
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS

ROWS_PENDING = "rows"
"""Beside the names of the components in `Master.saved`"""


class Loop(Protocol):
    """Passes through the instants of a run."""

    @property
    def engine(self) -> str:
        """By what it does."""

    @property
    def backlog(self) -> Backlog:
        """What is recorded and not handed over."""

    def run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        """Go on to the end, an interruption, or the first instant from `pause_at` [ns]; whether the run is over.

        Raises `Diverged`, `Terminated` or `SimulatorError` for what ends it before.
        """


class Master:
    """One run of a system whose components are instantiated and have their parameters."""

    def __init__(
        self,
        system: System,
        simulators: Mapping[str, Simulator],
        *,
        timetable: Timetable,
        streams: Streams,
        recorded: Mapping[str, Sequence[str]],
        recorder: Recorder,
        sources: Sources = (),
        feeds: Sequence[Feed] = (),
        interrupted: Callable[[], bool] = lambda: False,
        watch: Callable[[Board], Watch] | None = None,
        first_exchange: Sequence[Sequence[int]] | None = None,
        waiting: Collection[str] = (),
        loop: Callable[[AtWork, Recorder], Loop] = PythonLoop,
    ) -> None:
        """`waiting` are components that begin at 0 and are stepped to their first sample without one.

        Other sampled components, unless they have a clock of their own, begin at their first sample.
        """
        self._work = work = AtWork(
            system, simulators, timetable=timetable, streams=streams, recorded=recorded, sources=sources, feeds=feeds,
            interrupted=interrupted, watch=watch,
        )  # fmt: skip
        self.board, self.columns, self.recorder = work.board, work.columns, recorder
        self.divergence: str | None = None
        self.divergence_time: int | None = None
        self._first_exchange = [(i,) for i in range(len(work.channels))] if first_exchange is None else first_exchange
        self._first_samples, self._waiting = timetable.first_samples, waiting
        self._loop = loop(work, recorder)
        self.backlog = self._loop.backlog
        self.engine = self._loop.engine
        """By what it passes through instants"""

    # -- where it is ---------------------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        """The instant that it has reached [ns]."""
        return self._work.now

    @property
    def steps(self) -> int:
        """Of all components in continuous time."""
        return self._work.steps

    @property
    def termination(self) -> str | None:
        """How an FMU has ended the run."""
        return self._work.termination

    @property
    def interrupted_at(self) -> int | None:
        """[ns]"""
        return self._work.interrupted_at

    @property
    def channels(self) -> Sequence[Channel]:
        """The connections at work, in the order of the system."""
        return self._work.channels

    # -- a run ---------------------------------------------------------------------------------------------------

    def initialise(self) -> None:
        """The first exchange, in the order of the dependencies: never lost, late or noisy."""
        try:
            self._exchange_first()
        except (Diverged, SimulatorError) as error:
            self._ended(error)

    def run(self, *, pause_at: int | None = None, progress: Callable[[float], None] | None = None) -> bool:
        """Run to the end or to the first instant from `pause_at` [ns]; whether it is over.

        The end may be divergence, or an FMU's. A run is over at the first instant after an interruption too.
        """
        over = self.divergence is not None or self._run(pause_at, progress)
        if over:
            self.backlog.hand_over_rest()
        return over

    def _run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        try:
            if not self._loop.run(pause_at, progress):
                return False
        except (Diverged, Terminated, SimulatorError) as error:
            self._ended(error)
        if self.interrupted_at is not None:
            self.backlog.drop_later_events()
        elif progress is not None:
            progress(1.0)
        return True

    def pending(self) -> Chunk:
        """What was recorded since the last chunk was handed over; messages that go out later are left out."""
        return self.backlog.pending()

    def state(self) -> dict[str, Any]:
        """Where the run is, what is on its way, and what the recorder does not have yet, but for `saved`."""
        return {
            "instants": self._work.cursor.past,
            "row": self.board.row.tolist(),
            "handed_over": self.backlog.handed_over,
            "channels": [channel.state() for channel in self.channels],
            "events": self.backlog.events().ravel().tolist(),
        }

    def saved(self) -> dict[str, bytes]:
        """The states of the components, and the rows that the recorder does not have yet, as bytes."""
        return {
            **{name: simulator.save() for name, simulator in self._work.simulators.items()},
            ROWS_PENDING: self.backlog.rows().tobytes(),
        }

    def restore(self, state: Mapping[str, Any], saved: Mapping[str, bytes]) -> None:
        """Continue where `state` and `saved` were taken, instead of `initialise`."""
        for name, simulator in self._work.simulators.items():
            simulator.restore(saved[name])
        for schedule in self._work.cursor.move_to(state["instants"]):
            self._work.pass_over(schedule)
        self.board.row[:] = state["row"]
        events = np.array(state["events"], dtype=np.int64).reshape(-1, 4)
        self.backlog.restore(saved[ROWS_PENDING], events, handed_over=state["handed_over"])
        for channel, content in zip(self.channels, state["channels"], strict=True):
            channel.restore(content)

    def _ended(self, error: Exception) -> None:
        """Take divergence, or an FMU that ends the run, as its end; any other failure of an FMU is raised."""
        if isinstance(error, Terminated):
            self._work.termination = str(error)
        elif isinstance(error, SimulatorError) and not error.divergence:
            raise error
        else:
            self.divergence, self.divergence_time, self._work.termination = str(error), self.now, None
        self.backlog.drop_later_events()
        self.backlog.expect_a_row()

    # -- initialisation ------------------------------------------------------------------------------------------

    def _exchange_first(self) -> None:
        work, stop = self._work, self._work.stop / NANOSECONDS
        for name in work.wires.names:
            ratio, first = clock_of(work.system, name, self._first_samples)
            work.simulators[name].enter_initialization(0.0 if name in self._waiting else ratio * first, ratio * stop)
        for feed in work.feeds:
            feed.write(0.0)
        for group in self._first_exchange:
            self._exchange(group)
        for name in work.wires.names:
            work.simulators[name].exit_initialization()
            work.readers[name]()
        for channel in work.channels:
            channel.start()
        for index in range(len(work.wires.names)):
            work.component(index).expect_finite(0.0)
        for name in self._waiting:
            ratio, first = clock_of(work.system, name, self._first_samples)
            if first > 0.0:
                work.simulators[name].step(0.0, ratio * first)
        work.look(0.0)

    def _exchange(self, group: Sequence[int]) -> None:
        work, connections = self._work, self._work.system.connections

        def pass_on(index: int, open_: Booleans) -> tuple[Floats, Floats]:
            work.readers[connections[index].sender]()
            before = work.channels[index].received.copy()
            work.channels[index].pass_on()
            return before, work.channels[index].received

        if initial.exchange(group, pass_on).any():
            ends = "; ".join(f"{', '.join(connections[i].start)} -> {', '.join(connections[i].end)}" for i in group)
            raise SimulatorError(
                f"initialisation: no values found around the loop {ends} after {initial.ITERATIONS} exchanges"
            )
