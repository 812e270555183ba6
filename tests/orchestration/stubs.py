"""Simulators in a few lines of Python that write down every call, and a master over two of them."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.clock import Clock, random_streams
from orchestration.errors import SimulatorError
from orchestration.master import Master, Signals
from orchestration.recording import Chunk, Event, InMemory
from orchestration.reference import ReferencePath
from orchestration.sensors import Sensors
from orchestration.simulator import Floats, Simulator, Transfer
from orchestration.timing import Timing
from orchestration.wiring import COMMAND, MEASUREMENT

Call = tuple[Any, ...]


class Stub:
    """Values by name, and calls into a log that several stubs share."""

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

    def __init__(self, log: list[Call] | None = None, **start: float) -> None:
        super().__init__({**dict.fromkeys((*MEASUREMENT, *COMMAND), 0.0), "quaternion.w": 1.0, **start}, log)
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
    """A controller whose thrust is the number of its steps, and that remembers what it was told at each."""

    name = "controller"

    def __init__(self, log: list[Call] | None = None) -> None:
        super().__init__(dict.fromkeys((*MEASUREMENT, *COMMAND), math.nan), log)
        self.told: list[dict[str, float]] = []

    def exit_initialization(self) -> None:
        super().exit_initialization()
        self.told.append({name: self.values[name] for name in MEASUREMENT})
        self.values.update(dict.fromkeys(COMMAND, 0.0))

    def advance(self, t: float, h: float) -> None:
        self.told.append({name: self.values[name] for name in MEASUREMENT})
        self.values["thrust"] += 1.0


class Feedback(Counting):
    """A controller that pulls the mass to the origin, with memory, so that every difference shows."""

    def exit_initialization(self) -> None:
        super().exit_initialization()
        self.command()

    def advance(self, t: float, h: float) -> None:
        super().advance(t, h)
        self.command()

    def command(self) -> None:
        v = self.values
        v["torque.x"] += 0.1 * v["position.x"]
        v["thrust"] = -4.0 * v["position.x"] - 3.0 * v["velocity.x"] - v["torque.x"]


class AtOrigin:
    """The reference that stays at the origin."""

    def position(self, t: float) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0

    def positions(self, t: Floats) -> Floats:
        return np.zeros((len(t), 3))


class Flown:
    """A master that has flown, or has been made to."""

    def __init__(
        self,
        timing: Timing,
        stop_time: float = 0.1,
        plant: Plant | None = None,
        controller: Simulator | None = None,
        *,
        seed: int = 0,
        reference: ReferencePath | None = None,
        start: bool = True,
    ) -> None:
        self.timing = timing
        self.plant = plant or Plant(**{"position.x": 1.0})
        self.controller: Any = controller or Counting()
        streams = random_streams(seed)
        self.recorder = InMemory()
        self.master = Master(
            self.plant,
            self.controller,
            clock=Clock(timing, stop_time, streams),
            timing=timing,
            sensors=Sensors(MEASUREMENT, timing, streams["noise"]),
            reference=reference or AtOrigin(),
            signals=Signals(plant=(), controller=()),
            recorder=self.recorder,
        )
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

    def bits(self) -> tuple[bytes, list[tuple[Any, ...]]]:
        """All that was recorded."""
        return self.rows().tobytes(), [tuple(event) for event in self.all_events()]
