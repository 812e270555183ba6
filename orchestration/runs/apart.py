"""A run in a process of its own: however that ends, the run ends in words, and what it had recorded stays."""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from orchestration.basics import scratch
from orchestration.basics.interrupt import deferred_interrupts
from orchestration.engines.engine import Engine
from orchestration.engines.room import Left, left_in
from orchestration.processes import subprocesses
from orchestration.processes.child import Child, Died
from orchestration.processes.limits import UNLIMITED
from orchestration.recording.recording import Chunk, Recorder
from orchestration.runs.meant import Course, Flown, Meant, Progress, RunLost, result_of
from orchestration.runs.result import Result
from orchestration.schedule.happened import Happened
from orchestration.schedule.streams import Streams
from orchestration.system.request import Request
from orchestration.system.times import NANOSECONDS

_MESSAGES = logging.getLogger("quadcosim")
_PATIENCE = 5.0
"""[s] for a process that has said its last word"""


@dataclass(frozen=True, kw_only=True)
class Order:
    """What the process is to do."""

    asked: Request
    course: Course
    engine: Engine | None
    level: int
    """of the messages that are heard"""


def flown(
    meant: Meant,
    course: Course,
    recorder: Recorder,
    *,
    progress: Progress | None,
    engine: Engine | None,
    time_limit: float | None,
    memory_limit: float,
    started: float,
) -> Result | None:
    """As `simulation.flown`, which has found out what is `meant` and when it `started`."""
    room = scratch.temporary()
    try:
        with deferred_interrupts() as interrupt:
            order = Order(asked=meant.asked, course=course, engine=engine, level=_MESSAGES.getEffectiveLevel())
            with Child(
                subprocesses.command("orchestration.runs.apart_process", room.path),
                limits=replace(UNLIMITED, memory=memory_limit),
            ) as child:

                def begin() -> None:
                    child.allow(time_limit)
                    interrupt.forward(child.interrupt)

                heard = _Heard(recorder, progress, begin)
                why = heard.all_of(child, order)
            found = heard.flown
            if found is None:
                raise _lost(meant, heard, room.path, why or "ended", started)
            if why is not None:
                found = replace(found, warnings=(*found.warnings, f"after the run, its process {why}"))
            if not heard.over:
                return None
            return result_of(meant, found, recorder, time.perf_counter() - started, interrupt.requested)
    finally:
        room.remove()


class _Heard:
    """What the process says, passed on to who is to hear it."""

    def __init__(self, recorder: Recorder, progress: Progress | None, begun: Callable[[], None]) -> None:
        """`begun`: it is at the run itself. What it loads before is not limited in time, and hears of no Ctrl-C."""
        self.flown: Flown | None = None
        self.over = False
        """whether the run is"""
        self.doing = ""
        """what the process is at"""
        self.components: Sequence[str] = ()
        """whose FMUs may be called at that"""
        self.columns: tuple[str, ...] = ()
        self.recorded_until = -1.0
        """[s]"""
        self.recorder, self._progress, self._begun = recorder, progress, begun

    def all_of(self, child: Child, order: Order) -> str | None:
        """All that comes of an order; how the process ended if that was before its last word."""
        try:
            child.say(order)
            while True:
                name, *content = child.hear()
                if name == "end":
                    child.close(_PATIENCE)
                    return None
                getattr(self, name)(*content)
        except Died as death:
            reached = death.ending.reached
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

    def stage(self, doing: str, components: Sequence[str]) -> None:
        if not self.doing:
            self._begun()
        self.doing, self.components = doing, components

    def come_to(self, over: bool, flown: Flown) -> None:
        self.over, self.flown = over, flown

    def error(self, error: BaseException) -> None:
        raise error


def _lost(meant: Meant, heard: _Heard, room: Path, why: str, started: float) -> RunLost:
    """What is left of a run whose process has ended without a last word."""
    doing, called = heard.doing, [name for name in heard.components if name in meant.foreign]
    left = left_in(room, heard.columns)
    if left is not None:
        if left.calling is not None:
            doing, called = "in a call of", [list(meant.system.components)[left.calling]]
        elif len(left.rows) or heard.recorded_until >= 0.0:
            called = []
        if len(left.rows) and left.rows[-1, 0] > heard.recorded_until:
            heard.take(_chunk(meant, heard, left))
    end = heard.recorded_until
    who = [f"{name} ({meant.models[name].name})" for name in called]
    which = "" if not who else f", {doing} {who[0]}" if len(who) == 1 else f", {doing} one of {', '.join(who)}"
    if end < 0.0:
        return RunLost(f"the process of the run {why}{which}")
    text = f"the process of the run {why}{which}, after t = {end:g} s of {meant.system.stop_time:g} s"
    found = Flown(
        end=end, steps=0 if left is None else left.steps, divergence=None, divergence_time=None, termination=None,
        interrupted_at=end,
        provenance={"engine": "python" if left is None else "compiled"}, warnings=(text,),
    )  # fmt: skip
    return RunLost(text, result_of(meant, found, heard.recorder, time.perf_counter() - started, interrupted=False))


def _chunk(meant: Meant, heard: _Heard, left: Left) -> Chunk:
    """Rows and events that the compiled loop has not handed over, with what sources say."""
    rows, system, columns = left.rows, meant.system, heard.columns
    for name, values in meant.sources(Streams(system.seed, system.streams)).items():
        places = [columns.index(signal) for signal in system.sources[name].signals(name)]
        rows[:, places] = values.over(rows[:, 0])
    happened = Happened(system)
    if heard.recorded_until >= 0.0:
        happened.hand_over(round(heard.recorded_until * NANOSECONDS))
    events = happened.with_messages(left.events, round(float(rows[-1, 0]) * NANOSECONDS))
    return Chunk(columns=columns, rows=rows, events=events)
