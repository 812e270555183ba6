"""From a system to a result: instantiates its FMUs, lets the master step them, computes the objectives."""

import functools
import importlib.metadata
import logging
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import numpy as np

from orchestration.basics.interrupt import Interrupt, Interrupted, interrupts_held_back
from orchestration.basics.simulator import Floats
from orchestration.building import fmus
from orchestration.engines import initial
from orchestration.engines.condition import program
from orchestration.engines.engine import Engine
from orchestration.engines.engine import master as master_of
from orchestration.engines.feeds import Feed
from orchestration.engines.master import Master
from orchestration.engines.sources import Values
from orchestration.engines.watch import watch
from orchestration.engines.wiring import checked, fixed_steps, signals_of, source_values
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.instances import open_instance
from orchestration.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.fmi.model import Model, read_model
from orchestration.recording.recording import InMemory, Recorder
from orchestration.requests.request import usual
from orchestration.results import objectives
from orchestration.results.column_info import described
from orchestration.runs.result import Provenance, Result
from orchestration.schedule.streams import Streams
from orchestration.schedule.timetable import Timetable
from orchestration.system.check import recorded
from orchestration.system.model import Component, System, component_of, variable_of
from orchestration.system.request import Request, in_its_own_words
from orchestration.system.times import NANOSECONDS

_NOTES = logging.getLogger("quadcosim")

Progress = Callable[[float], None]
"""Hears the share of the run that is done."""
Announce = Callable[[str], None]
"""Hears what is done before the run begins."""


class RunInterrupted(Interrupted):
    """A run has ended at the first instant after Ctrl-C, with this `result` so far."""

    def __init__(self, text: str, result: Result) -> None:
        super().__init__(text)
        self.result = result


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A master over instances that have their parameters, ready to initialise or to restore."""

    asked: Request
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
                *self.asked.warnings(self.parameters),
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
    asked: Request | None = None,
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
    with prepared(asked or usual(), announce, recorder=recorder, engine=engine) as simulation:
        simulation.master.initialise()
        simulation.master.run(progress=progress)
        return simulation.result()


@contextmanager
def prepared(
    asked: Request,
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
        system = asked.as_system()
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
            said = described(system, models, ("time", *signals_of(system, models)))
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


def _seconds(time: int | None) -> float | None:
    return None if time is None else time / NANOSECONDS


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
