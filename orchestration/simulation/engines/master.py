"""The master of one run: initialises it, has a loop process its instants, pauses it, and states how it ended.

The loop is the compiled one where it is available, else that in Python; both give the same bytes.
"""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy as np

from orchestration.foundation.basics import errors
from orchestration.foundation.basics.times import nanoseconds, seconds
from orchestration.foundation.recording.recording import Chunk, Recorder
from orchestration.simulation.engines.algebraic_loops import AlgebraicLoop
from orchestration.simulation.engines.compiled import CompiledLoop, reason_unavailable
from orchestration.simulation.engines.instants import PythonLoop
from orchestration.simulation.engines.memory import Allocator
from orchestration.simulation.engines.running_system import Diverged, RunningSystem, Terminated
from orchestration.simulation.engines.wiring_by_index import clock_of

ROWS_PENDING = "rows"
"""Key in `Master.saved` beside the names of the components"""


Loop: TypeAlias = PythonLoop | CompiledLoop
"""Processes the instants of a run"""


class Master:
    """One run of a system whose components are instantiated and have their parameters."""

    def __init__(
        self,
        running: RunningSystem,
        recorder: Recorder,
        *,
        first_exchange: Sequence[Sequence[int]] | None = None,
        waiting: Collection[str] = (),
        never_computed: Collection[str] = (),
        loop: Callable[[RunningSystem, Recorder], Loop] = PythonLoop,
    ) -> None:
        """`waiting` are components that begin at 0 and are stepped to their first sample without sampling.

        Other sampled components, unless they have their own clock, begin at their first sample. To a first-order hold
        the first exchange of a connection that is `never_computed` is none that was applied.
        """
        self.running = running
        self.board, self.columns, self.recorder = running.board, running.columns, recorder
        self.divergence: str | None = None
        self.divergence_time: int | None = None
        self.failure: errors.SimulatorError | None = None
        """the error of an FMU that has ended the run after its first row; it has been raised"""
        self._first_exchange = (
            [(i,) for i in range(len(running.channels))] if first_exchange is None else first_exchange
        )
        self._waiting, self._never_computed = waiting, never_computed
        self._loop = loop(running, recorder)
        self.backlog = self._loop.backlog
        self.engine = self._loop.engine
        """the name of the loop"""

    # -- a run ---------------------------------------------------------------------------------------------------

    def initialise(self) -> None:
        """Initialise with the first exchange, in the order of dependencies: never lost, late or noisy."""
        try:
            self._exchange_first()
        except (Diverged, errors.SimulatorError) as error:
            self._ended(error)

    def run(self, *, pause_at: int | None = None, progress: Callable[[float], None] | None = None) -> bool:
        """Run to the end or to the first instant from `pause_at` [ns]; whether it is over.

        The end may be divergence, or caused by an FMU. A run is also over at the first instant after an interruption.
        Raises `SimulatorError` if an FMU refuses a call; all up to the last row has then been handed over.
        """
        over = self.divergence is not None or self._run(pause_at, progress)
        if over:
            self.backlog.hand_over_rest()
        return over

    def _run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        try:
            if not self._loop.run(pause_at, progress):
                return False
        except (Diverged, Terminated, errors.SimulatorError) as error:
            if isinstance(error, errors.SimulatorError) and not isinstance(error, errors.StoppedStepError):
                error.timed(seconds(self.running.now))
            self._ended(error)
        if self.running.interrupted_at is not None:
            self.backlog.drop_later_events()
        elif progress is not None:
            progress(1.0)
        return True

    def pending(self) -> Chunk:
        """What was recorded since the last chunk was handed over, without messages that are sent later."""
        return self.backlog.pending()

    def state(self) -> dict[str, Any]:
        """The state of the run, of its messages, and of events that are not handed over, without `saved`."""
        return {
            "instants": self.running.cursor.past,
            "row": self.board.row.tolist(),
            "handed_over": self.backlog.handed_over,
            "channels": [channel.state() for channel in self.running.channels],
            "events": self.backlog.events().ravel().tolist(),
        }

    def saved(self) -> dict[str, bytes]:
        """The states of the components, and the rows that are not handed over, as bytes."""
        return {
            **{name: simulator.save() for name, simulator in self.running.simulators.items()},
            ROWS_PENDING: self.backlog.tables.rows().tobytes(),
        }

    def restore(self, state: Mapping[str, Any], saved: Mapping[str, bytes]) -> None:
        """Continue where `state` and `saved` were taken, instead of `initialise`."""
        for name, simulator in self.running.simulators.items():
            simulator.restore(saved[name])
        for schedule in self.running.cursor.move_to(state["instants"]):
            self.running.skip(schedule)
        self.board.row[:] = state["row"]
        events = np.array(state["events"], dtype=np.int64).reshape(-1, 4)
        self.backlog.restore(saved[ROWS_PENDING], events, handed_over=state["handed_over"])
        for channel, content in zip(self.running.channels, state["channels"], strict=True):
            channel.restore(content)

    def _ended(self, error: Exception) -> None:
        """End the run by divergence or by an FMU that ends it; any other failure of an FMU is raised."""
        if isinstance(error, Terminated):
            self.running.termination = str(error)
        elif isinstance(error, errors.SimulatorError) and not error.divergence:
            if self.backlog.has_row():
                self.failure = error
                self.running.now = self.running.interrupted_at = nanoseconds(self.board.row[0])
                self.backlog.drop_later_events()
                self.backlog.hand_over_rest()
            raise error
        else:
            self.divergence, self.divergence_time, self.running.termination = str(error), self.running.now, None
        self.backlog.drop_later_events()
        self.backlog.ensure_row()

    # -- initialisation ------------------------------------------------------------------------------------------

    def _exchange_first(self) -> None:
        running, stop = self.running, seconds(self.running.stop)
        for name in running.wires.names:
            ratio, first = clock_of(running.system, name, running.first_samples)
            running.simulators[name].enter_initialization(0.0 if name in self._waiting else ratio * first, ratio * stop)
        for feed in running.feeds:
            feed.write(0.0)
        for group in self._first_exchange:
            AlgebraicLoop(running, group).close("initialisation")
        for name in running.wires.names:
            running.simulators[name].exit_initialization()
            running.readers[name]()
        for connection, channel in zip(running.system.connections, running.channels, strict=True):
            if connection.name not in self._never_computed:
                channel.start()
        for index in range(len(running.wires.names)):
            running.component(index).expect_finite(0.0)
        for name in self._waiting:
            ratio, first = clock_of(running.system, name, running.first_samples)
            if first > 0.0:
                running.simulators[name].step(0.0, ratio * first)
        running.check_divergence(0.0)


