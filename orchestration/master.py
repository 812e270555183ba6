"""The master: steps plant and controller through the instants of a clock, and records every row.

At one instant, in this order: the plant has reached it; the measurement is taken; the controller steps
if it samples now; commands that arrive now are applied; the row is recorded. So a row is the value just
after its instant, and at the end the controller is not stepped.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.clock import Clock, Sample
from orchestration.errors import SimulatorError
from orchestration.recording import ROWS, Chunk, Event, Recorder
from orchestration.reference import FromFile, ReferencePath
from orchestration.sensors import Sensors
from orchestration.simulator import Floats, Simulator, Transfer
from orchestration.timing import NANOSECONDS, Timing
from orchestration.wiring import COMMAND, MEASUREMENT, REFERENCE

FARTHEST = 100.0
"""[m] of position error, beyond which the loop counts as diverged"""
FASTEST = 1000.0
"""[rad/s] of angular speed, likewise"""


@dataclass(frozen=True, kw_only=True)
class Signals:
    """Names of what is recorded; the master adds what it needs itself."""

    plant: tuple[str, ...]
    controller: tuple[str, ...]


class Board:
    """One row of all values that are exchanged or recorded; simulators read and write parts of it in place."""

    def __init__(self, signals: Signals) -> None:
        plant = tuple(dict.fromkeys((*COMMAND, *MEASUREMENT, *signals.plant)))
        controller = tuple(dict.fromkeys((*COMMAND, *signals.controller)))
        self.columns = ("time", *(f"plant.{n}" for n in plant), *(f"controller.{n}" for n in controller))
        self.row: Floats = np.zeros(len(self.columns))
        split = 1 + len(plant)
        commands = 1 + len(COMMAND)
        self.plant_names, self.controller_names = plant[len(COMMAND) :], controller
        self.applied = self.row[1:commands]
        self.plant = self.row[commands:split]
        self.measured = self.plant[: len(MEASUREMENT)]
        self.controller = self.row[split:]
        self.computed = self.controller[: len(COMMAND)]


class Master:
    """One run of a plant and a controller; both are instantiated and have their parameters."""

    def __init__(
        self,
        plant: Simulator,
        controller: Simulator,
        *,
        clock: Clock,
        timing: Timing,
        sensors: Sensors,
        reference: ReferencePath,
        signals: Signals,
        recorder: Recorder,
        interrupted: Callable[[], bool] = lambda: False,
    ) -> None:
        self.board = board = Board(signals)
        self.events: list[tuple[int, str, str, int]] = []  # fields of `Event`, made cheaply
        self.divergence: str | None = None
        self.divergence_time: int | None = None
        self.interrupted_at: int | None = None
        self.steps = 0
        self.now = 0
        self._plant, self._controller = plant, controller
        self._interrupted = interrupted
        self._clock, self._timing, self._sensors, self._reference = clock, timing, sensors, reference
        self._recorder = recorder
        self._rows = bytearray()  # not handed over yet, and the times of `events` may lie before them
        self._chunk = ROWS * board.row.nbytes
        self._handed_over = False
        recorder.begin(board.columns)
        self._received: Floats = np.zeros(len(MEASUREMENT))
        self._in_flight: dict[int, Floats] = {}
        self._applied: list[tuple[int, Floats]] = []  # the last two, with their times
        self._read_plant = plant.reader(board.plant_names, board.plant)
        self._write_command = plant.writer(COMMAND, board.applied)
        self._read_controller = controller.reader(board.controller_names, board.controller)
        self._write_measurement = controller.writer(MEASUREMENT, self._received)
        self._write_reference = self._reference_writer()

    def initialise(self) -> None:
        """The first exchange: never lost, late or noisy; its command is held until the first arrival."""
        try:
            self._exchange_first()
        except (_Diverged, SimulatorError) as error:
            self._diverged(error)

    def _exchange_first(self) -> None:
        stop = self._clock.stop / NANOSECONDS
        self._plant.enter_initialization(0.0, stop)
        self._controller.enter_initialization(0.0, stop)
        self._read_plant()
        self._check(0.0)
        self._received[:] = self.board.measured
        self._write_measurement()
        self._write_reference(0.0)
        self._controller.exit_initialization()
        self._read_controller()
        self._apply(0, self.board.computed.copy())
        self._plant.exit_initialization()
        self._read_plant()

    def run(self, *, pause_at: int | None = None, progress: Callable[[float], None] | None = None) -> bool:
        """Fly to the end, to divergence or to the first instant from `pause_at` [ns]; whether it is over.

        So it is at the first instant after an interruption, but not at its end.
        """
        over = self.divergence is not None or self._fly(pause_at, progress)
        if over:
            self._finish()
        return over

    def _fly(self, pause_at: int | None, progress: Callable[[float], None] | None) -> bool:
        count = 0
        try:
            for time, sample, arrivals in self._clock:
                if time > self.now:
                    self._step_plant(time)
                if sample is not None or self._timing.clock == "fmu":
                    self._step_controller(time, sample)
                if arrivals:
                    self._arrive(time, arrivals)
                if self._timing.hold == "first":
                    self._extrapolate(time)
                self._record(time)
                if self._interrupted() and time < self._clock.stop:
                    self._end_early(time)
                    return True
                if pause_at is not None and time >= pause_at and time < self._clock.stop:
                    return False
                count += 1
                if progress is not None and count % 512 == 0:
                    progress(time / self._clock.stop)
        except (_Diverged, SimulatorError) as error:
            self._diverged(error)
        if progress is not None:
            progress(1.0)
        return True

    def pending(self) -> Chunk:
        """What was recorded since the last chunk was handed over; commands that go out later are left out."""
        columns = self.board.columns
        rows = np.frombuffer(bytes(self._rows), dtype=np.float64).reshape(-1, len(columns))
        events = sorted((event for event in self.events if event[0] <= self.now), key=lambda event: event[0])
        return Chunk(
            columns=columns,
            rows=rows,
            desired=self._reference.positions(rows[:, 0]),
            events=tuple(map(Event._make, events)),
        )

    def state(self) -> dict[str, Any]:
        """All that the rest of the run depends on, and what the recorder does not have yet."""
        return {
            "plant": self._plant.save(),
            "controller": self._controller.save(),
            "clock": self._clock.state(),
            "now": self.now,
            "steps": self.steps,
            "row": self.board.row.tobytes(),
            "rows": bytes(self._rows),
            "handed_over": self._handed_over,
            "received": self._received.tobytes(),
            "in_flight": [(index, command.tolist()) for index, command in self._in_flight.items()],
            "applied": [(time, command.tolist()) for time, command in self._applied],
            "events": list(self.events),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue where `state` was taken, instead of `initialise`."""
        self._plant.restore(state["plant"])
        self._controller.restore(state["controller"])
        self._clock.restore(state["clock"])
        self.now, self.steps = state["now"], state["steps"]
        self.board.row[:] = np.frombuffer(state["row"])
        self._rows, self._handed_over = bytearray(state["rows"]), state["handed_over"]
        self._received[:] = np.frombuffer(state["received"])
        self._in_flight = {index: np.array(command) for index, command in state["in_flight"]}
        self._applied = [(time, np.array(command)) for time, command in state["applied"]]
        self.events = [(time, kind, what, k) for time, kind, what, k in state["events"]]

    # -- what happens at an instant -------------------------------------------------------------------------

    def _step_plant(self, time: int) -> None:
        start, self.now = self.now, time
        self._plant.step(start / NANOSECONDS, (time - start) / NANOSECONDS)
        self.steps += 1
        self._read_plant()
        self._check(time / NANOSECONDS)

    def _check(self, t: float) -> None:
        """Divergence is noticed before any value is passed on."""
        measured = self.board.measured.tolist()
        if not math.isfinite(sum(measured)):
            _expect_finite(MEASUREMENT, measured, t)
        x, y, z, *_, wx, wy, wz = measured
        x_d, y_d, z_d = self._reference.position(t)
        distance, speed = math.hypot(x - x_d, y - y_d, z - z_d), math.hypot(wx, wy, wz)
        if not distance <= FARTHEST:
            raise _Diverged(f"position error {distance:g} m at t = {t:g} s, expected at most {FARTHEST:g} m")
        if not speed <= FASTEST:
            raise _Diverged(f"angular speed {speed:g} rad/s at t = {t:g} s, expected at most {FASTEST:g} rad/s")

    def _diverged(self, error: Exception) -> None:
        """Take divergence as the end of the run; any other failure of an FMU is raised."""
        if isinstance(error, SimulatorError) and not error.divergence:
            raise error
        self.divergence, self.divergence_time = str(error), self.now
        self._drop_later_events()
        if not self._rows:
            self._record(self.now)

    def _end_early(self, time: int) -> None:
        self.interrupted_at = time
        self._drop_later_events()

    def _drop_later_events(self) -> None:
        """In Jacobi order a command is written down before it goes out; after the end none does."""
        self.events = [event for event in self.events if event[0] <= self.now]

    def _step_controller(self, time: int, sample: Sample | None) -> None:
        if time == self._clock.stop:
            return
        end = self._clock.next_time() if sample is None or self._timing.clock == "fmu" else sample.next_time
        if sample is not None:
            self._sense(time, sample)
        ratio = self._timing.clock_ratio  # the controller's own seconds per true second
        start_s = time / NANOSECONDS
        self._controller.step(ratio * start_s, ratio * ((min(end, self._clock.stop) - time) / NANOSECONDS))
        self._read_controller()
        command = self.board.computed.tolist()
        if not math.isfinite(sum(command)):
            _expect_finite(COMMAND, command, start_s)
        if sample is None:
            return
        if sample.sent <= self._clock.stop:
            self.events.append((sample.sent, "sent", "command", sample.k))
            if sample.arrival is None:
                self.events.append((sample.sent, "lost", "command", sample.k))
        if sample.arrival is not None:
            self._in_flight[sample.k] = self.board.computed.copy()

    def _sense(self, time: int, sample: Sample) -> None:
        self.events.append((time, "sampled", "measurement", sample.k))
        if sample.measurement_lost:
            self.events.append((time, "lost", "measurement", sample.k))
        self._sensors.receive(self.board.measured, self._received, lost=sample.measurement_lost)
        self._write_measurement()
        self._write_reference(time / NANOSECONDS)

    def _arrive(self, time: int, samples: Sequence[int]) -> None:
        for index in samples:
            self.events.append((time, "arrived", "command", index))
            newest = self._in_flight.pop(index)
        self._apply(time, newest)

    def _apply(self, time: int, command: Floats) -> None:
        self._applied = [*self._applied[-1:], (time, command)]
        self.board.applied[:] = command
        self._write_command()

    def _extrapolate(self, time: int) -> None:
        """First-order hold: the line through the last two applied commands, held over the plant's step."""
        if len(self._applied) < 2:
            return
        (t0, before), (t1, last) = self._applied
        if t0 == t1 or time == t1:
            return
        share = (time - t1) / (t1 - t0)
        self.board.applied[:] = last + share * (last - before)
        self._write_command()

    def _record(self, time: int) -> None:
        row = self.board.row
        row[0] = time / NANOSECONDS
        self._rows += row.data
        if len(self._rows) == self._chunk:
            self._hand_over()

    def _hand_over(self) -> None:
        self._recorder.take(self.pending())
        self.events = [event for event in self.events if event[0] > self.now]
        self._rows.clear()
        self._handed_over = True

    def _finish(self) -> None:
        if self._rows or self.events or not self._handed_over:
            self._hand_over()

    def _reference_writer(self) -> Callable[[float], None]:
        """Feeds the reference inputs, if the reference is a file."""
        reference = self._reference
        if not isinstance(reference, FromFile):
            return lambda t: None
        values: Floats = np.zeros(len(REFERENCE))
        write: Transfer = self._controller.writer(REFERENCE, values)

        def feed(t: float) -> None:
            values[:] = reference.values(t)
            write()

        return feed


def _expect_finite(names: Sequence[str], values: Sequence[float], t: float) -> None:
    for name, value in zip(names, values, strict=True):
        if not math.isfinite(value):
            raise _Diverged(f"{name} = {value} at t = {t:g} s, expected a finite value")


class _Diverged(Exception):
    """The loop has left the region that counts as flying."""
