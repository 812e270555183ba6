"""A run in a separate process: however that process ends, the error is reported and the recorded rows are kept."""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmu_kit import scratch
from orchestration.foundation.basics.interrupt import deferred_interrupts
from orchestration.foundation.basics.times import nanoseconds
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.child import Child, Died
from orchestration.foundation.processes.resource_limits import UNLIMITED
from orchestration.foundation.processes.typed_frames import call
from orchestration.foundation.recording.recording import Chunk, Recorder
from orchestration.simulation.engines.backlog import RunEvents
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.engines.memory import Unrecorded, read_unrecorded
from orchestration.simulation.engines.resolved import ResolvedRequest
from orchestration.simulation.runs.outcome import Course, Progress, RunLost, RunOutcome, result_of
from orchestration.simulation.runs.result import Result
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.request import Request

_MESSAGES = logging.getLogger("quadcosim")
_PATIENCE = 5.0
"""Time in which the process must end after its last message [s]"""
PATIENCE_OF_CALL = 5.0
"""Time in which a call of an FMU must return after Ctrl-C [s]"""
_REPORTS = ("describe", "begin", "take", "share", "message", "stage", "outcome", "error", "crash", "end")
"""Methods of `_Receiver` that a message may name"""


@dataclass(frozen=True, kw_only=True)
class Order:
    """What the process is to run."""

    request: Request
    course: Course
    engine: Engine | None
    level: int
    """Level of the log messages that are passed on"""


def simulate(
    resolved: ResolvedRequest,
    course: Course,
    recorder: Recorder,
    *,
    progress: Progress | None,
    engine: Engine | None,
    time_limit: float | None,
    memory_limit: float,
    started: float,
) -> Result | None:
    """As `simulation.simulate`, of a request that is `resolved`; `started` is the time at which that began."""
    folder = scratch.temporary()
    try:
        with deferred_interrupts() as interrupt:
            order = Order(request=resolved.request, course=course, engine=engine, level=_MESSAGES.getEffectiveLevel())
            with Child(
                subprocesses.Module.of("orchestration.simulation.runs.apart_process", folder.path),
                limits=replace(UNLIMITED, memory=memory_limit),
            ) as child:

                def apply_limits() -> None:
                    child.allow(time_limit)
                    interrupt.forward(stop)

                def stop() -> None:
                    child.interrupt()
                    child.allow(PATIENCE_OF_CALL)

                receiver = _Receiver(recorder, progress, apply_limits)
                ending = receiver.receive_all(child, order)
            outcome = receiver.run_outcome
            if outcome is None:
                late = f"did not end within {PATIENCE_OF_CALL:g} s of Ctrl-C"
                is_late = interrupt.requested and receiver.out_of_time
                outcome = _lost(resolved, receiver, folder.path, late if is_late else ending or "ended")
            elif not receiver.is_over:
                return None
            elif ending is not None:
                outcome = replace(outcome, warnings=(*outcome.warnings, f"after the run, its process {ending}"))
            return result_of(resolved, outcome, recorder, time.perf_counter() - started, interrupt.requested)
    finally:
        folder.remove()


