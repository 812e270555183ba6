"""The flights of one system: by tools, in processes of their own, and by this project's master."""

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.basics.simulator import Floats, Transfer
from orchestration.fmi.fmi2 import Fmi2Instance
from orchestration.fmi.foreign import isolated_call
from orchestration.fmi.instance import Instance
from orchestration.fmi.instances import open_instance
from orchestration.interop.assignment import Loop, loop_of
from orchestration.interop.catalogue import Tool
from orchestration.interop.copies import expect_traceable, traced_copy
from orchestration.interop.job import Job
from orchestration.interop.trace import Trace, read_trace
from orchestration.processes import subprocesses
from orchestration.processes.child import Child
from orchestration.requests.ssp import writing
from orchestration.requests.ssp.export import Part, complete_export, export_of
from orchestration.runs.prepared import prepared
from orchestration.system.component import Parameter
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.request import Request, errors_in_own_terms
from orchestration.system.times import exact_nanoseconds

_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
"""Where a tool unpacks, by the names that systems have for it: not all clean up after themselves."""

Start = dict[str, tuple[tuple[float, ...], tuple[float, ...]]]
"""By component: its connected inputs as its initialisation ends, and those of its first step."""


class Flights:
    """One system, flown by whom it is asked of until the block ends; raises as `compare.agreements` does."""

    def __init__(self, asked: Request, folder: Path, announce: Callable[[str], None] | None) -> None:
        self._folder = folder
        with errors_in_own_terms(asked):
            system = _in_order(asked.as_system(), "gauss-seidel")
            given = complete_export(system, announce)
            self._fmus = {part.name: part.fmu.absolute() for part in given.parts}
            self._system = _with_fmus(system, self._fmus)
            self._clocks = {part.name for part in given.parts if part.model.has_clock}
            self.loop = loop_of(given)
            self.step = given.step
            """[s]"""
            _expect_common_grid(system, given.step)
            for fmu in self._fmus.values():
                expect_traceable(fmu)
        self.steps = round(system.stop_time / self.step)
        self._own: dict[tuple[str, str], Floats] = {}
        self._flying: list[Child] = []
        self._lock, self._over = threading.Lock(), False
        np.save(folder / "recorded.npy", self.rows_of_master("gauss-seidel", {})[:-1])

    def __enter__(self) -> "Flights":
        return self

    def __exit__(self, *exception: object) -> None:
        with self._lock:
            self._over = True
        for child in self._flying:
            child.close()

    def flown(self, tool: Tool) -> Floats:
        """A tool's rows, from the FMUs as they are."""
        return self._in_a_process(tool, "flown", lambda component, folder: self._fmus[component])

    def seen(self, tool: Tool) -> Trace:
        """How a tool flies, from traced copies."""
        ports = self.loop.ports
        self._in_a_process(tool, "seen", lambda name, folder: traced_copy(self._fmus[name], name, ports[name], folder))
        folder = self._folder / tool.call.replace(":", "_") / "seen"
        return read_trace(folder, {name: self._fmus[name] for name in self.flown_by(tool)}, self.loop, self.step)

    def flown_by(self, tool: Tool) -> tuple[str, ...]:
        """The components that a tool flies."""
        return tuple(self.loop.ports) if tool.alone is None else (tool.alone,)

    def _in_a_process(self, tool: Tool, purpose: str, prepare: Callable[[str, Path], Path]) -> Floats:
        folder = self._folder / tool.call.replace(":", "_") / purpose
        folder.mkdir(parents=True)
        system = _with_fmus(self._system, {name: prepare(name, folder) for name in self._fmus})
        parts = export_of(system).parts
        job = Job(
            fmus={part.name: part.fmu for part in parts},
            ssp=writing.write(system, folder / "loop.ssp"),
            step=self.step,
            stop=system.stop_time,
            parameters={part.name: parameters_for(tool, part) for part in parts},
            connections=self.loop.connections,
            signals=self.loop.signals,
            recorded=self._folder / "recorded.npy",
            folder=folder,
        )
        (folder / "job.json").write_text(job.to_json(), encoding="utf-8")
        ending = self._started(tool.command(folder / "job.json", folder / "rows.npy"), folder).ending()
        if ending.code != 0:
            raise QuadcosimError(f"{tool.name}: {ending.last_line or ending.description.removeprefix('ended with ')}")
        return np.asarray(np.load(folder / "rows.npy"))

    def _started(self, command: Sequence[str] | subprocesses.Module, folder: Path) -> Child:
        with self._lock:
            if self._over:  # copies were made meanwhile
                raise QuadcosimError("the flights have ended")
            child = Child(
                command,
                environment=subprocesses.environment(**dict.fromkeys(_TEMPORARY, str(folder))),
                folder=folder,  # not this process's: fmpy changes that while it loads an FMU, in another thread
                communicates=False,
            )
            self._flying.append(child)
        return child

    def rows_of_master(self, order: str, start: Start) -> Floats:
        """This project's flight: the time, the signals; a command is the one computed at the row's time."""
        key = (order, repr(start))
        if key not in self._own:
            system = _in_order(_by_own_clocks(self._system, self._clocks), order, self.step)

            found = isolated_call(self._fmus.values(), _rows, system, self.loop, start)
            if isinstance(found, str):
                raise QuadcosimError(f"in this project's master, {order}: {found}; nothing to compare")
            self._own[key] = found
        return self._own[key]


