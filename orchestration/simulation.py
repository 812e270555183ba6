"""From a system to a result: instantiates its FMUs, lets the master step them, computes the objectives."""

import importlib.metadata
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.packaging import read_source_hash
from fmu_kit.trajectory import Trajectory
from orchestration import fmus
from orchestration.errors import UsageError
from orchestration.fleet import Loader
from orchestration.fmi.model import NUMERIC, Model, read_model
from orchestration.fmpy_adapter import FmuSimulator
from orchestration.results import objectives
from orchestration.simulator import Floats
from orchestration.stepping import initial
from orchestration.stepping.agenda import Agenda, FixedStep
from orchestration.stepping.feeds import Feed
from orchestration.stepping.master import Event, Master
from orchestration.stepping.sources import BuiltIn, Constant, Table, Values, WhiteNoise
from orchestration.stepping.streams import VALUE, Streams
from orchestration.stepping.table_file import read_table
from orchestration.stepping.watch import watch
from orchestration.system.check import check, recorded
from orchestration.system.model import Component, System, component_of, variable_of
from orchestration.system.times import NANOSECONDS, Grid, exact_nanoseconds

Announce = Callable[[str], None]
"""Hears what is done before the run begins."""

SAMPLE_PERIOD, SAMPLE_OFFSET = "sample_period", "sample_offset"
"""Parameters by which a component built on `fmu_kit` is given a clock of its own; 0: it samples at every step"""
TRAJECTORY = ("amplitude_x", "amplitude_y", "frequency", "start_z", "rate_z")
"""Parameters trajectory.* of a component, and the fields of `Trajectory` that they are"""


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A master over instances that have their parameters, ready to initialise or to restore."""

    system: System
    instances: Mapping[str, FmuSimulator]
    sources: Mapping[str, Values]
    parameters: Mapping[str, float]
    """all numeric parameters of all components, as COMPONENT.NAME"""
    master: Master
    started: float
    """on the performance counter [s]"""

    def source_signals(self, time: Floats) -> dict[str, Floats]:
        """The signals of the sources at `time` [s], shape (n,)."""
        found: dict[str, Floats] = {}
        for name, values in self.sources.items():
            over = values.over(time)
            found |= {signal: over[:, i] for i, signal in enumerate(signals_of(name, self.system))}
        return found


@contextmanager
def prepared(system: System, announce: Announce | None = None, *, load: Loader = FmuSimulator) -> Iterator[Simulation]:
    """The FMUs of `system`, built if need be, instantiated by `load` and with their parameters.

    Raises `UsageError` for what the FMUs do not have or cannot take, before any is loaded.
    """
    started = time.perf_counter()
    paths = {name: fmus.locate(component.fmu, announce) for name, component in system.components.items()}
    models = {name: read_model(path) for name, path in paths.items()}
    check(system, models)
    streams = Streams(system.seed, system.streams)
    with ExitStack() as stack:
        instances = {name: stack.enter_context(load(path, name)) for name, path in paths.items()}
        for name, component in system.components.items():
            _set_parameters(instances[name], component)
            _set_clock(instances[name], component, paths[name])
        parameters = _parameters(system, models)
        sources = {name: _source(system, name, parameters, streams) for name in system.sources}
        objectives.check(system, _signals(system, models), set(parameters))
        signals = {name: signals_of(name, system) for name in sources}
        master = Master(
            system,
            instances,
            agenda=Agenda(system, streams, _fixed_steps(system, models)),
            streams=streams,
            recorded=recorded(system, models),
            feeds=_feeds(system, sources, instances),
            watch=lambda board: watch(system.criterion.diverged, board, sources, signals, parameters),
            first_exchange=initial.groups(system.connections, lambda name, output: models[name].depends_on(output)),
        )
        yield Simulation(
            system=system, instances=instances, sources=sources, parameters=parameters, master=master, started=started
        )


def signals_of(source: str, system: System) -> tuple[str, ...]:
    """The names by which the signals of a source are recorded."""
    described = system.sources[source]
    if described.trajectory is not None:
        return tuple(f"{source}.position.{axis}" for axis in "xyz")
    names = [variable_of(end) for end in described.to]
    return tuple(name if name.startswith(f"{source}.") else f"{source}.{name}" for name in names)


def versions() -> dict[str, str]:
    """Of the software that a run's numbers come from."""
    packages = ("quadcosim", "numpy", "fmpy", "pythonfmu")
    return {"python": platform.python_version(), **{name: _version(name) for name in packages}}


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _set_parameters(instance: FmuSimulator, component: Component) -> None:
    for name, value in component.parameters.items():
        instance.set(name, value)


