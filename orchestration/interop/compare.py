"""The same flight in every tool and in this project's master, compared signal by signal."""

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestration import fmus, ssp
from orchestration.errors import QuadcosimError, UsageError
from orchestration.flight import prepared
from orchestration.fmpy_adapter import FmuSimulator
from orchestration.interop.catalogue import Tool
from orchestration.interop.job import SIGNALS, Job
from orchestration.interop.trace import PORTS, Trace, read_trace, traced_copy
from orchestration.scenario import Scenario
from orchestration.simulator import Floats, Transfer
from orchestration.timing import exact_nanoseconds
from orchestration.wiring import MEASUREMENT

_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
"""Where a tool unpacks, by the names that systems have for it: not all clean up after themselves."""

STATES = len(MEASUREMENT)
"""The first so many of `SIGNALS` are the state of the plant, the others the command."""

MISSING = 1
"""Steps before the end that a tool may leave out: some stop where the next step would end beyond it."""

Start = dict[str, tuple[tuple[float, ...], tuple[float, ...]]]
"""By component: its connected inputs as its initialisation ends, and those of its first step."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far one tool's flight is from this project's, in the order of exchange that the tool was seen to have."""

    tool: Tool
    versions: dict[str, str]
    trace: Trace
    as_it_comes: dict[str, float]
    """by signal: largest difference from `quadcosim run` [SI]"""
    same_start: dict[str, float]
    """the same, with the tool's inputs until the end of the first step given to this project's master too"""

    def both(self) -> tuple[dict[str, float], dict[str, float]]:
        """As it comes, and with the same start."""
        return self.as_it_comes, self.same_start

    def largest(self, differences: dict[str, float]) -> tuple[float, str]:
        """The largest difference of a state, or of a command if the tool flew no plant, and the signal it is in."""
        return max((value, name) for name, value in differences.items() if name in _compared(self.tool))


def agreements(
    scenario: Scenario,
    tools: Iterable[Tool],
    *,
    announce: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Agreement]:
    """Fly `scenario` in each tool, as many at a time as there are processors.

    Its plant interval is the communication step of both FMUs, its period that of the controller's own clock.
    Raises `ModuleNotFoundError` if a tool is not installed, `UsageError` for a scenario that an SSP cannot
    carry or whose times are no multiples of that step, `QuadcosimError` with a tool's last words if it fails.
    """
    tools = list(tools)
    versions = {tool.name: tool.versions() for tool in tools}
    with tempfile.TemporaryDirectory(prefix="quadcosim_") as folder:
        flights = _Flights(scenario, Path(folder), announce)
        found = []
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            seen = pool.map(flights.seen, tools)
            flown = pool.map(flights.flown, tools)
            for tool, trace, rows in zip(tools, seen, flown):
                found.append(flights.agreement(tool, versions[tool.name], trace, rows))
                if progress is not None:
                    progress(len(found) / len(tools))
    return found


class _Flights:
    """The flights of one scenario, by tools and by this project's master."""

    def __init__(self, scenario: Scenario, folder: Path, announce: Callable[[str], None] | None) -> None:
        self._folder = folder
        self._scenario = scenario.with_fmus(
            plant=fmus.locate(scenario.plant.fmu, announce).absolute(),
            controller=fmus.locate(scenario.controller.fmu, announce).absolute(),
        )
        _expect_common_grid(self._scenario)
        self._step = scenario.timing.plant_interval
        self._steps = round(scenario.stop_time / self._step)
        self._own: dict[tuple[str, str], Floats] = {}
        np.save(folder / "recorded.npy", self._rows_of_master("gauss-seidel", {})[:-1])

    def flown(self, tool: Tool) -> Floats:
        """A tool's rows, from the FMUs as they are."""
        return self._in_a_process(tool, "flown", lambda path, component, folder: path)

    def seen(self, tool: Tool) -> Trace:
        """How a tool flies, from traced copies."""
        self._in_a_process(tool, "seen", traced_copy)
        folder = self._folder / tool.call.replace(":", "_") / "seen"
        return read_trace(folder, {name: self._path(name) for name in tool.components}, self._step)

    def agreement(self, tool: Tool, versions: dict[str, str], trace: Trace, rows: Floats) -> Agreement:
        """Compare the rows of a tool with this project's in the order that it was seen to have."""
        order = "gauss-seidel" if trace.order == "alone" else trace.order
        if len(rows) < self._steps - MISSING:
            raise QuadcosimError(f"{tool.name}: ended after {len(rows)} steps, expected {self._steps}")
        late = np.abs(rows[:, 0] - self._step * np.arange(1, len(rows) + 1)).max()
        if late > 0.01 * self._step:
            raise QuadcosimError(f"{tool.name}: a row is {late:g} s beside its communication point")
        given = {name: (trace.initial_inputs[name], first) for name, first in trace.first_inputs.items()}
        return Agreement(
            tool=tool,
            versions=versions,
            trace=trace,
            as_it_comes=_differences(tool, rows, self._rows_of_master(order, {})),
            same_start=_differences(tool, rows, self._rows_of_master(order, {} if trace.order == "alone" else given)),
        )

    def _path(self, component: str) -> Path:
        return Path(getattr(self._scenario, component).fmu)

    def _in_a_process(self, tool: Tool, purpose: str, prepare: Callable[[Path, str, Path], Path]) -> Floats:
        folder = self._folder / tool.call.replace(":", "_") / purpose
        folder.mkdir(parents=True)
        paths = {name: prepare(self._path(name), name, folder) for name in ("controller", "plant")}
        scenario = self._scenario.with_fmus(**paths)
        job = Job(
            **paths,
            ssp=ssp.write(scenario, folder / "loop.ssp"),
            step=self._step,
            stop=self._scenario.stop_time,
            parameters={component.name: component.parameters for component in ssp.components(scenario)},
            recorded=self._folder / "recorded.npy",
            folder=folder,
        )
        (folder / "job.json").write_text(job.to_json(), encoding="utf-8")
        arguments = [tool.name, str(folder / "job.json"), str(folder / "rows.npy")]
        done = subprocess.run(
            [sys.executable, "-m", "orchestration.interop.child", *arguments],
            capture_output=True, text=True, errors="replace", check=False, env=_environment(folder),
            cwd=folder,  # not this process's: fmpy changes that while it loads an FMU, in another thread
        )  # fmt: skip
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise QuadcosimError(f"{tool.name}: {lines[-1]}")
        return np.asarray(np.load(folder / "rows.npy"))

    def _rows_of_master(self, order: str, start: Start) -> Floats:
        """This project's flight: the time, `SIGNALS`; the command is the one computed at the row's time."""
        key = (order, repr(start))
        if key not in self._own:
            late = 0.0 if order == "gauss-seidel" else self._step
            scenario = self._scenario.with_changes(timing={"clock": "fmu", "delay": late})

            def load(path: Path, instance_name: str) -> FmuSimulator:
                if not start:
                    return FmuSimulator(path, instance_name)
                return _GivenStart(path, instance_name, *start[instance_name])

            with prepared(scenario, load=load) as flight:
                flight.master.initialise()
                flight.master.run()
                result = flight.result()
            if result.divergence is not None:
                raise QuadcosimError(f"in this project's master, {order}: {result.divergence}; nothing to compare")
            self._own[key] = np.column_stack([result.signals[name] for name in ("time", *SIGNALS)])
        return self._own[key]


