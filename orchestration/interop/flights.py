"""The flights of one scenario: by tools, in processes of their own, and by this project's master."""

import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from orchestration import child, fmus
from orchestration.errors import QuadcosimError, UsageError
from orchestration.fmi.fmi2 import Fmi2Instance
from orchestration.interop.catalogue import Tool
from orchestration.interop.job import SIGNALS, Job
from orchestration.interop.trace import PORTS, Trace, read_trace, traced_copy
from orchestration.scenario import Scenario
from orchestration.simulation import prepared
from orchestration.simulator import Floats, Transfer
from orchestration.ssp import writing
from orchestration.ssp.carried import carried
from orchestration.system.times import exact_nanoseconds

_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
"""Where a tool unpacks, by the names that systems have for it: not all clean up after themselves."""

Start = dict[str, tuple[tuple[float, ...], tuple[float, ...]]]
"""By component: its connected inputs as its initialisation ends, and those of its first step."""


class Flights:
    """One scenario, flown by whom it is asked of; raises as `compare.agreements` does."""

    def __init__(self, scenario: Scenario, folder: Path, announce: Callable[[str], None] | None) -> None:
        self._folder = folder
        self._scenario = scenario.with_fmus(
            plant=fmus.locate(scenario.plant.fmu, announce).absolute(),
            controller=fmus.locate(scenario.controller.fmu, announce).absolute(),
        )
        _expect_common_grid(self._scenario)
        self.step = scenario.timing.plant_interval
        """[s]"""
        self.steps = round(scenario.stop_time / self.step)
        self._own: dict[tuple[str, str], Floats] = {}
        np.save(folder / "recorded.npy", self.rows_of_master("gauss-seidel", {})[:-1])

    def flown(self, tool: Tool) -> Floats:
        """A tool's rows, from the FMUs as they are."""
        return self._in_a_process(tool, "flown", lambda path, component, folder: path)

    def seen(self, tool: Tool) -> Trace:
        """How a tool flies, from traced copies."""
        self._in_a_process(tool, "seen", traced_copy)
        folder = self._folder / tool.call.replace(":", "_") / "seen"
        return read_trace(folder, {name: self._path(name) for name in tool.components}, self.step)

    def _path(self, component: str) -> Path:
        return Path(getattr(self._scenario, component).fmu)

    def _in_a_process(self, tool: Tool, purpose: str, prepare: Callable[[Path, str, Path], Path]) -> Floats:
        folder = self._folder / tool.call.replace(":", "_") / purpose
        folder.mkdir(parents=True)
        paths = {name: prepare(self._path(name), name, folder) for name in ("controller", "plant")}
        scenario = self._scenario.with_fmus(**paths)
        job = Job(
            **paths,
            ssp=writing.write(scenario, folder / "loop.ssp"),
            step=self.step,
            stop=self._scenario.stop_time,
            parameters={component.name: component.parameters for component in carried(scenario).parts},
            recorded=self._folder / "recorded.npy",
            folder=folder,
        )
        (folder / "job.json").write_text(job.to_json(), encoding="utf-8")
        done = subprocess.run(
            tool.command(folder / "job.json", folder / "rows.npy"),
            capture_output=True, text=True, errors="replace", check=False,
            env=child.environment(**dict.fromkeys(_TEMPORARY, str(folder))),
            cwd=folder,  # not this process's: fmpy changes that while it loads an FMU, in another thread
        )  # fmt: skip
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise QuadcosimError(f"{tool.name}: {lines[-1]}")
        return np.asarray(np.load(folder / "rows.npy"))

    def rows_of_master(self, order: str, start: Start) -> Floats:
        """This project's flight: the time, `SIGNALS`; the command is the one computed at the row's time."""
        key = (order, repr(start))
        if key not in self._own:
            late = 0.0 if order == "gauss-seidel" else self.step
            scenario = self._scenario.with_changes(timing={"clock": "fmu", "delay": late})

            def load(path: Path, instance_name: str) -> Fmi2Instance:
                if not start:
                    return Fmi2Instance(path, instance_name)
                return _GivenStart(path, instance_name, *start[instance_name])

            with prepared(scenario, load=load) as flight:
                flight.master.initialise()
                flight.master.run()
                result = flight.result()
            if result.divergence is not None:
                raise QuadcosimError(f"in this project's master, {order}: {result.divergence}; nothing to compare")
            self._own[key] = np.column_stack([result.signals[name] for name in ("time", *SIGNALS)])
        return self._own[key]


class _GivenStart(Fmi2Instance):
    """An FMU whose connected inputs are given ones until its first step is over, whatever the master sends."""

    def __init__(self, path: Path, name: str, initial: Sequence[float], first: Sequence[float]) -> None:
        super().__init__(path, name)
        names = PORTS[name][0]
        self._put_initial = super().writer(names, np.array(initial))
        self._put_first = super().writer(names, np.array(first))
        self._held: list[Transfer] = []
        self.stepped = False

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As of the base; of connected inputs only once the first step is over."""
        usual = super().writer(names, source)
        if not set(names) <= set(PORTS[self.name][0]):
            return usual
        self._held.append(usual)
        return lambda: usual() if self.stepped else None

    def exit_initialization(self) -> None:
        """As of the base, between the given inputs."""
        self._put_initial()
        super().exit_initialization()
        self._put_first()

    def step(self, t: float, h: float) -> None:
        """As of the base; after the first one the inputs are what the master has sent meanwhile."""
        super().step(t, h)
        if not self.stepped:
            self.stepped = True
            for write in self._held:
                write()


def _expect_common_grid(scenario: Scenario) -> None:
    """Other masters step both FMUs together; between two of their points nothing can be due."""
    carried(scenario)
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
