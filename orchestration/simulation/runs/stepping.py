"""A run that is stepped from sample to sample, with the caller's code in place of one component."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any

import numpy as np

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.instance import Instance, Value
from orchestration.components.fmi.read_description import Model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import Named, UsageError
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.recording.recording import InMemory
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.runs.outcome import RunOutcome, result_of
from orchestration.simulation.runs.prepared import PreparedRun, prepared
from orchestration.simulation.runs.replacement import command_of, names_of, replace_component
from orchestration.simulation.runs.result import Result
from orchestration.systems.schedule.streams import Streams


class Simulation:
    """A run of a system, or a scenario, in which your code takes the place of one component.

    The run stops wherever that component is to be stepped, returns its inputs (late, lost and noisy as in the system;
    at the end of the run the true values), and goes on with the outputs that your code computes::

        with quadcosim.Simulation(Scenario()) as simulation:
            measurement = simulation.reset(seed=1)
            while not simulation.is_over:
                measurement = simulation.step(law(measurement))
            print(simulation.result.metrics)

    The component's own FMU is not called. All else is as in the run with that FMU, by the same engine, to the bit.
    """

    def __init__(
        self,
        request: RequestLike,
        component: str | None = None,
        *,
        initial: Any = None,
        in_process: bool = False,
    ) -> None:
        """`component` is the one that is replaced; default: the only sampled one.

        `initial` is the command that stands until your first one arrives, which a delay or a loss puts off; default:
        that with which inputs keep their start values, of a scenario the thrust of hover, m·g, and no torque. FMUs that
        were not built here from this project's sources have a process each, unless `in_process`.

        Raises `UsageError` for a system that cannot run, and for a component that does not exist or has its own clock.
        """
        self._replacement = replacement = replace_component(request_of(request), component, initial)
        self.component = replacement.component
        """The name of the component that is replaced."""
        self.measured = replacement.measured
        """The names in a measurement, in order: its inputs that are connected or fed by a source."""
        self.commanded = replacement.commanded
        """The names in a command, in order: its outputs that are connected."""
        self._instances = Instances(foreign_apart=not in_process)
        self._thread: threading.Thread | None = None
        self._run: PreparedRun | None = None
        self._outcome: RunOutcome | None = None
        self._result: Result | None = None

    # -- a run -----------------------------------------------------------------------------------------------------

    def reset(self, seed: int | None = None, values: Mapping[str, Any] | None = None) -> Floats:
        """Begin a run and return the first measurement, shape (number of `measured`,).

        `seed` is that of all random numbers; default: the one of the system. `values` are other values by path, as
        axes of studies name them. Raises `UsageError` for invalid values, `SimulatorError` if an FMU refuses them.
        """
        self._abandon()
        self._resolved = self._replacement.resolve(values or {}, seed)
        self._reports: SimpleQueue[BaseException | None] = SimpleQueue()
        self._replies: SimpleQueue[bool] = SimpleQueue()
        self._outcome, self._result, self._run = None, None, None
        self._recorder, self._started = InMemory(), time.perf_counter()
        self._sources = self._resolved.sources(Streams(self._resolved.system.seed, self._resolved.system.streams))
        self._thread = threading.Thread(target=self._simulate, name="quadcosim run", daemon=True)
        self._thread.start()
        return self._next_measurement()

    def step(self, command: Any) -> Floats:
        """Go on with a command and return the next measurement; at the end of the run, the true values then.

        These, also where a run diverges, are neither late, lost nor noisy: the component is not stepped there.
        `command` is an array with one number for each of `commanded`, or their values by name. Raises `UsageError` for
        anything else, and where no run is under way.
        """
        if self._thread is None:
            ended = "no run is under way" if self._outcome is None else f"the run is over, {_end_of(self._outcome)}"
            raise UsageError(f"step: {ended}; expected reset before it")
        self._substitute.command[:] = command_of(command, self.commanded, "command")
        self._replies.put(True)
        return self._next_measurement()

    @property
    def is_over(self) -> bool:
        """Whether the run is over: at its end, diverged, or ended by an FMU."""
        return self._outcome is not None

    @property
    def time(self) -> float:
        """The time [s] of the last measurement."""
        return seconds(self._under_way.master.running.now)

    @property
    def names(self) -> tuple[str, ...]:
        """The names that `values` has in a run."""
        return names_of(self._replacement.resolve({}, None).system, self._replacement.models)

    @property
    def values(self) -> dict[str, float]:
        """The values of all columns and sources now, by name; commands are the last ones before now."""
        master, t = self._under_way.master, self.time
        board = {column: float(master.board.row[place]) for column, place in master.board.place.items()}
        sources = {
            signal: float(value)
            for name, each in self._sources.items()
            for signal, value in zip(self._resolved.system.sources[name].signals(name), each.at(t))
        }
        return Named({**board, "time": t, **sources})

    @property
    def result(self) -> Result:
        """The result of the run, as `run` returns it; raises `UsageError` before the run is over."""
        if self._outcome is None:
            raise UsageError("result: the run is not over; expected it after the last step")
        if self._result is None:
            wall_time = time.perf_counter() - self._started
            self._result = result_of(self._resolved, self._outcome, self._recorder, wall_time, interrupted=False)
        return self._result

    def close(self) -> None:
        """Abandon the run and free the FMUs."""
        self._abandon()
        self._instances.close()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- the thread of the run -------------------------------------------------------------------------------------

    def _simulate(self) -> None:
        """The whole run; its outcome is reported to the thread that waits for it."""
        error: BaseException | None = None
        try:
            with prepared(
                self._resolved.request, load=self._load, recorder=self._recorder, resolved=self._resolved
            ) as self._run:  # fmt: skip
                self._run.master.initialise()
                self._substitute.begin()
                self._run.master.run()
                self._measure_end(self._run)
                self._outcome = self._run.outcome()
        except BaseException as raised:  # raised again in the thread that waits for the run
            error = raised
        self._reports.put(error)

    @contextmanager
    def _load(self, path: Path, instance_name: str, access: Access = USUAL) -> Iterator[Instance]:
        """An instance of a component, or its substitute."""
        if instance_name == self.component:
            resolved, model = self._resolved, self._replacement.models[instance_name]
            initial = self._replacement.initial_command(resolved.system, resolved.parameters)
            self._substitute = Substitute(path, instance_name, model, self.measured, self.commanded, initial)
            self._substitute.await_command = self._await_command
            yield self._substitute
            return
        with self._instances.load(path, instance_name, access) as instance:
            yield instance

    def _await_command(self) -> None:
        """Wait for a command; raises `Abandoned` if there will be none."""
        self._reports.put(None)
        if not self._replies.get():
            raise Abandoned

    def _measure_end(self, run: PreparedRun) -> None:
        """Deliver the measurement at the end of the run, where the component is not stepped."""
        running = run.master.running
        for x, channel in zip(self._resolved.system.connections, running.channels):
            if x.receiver == self.component:
                channel.pass_on()
        for feed in running.feeds:
            if feed.feeds(self.component):
                feed.write(seconds(running.now))

    # -- the thread that waits for it ------------------------------------------------------------------------------

    def _next_measurement(self) -> Floats:
        """Wait for the next measurement; raises the error that ended the run, if one did."""
        assert self._thread is not None
        error = self._reports.get()
        if error is not None or self._outcome is not None:
            self._thread.join()
            self._thread = None
        if error is not None:
            raise error
        return np.asarray(self._substitute.measurement.copy())

    def _abandon(self) -> None:
        """End the run that is under way, if there is one."""
        if self._thread is not None:
            self._replies.put(False)
            self._thread.join()
            self._thread = None

    @property
    def _under_way(self) -> PreparedRun:
        if self._run is None:
            raise UsageError("no run is under way; expected reset before")
        return self._run


def _end_of(outcome: RunOutcome) -> str:
    """Why a run is over, and when."""
    why = outcome.termination or ("diverged" if outcome.divergence else "at its end")
    return f"{why}, t = {outcome.end:g} s"


class Abandoned(BaseException):
    """The caller computes no more outputs: the run is to be left where it is."""


class Substitute(Instance):
    """In the place of the instance of a component: the caller computes its outputs."""

    await_command: Callable[[], None]
    """Called at each step: `measurement` is up to date then, and it fills in `command`"""

    def __init__(
        self,
        path: Path,
        name: str,
        model: Model,
        measured: Sequence[str],
        commanded: Sequence[str],
        initial: Sequence[float],
    ) -> None:
        """`initial` is the command that stands until the first."""
        self._measured, self._commanded = list(measured), list(commanded)
        self._has_begun = False
        self.path, self.name, self.model = path, name, model
        self.measurement: Floats = np.zeros(len(measured))
        self.command: Floats = np.array(initial, dtype=np.float64)
        self.warnings, self.failed, self.stopped = [], False, False

    def begin(self) -> None:
        """From here on the caller computes each step; before, it is stepped to its first sample."""
        self._has_begun = True

    def set(self, name: str, value: Value) -> None:
        """Nothing: parameters are those of the FMU's code."""

    def set_tolerance(self, tolerance: float) -> None:
        """Nothing, likewise."""

    def set_clock(self, period: float, offset: float, *, late: bool) -> None:
        """Nothing, likewise."""

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As any instance, of the command."""
        places = [self._commanded.index(name) for name in names]

        def transfer() -> None:
            into[:] = self.command[places]

        return transfer

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As any instance; a reference that the FMU follows is no measurement."""
        kept = [i for i, name in enumerate(names) if name in self._measured]
        places = [self._measured.index(names[i]) for i in kept]

        def transfer() -> None:
            self.measurement[places] = source[kept]

        return transfer

    def get(self, name: str) -> Value:
        """The value of an output."""
        return float(self.command[self._commanded.index(name)])

    def reset(self) -> None:
        """Nothing: it is that of one run."""
        return

    def close(self) -> None:
        """Nothing, likewise."""
        return

    def enter_initialization(self, start: float, stop: float) -> None:
        """Nothing: the command is known."""

    def exit_initialization(self) -> None:
        """Nothing, likewise."""

    def step(self, t: float, h: float) -> None:
        """Wait for the outputs of the caller."""
        if self._has_begun:
            self.await_command()

    def save(self) -> bytes:
        """Not supported: the state of the caller's code is unknown."""
        raise NotImplementedError

    def restore(self, state: bytes) -> None:
        """Not supported: the state of the caller's code is unknown."""
        raise NotImplementedError
