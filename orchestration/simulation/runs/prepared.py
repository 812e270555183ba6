"""From a request to instances of its FMUs and a master, ready to run."""

import functools
import importlib.metadata
import platform
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import numpy as np

from orchestration.components.fmi.instance import Instance, Loader
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.opening import open_instance
from orchestration.components.fmi.read_description import Model
from orchestration.components.fmi.surroundings import FOLDER, LIMITS, sentence
from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.interrupt import Interrupt, deferred_interrupts
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.recording.recording import InMemory, Recorder
from orchestration.simulation.engines import initial
from orchestration.simulation.engines.condition import Condition
from orchestration.simulation.engines.master import Engine, Master, create_master
from orchestration.simulation.engines.memory import Allocator, process_memory
from orchestration.simulation.engines.resolved import Announce, ResolvedRequest, fixed_steps, never_computed, resolve
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.simulation.engines.sources import Feed, SourceValues, TableValues
from orchestration.simulation.runs.outcome import Course, Progress, RunOutcome, result_of
from orchestration.simulation.runs.result import Provenance, Result
from orchestration.systems.schedule.compiled_timetable import timetable
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.check import recorded_variables
from orchestration.systems.system.component import Component, instance_of
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms


@dataclass(frozen=True, kw_only=True)
class PreparedRun:
    """A master over instances that have their parameters, ready to initialise or to restore."""

    resolved: ResolvedRequest
    instances: Mapping[str, Instance]
    master: Master
    recorder: Recorder
    interrupt: Interrupt
    started: float
    """Start on the performance counter [s]"""

    @property
    def request(self) -> Request:
        """The request as the user wrote it."""
        return self.resolved.request

    @property
    def system(self) -> System:
        """The system of the request."""
        return self.resolved.system

    @property
    def models(self) -> Mapping[str, Model]:
        """The models of the FMUs, by component."""
        return self.resolved.models

    @property
    def parameters(self) -> Mapping[str, float]:
        """All numeric parameters of all components, as COMPONENT.NAME."""
        return self.resolved.parameters

    def follow(self, course: Course, progress: Progress | None) -> bool:
        """Run along a `course`; whether the run is over. An error of an FMU after the first row is its outcome."""

        def report(share: float) -> None:
            self.restore_process()
            if progress is not None:
                progress(share)

        try:
            return course(self, report)
        except SimulatorError:
            if self.master.failure is None:
                raise
            return True

    def outcome(self) -> RunOutcome:
        """The outcome of the run so far."""
        self.restore_process()
        master, running = self.master, self.master.running
        return RunOutcome(
            end=float(master.board.row[0]),
            steps=running.steps,
            divergence=master.divergence,
            divergence_time=_seconds(master.divergence_time),
            termination=running.termination,
            failure=master.failure,
            interrupted_at=_seconds(running.interrupted_at),
            provenance=self._provenance(),
            warnings=tuple(warning for instance in self.instances.values() for warning in instance.warnings),
        )

    def _provenance(self) -> Provenance:
        found: Provenance = {**provenance(self.instances), "engine": self.master.engine}
        if (pace := self.master.running.pace) is not None:
            found["largest_lateness"] = pace.largest_lateness
        return found

    def result(self) -> Result:
        """The result so far, with its metrics; raises `RunInterrupted` or a failure as `result_of`."""
        return result_of(
            self.resolved, self.outcome(), self.recorder, time.perf_counter() - self.started, self.interrupt.requested
        )

    def restore_process(self) -> None:
        """Restore the current folder and the limits of before the run if an FMU has changed them while stepped."""
        foreign = [one for one in self.instances.values() if isinstance(one, NativeInstance) and one.guard is not None]
        if not foreign or (guard := foreign[0].guard) is None:
            return
        for what, restore in ((FOLDER, guard.restore_folder), (LIMITS, guard.restore_limits)):
            warning = sentence([f"{one.name} ({one.model.name})" for one in foreign], what)
            if restore() and warning not in foreign[0].warnings:
                foreign[0].warnings.append(warning)


