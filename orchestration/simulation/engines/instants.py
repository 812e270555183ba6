"""What happens at an instant, in Python: the reference that the loops in C follow (`instants.h`).

Component i has the state x_i, inputs u_i and outputs y_i. ⁻ marks a value as the instant t begins, ⁺ as it ends; what
nothing below sets stays: x_i⁺ = x_i⁻. A component in continuous time is stepped to t, from the time t_i⁻ that it has
reached; a sampled one with the clock ratio r from t, to its next sample t_i⁺. m is a message, w(t) a value of a source.

    (1) for each i in continuous time that has a communication point at t > t_i⁻, in order:    _step_continuous
            u_i ← y_j⁺, over each wire from a j that is stepped before i                       component.ahead
            x_i⁺, y_i⁺ ← step(x_i⁻, u_i, from t_i⁻ to t); t_i⁺ ← t
            y_i⁺ is not finite: the run ends
        the row so far satisfies the condition of divergence, and some i was stepped: the run ends
    (2) for each m that arrives at t, in the order of sending:                                 _arrive
            u_i ← m
        for each m that a j in continuous time sends at t, in the order of sending:            _post
            m ← y_j⁺, unless it is lost
            u_i ← m, if it arrives at t
    (3) for each m that is measured at t for a later sample:                                   _measure
            m ← y_j⁺, unless it is lost
    (4) for each sampled i that is due at t, in order:                                         _sample
            u_i ← y_j⁺, or m from an earlier (3), over each connection, unless it is lost      _sense
            u_i ← the line through its last two m, at t, where the hold is of first order      component.held
            u_i ← w(t)                                                                         component.feeds
            x_i⁺, y_i⁺ ← step(x_i⁻, u_i, from r t to r min(t_i⁺, stop))                        _step_task
            y_i⁺ is not finite: the run ends
            for each m that i sends for this sample, unless it is lost:                        _send
                m ← y_i⁺
                u_k ← m, if it arrives at t
    (5) for each i in continuous time that has a communication point at t:                     _settle
            u_i ← the line through its last two m, at t, where the hold is of first order      component.held
            u_i ← y_j⁺, over each other wire                                                   component.behind
            u_i ← w(t)                                                                         component.feeds
        if there are any: y_j⁺ where it follows inputs at once, u_i ← y_j⁺ over each wire      _close
    (6) the row of t has u_i⁺ of components in continuous time, and y_i⁺ of all                _record
    (7) an FMU ended the run: it ends; Ctrl-C or a pause: it stops here

So u_i in (1) is u_i⁻, but over the wires ahead. y⁺ becomes m with noise, quantisation, scale and offset
(`Channel.take`), over a wire with scale and offset alone. A component with its own clock is stepped at each instant
before the end, to the next one: where it is not due, (4) leaves out what it reads, w(t) and what it sends. Nothing
samples at the end. For users: docs/timing.md, "At one instant".
"""

from collections.abc import Callable, Sequence
from typing import ClassVar

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.recording.recording import ARRIVED, LOST, SAMPLED, SENT, Recorder
from orchestration.simulation.engines.algebraic_loops import EXCHANGES, AlgebraicLoop
from orchestration.simulation.engines.backlog import Backlog, ListTables, events_of_a_chunk, rows_of_a_chunk
from orchestration.simulation.engines.running_system import RunningSystem, SampledComponent, Terminated
from orchestration.systems.schedule.instant_arrays import Message, SampleInstant