_NOTES = logging.getLogger("quadcosim")

Engine = Literal["python", "compiled"]
BATCH = "batch"
"""Name of the engine of many runs at once, whose metrics differ from those of the others in their last bits"""


def engine_named(name: str | None, *others: str) -> Engine | None:
    """The engine of that name; raises `UsageError` for an unknown name, listing `others` too."""
    if name is not None and name not in get_args(Engine):
        raise errors.UsageError(f"--engine {name}: {errors.expected_name(name, [*get_args(Engine), *others])}")
    return cast(Engine | None, name)


def create_master(
    engine: Engine | None, running: RunningSystem, recorder: Recorder, *, allocate: Allocator, **others: Any
) -> Master:
    """The master of a run, with an engine; default: the compiled loop where available.

    The compiled loop keeps what it has not handed over in memory of `allocate`; `others` are arguments of `Master`.
    Raises `QuadcosimError` with the reason if the compiled loop was requested and is not available.
    """
    reason = None if engine == "python" else reason_unavailable(running)
    if reason:
        _NOTES.debug("no compiled loop: %s", reason)
    if engine == "python" or (engine is None and reason):
        return Master(running, recorder, **others)
    if reason:
        raise errors.QuadcosimError(f"--engine compiled is not available: {reason}")
    return Master(running, recorder, loop=partial(CompiledLoop, allocate=allocate), **others)