def _set_clock(instance: FmuSimulator, component: Component, path: Path) -> None:
    """A component built on `fmu_kit` samples at every step that it is given, unless it is to keep its own clock."""
    sampling = component.sampling
    if sampling is None or SAMPLE_PERIOD not in instance.variables:
        if sampling is not None and sampling.clock == "fmu":
            raise UsageError(f"components.{instance.name}.sampling.clock = fmu: expected an FMU with {SAMPLE_PERIOD}")
        return
    for name in (SAMPLE_PERIOD, SAMPLE_OFFSET):
        if name in component.parameters:
            raise UsageError(
                f"components.{instance.name}.parameters.{name}: expected sampling instead; the master sets it, to 0 "
                "with clock master (the master decides when to sample) and to that of sampling with clock fmu"
            )
    if sampling.clock == "fmu":
        instance.set(SAMPLE_PERIOD, sampling.period)
        instance.set(SAMPLE_OFFSET, sampling.offset)
    elif read_source_hash(path) is not None:
        instance.set(SAMPLE_PERIOD, 0.0)
        instance.set(SAMPLE_OFFSET, 0.0)


def _parameters(system: System, models: Mapping[str, Model]) -> dict[str, float]:
    found = {}
    for name, model in models.items():
        given = system.components[name].parameters
        for variable in model.variables.values():
            value = given.get(variable.name, variable.start)
            if variable.causality == "parameter" and variable.kind in NUMERIC and value is not None:
                number = {"true": 1.0, "false": 0.0}.get(str(value).lower(), value)
                found[f"{name}.{variable.name}"] = float(number)
    return found


def _signals(system: System, models: Mapping[str, Model]) -> set[str]:
    """Everything that is recorded, or comes from a source."""
    found = {f"{name}.{variable}" for name, variables in recorded(system, models).items() for variable in variables}
    for x in system.connections:
        found.update(x.start)
        if system.components[x.receiver].sampling is None:
            found.update(x.end)
    return found.union(*(signals_of(name, system) for name in system.sources))


def _source(system: System, name: str, parameters: Mapping[str, float], streams: Streams) -> Values:
    source = system.sources[name]
    if source.constant is not None:
        return Constant([source.constant] * len(source.to))
    if source.noise is not None and source.period is not None:
        return WhiteNoise(source.noise, source.period, len(source.to), streams.of(f"sources.{name}", VALUE))
    if source.file is not None:
        columns = [variable_of(end) for end in source.to]
        return Table(*read_table(source.file, columns, system.stop_time))
    owner = f"{source.trajectory}.trajectory."
    given = {field: parameters[owner + field] for field in TRAJECTORY if owner + field in parameters}
    return BuiltIn(Trajectory(**given))


def _feeds(system: System, sources: Mapping[str, Values], instances: Mapping[str, FmuSimulator]) -> list[Feed]:
    feeds = []
    for name, values in sources.items():
        ends = system.sources[name].to
        for component in dict.fromkeys(map(component_of, ends)):
            places = [i for i, end in enumerate(ends) if component_of(end) == component]
            into: Floats = np.zeros(len(places))
            write = instances[component].writer([variable_of(ends[i]) for i in places], into)
            feeds.append(Feed(component, _picked(values, places, len(ends)), into, write))
    return feeds


def _picked(values: Values, places: Sequence[int], count: int) -> Callable[[float], Sequence[float]]:
    if len(places) == count:
        return values.at

    def at(t: float) -> list[float]:
        found = values.at(t)
        return [found[i] for i in places]

    return at


def _fixed_steps(system: System, models: Mapping[str, Model]) -> dict[str, FixedStep]:
    """Components in continuous time that take steps of one length only."""
    found = {}
    for name, component in system.components.items():
        if component.step is not None and not models[name].varies_step:
            grid = Grid(Fraction(0), exact_nanoseconds(component.step))
            found[name] = FixedStep(name=name, grid=grid, moves=component.align == "next")
    return found


def finished(simulation: Simulation, rows: Floats, columns: Sequence[str]) -> dict[str, Any]:
    """Signals, events and metrics of a run that has ended."""
    master, system = simulation.master, simulation.system
    signals = {name: rows[:, i] for i, name in enumerate(columns)}
    events = tuple(sorted(map(Event._make, master.events), key=lambda event: event.time))
    at = master.divergence_time
    seen = objectives.recorded_of(
        system,
        signals,
        sources=simulation.source_signals(signals["time"]),
        events=events,
        parameters=simulation.parameters,
    )
    divergence_time = None if at is None else at / NANOSECONDS
    metrics = objectives.compute(system, lambda: iter([seen]), divergence_time=divergence_time, steps=master.steps)
    return {"signals": signals, "events": events, "metrics": metrics}