class PythonLoop:
    """Processes the instants of a run."""

    engine: ClassVar[str] = "python"
    """its name"""

    def __init__(self, running: RunningSystem, recorder: Recorder) -> None:
        tables = ListTables(running)
        self._running, self.backlog = running, Backlog(running, tables, recorder)
        self._events, self._rows = tables.noted, tables.content
        self._arrived: list[int] = []  # of this instant: noted after the messages that are sent at it
        self._instants = running.cursor.instants()
        self._channels, self._continuous, self._sampled = running.channels, running.continuous, running.sampled
        self._read_ahead, self._stop = running.wires.plan.read_ahead, running.stop
        self._loops = [AlgebraicLoop(running, group, EXCHANGES) for group in running.closing.groups]
        self._closes = bool(running.closing.groups or running.closing.read_again)
        self._row = running.board.row.data.cast("B")
        self._chunk, self._most_events = rows_of_a_chunk(running) * running.board.row.nbytes, events_of_a_chunk()

    def run(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        """Go on to the end, an interruption, or the first instant from `pause_at` [ns]; whether the run is over.

        Raises `Diverged`, `Terminated` or `SimulatorError` if the run ends before.
        """
        running, stop, pace = self._running, self._stop, self._running.pace
        for count, (time, next_time, stepped, arrivals, posted, measured, samples) in enumerate(self._instants, 1):
            if pace is not None:
                pace.wait(time, running.interrupted)
            running.now = time
            if stepped:  # (1)
                self._step_continuous(time, stepped)
            if arrivals:  # (2), before messages without delay, which are sent now and delivered last
                self._arrive(arrivals, time)
            if posted:
                self._post(posted, time)
            if measured:  # (3)
                self._measure(measured)
            if running.some_by_themselves:  # (4)
                self._sample_in_turn(samples, time, next_time)
            else:
                for due in samples:
                    self._sample(due, time, due.next_time)
            if running.settles:  # (5)
                self._settle(time, stepped)
            if self._closes and stepped:
                self._close(time)
            self._record(time)  # (6)
            if running.termination is not None:  # (7)
                raise Terminated(running.termination)
            if running.interrupted() and time < stop:
                running.interrupted_at = time
                return True
            if pause_at is not None and pause_at <= time < stop:
                return False
            if progress is not None and count % 512 == 0:
                progress(time / stop)
        return True

    def _step_continuous(self, time: int, stepped: Sequence[int]) -> None:
        """Step components in continuous time to `time`; divergence is detected before any value is passed on."""
        moved = False
        t = time / NANOSECONDS
        for index in stepped:
            component = self._continuous[index]
            start = component.now
            if time == start:
                continue
            for channel in component.ahead:
                channel.pass_on()
            component.now = time
            try:
                component.step(start / NANOSECONDS, (time - start) / NANOSECONDS)
            except SimulatorError as error:
                self._running.handle_failed_step(error, time)
            self._running.steps += 1
            component.read()
            component.expect_finite(t)
            moved = True
        if moved:
            self._running.check_divergence(t)

    def _post(self, messages: Sequence[Message], time: int) -> None:
        for message in messages:
            self._note_sending(message)
            index, k, _, arrival = message
            self._channels[index].send(k, lost=arrival < 0)
            if arrival == time:
                self._deliver(index, k, time)

    def _measure(self, messages: Sequence[Message]) -> None:
        """Measure values for later samples."""
        for index, k, _, arrival in messages:
            self._channels[index].send(k, lost=arrival < 0)

    def _arrive(self, messages: Sequence[Message], time: int) -> None:
        for index, k, _, _ in messages:
            self._deliver(index, k, time)

    def _deliver(self, index: int, k: int, time: int) -> None:
        self._arrived += (time, ARRIVED, index, k)
        self._channels[index].deliver(k, time)

    def _sample_in_turn(self, samples: Sequence[SampleInstant], time: int, next_time: int) -> None:
        """The samples; a component with its own clock is stepped to the next instant, even if it does not sample."""
        due_of = {due.component: due for due in samples}
        for index, task in self._sampled.items():
            if index in due_of:
                due = due_of[index]
                self._sample(due, time, next_time if task.by_itself else due.next_time)
            elif task.by_itself and time < self._stop:
                for channel in task.held:
                    channel.extrapolate(time)
                self._step_task(task, time, next_time)

    def _sample(self, due: SampleInstant, time: int, end: int) -> None:
        """A component reads, steps to `end` [ns], and sends."""
        task = self._sampled[due.component]
        self._sense(due.received, time)
        for channel in task.held:
            channel.extrapolate(time)
        for feed in task.feeds:
            feed.write(time / NANOSECONDS)
        self._step_task(task, time, end)
        self._send(due.sent, time)

    def _step_task(self, task: SampledComponent, time: int, end: int) -> None:
        start, until = time / NANOSECONDS, min(end, self._stop)
        try:
            task.step(task.ratio * start, task.ratio * ((until - time) / NANOSECONDS))
        except SimulatorError as error:
            self._running.handle_failed_step(error, until)
        task.read()
        task.expect_finite(start)

    def _sense(self, messages: Sequence[Message], time: int) -> None:
        """Take the measurements of a sample."""
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
        """Send the outputs of a component, which no arrival changes."""
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

    def _settle(self, time: int, stepped: Sequence[int]) -> None:
        """Set the inputs that components in continuous time hold over the step that begins now."""
        for index in stepped:
            component = self._continuous[index]
            for channel in component.held:
                channel.extrapolate(time)
            for channel in component.behind:
                channel.pass_on()
            for feed in component.feeds:
                feed.write(time / NANOSECONDS)

    def _close(self, time: int) -> None:
        """Read outputs that follow at once what has been set, and pass them on."""
        t = time / NANOSECONDS
        for loop in self._loops:
            loop.close(f"t = {t:g} s")
        for index in self._running.closing.read_again:
            component = self._continuous[index]
            component.read()
            component.expect_finite(t)

    def _record(self, time: int) -> None:
        if self._arrived:
            self._events += self._arrived
            self._arrived.clear()
        self._running.board.row[0] = time / NANOSECONDS
        self._rows += self._row
        if len(self._rows) >= self._chunk or len(self._events) >= 4 * self._most_events:
            self.backlog.hand_over()