def _rows(system: System, loop: Loop, start: Start) -> Floats | str:
    """The time and the signals of a flight here; why it has ended, if that was before its time."""

    def load(path: Path, instance_name: str) -> Instance:
        if not start:
            return open_instance(path, instance_name)
        return _GivenStart(path, instance_name, loop.ports[instance_name].inputs, *start[instance_name])

    with prepared(system, load=load) as flight:
        flight.master.initialise()
        flight.master.run()
        result = flight.result()
    ended = result.divergence or result.termination
    return ended or np.column_stack([result.signals[name] for name in ("time", *loop.signals)])


def parameters_for(tool: Tool, part: Part) -> dict[str, Parameter]:
    """The parameters that a tool is to set; raises `UsageError` for one that it cannot and that is not as it starts."""
    if not tool.sets_reals_only:
        return part.parameters
    others = {name: value for name, value in part.parameters.items() if part.variable(name).kind != "Real"}
    for name, value in others.items():
        start = part.variable(name).start
        if str(value) != start:
            raise UsageError(
                f"{tool.name}: {part.name}.{name} = {value}: it sets parameters of type Real only; expected {start}"
            )
    return {name: value for name, value in part.parameters.items() if name not in others}


def _with_fmus(system: System, fmus: Mapping[str, Path]) -> System:
    return changed(system, {f"components.{name}.fmu": str(path) for name, path in fmus.items()})


def _by_own_clocks(system: System, clocks: Collection[str]) -> System:
    """Sampled components that can keep a clock of their own, as they do in other masters."""
    sampled = [name for name, component in system.components.items() if component.sampling is not None]
    return changed(system, {f"components.{name}.sampling.clock": "fmu" for name in sampled if name in clocks})


def _in_order(system: System, order: str, step: float = 0.0) -> System:
    """Every connection in an order; in Jacobi's, what a component with its own clock sends is a step late.

    (As it takes many steps in a period, and other masters exchange after each.)
    """
    changes: dict[str, Any] = {}
    for x in system.connections:
        sampling = system.components[x.sender].sampling
        has_built_in_trajectory = sampling is not None and sampling.clock == "fmu"
        changes[f"connections.{x.name}.order"] = "gauss-seidel" if has_built_in_trajectory else order
        if has_built_in_trajectory and order == "jacobi":
            changes[f"connections.{x.name}.delay"] = step
    return changed(system, changes)


class _GivenStart(Fmi2Instance):
    """An FMU whose connected inputs are given ones until its first step is over, whatever the master sends."""

    def __init__(
        self, path: Path, name: str, connected: Sequence[str], initial: Sequence[float], first: Sequence[float]
    ) -> None:
        super().__init__(path, name)
        self._connected = names = tuple(connected)
        self._put_initial = super().writer(names, np.array(initial))
        self._put_first = super().writer(names, np.array(first))
        self._held: list[Transfer] = []
        self.stepped = False

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As of the base; of connected inputs only once the first step is over."""
        usual = super().writer(names, source)
        if not set(names) <= set(self._connected):
            return usual
        self._held.append(usual)
        return lambda: usual() if self.stepped else None

    def enter_initialization(self, start: float, stop: float) -> None:
        """As of the base; what it sends first is what comes of the given inputs."""
        super().enter_initialization(start, stop)
        self._put_initial()

    def exit_initialization(self) -> None:
        """As of the base; then the inputs of the first step."""
        super().exit_initialization()
        self._put_first()

    def step(self, t: float, h: float) -> None:
        """As of the base; after the first one the inputs are what the master has sent meanwhile."""
        super().step(t, h)
        if not self.stepped:
            self.stepped = True
            for write in self._held:
                write()


def _expect_common_grid(system: System, step: float) -> None:
    """Other masters step all FMUs together; between two of their points nothing can be due."""
    exact = exact_nanoseconds(step)
    continuous = [f"components.{name}.step" for name, component in system.components.items() if component.step]
    if exact.denominator != 1:
        place = next(iter(continuous), "step")
        raise UsageError(f"{place} = {step}: expected a whole number of nanoseconds")
    times = {"stop_time": system.stop_time}
    for name, component in system.components.items():
        if component.sampling is not None:
            times[f"components.{name}.sampling.period"] = component.sampling.period
            times[f"components.{name}.sampling.offset"] = component.sampling.offset
    for place, value in times.items():
        if exact_nanoseconds(value) % exact != 0:
            raise UsageError(f"{place} = {value}: expected a multiple of the common step of {step} s")