@contextmanager
def prepared(
    request: Request,
    announce: Announce | None = None,
    *,
    load: Loader = open_instance,
    recorder: Recorder | None = None,
    engine: Engine | None = None,
    resolved: ResolvedRequest | None = None,
    allocate: Allocator = process_memory,
) -> Iterator[PreparedRun]:
    """A run whose FMUs, built if need be, are instantiated by `load` and have their parameters.

    Ctrl-C ends the run at its next instant. `resolved`: the request has been resolved already. The compiled loop keeps
    rows in memory of `allocate` until they are recorded. Raises `UsageError` for what the FMUs do not have or cannot
    take, before any is loaded.
    """
    started = time.perf_counter()
    recorder = InMemory() if recorder is None else recorder
    resolved = resolve(request, announce) if resolved is None else resolved
    system, models, parameters = resolved.system, resolved.models, resolved.parameters
    streams = Streams(system.seed, system.streams)
    with deferred_interrupts() as interrupt, ExitStack() as stack:
        instances = _loaded(system, models, load, stack)
        with errors_in_own_terms(request):
            schedule = timetable(system, streams, fixed_steps(system, models))
            for name, component in system.components.items():
                set_parameters(instances[name], component)
                _set_clock(instances[name], component, models[name], schedule.first_samples.get(name, 0))
            recorder.describe({name: one.as_metadata() for name, one in resolved.described.items()})
            sources = resolved.sources(streams)
            signals = {name: system.sources[name].signals(name) for name in sources}
            running = RunningSystem(
                system,
                instances,
                timetable=schedule,
                streams=streams,
                recorded=recorded_variables(system, models),
                sources=[(signals[name], values) for name, values in sources.items()],
                feeds=_feeds(system, sources, instances),
                interrupted=lambda: interrupt.requested,
                condition=Condition(
                    text=system.criterion.diverged, sources=sources, signals_of=signals, numbers=parameters
                ),
                at_once=lambda name, output: models[name].follows_at_once(output),
            )
            master = create_master(
                engine,
                running,
                recorder,
                allocate=allocate,
                first_exchange=initial.groups(system.connections, lambda name, output: models[name].depends_on(output)),
                waiting=[name for name in system.components if models[name].waits],
                never_computed=never_computed(system, models),
            )
        run = PreparedRun(
            resolved=resolved,
            instances=instances,
            master=master,
            recorder=recorder,
            interrupt=interrupt,
            started=started,
        )
        stack.callback(run.restore_process)  # also after a failure
        yield run


def _loaded(system: System, models: Mapping[str, Model], load: Loader, stack: ExitStack) -> dict[str, Instance]:
    """The instance of each component; partitions of one follow the first of them."""
    instances: dict[str, Instance] = {}
    first: dict[tuple[str, str | None], Instance] = {}
    for name, model in models.items():
        shared = instance_of(system.components[name])
        if shared in first:
            instances[name] = stack.enter_context(first[shared].beside(name, model.access))
        else:
            instances[name] = stack.enter_context(load(model.path, name, model.access))
            if shared is not None:
                first[shared] = instances[name]
    return instances


def _seconds(time: int | None) -> float | None:
    return None if time is None else seconds(time)


def provenance(instances: Mapping[str, Instance]) -> Provenance:
    """Where the numbers of a run come from: versions of the software and GUIDs of the FMUs."""
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
    """Set the parameters and the tolerance of a component in an instance that is not initialised."""
    for name, value in component.parameters.items():
        if not instance.variables[name].is_constant:
            instance.set(name, value)
    if component.tolerance is not None:
        instance.set_tolerance(component.tolerance)


def _set_clock(instance: Instance, component: Component, model: Model, first: int) -> None:
    """Have a component built on `fmu_kit` sample at every step from its `first` sample [ns] on, or by its own clock."""
    sampling = component.sampling
    if sampling is not None and model.ticking:
        instance.set_clock(sampling.period, sampling.offset, late=first > 0)
    if sampling is None or not model.has_clock:
        return
    if sampling.clock == "fmu":
        instance.set(SAMPLE_PERIOD, sampling.period)
        instance.set(SAMPLE_OFFSET, sampling.offset)
    elif model.waits:
        instance.set(SAMPLE_PERIOD, 0.0)
        instance.set(SAMPLE_OFFSET, sampling.clock_ratio * seconds(first))


def _feeds(system: System, sources: Mapping[str, SourceValues], instances: Mapping[str, Instance]) -> list[Feed]:
    feeds = []
    for name, values in sources.items():
        ends = system.sources[name].to
        for component in dict.fromkeys(map(component_of, ends)):
            places = [i for i, end in enumerate(ends) if component_of(end) == component]
            into: Floats = np.zeros(len(places))
            inputs = [variable_of(ends[i]) for i in places]
            write = instances[component].writer(inputs, into)
            if isinstance(values, TableValues) and system.sources[name].within_steps:
                instances[component].follow(inputs, values.time, values.columns[:, places])
            feeds.append(Feed(component, values, places, into, write, count=len(ends)))
    return feeds
