"""Computers for the scheduler, described by a few numbers."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from orchestration.foundation.basics.times import Constant
from orchestration.systems.computers.compiled import CompiledScheduler
from orchestration.systems.computers.parts import (
    FIXED_PRIORITY,
    LATER,
    NONE,
    QUEUE,
    Carrier,
    Leg,
    NetworkLink,
    Parts,
    Processor,
    ScheduledFrame,
    ScheduledTask,
    Stream,
)
from orchestration.systems.computers.scheduler import Scheduler
from orchestration.systems.computers.timeline import Names, Timeline, timeline

MS = 1_000_000


def every(period: int, offset: int = 0) -> Stream:
    """Instants of a grid."""
    k = 0

    def drawn(count: int) -> Any:
        nonlocal k
        k += count
        return offset + np.arange(k - count, k, dtype=np.int64) * period

    return drawn


class Described:
    """Puts parts together."""

    def __init__(self, stop: int) -> None:
        self.stop = stop
        self.processors: list[Processor] = []
        self.tasks: list[ScheduledTask] = []
        self.carriers: list[Carrier] = []
        self.messages: list[ScheduledFrame] = []
        self.links: list[NetworkLink] = []
        self.streams: list[Stream] = []

    def stream(self, stream: Stream | int) -> int:
        self.streams.append(Constant(stream) if isinstance(stream, int) else stream)
        return len(self.streams) - 1

    def processor(self, policy: int = FIXED_PRIORITY, *, preemptive: bool = True, switch: int = 0) -> int:
        self.processors.append(Processor(policy, preemptive, switch))
        return len(self.processors) - 1

    def task(self, execution: Stream | int, period: int | None, *, priority: int = 1, deadline: int | None = None,
             offset: int = 0, overrun: int = QUEUE, processor: int = 0, at_release: bool = False,
             at_deadline: bool = False, late: Stream | int = 0) -> int:  # fmt: skip
        self.tasks.append(
            ScheduledTask(
                processor=processor,
                priority=priority,
                deadline=deadline or period or 1,
                overrun=overrun,
                reads_at_release=at_release,
                writes_at_deadline=at_deadline,
                nominal=NONE if period is None else self.stream(every(period, offset)),
                late=self.stream(late),
                execution=self.stream(execution),
            )
        )
        return len(self.tasks) - 1

    def message(self, length: int, period: int | None, *, rank: int = 0, offset: int = 0, link: int = 0,
                corrupted: Stream | int = 0, more: int = 0) -> int:  # fmt: skip
        self.messages.append(
            ScheduledFrame(
                rank=rank,
                legs=(Leg(link=link, slot=NONE, length=length, corrupted_length=length + more),),
                pause=0,
                nominal=NONE if period is None else self.stream(every(period, offset)),
                late=self.stream(0),
                corrupted=self.stream(corrupted),
                carrier=NONE,
            )
        )
        return len(self.messages) - 1

    def link(self) -> int:
        self.links.append(NetworkLink(slots=0, begins=NONE))
        return len(self.links) - 1

    def parts(self) -> Parts:
        return Parts(
            stop=self.stop, processors=self.processors, tasks=self.tasks, carriers=self.carriers,
            messages=self.messages, links=self.links, streams=self.streams,
        )  # fmt: skip

    def names(self) -> Names:
        def numbered(of: Sequence[Any]) -> list[str]:
            return [str(i) for i in range(len(of))]

        return Names(
            processors=numbered(self.processors), tasks=numbered(self.tasks), messages=numbered(self.messages),
            links=numbered(self.links),
        )  # fmt: skip

    def timeline(self, scheduler: Callable[[Parts], Scheduler | CompiledScheduler] = Scheduler) -> Timeline:
        parts = self.parts()
        made = scheduler(parts)
        made.run(LATER)
        return timeline(parts, self.names(), [LATER] * len(self.messages), made.take_notes())
