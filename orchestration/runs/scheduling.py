"""The computers and networks of a system by themselves: no FMU is loaded, and none has to be there."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.basics.documents import read_toml
from orchestration.basics.errors import UsageError
from orchestration.computers.results import Timeline
from orchestration.requests.request import SSP, SSP_ENDINGS, Asked, asked_for, request_from_tables
from orchestration.schedule.resources import timeline_of
from orchestration.schedule.responses import Responses, responses_of
from orchestration.system.request import Request, system_meant

if TYPE_CHECKING:
    from orchestration.figures.gallery import Figures


@dataclass(frozen=True, kw_only=True)
class Scheduled:
    """What becomes of the tasks and messages of a system, up to a time."""

    until: float
    """Up to when [s]."""
    tasks: Mapping[str, Responses]
    """By COMPUTER.TASK."""
    messages: Mapping[str, Responses]
    """By NETWORK.MESSAGE."""
    busy: Mapping[str, float]
    """The share of the time that a computer was at work, switches included, or a link carried a frame."""
    timeline: Timeline
    """All jobs and frames, in nanoseconds."""

    def plot(self, window: tuple[float, float] | None = None, style: str = "screen") -> "Figures":
        """Its Gantt chart, over a `window` of time [s], else over as much from the start as can be told apart."""
        from orchestration.figures import gantt
        from orchestration.figures.gallery import Figures
        from orchestration.figures.style import style_named

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"schedule": gantt.draw(self.timeline, chosen, window)}, chosen)


def schedule(asked: Asked, until: float | None = None) -> Scheduled:
    """What becomes of the tasks and messages of a system up to a time, or else up to its `stop_time`.

    It may be given by the path of its file, or as a dictionary of what stands there; its FMUs need not be there.

    Raises `UsageError` for a system without computers and networks.
    """
    system = system_meant(asked_until(asked, until))
    if not (system.computers or system.networks):
        raise UsageError("computers: none, and no networks: expected at least one of them to schedule")
    timeline = timeline_of(system)
    found = responses_of(system, timeline)
    return Scheduled(
        until=timeline.stop / 1e9, tasks=found.tasks, messages=found.messages, busy=found.busy, timeline=timeline
    )


def asked_until(asked: Asked, until: float | None) -> Request:
    """What is asked for, up to a time: a file that is only for this needs no end of its own."""
    if until is None:
        return asked_for(asked)
    if isinstance(asked, (str, os.PathLike)) and Path(asked).suffix.lower() not in SSP_ENDINGS:
        path = Path(asked)
        tables = read_toml(path, "system or scenario file")
        if SSP not in tables:
            return request_from_tables({**tables, "stop_time": until}, path.parent)
    if isinstance(asked, Mapping):
        return asked_for({**asked, "stop_time": until})
    return replace(system_meant(asked_for(asked)), stop_time=until)