class _GivenStart(FmuSimulator):
    """An FMU whose connected inputs are given ones until its first step is over, whatever the master sends."""

    def __init__(self, path: Path, name: str, initial: Sequence[float], first: Sequence[float]) -> None:
        super().__init__(path, name)
        names = PORTS[name][0]
        self._put_initial = super().writer(names, np.array(initial))
        self._put_first = super().writer(names, np.array(first))
        self._held: list[Transfer] = []
        self._stepped = False

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As of the base, once the first step is over."""
        usual = super().writer(names, source)
        self._held.append(usual)
        return lambda: usual() if self._stepped else None

    def exit_initialization(self) -> None:
        """As of the base, between the given inputs."""
        self._put_initial()
        super().exit_initialization()
        self._put_first()

    def step(self, t: float, h: float) -> None:
        """As of the base; after the first one the inputs are what the master has sent meanwhile."""
        super().step(t, h)
        if not self._stepped:
            self._stepped = True
            for write in self._held:
                write()


def _environment(folder: Path) -> dict[str, str]:
    """Of a flight in `folder`: it finds this package wherever it lies, and unpacks there."""
    root = str(Path(fmus.__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    return {**os.environ, **dict.fromkeys(_TEMPORARY, str(folder)), "PYTHONPATH": path}


def _expect_common_grid(scenario: Scenario) -> None:
    """Other masters step both FMUs together; between two of their points nothing can be due."""
    ssp.components(scenario)
    timing = scenario.timing
    step = exact_nanoseconds(timing.plant_interval)
    if step.denominator != 1:
        raise UsageError(f"timing.plant_interval = {timing.plant_interval}: expected a whole number of nanoseconds")
    times = {"timing.period": timing.period, "timing.offset": timing.offset, "stop_time": scenario.stop_time}
    for name, value in times.items():
        if exact_nanoseconds(value) % step != 0:
            raise UsageError(
                f"{name} = {value}: expected a multiple of the plant interval of {timing.plant_interval} s"
            )


def _compared(tool: Tool) -> tuple[str, ...]:
    """The states; the command of a tool that flew no plant."""
    return SIGNALS[:STATES] if "plant" in tool.components else SIGNALS[STATES:]


def _differences(tool: Tool, rows: Floats, own: Floats) -> dict[str, float]:
    """By signal, the largest difference of a tool's rows, which are of the ends of steps, from this project's."""
    count = min(len(rows), len(own) - 1)
    expected = np.column_stack([own[1 : count + 1, 1 : STATES + 1], own[:count, STATES + 1 :]])
    differences = np.abs(rows[:count, 1:] - expected).max(axis=0)
    flown = {name: float(value) for name, value in zip(SIGNALS, differences, strict=True) if _flies(tool, name)}
    return {name: math.inf if math.isnan(value) else value for name, value in flown.items()}


def _flies(tool: Tool, signal: str) -> bool:
    return signal.partition(".")[0] in tool.components