class _Receiver:
    """Receives the messages of the process; each is handled by the method of its name."""

    def __init__(self, recorder: Recorder, progress: Progress | None, on_start: Callable[[], None]) -> None:
        """`on_start` is called when the run begins: loading before it has no time limit and takes no Ctrl-C."""
        self.run_outcome: RunOutcome | None = None
        self.is_over = False
        """whether the run is over"""
        self.out_of_time = False
        """whether a limit of time has ended the process"""
        self.activity = ""
        """Activity of the process"""
        self.components: Sequence[str] = ()
        """whose FMUs may be called meanwhile"""
        self.place = ""
        """Line at which the C of an FMU has crashed, if that is known"""
        self.columns: tuple[str, ...] = ()
        self.recorded_until = -1.0
        """Time up to which rows are recorded [s]"""
        self.recorder, self._progress, self._on_start = recorder, progress, on_start

    def receive_all(self, child: Child, order: Order) -> str | None:
        """Send an order and handle all messages; how the process ended if that was before its last message."""
        try:
            child.send(order)
            while True:
                if child.receive_by(lambda message: call(self, message, _REPORTS)) == "end":
                    child.close(_PATIENCE)
                    return None
        except Died as death:
            reached, self.out_of_time = death.ending.reached, death.ending.out_of_time
            return str(death) if reached is None else f"was ended: {reached}"

    def describe(self, about: dict[str, dict[str, str]]) -> None:
        self.recorder.describe(about)

    def begin(self, columns: tuple[str, ...]) -> None:
        self.columns = columns
        self.recorder.begin(columns)

    def take(self, chunk: Chunk) -> None:
        self.recorder.take(chunk)
        if len(chunk.rows):
            self.recorded_until = float(chunk.rows[-1, 0])

    def share(self, share: float) -> None:
        if self._progress is not None:
            self._progress(share)

    def message(self, level: int, text: str) -> None:
        _MESSAGES.log(level, "%s", text)

    def stage(self, activity: str, components: Sequence[str]) -> None:
        if not self.activity:
            self._on_start()
        self.activity, self.components = activity, components

    def outcome(self, is_over: bool, run_outcome: RunOutcome) -> None:
        self.is_over, self.run_outcome = is_over, run_outcome

    def error(self, error: BaseException) -> None:
        raise error

    def crash(self, place: str) -> None:
        self.place = place

    def end(self) -> None:
        """The last message."""


def _lost(resolved: ResolvedRequest, receiver: _Receiver, folder: Path, ending: str) -> RunOutcome:
    """The outcome of a run whose process ended before its last message, once all that was recorded is received.

    Raises `RunLost` if nothing was.
    """
    activity, called = receiver.activity, [name for name in receiver.components if name in resolved.foreign]
    unrecorded = read_unrecorded(folder, receiver.columns)
    if unrecorded is not None:
        if unrecorded.calling is not None:
            activity, called = "in a call of", [list(resolved.system.components)[unrecorded.calling]]
        elif len(unrecorded.rows) or receiver.recorded_until >= 0.0:
            called = []
        if len(unrecorded.rows) and unrecorded.rows[-1, 0] > receiver.recorded_until:
            receiver.take(_chunk(resolved, receiver, unrecorded))
    end = receiver.recorded_until
    fmus = [f"{name} ({resolved.models[name].name})" for name in called]
    where = (
        "" if not fmus else f", {activity} {fmus[0]}" if len(fmus) == 1 else f", {activity} one of {', '.join(fmus)}"
    )
    if receiver.place:
        where = f"{where}, at {receiver.place}"
    if end < 0.0:
        raise RunLost(f"the process of the run {ending}{where}")
    text = f"the process of the run {ending}{where}, after t = {end:g} s of {resolved.system.stop_time:g} s"
    return RunOutcome(
        end=end, steps=0 if unrecorded is None else unrecorded.steps, divergence=None, divergence_time=None,
        termination=None, failure=RunLost(text), interrupted_at=end,
        provenance={"engine": "python" if unrecorded is None else "compiled"}, warnings=(),
    )  # fmt: skip


def _chunk(resolved: ResolvedRequest, receiver: _Receiver, unrecorded: Unrecorded) -> Chunk:
    """Rows and events that the compiled loop has not handed over, with the values of sources filled in."""
    rows, system, columns = unrecorded.rows, resolved.system, receiver.columns
    for name, values in resolved.sources(Streams(system.seed, system.streams)).items():
        places = [columns.index(signal) for signal in system.sources[name].signals(name)]
        rows[:, places] = values.over(rows[:, 0])
    run_events = RunEvents(system)
    if receiver.recorded_until >= 0.0:
        run_events.discard_until(nanoseconds(receiver.recorded_until))
    events = run_events.with_messages(unrecorded.events, nanoseconds(rows[-1, 0]))
    return Chunk(columns=columns, rows=rows, events=events)
