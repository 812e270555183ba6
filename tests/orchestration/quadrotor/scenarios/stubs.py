"""Simulators in a few lines of Python that write down every call, a master over two of them, and its timetable."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.simulator import Floats, Simulator, Transfer
from orchestration.foundation.recording.recording import Chunk, Event, InMemory
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT, POSITION_REFERENCE
from orchestration.simulation.engines.condition import Condition
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.simulation.engines.sources import ConstantValues, SourceValues
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable

Call = tuple[Any, ...]


class Stub:
    """SourceValues by name, and calls into a log that several stubs share."""

    name = "stub"

    def __init__(self, values: Mapping[str, float], log: list[Call] | None = None) -> None:
        self.values = dict(values)
        self.log: list[Call] = [] if log is None else log

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        def read() -> None:
            self.log.append((self.name, "read"))
            into[:] = [self.values[name] for name in names]

        return read

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        def write() -> None:
            self.log.append((self.name, "write", *names[:1]))
            self.values.update(zip(names, source.tolist(), strict=True))

        return write

    def enter_initialization(self, start: float, stop: float) -> None:
        self.log.append((self.name, "enter", start, stop))

    def exit_initialization(self) -> None:
        self.log.append((self.name, "exit"))

    def step(self, t: float, h: float) -> None:
        self.log.append((self.name, "step", t, h))
        self.advance(t, h)

    def advance(self, t: float, h: float) -> None:
        """What the model does in a step."""

    def save(self) -> bytes:
        return json.dumps(self.values).encode()

    def restore(self, state: bytes) -> None:
        self.values = json.loads(state)

    def steps(self) -> list[tuple[float, float]]:
        return [(call[2], call[3]) for call in self.log if call[:2] == (self.name, "step")]


class Plant(Stub):
    """A mass on a line, `position.x`, that the thrust pushes; it remembers the thrust of every step."""

    name = "plant"

    def __init__(self, start: Mapping[str, float] | None = None, log: list[Call] | None = None) -> None:
        super().__init__({**dict.fromkeys((*MEASUREMENT, *COMMAND), 0.0), "quaternion.w": 1.0, **(start or {})}, log)
        self.thrusts: list[float] = []

    def advance(self, t: float, h: float) -> None:
        v, thrust = self.values, self.values["thrust"]
        self.thrusts.append(thrust)
        v["position.x"] += h * v["velocity.x"] + 0.5 * h * h * thrust
        v["velocity.x"] += h * thrust
        v["position.y"] = t + h
        v["angular_velocity.z"] = math.sin(thrust)


class Still(Plant):
    """A plant that stays where it is, however long it is pushed."""

    def advance(self, t: float, h: float) -> None:
        self.thrusts.append(self.values["thrust"])


class Straying(Plant):
    """A plant that at `time` takes the `sudden` values, `__` for the dots in their names, or raises `error`."""

    def __init__(self, *, time: float = math.inf, error: SimulatorError | None = None, **sudden: float) -> None:
        super().__init__()
        self.time, self.error, self.sudden = time, error, sudden

    def advance(self, t: float, h: float) -> None:
        super().advance(t, h)
        if t + h >= self.time - 1e-12:
            if self.error is not None:
                raise self.error
            self.values.update({name.replace("__", "."): value for name, value in self.sudden.items()})


class Counting(Stub):
    """A controller whose thrust is the number of its steps, and that remembers its inputs at each."""

    name = "controller"

    def __init__(self, log: list[Call] | None = None) -> None:
        super().__init__(dict.fromkeys((*MEASUREMENT, *COMMAND), math.nan), log)
        self.received: list[dict[str, float]] = []
        self.initialising = False

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        read = super().reader(names, into)

        def read_what_follows() -> None:
            if self.initialising:
                self.begin()
            read()

        return read_what_follows

    def enter_initialization(self, start: float, stop: float) -> None:
        super().enter_initialization(start, stop)
        self.initialising = True

    def exit_initialization(self) -> None:
        super().exit_initialization()
        self.initialising = False
        self.received.append({name: self.values[name] for name in MEASUREMENT})

    def begin(self) -> None:
        """What follows from its inputs while it is initialised, however often it is asked for."""
        self.values.update(dict.fromkeys(COMMAND, 0.0))

    def advance(self, t: float, h: float) -> None:
        self.received.append({name: self.values[name] for name in MEASUREMENT})
        self.values["thrust"] += 1.0


class Feedback(Counting):
    """A controller that pulls the mass to the origin, with memory, so that every difference shows."""

    def begin(self) -> None:
        super().begin()
        self.command()

    def advance(self, t: float, h: float) -> None:
        super().advance(t, h)
        self.command()

    def command(self) -> None:
        v = self.values
        v["torque.x"] += 0.1 * v["position.x"]
        v["thrust"] = -4.0 * v["position.x"] - 3.0 * v["velocity.x"] - v["torque.x"]


AT_ORIGIN = ConstantValues([0.0, 0.0, 0.0])
"""The reference that stays at the origin."""


class Sample(NamedTuple):
    """One sampling instant of the controller."""

    k: int
    time: int
    next_time: int
    measurement_lost: bool
    sent: int
    arrival: int | None


class Instant(NamedTuple):
    """A communication point of the plant, and what happens there."""

    time: int
    sample: Sample | None
    arrivals: tuple[int, ...]


def cursor_of(timing: Timing, stop_time: float, seed: int = 0) -> Cursor:
    """At the start of a flight with this timing."""
    system = Scenario(timing=timing, stop_time=stop_time).as_system()
    return Cursor(Timetable(system, Streams(seed, system.streams)))


def instants_of(cursor: Cursor) -> Iterator[Instant]:
    """The instants of a flight in words of the loop of two: each is a communication point of the plant."""
    for instant in cursor.instants():
        sample, arrivals = None, [k for _, k, _, _ in instant.arrivals]
        for due in instant.samples:
            ((_, k, _, received),), ((_, _, sent, arrival),) = due.received, due.sent
            sample = Sample(k, instant.time, due.next_time, received < 0, sent, None if arrival < 0 else arrival)
            arrivals += [k] if arrival == instant.time else []
        assert list(instant.stepped) == [0]
        yield Instant(instant.time, sample, tuple(arrivals))


class StubRun:
    """A master over stubs, which has run unless `start` is False."""

    def __init__(
        self,
        timing: Timing,
        stop_time: float = 0.1,
        plant: Plant | None = None,
        controller: Simulator | None = None,
        *,
        seed: int = 0,
        reference: SourceValues = AT_ORIGIN,
        start: bool = True,
    ) -> None:
        self.timing = timing
        self.plant = plant or Plant({"position.x": 1.0})
        self.controller: Any = controller or Counting()
        self.recorder = InMemory()
        system = Scenario(timing=timing, stop_time=stop_time).as_system()
        streams = Streams(seed, system.streams)
        named, signals = {"reference": reference}, {"reference": POSITION_REFERENCE}
        running = RunningSystem(
            system,
            {"plant": self.plant, "controller": self.controller},
            timetable=Timetable(system, streams),
            streams=streams,
            recorded={"plant": (), "controller": ()},
            condition=Condition(text=system.criterion.diverged, sources=named, signals_of=signals),
        )
        self.master = Master(running, self.recorder)
        self.over: bool | None = None
        if start:
            self.master.initialise()
            self.over = self.master.run()

    def column(self, name: str) -> npt.NDArray[np.float64]:
        return self.rows()[:, self.master.board.columns.index(name)]

    def chunks(self) -> list[Chunk]:
        """What was handed over, and what was not yet."""
        return [*self.recorder.chunks(), self.master.pending()]

    def rows(self) -> Floats:
        return np.concatenate([chunk.rows for chunk in self.chunks()])

    def all_events(self) -> list[Event]:
        return [event for chunk in self.chunks() for event in chunk.events]

    def nanoseconds(self) -> list[int]:
        return [round(t * 1e9) for t in self.column("time")]

    def events(self, kind: str, what: str | None = None) -> list[Event]:
        """In order of time."""
        return [event for event in self.all_events() if event.kind == kind and what in (None, event.what)]

    def state(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """What another goes on from."""
        return self.master.state(), self.master.saved()

    def bits(self) -> tuple[bytes, list[tuple[Any, ...]]]:
        """All that was recorded."""
        return self.rows().tobytes(), [tuple(event) for event in self.all_events()]
