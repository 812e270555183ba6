"""Runs a system or a scenario from start to end, in this process or in a separate one."""

import time
from functools import partial
from typing import TYPE_CHECKING, Any, overload

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes.resource_limits import Limits
from orchestration.foundation.recording.recording import InMemory, Recorder
from orchestration.simulation.engines.master import Engine, engine_named
from orchestration.simulation.engines.resolved import Announce, resolve
from orchestration.simulation.engines.running_system import Pace
from orchestration.simulation.runs.outcome import Course, Progress
from orchestration.simulation.runs.prepared import PreparedRun, prepared
from orchestration.simulation.runs.result import Result
from orchestration.systems.system.request import Request

if TYPE_CHECKING:
    from orchestration.simulation.requests.request import RequestLike


def run_to_end(simulation: PreparedRun, progress: Progress | None) -> bool:
    """The course of a run from start to end."""
    simulation.master.initialise()
    return simulation.master.run(progress=progress)


def paced(rate: float, course: Course, simulation: PreparedRun, progress: Progress | None) -> bool:
    """Follow a course that keeps a pace of `rate` seconds in a second."""
    simulation.master.running.pace = Pace(rate)
    return course(simulation, progress)


@overload
def run(
    request: "RequestLike | None" = None, *, recorder: Recorder | None = None, progress: Progress | None = None,
    announce: Announce | None = None, engine: Engine | None = None, in_process: bool = False,
    time_limit: float | None = None, memory_limit: float = Limits.memory,
) -> Result: ...  # fmt: skip
@overload
def run(
    request: list[Any], *, recorder: None = None, progress: Progress | None = None,
    announce: Announce | None = None, engine: Engine | None = None, in_process: bool = False,
    time_limit: float | None = None, memory_limit: float = Limits.memory,
) -> list[Result]: ...  # fmt: skip
def run(
    request: "RequestLike | list[Any] | None" = None,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
) -> Result | list[Result]:
    """Run a system, or a scenario of the quadrotor; default: the paper's.

    `request` may also be the path of a file, a dictionary with the content of one, or a list, whose items run in turn.

    A run that diverges has a result, and so has one that an FMU ends early.

    Rows are kept in memory unless a `recorder` takes them. `engine`: by default the compiled loop where available; the
    results are the same. With FMUs that were not built here from this project's sources the run has a separate process,
    unless `in_process`: however that process ends, this one goes on. `memory_limit` [MB] applies to that process, and
    so does `time_limit` [s] of processor time; with a time limit any run has a separate process.

    Raises `UsageError` for an FMU, variable or value that does not exist, `SimulatorError` if an FMU
    refuses a call for another reason than divergence, `RunLost` if an FMU or a limit ends the process,
    `RunInterrupted` after Ctrl-C; what was recorded is their `result`.
    """
    from orchestration.simulation.requests.request import (
        default_request,
        request_of,
    )  # not before: they load readers of files

    if isinstance(request, list):
        if recorder is not None:
            raise UsageError("recorder: expected none for a list of runs")
        return [
            run(
                each, progress=progress, announce=announce, engine=engine, in_process=in_process,
                time_limit=time_limit, memory_limit=memory_limit,
            ) for each in request
        ]  # fmt: skip
    result = simulate(
        default_request() if request is None else request_of(request), recorder=recorder, progress=progress,
        announce=announce, engine=engine, in_process=in_process, time_limit=time_limit, memory_limit=memory_limit,
    )  # fmt: skip
    assert result is not None
    return result


def simulate(
    request: Request,
    course: Course = run_to_end,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    engine: Engine | None = None,
    in_process: bool = False,
    time_limit: float | None = None,
    memory_limit: float = Limits.memory,
    pace: float | None = None,
) -> Result | None:
    """Run along a `course`; the result, or None if the run is not over then. Else as `run`.

    No instant begins before its time at a `pace`, in seconds of the run in a second.
    """
    engine = engine_named(engine)
    if pace is not None:
        course = partial(paced, pace, course)
    if in_process and time_limit is not None:
        raise UsageError("--time-limit: expected without --in-process; it is a process that is limited")
    started = time.perf_counter()
    recorder = InMemory() if recorder is None else recorder
    resolved = resolve(request, announce)
    if not in_process and (resolved.foreign or time_limit is not None):
        from orchestration.simulation.runs import run_in_process  # not before: loads what starts processes

        return run_in_process.simulate(
            resolved, course, recorder, progress=progress, engine=engine, time_limit=time_limit,
            memory_limit=memory_limit, started=started,
        )  # fmt: skip
    with prepared(request, announce, recorder=recorder, engine=engine, resolved=resolved) as simulation:
        return simulation.result() if simulation.follow(course, progress) else None
