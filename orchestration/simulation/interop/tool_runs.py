"""The runs of one system: by tools, in separate processes, and by this project's master."""

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.new_files import write_atomically
from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.opening import open_instance
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.basics.times import exact_nanoseconds
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.child import Child
from orchestration.simulation.interop.assignment import AssignedLoop, assigned_loop
from orchestration.simulation.interop.catalogue import Tool
from orchestration.simulation.interop.job import Job
from orchestration.simulation.interop.trace import Trace, expect_traceable, read_trace, traced_copy
from orchestration.simulation.requests.ssp import writing
from orchestration.simulation.requests.ssp.export import Part, complete_export, export_of
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import Request, errors_in_own_terms

_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
"""variables with the folder in which a tool unpacks: not all clean up after themselves"""

FirstInputs = dict[str, tuple[tuple[float, ...], tuple[float, ...]]]
"""Connected inputs of a component at the end of its initialisation, and those of its first step, by component"""


class ToolRuns:
    """Runs one system by tools until the block ends; raises as `compare.agreements` does."""

    def __init__(self, request: Request, folder: Path, announce: Callable[[str], None] | None) -> None:
        self._folder = folder
        with errors_in_own_terms(request):
            system = _in_order(request.as_system(), "gauss-seidel")
            export = complete_export(system, announce)
            self._fmus = {part.name: part.fmu.absolute() for part in export.parts}
            self._system = _with_fmus(system, self._fmus)
            self._clocks = {part.name for part in export.parts if part.model.has_clock}
            self.loop = assigned_loop(export)
            self.step = export.step
            """Step [s]"""
            _expect_common_grid(system, export.step)
            for fmu in self._fmus.values():
                expect_traceable(fmu)
        self.steps = round(system.stop_time / self.step)
        self._master_rows: dict[tuple[str, str], Floats] = {}
        self._children: list[Child] = []
        self._lock, self._closed = threading.Lock(), False
        np.save(folder / "recorded.npy", self._with_first_exchange("gauss-seidel", {})[:-1])

    def __enter__(self) -> "ToolRuns":
        return self

    def __exit__(self, *exception: object) -> None:
        with self._lock:
            self._closed = True
        for child in self._children:
            child.close()

    def run(self, tool: Tool) -> Floats:
        """A tool's rows, from the original FMUs."""
        return self._run_in_process(tool, "run", lambda component, folder: self._fmus[component])

    def trace(self, tool: Tool) -> Trace:
        """How a tool steps the FMUs, from traced copies."""
        ports = self.loop.ports
        self._run_in_process(
            tool, "trace", lambda name, folder: traced_copy(self._fmus[name], name, ports[name], folder)
        )
        folder = self._folder / tool.call.replace(":", "_") / "trace"
        return read_trace(folder, {name: self._fmus[name] for name in self.components_of(tool)}, self.loop, self.step)

    def components_of(self, tool: Tool) -> tuple[str, ...]:
        """The components that a tool runs."""
        return tuple(self.loop.ports) if tool.alone is None else (tool.alone,)

    def _run_in_process(self, tool: Tool, purpose: str, prepare: Callable[[str, Path], Path]) -> Floats:
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
        write_atomically(folder / "job.json", job.to_json())
        ending = self._start(tool.command(folder / "job.json", folder / "rows.npy"), folder).ending()
        if ending.code != 0:
            raise QuadcosimError(f"{tool.name}: {ending.last_line or ending.description.removeprefix('ended with ')}")
        return np.asarray(np.load(folder / "rows.npy"))

    def _start(self, command: Sequence[str] | subprocesses.Module, folder: Path) -> Child:
        with self._lock:
            if self._closed:  # meanwhile, as copies take time
                raise QuadcosimError("the runs have ended")
            child = Child(
                command,
                environment=subprocesses.environment(**dict.fromkeys(_TEMPORARY, str(folder))),
                folder=folder,  # not that of this process: fmpy changes it while it loads an FMU, in another thread
                communicates=False,
            )
            self._children.append(child)
        return child

    def rows_of_master(self, order: str, start: FirstInputs) -> Floats:
        """The run of this project's master: time and signals; a command is the one computed at the row's time."""
        return self._with_first_exchange(order, start)[1:]

    def _with_first_exchange(self, order: str, start: FirstInputs) -> Floats:
        """The same after a row at 0 with the signals that were exchanged during initialisation."""
        key = (order, repr(start))
        if key not in self._master_rows:
            system = _in_order(_by_own_clocks(self._system, self._clocks), order, self.step)

            found = isolated_call(self._fmus.values(), _rows, system, self.loop, start)
            if isinstance(found, str):
                raise QuadcosimError(f"in this project's master, {order}: {found}; nothing to compare")
            self._master_rows[key] = found
        return self._master_rows[key]


