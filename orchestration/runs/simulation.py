"""From a system to a result: instantiates its FMUs, lets the master step them, computes the objectives."""

import functools
import importlib.metadata
import platform
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.interrupt import Interrupt, deferred_interrupts
from orchestration.basics.simulator import Floats
from orchestration.engines import initial
from orchestration.engines.condition import program
from orchestration.engines.engine import Engine
from orchestration.engines.engine import master as master_of
from orchestration.engines.feeds import Feed
from orchestration.engines.master import Master
from orchestration.engines.room import Room, private
from orchestration.engines.sources import Values
from orchestration.engines.watch import watch
from orchestration.engines.wiring import fixed_steps
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.instances import open_instance
from orchestration.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.fmi.model import Model
from orchestration.fmi.native import NativeInstance
from orchestration.fmi.surroundings import FOLDER, sentence
from orchestration.processes.limits import Limits
from orchestration.recording.recording import InMemory, Recorder
from orchestration.runs import apart
from orchestration.runs.meant import (
    Announce,
    Course,
    Flown,
    Meant,
    Progress,
    held_to_fmus,
    result_of,
)
from orchestration.runs.result import Provenance, Result
from orchestration.schedule.streams import Streams
from orchestration.schedule.timetable import Timetable
from orchestration.system.check import recorded
from orchestration.system.component import Component
from orchestration.system.model import System
from orchestration.system.request import Request, in_its_own_words
from orchestration.system.times import NANOSECONDS
from orchestration.system.variable_names import component_of, variable_of

if TYPE_CHECKING:
    from orchestration.requests.request import Asked


@dataclass(frozen=True, kw_only=True)
class PreparedRun:
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


def whole(simulation: PreparedRun, progress: Progress | None) -> bool:
    """From the start to the end."""
    simulation.master.initialise()
    return simulation.master.run(progress=progress)


@overload
def run(
    asked: "Asked | None" = None, *, recorder: Recorder | None = None, progress: Progress | None = None,
    announce: Announce | None = None, engine: Engine | None = None, in_process: bool = False,
    time_limit: float | None = None, memory_limit: float = Limits.memory,
) -> Result: ...  # fmt: skip
@overload
def run(
    asked: list[Any], *, recorder: None = None, progress: Progress | None = None,
    announce: Announce | None = None, engine: Engine | None = None, in_process: bool = False,
    time_limit: float | None = None, memory_limit: float = Limits.memory,
) -> list[Result]: ...  # fmt: skip
def run(
    asked: "Asked | list[Any] | None" = None,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
) -> Result | list[Result]:
    """Run a system, or fly a scenario of the quadrotor, the paper's if none is given.

    It may be given by the path of its file, or as a dictionary of what stands there; of a list each is run, in turn.

    Divergence is a result, and so is what was recorded until an FMU has ended the run.

    Its rows are kept in memory unless a `recorder` takes them. By the compiled loop where that can be had, unless an
    `engine` is named; the result is the same. With FMUs that are not built on this project's kit it is flown in a
    process of its own, unless `in_process`: however that process ends, this one goes on. `memory_limit` [MB] is of
    that process; so is `time_limit` [s], of the processor, with which any run has a process of its own.

    Raises `UsageError` for an FMU, variable or value that does not exist, `SimulatorError` if an FMU
    refuses a call for another reason than divergence, `RunLost` with what was recorded if an FMU or a limit ends
    the process, `RunInterrupted` after Ctrl-C.
    """
    from orchestration.requests.request import asked_for, usual  # the readers of files are for who reads one

    if isinstance(asked, list):
        if recorder is not None:
            raise UsageError("recorder: expected none for a list of runs")
        return [
            run(
                each, progress=progress, announce=announce, engine=engine, in_process=in_process,
                time_limit=time_limit, memory_limit=memory_limit,
            ) for each in asked
        ]  # fmt: skip
    request = usual() if asked is None else asked_for(asked)
    result = flown(
        request, whole, recorder=recorder, progress=progress, announce=announce, engine=engine,
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


def looked_after(simulation: PreparedRun, progress: Progress | None) -> Progress:
    """Hears of the progress of a run, and at times looks after what its FMUs share."""

    def hear(share: float) -> None:
        simulation.put_folder_back()
        if progress is not None:
            progress(share)

    return hear


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
) -> Iterator[PreparedRun]:
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
    with deferred_interrupts() as interrupt, ExitStack() as stack:
        instances = {name: stack.enter_context(load(path, name)) for name, path in meant.paths.items()}
        with in_its_own_words(asked):
            timetable = Timetable(system, streams, fixed_steps(system, models))
            for name, component in system.components.items():
                set_parameters(instances[name], component)
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
        yield PreparedRun(
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


def set_parameters(instance: Instance, component: Component) -> None:
    """Give an instance that has not been initialised what its component says."""
    for name, value in component.parameters.items():
        if not instance.variables[name].is_constant:
            instance.set(name, value)
    if component.tolerance is not None:
        instance.set_tolerance(component.tolerance)


def _set_clock(instance: Instance, component: Component, model: Model, first: int) -> None:
    """A component built on `fmu_kit` samples at every step from its `first` sample [ns] on, or keeps its own clock."""
    sampling = component.sampling
    if sampling is None or not model.has_clock:
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
