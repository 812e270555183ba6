"""From a system to a result: instantiates its FMUs, lets the master step them, computes the objectives."""

import functools
import importlib.metadata
import logging
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from fmu_kit.trajectory import Trajectory
from orchestration import fmus
from orchestration.errors import UsageError
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.instances import open_instance
from orchestration.fmi.model import NUMERIC, Model, read_model
from orchestration.fmi.values import number_of
from orchestration.interrupt import Interrupt, Interrupted, interrupts_held_back
from orchestration.master import initial
from orchestration.master.condition import program
from orchestration.master.engine import Engine
from orchestration.master.engine import master as master_of
from orchestration.master.feeds import Feed
from orchestration.master.fixed_step import FixedStep
from orchestration.master.master import Master
from orchestration.master.recording import InMemory, Recorder
from orchestration.master.sources import (
    BuiltIn,
    Constant,
    Held,
    Moving,
    Scaled,
    Table,
    Values,
    WhiteNoise,
    along,
    by_name,
    gusts,
)
from orchestration.master.streams import VALUE, Streams
from orchestration.master.timetable import Timetable
from orchestration.master.watch import watch
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.translation import in_its_own_words, system_of, warnings
from orchestration.results import objectives
from orchestration.results.described import described
from orchestration.results.result import Provenance, Result
from orchestration.results.units import units
from orchestration.signals.library import made
from orchestration.signals.table_file import read_table
from orchestration.signals.waypoints import read_waypoints
from orchestration.simulator import Floats
from orchestration.system.check import check, recorded
from orchestration.system.model import MOTION, Component, Source, System, component_of, variable_of
from orchestration.system.times import NANOSECONDS, Grid, exact_nanoseconds

_NOTES = logging.getLogger("quadcosim")

Progress = Callable[[float], None]
"""Hears the share of the run that is done."""
Announce = Callable[[str], None]
"""Hears what is done before the run begins."""

SAMPLE_PERIOD, SAMPLE_OFFSET = "sample_period", "sample_offset"
"""Parameters by which a component built on `fmu_kit` is given a clock of its own; 0: it samples at every step"""
TRAJECTORY = ("amplitude_x", "amplitude_y", "frequency", "start_z", "rate_z")
"""Parameters trajectory.* of a component, and the fields of `Trajectory` that they are"""