def _rows(system: System, loop: AssignedLoop, start: FirstInputs) -> Floats | str:
    """The time and the signals of a run here, at the end of its initialisation, too; or why it ended early."""

    def load(path: Path, instance_name: str, access: Access = USUAL) -> Instance:
        if not start:
            return open_instance(path, instance_name, access)
        return _FixedFirstInputs(path, instance_name, loop.ports[instance_name].inputs, *start[instance_name])

    with prepared(system, load=load) as run:
        run.master.initialise()
        first = dict(zip(run.master.columns, run.master.board.row.tolist()))
        run.master.run()
        result = run.result()
    ended = result.divergence or result.termination
    names = ("time", *loop.signals)
    return ended or np.column_stack([np.append(first[name], result.signals[name]) for name in names])


def parameters_for(tool: Tool, part: Part) -> dict[str, Parameter]:
    """The parameters for a tool to set; raises `UsageError` for one that it cannot set and that is not at its start."""
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
    """The system with sampled components by their own clocks where they have one, as in other masters."""
    sampled = [name for name, component in system.components.items() if component.sampling is not None]
    return changed(system, {f"components.{name}.sampling.clock": "fmu" for name in sampled if name in clocks})


def _in_order(system: System, order: str, step: float = 0.0) -> System:
    """The system with an order for all connections; in Jacobi's, a component with its own clock sends a step late.

    (It takes many steps in a period, and other masters exchange values after each.)
    """
    changes: dict[str, Any] = {}
    for x in system.connections:
        sampling = system.components[x.sender].sampling
        has_own_clock = sampling is not None and sampling.clock == "fmu"
        changes[f"connections.{x.name}.order"] = "gauss-seidel" if has_own_clock else order
        if has_own_clock and order == "jacobi":
            changes[f"connections.{x.name}.delay"] = step
    return changed(system, changes)


class _FixedFirstInputs(Fmi2Instance):
    """An FMU whose connected inputs have fixed values until its first step is over, whatever the master sends."""

    def __init__(
        self, path: Path, name: str, connected: Sequence[str], initial: Sequence[float], first: Sequence[float]
    ) -> None:
        super().__init__(path, name)
        self._connected = names = tuple(connected)
        self._write_initial = super().writer(names, np.array(initial))
        self._write_first = super().writer(names, np.array(first))
        self._held: list[Transfer] = []
        self.stepped = False

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As the base; connected inputs are written only after the first step."""
        usual = super().writer(names, source)
        if not set(names) <= set(self._connected):
            return usual
        self._held.append(usual)
        return lambda: usual() if self.stepped else None

    def enter_initialization(self, start: float, stop: float) -> None:
        """As the base; its first outputs follow from the fixed inputs."""
        super().enter_initialization(start, stop)
        self._write_initial()

    def exit_initialization(self) -> None:
        """As the base; then with the inputs of the first step."""
        super().exit_initialization()
        self._write_first()

    def step(self, t: float, h: float) -> None:
        """As the base; after the first one with the inputs that the master has sent meanwhile."""
        super().step(t, h)
        if not self.stepped:
            self.stepped = True
            for write in self._held:
                write()


def _expect_common_grid(system: System, step: float) -> None:
    """Raise `UsageError` for times between the common steps of all FMUs, which other masters have."""
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
