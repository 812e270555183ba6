"""From a system to a result: instantiates its FMUs, lets the master step them, computes the objectives."""

import functools
import importlib.metadata
import logging
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.basics.interrupt import Interrupt, Interrupted, interrupts_held_back
from orchestration.basics.simulator import Floats
from orchestration.building import fmus
from orchestration.engines import initial
from orchestration.engines.condition import program
from orchestration.engines.engine import Engine
from orchestration.engines.engine import master as master_of
from orchestration.engines.feeds import Feed
from orchestration.engines.master import Master
from orchestration.engines.room import Room, private
from orchestration.engines.sources import Values
from orchestration.engines.watch import watch
from orchestration.engines.wiring import checked, fixed_steps, signals_of, source_values
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.instances import open_instance
from orchestration.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.fmi.model import Model, read_model
from orchestration.fmi.native import NativeInstance
from orchestration.fmi.surroundings import FOLDER, sentence
from orchestration.processes.confined import Limits
from orchestration.recording.recording import InMemory, Recorder
from orchestration.requests.request import usual
from orchestration.results import objectives
from orchestration.results.column_info import Described, described
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


class RunLost(QuadcosimError):
    """The process of a run has ended before the run had; the text says how and when."""

    def __init__(self, text: str, result: Result | None = None) -> None:
        super().__init__(text)
        self.result = result
        """What it had recorded; None if that is nothing."""


@dataclass(frozen=True, kw_only=True)
class Meant:
    """What somebody asked for, held to FMUs that are there."""

    asked: Request
    """as the user wrote it"""
    system: System
    """what it means"""
    paths: Mapping[str, Path]
    """of the FMUs, by component"""
    models: Mapping[str, Model]
    parameters: Mapping[str, float]
    """all numeric parameters of all components, as COMPONENT.NAME"""
    units: Mapping[str, str]
    """of what it comes to"""

    @property
    def foreign(self) -> list[str]:
        """Components whose FMUs are not built on this project's kit."""
        return [name for name, model in self.models.items() if not model.is_of_this_kit]

    @property
    def described(self) -> dict[str, Described]:
        """What is known of each column."""
        return described(self.system, self.models, ("time", *signals_of(self.system, self.models)))

    def sources(self, streams: Streams) -> dict[str, Values]:
        """The sources at work in a run, by name."""
        return {name: source_values(self.system, name, self.parameters, streams) for name in self.system.sources}


