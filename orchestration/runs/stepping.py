"""A run that goes on from sample to sample, with the caller's code in the place of one of its components."""

import math
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.fmi.instance import Instance
from orchestration.fmi.reuse import Instances
from orchestration.recording.recording import InMemory
from orchestration.requests.request import Asked, asked_for
from orchestration.runs.in_place import InPlace, Left
from orchestration.runs.meant import Flown, result_of
from orchestration.runs.replaced import replaced
from orchestration.runs.result import Result
from orchestration.runs.simulation import PreparedRun, prepared
from orchestration.schedule.streams import Streams
from orchestration.system.times import NANOSECONDS


class Simulation:
    """A system, or a scenario, whose run stops wherever one of its components is to be stepped: that is your code.

    Each time it hands out what the component's inputs are then, late, lost and noisy as the system has it, and goes on
    with what you say that its outputs are::

        with quadcosim.Simulation(Scenario()) as simulation:
            measurement = simulation.reset(seed=1)
            while not simulation.is_over:
                measurement = simulation.step(law(measurement))
            print(simulation.result.metrics)

    The component's own FMU computes its outputs at initialisation, with its parameters, and is not called after. All
    else is the run that it is with that FMU, by the same engine, to the bit.
    """

    def __init__(self, asked: Asked, component: str | None = None) -> None:
        """`component` is the one that is replaced; without it, the only sampled one.

        Raises `UsageError` for a system that cannot run, and for a component that there is not or that has a clock of
        its own.
        """
        self._replaced = one = replaced(asked_for(asked), component)
        self.component = one.component
        """The name of the component that is replaced."""
        self.measured = one.measured
        """What it is told, in the order of a measurement: its inputs that are connected, or fed by a source."""
        self.commanded = one.commanded
        """What it says, in the order of a command: its outputs that are connected."""
        self._instances = Instances()
        self._thread: threading.Thread | None = None
        self._run: PreparedRun | None = None
        self._flown: Flown | None = None
        self._result: Result | None = None

    # -- a run -----------------------------------------------------------------------------------------------------

    def reset(self, seed: int | None = None, values: Mapping[str, Any] | None = None) -> Floats:
        """Begin a run, and give the first measurement, shape (number of `measured`,).

        `seed` is that of all random numbers, without it the one of the system; `values` are other values by path, as
        axes of studies name them. Raises `UsageError` for what cannot be, `SimulatorError` if an FMU refuses it.
        """
        self._leave()
        self._meant = self._replaced.held({**(values or {}), **({} if seed is None else {"seed": seed})})
        self._said: SimpleQueue[BaseException | None] = SimpleQueue()
        self._answers: SimpleQueue[bool] = SimpleQueue()
        self._flown, self._result, self._run = None, None, None
        self._recorder, self._started = InMemory(), time.perf_counter()
        self._sources = self._meant.sources(Streams(self._meant.system.seed, self._meant.system.streams))
        self._thread = threading.Thread(target=self._fly, name="quadcosim run", daemon=True)
        self._thread.start()
        return self._heard()

    def step(self, command: Any) -> Floats:
        """Go on with a command, and give the next measurement; at the end of the run, what would be measured then.

        `command` is an array of the number of `commanded`, or their values by name. Raises `UsageError` for another,
        and where no run is under way.
        """
        if self._thread is None:
            raise UsageError("step: no run is under way; expected reset before it")
        self._place.command[:] = self._read(command)
        self._answers.put(True)
        return self._heard()

    @property
    def is_over(self) -> bool:
        """Whether the run is: at its end, diverged, or ended by an FMU."""
        return self._flown is not None

    @property
    def time(self) -> float:
        """The time [s] of the last measurement."""
        return self._under_way.master.now / NANOSECONDS

    @property
    def values(self) -> dict[str, float]:
        """What all columns of the run are now, by name, and what its sources say; commands are those before this."""
        master, t = self._under_way.master, self.time
        board = {column: float(master.board.row[place]) for column, place in master.board.place.items()}
        sources = {
            signal: float(value)
            for name, each in self._sources.items()
            for signal, value in zip(self._meant.system.sources[name].signals(name), each.at(t))
        }
        return {**board, "time": t, **sources}

    @property
    def result(self) -> Result:
        """The run that is over, as `run` gives it; raises `UsageError` before."""
        if self._flown is None:
            raise UsageError("result: the run is not over; expected it after the last step")
        if self._result is None:
            wall_time = time.perf_counter() - self._started
            self._result = result_of(self._meant, self._flown, self._recorder, wall_time, interrupted=False)
        return self._result

    def close(self) -> None:
        """Leave the run where it is, and free the FMUs."""
        self._leave()
        self._instances.close()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- the thread of the run -------------------------------------------------------------------------------------

    def _fly(self) -> None:
        """The whole run; what comes of it is said where it is waited for."""
        error: BaseException | None = None
        try:
            with prepared(
                self._meant.asked, load=self._load, recorder=self._recorder, meant=self._meant
            ) as self._run:  # fmt: skip
                self._run.master.initialise()
                self._place.begin()
                self._run.master.run()
                self._measure_end(self._run)
                self._flown = self._run.flown()
        except BaseException as raised:  # whatever it is, it is raised where the run is waited for
            error = raised
        self._said.put(error)

    @contextmanager
    def _load(self, path: Path, instance_name: str) -> Iterator[Instance]:
        """An instance of a component, or what stands in its place."""
        with self._instances.load(path, instance_name) as instance:
            if instance_name == self.component:
                self._place = InPlace(instance, self.measured, self.commanded, self._ask)
                yield self._place
            else:
                yield instance

    def _ask(self) -> None:
        """Wait for a command; raises `Left` if there will be none."""
        self._said.put(None)
        if not self._answers.get():
            raise Left

    def _measure_end(self, run: PreparedRun) -> None:
        """What the component would be told at the end of the run, where it is not asked."""
        for x, channel in zip(self._meant.system.connections, run.master.channels):
            if x.receiver == self.component:
                channel.pass_on()

    # -- where it is waited for ------------------------------------------------------------------------------------

    def _heard(self) -> Floats:
        """The next measurement; raises what has ended the run if that is an error."""
        assert self._thread is not None
        error = self._said.get()
        if error is not None or self._flown is not None:
            self._thread.join()
            self._thread = None
        if error is not None:
            raise error
        measurement: Floats = self._place.measurement.copy()
        return measurement

    def _leave(self) -> None:
        """End the run that is under way, if any is."""
        if self._thread is not None:
            self._answers.put(False)
            self._thread.join()
            self._thread = None

    @property
    def _under_way(self) -> PreparedRun:
        if self._run is None:
            raise UsageError("no run is under way; expected reset before")
        return self._run

    def _read(self, command: Any) -> Floats:
        """A command as numbers in their order; raises `UsageError` for what is none."""
        names = self.commanded
        if isinstance(command, Mapping):
            for name in (*command, *names):
                if name not in names or name not in command:
                    raise UsageError(f"command: {name}: expected values of {', '.join(names)}")
            command = [command[name] for name in names]
        values: Floats = np.zeros((0, 0))
        with suppress(TypeError, ValueError):  # of numpy's, for what is no array of numbers
            values = np.asarray(command, dtype=np.float64)
        if values.shape != (len(names),):
            raise UsageError(f"command: expected {len(names)} numbers: {', '.join(names)}")
        for name, value in zip(names, values.tolist()):
            if not math.isfinite(value):
                raise UsageError(f"command: {name} = {value}: expected a finite number")
        return values
