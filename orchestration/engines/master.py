"""The master: steps components through the instants of a timetable, and records every row.

At one instant, in this order: components in continuous time have reached it; messages that arrive are delivered;
sampled components that are due read what they have received, step and send, and what arrives without delay is
delivered; the row is recorded. So a row is the value just after its instant, and at the end nothing samples.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orchestration.basics.errors import SimulatorError, StoppedStepError
from orchestration.basics.simulator import Floats, Integers, Simulator, Transfer
from orchestration.engines import initial
from orchestration.engines.board import Board
from orchestration.engines.channel import Channel
from orchestration.engines.feeds import Feed
from orchestration.engines.initial import Marks
from orchestration.engines.sources import Values
from orchestration.engines.wires import Wires, clock_of
from orchestration.recording.recording import (
    ARRIVED,
    BYTES,
    EVENTS,
    LOST,
    ROWS,
    SAMPLED,
    SENT,
    Chunk,
    Events,
    Recorder,
)
from orchestration.schedule.cursor import Position
from orchestration.schedule.schedule import Due, Message, Schedule
from orchestration.schedule.streams import NOISE, Streams
from orchestration.schedule.timetable import Timetable
from orchestration.system.model import System, variable_of
from orchestration.system.times import NANOSECONDS

ROWS_PENDING = "rows"
"""Beside the names of the components in `Master.saved`"""

Watch = Callable[[float], str | None]
"""At t [s], says how the values of the row have diverged, or None"""


@dataclass(kw_only=True)
class _Worked:
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
            _expect_finite(self.names, outputs, t)


@dataclass(kw_only=True)
class _Task(_Worked):
    """A sampled component at work."""

    ratio: float
    by_itself: bool
    """whether it has a clock of its own and is stepped at every instant"""


@dataclass(kw_only=True)
class _Body(_Worked):
    """A component in continuous time at work."""

    ahead: list[Channel]
    """wires from components that are stepped before it: their new values"""
    behind: list[Channel]
    """wires from others: their values where its step begins"""
    now: int = 0


class Master:
    """One run of a system whose components are instantiated and have their parameters."""

    engine: ClassVar[str] = "python"
    """By what it passes through instants"""

    def __init__(
        self,
        system: System,
        simulators: Mapping[str, Simulator],
        *,
        timetable: Timetable,
        streams: Streams,
        recorded: Mapping[str, Sequence[str]],
        recorder: Recorder,
        sources: Sequence[tuple[Sequence[str], Values]] = (),
        feeds: Sequence[Feed] = (),
        interrupted: Callable[[], bool] = lambda: False,
        watch: Callable[[Board], Watch] | None = None,
        first_exchange: Sequence[Sequence[int]] | None = None,
        waiting: Collection[str] = (),
    ) -> None:
        """`waiting` are components that begin at 0 and are stepped to their first sample without one.

        Other sampled components, unless they have a clock of their own, begin at their first sample.
        """
        self._wires = wires = Wires(system, recorded)
        self.board = board = wires.board
        self._events: list[int] = []  # a table of `Events`, row after row: no object an event, for the collector to see
        self._arrived: list[int] = []  # of this instant: noted after what was sent at it
        self.interrupted_at: int | None = None
        self.divergence: str | None = None
        self.divergence_time: int | None = None
        self.termination: str | None = None
        self.steps = 0
        self.now = 0
        self._system, self._simulators, self._stop = system, simulators, timetable.stop
        self._position = Position(timetable)
        self._instants = self._position.instants()
        self._read_ahead = wires.plan.read_ahead
        self._names = names = wires.names
        self._sources, self._interrupted, self.recorder = list(sources), interrupted, recorder
        self.columns = (*board.columns, *(signal for signals, _ in self._sources for signal in signals))
        """of every row: those of the board, then the signals of the sources"""
        self._row = board.row.data.cast("B")
        self._rows = bytearray()  # not handed over yet, and the times of the events may lie before them
        most = min(ROWS, max(1, BYTES // board.row.nbytes))
        self._chunk, self._most_events = most * board.row.nbytes, EVENTS
        self._handed_over = False
        recorder.begin(self.columns)
        self._watch = watch(board) if watch is not None else lambda t: None
        self._feeds = list(feeds)
        self._connections = tuple(x.name for x in system.connections)
        self._channels = [self._channel(i, streams) for i in range(len(system.connections))]
        self._first_exchange = [(i,) for i in range(len(self._channels))] if first_exchange is None else first_exchange
        self._first_samples, self._waiting = timetable.first_samples, waiting
        self._readers = {name: simulators[name].reader(board.outputs[name], self._outputs(name)) for name in names}
        self._bodies = {index: self._body(names[index]) for index in wires.continuous}
        self._tasks = {index: self._task(names[index]) for index in wires.sampled}
        self._settling = any(body.held or body.behind or body.feeds for body in self._bodies.values())
        self._some_by_themselves = any(task.by_itself for task in self._tasks.values())

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
        if over and (self._is_pending() or not self._handed_over):
            self._hand_over()
        return over

    def _run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        by_themselves, stop, count = self._some_by_themselves, self._stop, 0
        try:
            for time, next_time, halts, arrivals, posted, measured, dues in self._instants:
                self.now = time
                if halts:
                    self._step_bodies(time, halts)
                if arrivals:  # before what is sent now, which is delivered last if it arrives at once
                    self._arrive(arrivals, time)
                if posted:
                    self._post(posted, time)
                if measured:
                    self._measure(measured)
                if by_themselves:
                    self._sample_in_turn(dues, time, next_time)
                else:
                    for due in dues:
                        self._sample(due, time, due.next_time)
                if self._settling:
                    self._settle(time, halts)
                if self._arrived:
                    self._events += self._arrived
                    self._arrived.clear()
                self._record(time)
                if self.termination is not None:
                    raise Terminated(self.termination)
                if self._interrupted() and time < stop:
                    self.interrupted_at = time
                    self._drop_later_events()
                    return True
                if pause_at is not None and pause_at <= time < stop:
                    return False
                count += 1
                if progress is not None and count % 512 == 0:
                    progress(time / stop)
        except (Diverged, Terminated, SimulatorError) as error:
            self._ended(error)
        if progress is not None:
            progress(1.0)
        return True

    def pending(self) -> Chunk:
        """What was recorded since the last chunk was handed over; messages that go out later are left out."""
        events, _ = self._past_and_later()
        return Chunk(
            columns=self.columns,
            rows=self._rows_with_sources(),
            events=Events(self._connections, in_order(events)),
        )

    @property
    def channels(self) -> Sequence[Channel]:
        """The connections at work, in the order of the system."""
        return self._channels

    def state(self) -> dict[str, Any]:
        """Where the run is, what is on its way, and what the recorder does not have yet, but for `saved`."""
        return {
            "instants": self._position.past,
            "row": self.board.row.tolist(),
            "handed_over": self._handed_over,
            "channels": [channel.state() for channel in self._channels],
            "events": self._pending_events().ravel().tolist(),
        }

    def saved(self) -> dict[str, bytes]:
        """The states of the components, and the rows that the recorder does not have yet, as bytes."""
        return {
            **{name: simulator.save() for name, simulator in self._simulators.items()},
            ROWS_PENDING: self._pending_rows().tobytes(),
        }

    def restore(self, state: Mapping[str, Any], saved: Mapping[str, bytes]) -> None:
        """Continue where `state` and `saved` were taken, instead of `initialise`."""
        for name, simulator in self._simulators.items():
            simulator.restore(saved[name])
        for schedule in self._position.move_to(state["instants"]):
            self._pass_over(schedule)
        self.board.row[:] = state["row"]
        self._handed_over = state["handed_over"]
        self._keep_rows(saved[ROWS_PENDING])
        for channel, content in zip(self._channels, state["channels"], strict=True):
            channel.restore(content)
        self._keep_events(np.array(state["events"], dtype=np.int64).reshape(-1, 4))

    # -- what happens at an instant ------------------------------------------------------------------------------

    def _step_bodies(self, time: int, halts: Sequence[int]) -> None:
        """Components in continuous time reach `time`; divergence is noticed before any value is passed on."""
        moved = False
        t = time / NANOSECONDS
        for index in halts:
            body = self._bodies[index]
            start = body.now
            if time == start:
                continue
            for channel in body.ahead:
                channel.pass_on()
            body.now = time
            try:
                body.step(start / NANOSECONDS, (time - start) / NANOSECONDS)
            except SimulatorError as error:
                self._stopped(error, time)
            self.steps += 1
            body.read()
            body.expect_finite(t)
            moved = True
        if moved:
            self._look(t)

    def _stopped(self, error: SimulatorError, until: int) -> None:
        """A step to `until` [ns] was not simply done: raise what that is, unless it was whole and ends the run.

        Then the instant is gone through, and is the last one. So is that of a discarded step at the end of the run.
        """
        if not isinstance(error, StoppedStepError) or not (error.ends or until == self._stop):
            raise error
        if not error.whole:
            raise Terminated(str(error))
        self.termination = self.termination or str(error)

    def _look(self, t: float) -> None:
        complaint = self._watch(t)
        if complaint is not None:
            raise Diverged(complaint)

    def _post(self, messages: Sequence[Message], time: int) -> None:
        for message in messages:
            self._note_sending(message)
            index, k, _, arrival = message
            self._channels[index].send(k, lost=arrival < 0)
            if arrival == time:
                self._deliver(index, k, time)

    def _measure(self, messages: Sequence[Message]) -> None:
        """Values for samples to come."""
        for index, k, _, arrival in messages:
            self._channels[index].send(k, lost=arrival < 0)

    def _arrive(self, messages: Sequence[Message], time: int) -> None:
        for index, k, _, _ in messages:
            self._deliver(index, k, time)

    def _deliver(self, index: int, k: int, time: int) -> None:
        self._arrived += (time, ARRIVED, index, k)
        self._channels[index].deliver(k, time)

    def _sample_in_turn(self, dues: Sequence[Due], time: int, next_time: int) -> None:
        """The samples; who has a clock of its own is stepped to the next instant, and also if it does not sample."""
        samples = {due.component: due for due in dues}
        for index, task in self._tasks.items():
            if index in samples:
                due = samples[index]
                self._sample(due, time, next_time if task.by_itself else due.next_time)
            elif task.by_itself and time < self._stop:
                for channel in task.held:
                    channel.extrapolate(time)
                self._step_task(task, time, next_time)

    def _sample(self, due: Due, time: int, end: int) -> None:
        """A component reads, steps to `end` [ns], and sends."""
        task = self._tasks[due.component]
        self._sense(due.received, time)
        for channel in task.held:
            channel.extrapolate(time)
        for feed in task.feeds:
            feed.write(time / NANOSECONDS)
        self._step_task(task, time, end)
        self._send(due.sent, time)

    def _step_task(self, task: _Task, time: int, end: int) -> None:
        start, until = time / NANOSECONDS, min(end, self._stop)
        try:
            task.step(task.ratio * start, task.ratio * ((until - time) / NANOSECONDS))
        except SimulatorError as error:
            self._stopped(error, until)
        task.read()
        task.expect_finite(start)

    def _sense(self, messages: Sequence[Message], time: int) -> None:
        """The sample reads what it measures itself."""
        for index, k, measured, arrival in messages:
            channel = self._channels[index]
            self._events += (measured, SAMPLED, index, k)
            if arrival < 0:
                self._events += (measured, LOST, index, k)
            if index not in self._read_ahead:
                channel.hand_over(time, lost=arrival < 0)
            elif arrival >= 0:
                channel.deliver(k, time)

    def _send(self, messages: Sequence[Message], time: int) -> None:
        """What it sends are its outputs, which no arrival changes."""
        for message in messages:
            self._note_sending(message)
            index, k, _, arrival = message
            if arrival == time:
                self._arrived += (time, ARRIVED, index, k)
                self._channels[index].hand_over(time, lost=False)
            else:
                self._channels[index].send(k, lost=arrival < 0)

    def _note_sending(self, message: Message) -> None:
        index, k, sent, arrival = message
        if sent > self._stop:
            return
        self._events += (sent, SENT, index, k)
        if arrival < 0:
            self._events += (sent, LOST, index, k)

    def _settle(self, time: int, halts: Sequence[int]) -> None:
        """What components in continuous time hold over the step that begins now."""
        for index in halts:
            body = self._bodies[index]
            for channel in body.held:
                channel.extrapolate(time)
            for channel in body.behind:
                channel.pass_on()
            for feed in body.feeds:
                feed.write(time / NANOSECONDS)

    def _record(self, time: int) -> None:
        self.board.row[0] = time / NANOSECONDS
        self._rows += self._row
        if len(self._rows) >= self._chunk or len(self._events) >= 4 * self._most_events:
            self._hand_over()

    def _hand_over(self) -> None:
        self.recorder.take(self.pending())
        self._keep_events(self._past_and_later()[1])
        self._keep_rows(b"")
        self._handed_over = True

    def _past_and_later(self) -> tuple[Integers, Integers]:
        """The events up to now, and those of messages that go out later."""
        table = self._pending_events()
        past = table[:, 0] <= self.now
        return (table, table[:0]) if past.all() else (table[past], table[~past])

    def _ended(self, error: Exception) -> None:
        """Take divergence, or an FMU that ends the run, as its end; any other failure of an FMU is raised."""
        if isinstance(error, Terminated):
            self.termination = str(error)
        elif isinstance(error, SimulatorError) and not error.divergence:
            raise error
        else:
            self.divergence, self.divergence_time, self.termination = str(error), self.now, None
        self._drop_later_events()
        if not len(self._pending_rows()) and not self._handed_over:
            self._record(self.now)

    def _drop_later_events(self) -> None:
        """In Jacobi order a message is written down before it goes out; after the end none does."""
        self._keep_events(self._past_and_later()[0])

    # -- what is not handed over yet -----------------------------------------------------------------------------

    def _is_pending(self) -> bool:
        return bool(self._rows or self._events)

    def _pending_rows(self) -> Floats:
        """Of the board, shape (n, number of its columns)."""
        return np.frombuffer(bytes(self._rows), dtype=np.float64).reshape(-1, len(self.board.columns))

    def _rows_with_sources(self) -> Floats:
        """The same with what sources say, shape (n, number of `columns`)."""
        rows = self._pending_rows()
        return np.column_stack([rows, *(values.over(rows[:, 0]) for _, values in self._sources)])

    def _pending_events(self) -> Integers:
        """As the table of `Events`."""
        return np.fromiter(self._events, np.int64, len(self._events)).reshape(-1, 4)

    def _keep_rows(self, rows: bytes) -> None:
        self._rows = bytearray(rows)

    def _keep_events(self, events: Integers) -> None:
        self._events = events.ravel().tolist()

    def _pass_over(self, schedule: Schedule) -> None:
        """These instants are past, and what follows from them alone is as if the run had gone through them."""
        self.now = int(schedule.times[-2])
        reached = np.repeat(schedule.times[:-1], np.diff(schedule.halts_at))
        self.steps += int(np.count_nonzero(reached))  # nobody steps to the start
        for index, body in self._bodies.items():
            body.now = max(body.now, int(reached[schedule.halts == index].max(initial=0)))
        for index, channel in enumerate(self._channels):
            taken, _ = schedule.of(index, self._wires.table(index))
            channel.skip(taken)

    # -- initialisation ------------------------------------------------------------------------------------------

    def _exchange_first(self) -> None:
        stop = self._stop / NANOSECONDS
        for name in self._names:
            ratio, first = clock_of(self._system, name, self._first_samples)
            begin = 0.0 if name in self._waiting else first
            self._simulators[name].enter_initialization(ratio * begin, ratio * stop)
        for feed in self._feeds:
            feed.write(0.0)
        for group in self._first_exchange:
            self._exchange(group)
        for name in self._names:
            self._simulators[name].exit_initialization()
            self._readers[name]()
        for channel in self._channels:
            channel.start()
        for name in self._names:
            _expect_finite(self._wires.connected(name), self._outputs(name).tolist(), 0.0)
        for name in self._waiting:
            ratio, first = clock_of(self._system, name, self._first_samples)
            if first > 0:
                self._simulators[name].step(0.0, ratio * first)
        self._look(0.0)

    def _exchange(self, group: Sequence[int]) -> None:
        def pass_on(index: int, open_: Marks) -> tuple[Floats, Floats]:
            self._readers[self._system.connections[index].sender]()
            before = self._channels[index].received.copy()
            self._channels[index].pass_on()
            return before, self._channels[index].received

        if initial.exchange(group, pass_on).any():
            connections = [self._system.connections[i] for i in group]
            ends = "; ".join(f"{', '.join(x.start)} -> {', '.join(x.end)}" for x in connections)
            raise SimulatorError(
                f"initialisation: no values found around the loop {ends} after {initial.ITERATIONS} exchanges"
            )

    # -- how it is made ------------------------------------------------------------------------------------------

    def _outputs(self, name: str) -> Floats:
        return self.board.of([f"{name}.{output}" for output in self.board.outputs[name]])

    def _channel(self, index: int, streams: Streams) -> Channel:
        x = self._system.connections[index]
        inputs = [variable_of(end) for end in x.end]
        sampled = self._system.components[x.receiver].sampling is not None
        received: Floats = np.zeros(len(inputs)) if sampled else self.board.of(x.end)
        return Channel(
            x,
            row=self.board.row,
            places=self.board.places(x.start),
            received=received,
            write=self._simulators[x.receiver].writer(inputs, received),
            noise=streams.of(f"connections.{x.name}", NOISE),
        )

    def _body(self, name: str) -> _Body:
        into = self._wires.into(name)
        return _Body(
            **self._worked(name),
            ahead=[self._channels[i] for i in into.ahead],
            behind=[self._channels[i] for i in into.behind],
        )

    def _task(self, name: str) -> _Task:
        sampling = self._system.components[name].sampling
        assert sampling is not None
        return _Task(**self._worked(name), ratio=sampling.clock_ratio, by_itself=self._wires.is_by_itself(name))

    def _worked(self, name: str) -> dict[str, Any]:
        names = self._wires.connected(name)
        return {
            "step": self._simulators[name].step,
            "read": self._readers[name],
            "outputs": self._outputs(name)[: len(names)],
            "names": names,
            "feeds": [feed for feed in self._feeds if feed.feeds(name)],
            "held": [self._channels[i] for i in self._wires.into(name).held],
        }


def in_order(events: Integers) -> Integers:
    """A table of events sorted by time, a new one."""
    if (events[1:, 0] >= events[:-1, 0]).all():
        return np.array(events)
    ordered: Integers = events[np.argsort(events[:, 0], kind="stable")]
    return ordered


def _expect_finite(names: Sequence[str], values: Sequence[float], t: float) -> None:
    for name, value in zip(names, values):
        if not math.isfinite(value):
            raise Diverged(f"{name} = {value} at t = {t:g} s, expected a finite value")


class Diverged(Exception):
    """The loop has left the region that counts as running."""


class Terminated(Exception):
    """An FMU has ended the run."""