@dataclass(frozen=True, kw_only=True)
class Flown:
    """What a run has come to, beside what was recorded."""

    end: float
    """the time of the last row [s]"""
    steps: int
    divergence: str | None
    divergence_time: float | None
    termination: str | None
    interrupted_at: float | None
    provenance: Provenance
    warnings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A master over instances that have their parameters, ready to initialise or to restore."""

    meant: Meant
    instances: Mapping[str, Instance]
    master: Master
    recorder: Recorder
    interrupt: Interrupt
    started: float
    """on the performance counter [s]"""

    @property
    def asked(self) -> Request:
        """What was asked for, as the user wrote it."""
        return self.meant.asked

    @property
    def system(self) -> System:
        """What it means."""
        return self.meant.system

    @property
    def models(self) -> Mapping[str, Model]:
        """What the FMUs say of themselves, by component."""
        return self.meant.models

    @property
    def parameters(self) -> Mapping[str, float]:
        """All numeric parameters of all components, as COMPONENT.NAME."""
        return self.meant.parameters

    def flown(self) -> Flown:
        """What the run has come to so far."""
        master = self.master
        return Flown(
            end=float(master.board.row[0]),
            steps=master.steps,
            divergence=master.divergence,
            divergence_time=_seconds(master.divergence_time),
            termination=master.termination,
            interrupted_at=_seconds(master.interrupted_at),
            provenance={**provenance(self.instances), "engine": master.engine},
            warnings=tuple(warning for instance in self.instances.values() for warning in instance.warnings),
        )

    def result(self) -> Result:
        """What was recorded so far, with its metrics; raises `RunInterrupted` with it if that is why it ended."""
        return result_of(
            self.meant, self.flown(), self.recorder, time.perf_counter() - self.started, self.interrupt.requested
        )

    def put_folder_back(self) -> None:
        """The current folder is as it was before the run, whatever FMU has changed it while it was stepped."""
        foreign = [one for one in self.instances.values() if isinstance(one, NativeInstance) and one.guard is not None]
        if foreign and foreign[0].guard is not None and foreign[0].guard.put_back_folder():
            warning = sentence([f"{one.name} ({one.model.name})" for one in foreign], FOLDER)
            if warning not in foreign[0].warnings:
                foreign[0].warnings.append(warning)


def result_of(meant: Meant, flown: Flown, recorder: Recorder, wall_time: float, interrupted: bool) -> Result:
    """The result of a run, with its metrics; raises `RunInterrupted` with it if it was `interrupted`."""
    recording = recorder.finish()
    result = Result(
        asked=meant.asked,
        system=meant.system,
        recording=recording,
        metrics=objectives.compute(
            meant.system,
            lambda: objectives.spans(meant.system, recording, meant.parameters, flown.end),
            end=flown.end,
            divergence_time=flown.divergence_time,
            steps=flown.steps,
            terminated=flown.termination is not None,
        ),
        units=meant.units,
        described=described(meant.system, meant.models, recording.columns),
        parameters=meant.parameters,
        divergence=flown.divergence,
        termination=flown.termination,
        interrupted_at=flown.interrupted_at,
        provenance={**flown.provenance, "wall_time": wall_time},
        warnings=(*meant.asked.warnings(meant.parameters), *flown.warnings),
    )
    _NOTES.debug(
        "%d steps to t = %g s by the %s loop in %.3f s", flown.steps, flown.end, flown.provenance["engine"], wall_time
    )
    if interrupted:
        raise RunInterrupted(f"at t = {flown.end:g} s of {meant.system.stop_time:g} s", result)
    return result


Course = Callable[[Simulation, Progress | None], bool]
"""Flies what is prepared; whether the run is over then. Of a run in another process it is pickled."""


def whole(simulation: Simulation, progress: Progress | None) -> bool:
    """From the start to the end."""
    simulation.master.initialise()
    return simulation.master.run(progress=progress)


def run(
    asked: Request | None = None,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
) -> Result:
    """Run a system, or fly a scenario of the quadrotor, the paper's if none is given.

    Divergence is a result, and so is what was recorded until an FMU has ended the run.

    Its rows are kept in memory unless a `recorder` takes them. By the compiled loop where that can be had, unless an
    `engine` is named; the result is the same. With FMUs that are not built on this project's kit it is flown in a
    process of its own, unless `in_process`: however that process ends, this one goes on. `memory_limit` [MB] is of
    that process; so is `time_limit` [s], of the processor, with which any run has a process of its own.

    Raises `UsageError` for an FMU, variable or value that does not exist, `SimulatorError` if an FMU
    refuses a call for another reason than divergence, `RunLost` with what was recorded if an FMU or a limit ends
    the process, `RunInterrupted` after Ctrl-C.
    """
    result = flown(
        asked or usual(), whole, recorder=recorder, progress=progress, announce=announce, engine=engine,
        in_process=in_process, time_limit=time_limit, memory_limit=memory_limit,
    )  # fmt: skip
    assert result is not None
    return result


def flown(
    asked: Request,
    course: Course,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
) -> Result | None:
    """What comes of a run that takes a `course`; None if it is not over then. Else as `run`."""
    from orchestration.runs import apart  # which knows what is here

    if in_process and time_limit is not None:
        raise UsageError("--time-limit: expected without --in-process; it is a process that is limited")
    started = time.perf_counter()
    recorder = InMemory() if recorder is None else recorder
    meant = held_to_fmus(asked, announce)
    if not in_process and (meant.foreign or time_limit is not None):
        return apart.flown(
            meant, course, recorder, progress=progress, engine=engine, time_limit=time_limit,
            memory_limit=memory_limit, started=started,
        )  # fmt: skip
    with prepared(asked, announce, recorder=recorder, engine=engine, meant=meant) as simulation:
        over = course(simulation, looked_after(simulation, progress))
        return simulation.result() if over else None


def looked_after(simulation: Simulation, progress: Progress | None) -> Progress:
    """Hears of the progress of a run, and at times looks after what its FMUs share."""

    def hear(share: float) -> None:
        simulation.put_folder_back()
        if progress is not None:
            progress(share)

    return hear


def held_to_fmus(asked: Request, announce: Announce | None = None) -> Meant:
    """The system that somebody asked for, its FMUs built if need be; raises `UsageError` for what they do not have."""
    with in_its_own_words(asked):
        system = asked.as_system()
        paths = fmus.of_components(system.fmus, announce)
        models = {name: read_model(path) for name, path in paths.items()}
        found = checked(system, models)
    return Meant(
        asked=asked, system=found.system, paths=paths, models=models, parameters=found.parameters, units=found.units
    )  # fmt: skip


@contextmanager
def prepared(
    asked: Request,
    announce: Announce | None = None,
    *,
    load: Loader = open_instance,
    recorder: Recorder | None = None,
    engine: Engine | None = None,
    meant: Meant | None = None,
    room: Room = private,
) -> Iterator[Simulation]:
    """The FMUs of a system, built if need be, instantiated by `load` and with their parameters.

    Ctrl-C ends the run at its next instant. What it is held to may be known already (`meant`); the compiled loop keeps
    rows in `room` until they are recorded. Raises `UsageError` for what the FMUs do not have or cannot take, before
    any is loaded.
    """
    started = time.perf_counter()
    recorder = InMemory() if recorder is None else recorder
    meant = held_to_fmus(asked, announce) if meant is None else meant
    system, models, parameters = meant.system, meant.models, meant.parameters
    streams = Streams(system.seed, system.streams)
    with interrupts_held_back() as interrupt, ExitStack() as stack:
        instances = {name: stack.enter_context(load(path, name)) for name, path in meant.paths.items()}
        with in_its_own_words(asked):
            timetable = Timetable(system, streams, fixed_steps(system, models))
            for name, component in system.components.items():
                _set_parameters(instances[name], component)
                _set_clock(instances[name], component, models[name], timetable.first_samples.get(name, 0))
            recorder.describe({name: one.as_words() for name, one in meant.described.items()})
            sources = meant.sources(streams)
            signals = {name: system.sources[name].signals(name) for name in sources}
            watched = (sources, signals, parameters)
            master = master_of(
                engine,
                system,
                instances,
                timetable=timetable,
                streams=streams,
                recorded=recorded(system, models),
                recorder=recorder,
                sources=[(signals[name], values) for name, values in sources.items()],
                feeds=_feeds(system, sources, instances),
                interrupted=lambda: interrupt.requested,
                watch=lambda board: watch(system.criterion.diverged, board, *watched),
                condition=lambda board: program(system.criterion.diverged, board, *watched),
                room=room,
                first_exchange=initial.groups(system.connections, lambda name, output: models[name].depends_on(output)),
                waiting=[name for name in system.components if models[name].waits],
            )
        yield Simulation(
            meant=meant, instances=instances, master=master, recorder=recorder, interrupt=interrupt, started=started
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
    if component.tolerance is not None:
        instance.set_tolerance(component.tolerance)


def _set_clock(instance: Instance, component: Component, model: Model, first: int) -> None:
    """A component built on `fmu_kit` samples at every step from its `first` sample [ns] on, or keeps its own clock."""
    sampling = component.sampling
    if sampling is None or SAMPLE_PERIOD not in instance.variables:
        return
    if sampling.clock == "fmu":
        instance.set(SAMPLE_PERIOD, sampling.period)
        instance.set(SAMPLE_OFFSET, sampling.offset)
    elif model.waits:
        instance.set(SAMPLE_PERIOD, 0.0)
        instance.set(SAMPLE_OFFSET, sampling.clock_ratio * (first / NANOSECONDS))


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