class RunInterrupted(Interrupted):
    """A run has ended at the first instant after Ctrl-C, with this `result` so far."""

    def __init__(self, text: str, result: Result) -> None:
        super().__init__(text)
        self.result = result


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A master over instances that have their parameters, ready to initialise or to restore."""

    asked: Scenario | System
    """as the user wrote it"""
    system: System
    """what it means"""
    instances: Mapping[str, Instance]
    models: Mapping[str, Model]
    parameters: Mapping[str, float]
    """all numeric parameters of all components, as COMPONENT.NAME"""
    units: Mapping[str, str]
    """of what it comes to"""
    master: Master
    recorder: Recorder
    interrupt: Interrupt
    started: float
    """on the performance counter [s]"""

    def result(self) -> Result:
        """What was recorded so far, with its metrics; raises `RunInterrupted` with it if that is why it ended."""
        master, recording = self.master, self.recorder.finish()
        end = float(master.board.row[0])
        result = Result(
            asked=self.asked,
            system=self.system,
            recording=recording,
            metrics=objectives.compute(
                self.system,
                lambda: objectives.spans(self.system, recording, self.parameters, end),
                end=end,
                divergence_time=_seconds(master.divergence_time),
                steps=master.steps,
            ),
            units=self.units,
            described=described(self.system, self.models, recording.columns),
            parameters=self.parameters,
            divergence=master.divergence,
            interrupted_at=_seconds(master.interrupted_at),
            provenance={
                **provenance(self.instances),
                "engine": master.engine,
                "wall_time": time.perf_counter() - self.started,
            },
            warnings=(
                *(warnings(self.asked, self.parameters) if isinstance(self.asked, Scenario) else ()),
                *(warning for instance in self.instances.values() for warning in instance.warnings),
            ),
        )
        _NOTES.debug(
            "%d steps to t = %g s by the %s loop in %.3f s", master.steps, end, master.engine,
            result.provenance["wall_time"],
        )  # fmt: skip
        if self.interrupt.requested:
            raise RunInterrupted(f"at t = {end:g} s of {self.system.stop_time:g} s", result)
        return result


def run(
    asked: Scenario | System | None = None,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
) -> Result:
    """Run a system, or fly a scenario of the quadrotor, the paper's if none is given; divergence is a result.

    Its rows are kept in memory unless a `recorder` takes them. By the compiled loop where that can be had, unless an
    `engine` is named; the result is the same.

    Raises `UsageError` for an FMU, variable or value that does not exist, `SimulatorError` if an FMU
    refuses a call for another reason than divergence, `RunInterrupted` after Ctrl-C.
    """
    with prepared(asked or Scenario(), announce, recorder=recorder, engine=engine) as simulation:
        simulation.master.initialise()
        simulation.master.run(progress=progress)
        return simulation.result()


@contextmanager
def prepared(
    asked: Scenario | System,
    announce: Announce | None = None,
    *,
    load: Loader = open_instance,
    recorder: Recorder | None = None,
    engine: Engine | None = None,
) -> Iterator[Simulation]:
    """The FMUs of a system, built if need be, instantiated by `load` and with their parameters.

    Ctrl-C ends the run at its next instant. Raises `UsageError` for what the FMUs do not have or cannot take,
    before any is loaded.
    """
    started = time.perf_counter()
    recorder = InMemory() if recorder is None else recorder
    with in_its_own_words(asked):
        system = system_of(asked) if isinstance(asked, Scenario) else asked
        paths = fmus.of_components(system.fmus, announce)
        models = {name: read_model(path) for name, path in paths.items()}
        found = checked(system, models)
        system, parameters = found.system, found.parameters
    streams = Streams(system.seed, system.streams)
    with interrupts_held_back() as interrupt, ExitStack() as stack:
        instances = {name: stack.enter_context(load(path, name)) for name, path in paths.items()}
        with in_its_own_words(asked):
            for name, component in system.components.items():
                _set_parameters(instances[name], component)
                _set_clock(instances[name], component, models[name])
            said = described(system, models, ("time", *_signals(system, models)))
            recorder.describe({name: one.as_words() for name, one in said.items()})
            sources = {name: source_values(system, name, parameters, streams) for name in system.sources}
            signals = {name: system.sources[name].signals(name) for name in sources}
            watched = (sources, signals, parameters)
            master = master_of(
                engine,
                system,
                instances,
                timetable=Timetable(system, streams, fixed_steps(system, models)),
                streams=streams,
                recorded=recorded(system, models),
                recorder=recorder,
                sources=[(signals[name], values) for name, values in sources.items()],
                feeds=_feeds(system, sources, instances),
                interrupted=lambda: interrupt.requested,
                watch=lambda board: watch(system.criterion.diverged, board, *watched),
                condition=lambda board: program(system.criterion.diverged, board, *watched),
                first_exchange=initial.groups(system.connections, lambda name, output: models[name].depends_on(output)),
            )
        yield Simulation(
            asked=asked,
            system=system,
            instances=instances,
            models=models,
            parameters=parameters,
            units=found.units,
            master=master,
            recorder=recorder,
            interrupt=interrupt,
            started=started,
        )


@dataclass(frozen=True, kw_only=True)
class Checked:
    """A system that its FMUs fit."""

    system: System
    """with the objectives that they have the variables for"""
    parameters: dict[str, float]
    """the numeric ones of all components, as COMPONENT.NAME"""
    units: dict[str, str]
    """of what it comes to, where it has one"""


def checked(system: System, models: Mapping[str, Model]) -> Checked:
    """A system held to what its FMUs say; raises `UsageError` for what they do not have, or cannot take."""
    check(system, models)
    for name, component in system.components.items():
        _expect_clock(name, component, models[name])
    parameters = _parameters(system, models)
    system = objectives.known(system, _signals(system, models), set(parameters))
    return Checked(system=system, parameters=parameters, units=units(system, models))


def _seconds(time: int | None) -> float | None:
    return None if time is None else time / NANOSECONDS


def columns_of(system: System) -> tuple[str, ...]:
    """The columns that a run of `system` has whatever is recorded beside them."""
    exchanged = [start for x in system.connections for start in x.start]
    applied = [end for x in system.connections for end in x.end if system.components[x.receiver].sampling is None]
    sources = [signal for name, source in system.sources.items() for signal in source.signals(name)]
    return ("time", *dict.fromkeys((*applied, *exchanged, *sources)))


def provenance(instances: Mapping[str, Instance]) -> Provenance:
    """What the numbers of a run came from: versions of the software and GUIDs of the FMUs."""
    packages = ("quadcosim", "numpy", "fmpy", "pythonfmu")
    return {
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in packages}},
        "platform": platform.platform(),
        "fmus": {
            name: {"model": fmu.description.modelName, "guid": fmu.description.guid, "path": str(fmu.path)}
            for name, fmu in instances.items()
        },
    }


@functools.cache
def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _set_parameters(instance: Instance, component: Component) -> None:
    for name, value in component.parameters.items():
        instance.set(name, value)


def _expect_clock(name: str, component: Component, model: Model) -> None:
    """Raise `UsageError` for a clock that the FMU does not have, or that its parameters would set beside the master."""
    sampling = component.sampling
    if sampling is None or SAMPLE_PERIOD not in model.variables:
        if sampling is not None and sampling.clock == "fmu":
            raise UsageError(f"components.{name}.sampling.clock = fmu: expected an FMU with {SAMPLE_PERIOD}")
        return
    for parameter in (SAMPLE_PERIOD, SAMPLE_OFFSET):
        if parameter in component.parameters:
            raise UsageError(
                f"components.{name}.parameters.{parameter}: expected sampling instead; the master sets it, to 0 "
                "with clock master (the master decides when to sample) and to that of sampling with clock fmu"
            )


def _set_clock(instance: Instance, component: Component, model: Model) -> None:
    """A component built on `fmu_kit` samples at every step that it is given, unless it is to keep its own clock."""
    sampling = component.sampling
    if sampling is None or SAMPLE_PERIOD not in instance.variables:
        return
    if sampling.clock == "fmu":
        instance.set(SAMPLE_PERIOD, sampling.period)
        instance.set(SAMPLE_OFFSET, sampling.offset)
    elif model.is_of_this_kit:
        instance.set(SAMPLE_PERIOD, 0.0)
        instance.set(SAMPLE_OFFSET, 0.0)


def _parameters(system: System, models: Mapping[str, Model]) -> dict[str, float]:
    found = {}
    for name, model in models.items():
        given = system.components[name].parameters
        for variable in model.variables.values():
            value = given.get(variable.name, variable.start)
            if variable.causality == "parameter" and variable.kind in NUMERIC and value is not None:
                found[f"{name}.{variable.name}"] = number_of(variable, value)
    return found


def _signals(system: System, models: Mapping[str, Model]) -> set[str]:
    """Everything that is recorded, or comes from a source."""
    found = {f"{name}.{variable}" for name, variables in recorded(system, models).items() for variable in variables}
    return found.union(columns_of(system)) - {"time"}


def source_values(system: System, name: str, parameters: Mapping[str, float], streams: Streams) -> Values:
    """A source at work in a run; `parameters` are those of the component of a trajectory, as COMPONENT.NAME."""
    source = system.sources[name]
    if source.constant is not None:
        return Constant([source.constant] * len(source.to))
    if source.noise is not None and source.period is not None:
        return WhiteNoise(source.noise, source.period, len(source.to), streams.of(f"sources.{name}", VALUE))
    if source.trajectory is None:
        values = _of_file_or_signal(system, name, streams)
        return values if source.scale == 1.0 else Scaled(values, source.scale)
    owner = f"{source.trajectory}.trajectory."
    given = {field: parameters[owner + field] for field in TRAJECTORY if owner + field in parameters}
    return BuiltIn(Trajectory(**given))


def _of_file_or_signal(system: System, name: str, streams: Streams) -> Values:
    source = system.sources[name]
    quantities = [MOTION.index(".".join(signal.split(".")[-2:])) for signal in source.signals(name) if source.is_motion]
    if source.signal is not None:
        signal = made(source.signal, source.parameters)
        if source.is_motion:
            return Moving(by_name(signal), quantities)
        return gusts(signal, system.stop_time, streams.of(f"sources.{name}", VALUE))
    assert source.file is not None
    if source.is_motion:
        return Moving(along(read_waypoints(source.file, source.parameters)), quantities)
    table = read_table(source.file, table_columns(source), system.stop_time)
    return Held(*table) if source.interpolation == "previous" else Table(*table)


def table_columns(source: Source) -> Sequence[str]:
    """The columns of the file of a source, in the order of the inputs."""
    return [variable_of(end) for end in source.to] if source.columns is None else source.columns


def _feeds(system: System, sources: Mapping[str, Values], instances: Mapping[str, Instance]) -> list[Feed]:
    feeds = []
    for name, values in sources.items():
        ends = system.sources[name].to
        for component in dict.fromkeys(map(component_of, ends)):
            places = [i for i, end in enumerate(ends) if component_of(end) == component]
            into: Floats = np.zeros(len(places))
            write = instances[component].writer([variable_of(ends[i]) for i in places], into)
            feeds.append(Feed(component, values, places, into, write, count=len(ends)))
    return feeds


def fixed_steps(system: System, models: Mapping[str, Model]) -> dict[str, FixedStep]:
    """Components in continuous time that take steps of one length only, by name."""
    found = {}
    for name, component in system.components.items():
        if component.step is not None and not models[name].varies_step:
            grid = Grid(Fraction(0), exact_nanoseconds(component.step))
            found[name] = FixedStep(name=name, grid=grid, moves=component.align == "next")
    return found
