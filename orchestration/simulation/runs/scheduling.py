"""The schedule of the computers and networks of a system; no FMU is loaded, and none needs to exist."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.simulation.requests.request import (
    FMU,
    SSP,
    SSP_ENDINGS,
    WHAT,
    RequestLike,
    request_from_tables,
    request_of,
)
from orchestration.simulation.runs.arguments import window_within
from orchestration.systems.computers.timeline import NEVER, Timeline
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.schedule.responses import Responses, responses_of
from orchestration.systems.system.request import Request, system_of

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures


@dataclass(frozen=True, kw_only=True)
class Scheduled:
    """The jobs of the tasks and the frames of the messages of a system, up to a time."""

    until: float
    """The end of the schedule [s]."""
    tasks: Mapping[str, Responses]
    """Responses by COMPUTER.TASK."""
    messages: Mapping[str, Responses]
    """Responses by NETWORK.MESSAGE."""
    busy: Mapping[str, float]
    """The share of the time in which a computer was busy, switches included, or a link carried a frame."""
    timeline: Timeline
    """All jobs and frames, in nanoseconds."""

    @property
    def missed(self) -> dict[str, float]:
        """By task and message that misses deadlines, the share missed."""
        return {name: one.missed for name, one in {**self.tasks, **self.messages}.items() if one.missed}

    @property
    def starved(self) -> list[str]:
        """The tasks and messages that are released, and none of which is ever done."""
        each = {**self.tasks, **self.messages}
        return [name for name, one in each.items() if one.jobs and one.response is None]

    def _never(self, late: str) -> str:
        """That nothing of a late task or message is done, or no job of it has any time; empty for any other."""
        jobs = self.timeline.jobs.get(late)
        never = "never done" if jobs is None or (jobs.started != NEVER).any() else "never ran"
        return f" ({never})" if late in self.starved else ""

    @property
    def verdict(self) -> str:
        """Which deadlines are missed, or how near the worst response comes to one, and what is busiest."""
        each = {**self.tasks, **self.messages}
        due = [name for name, one in each.items() if one.deadline is not None and one.missed is not None]
        busiest = max(self.busy, key=lambda name: self.busy[name], default=None)
        busy = "" if busiest is None else f"; {busiest} busy {100.0 * self.busy[busiest]:.3g} %"
        until = f"in {quantity(self.until, 's')}"
        if missed := self.missed:
            worst = [
                f"{name} {100.0 * share:.3g} %{self._never(name)}"
                for name, share in sorted(missed.items(), key=lambda item: -item[1])
            ]
            return f"deadlines missed {until}: {some(worst)}{busy}"
        if not due:
            return f"no deadline to meet {until}{busy}"
        margins = {
            name: (one.response.max / one.deadline, one.response.max, one.deadline)
            for name, one in each.items()
            if one.response is not None and one.deadline
        }
        name = max(margins, key=lambda one: margins[one][0])
        _, response, deadline = margins[name]
        return (
            f"all deadlines met {until}, {name} nearest: {quantity(response, 's')} of {quantity(deadline, 's')}{busy}"
        )

    def plot(self, window: tuple[float, float] | None = None, style: str = "screen") -> "Figures":
        """Its Gantt chart, over a `window` of time [s]; default: from the start, as long as jobs can be told apart."""
        from orchestration.simulation.figures import gantt
        from orchestration.simulation.figures.style import Figures, style_named

        chosen = style_named(style)
        if window is not None:
            window = window_within(window, self.until, f"window = {shown(repr(window))}")
        with chosen.applied():
            return Figures({"schedule": gantt.draw(self.timeline, chosen, window)}, chosen)


def schedule(request: RequestLike, until: float | None = None) -> Scheduled:
    """Schedule the tasks and messages of a system up to a time; default: its `stop_time`.

    `request` may also be the path of a file or a dictionary with the content of one; its FMUs need not exist.

    Raises `UsageError` for a system without computers and networks.
    """
    system = system_of(request_until(request, until))
    if not (system.computers or system.networks):
        raise UsageError("computers: none, and no networks: expected at least one of them to schedule")
    timeline = timeline_of(system)
    responses = responses_of(system, timeline)
    return Scheduled(
        until=seconds(timeline.stop),
        tasks=responses.tasks,
        messages=responses.messages,
        busy=responses.busy,
        timeline=timeline,
    )


def request_until(request: RequestLike, until: float | None) -> Request:
    """A request with this stop time; a file that is used for this only need not have one."""
    if until is None:
        return request_of(request)
    if isinstance(request, (str, os.PathLike)) and Path(request).suffix.lower() not in (FMU, *SSP_ENDINGS):
        path = Path(request)
        tables = read_toml(path, WHAT)
        if SSP not in tables:
            return request_from_tables({**tables, "stop_time": until}, path.parent)
    if isinstance(request, Mapping):
        return request_of({**request, "stop_time": until})
    return replace(system_of(request_of(request)), stop_time=until)
