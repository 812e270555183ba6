"""The command `schedule`: timeline and response times of computers and networks, with bounds of theory."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command.flags import assigned
from orchestration.command.options import option
from orchestration.command.registry import CommandResult
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.terminal import in_columns, inform, warn
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.figures.names import expect_figure

if TYPE_CHECKING:
    from orchestration.simulation.runs.scheduling import Scheduled
    from orchestration.systems.schedule.responses import Responses

HEAD = (
    "", "jobs", "share", "least", "mean", "99 %", "most", "bound", "start ±", "end ±", "latency", "deadline", "missed",
    "unfinished",
)  # fmt: skip


def schedule(
    system: Annotated[Path, typer.Argument(help="System file, or SSP; its FMUs need not exist.")],
    until: Annotated[float | None, option("--until", "End of the schedule; default: stop_time.", "SECONDS")] = None,
    out: Annotated[
        Path | None, option("--out", "Draw the Gantt chart, in the format of the ending.", "FIGURE.png")
    ] = None,
    start: Annotated[float | None, option("--from", "Start of the chart, in seconds.")] = None,
    end: Annotated[float | None, option("--to", "End of the chart.")] = None,
    changes: Annotated[
        list[str] | None,
        option("--set", "A value by its path, as computers.NAME.scheduling=V; may be repeated.", "PATH=V"),
    ] = None,
) -> CommandResult:
    """Simulate the computers and networks of a system: response times, missed deadlines, bounds of theory."""
    if until is not None and not 0.0 < until < float("inf"):
        raise UsageError(f"--until {until:g}: expected a positive number of seconds")
    if out is not None:
        expect_figure(out)
    from orchestration.simulation.runs import scheduling
    from orchestration.systems.schedule.overload import overloads_in_words
    from orchestration.systems.system.paths import changed
    from orchestration.systems.system.request import system_of

    request = scheduling.request_until(system, until)
    found = scheduling.schedule(asked := changed(system_of(request), assigned("set", changes)))
    for text in overloads_in_words([asked]):
        warn(text)
    if out is not None:
        inform(str(_draw(found, out, start, end)))
    document = {
        "until": found.until,
        "tasks": {name: asdict(each) for name, each in found.tasks.items()},
        "messages": {name: asdict(each) for name, each in found.messages.items()},
        "busy": found.busy,
    }
    return CommandResult(document=document, verdict=found.verdict, lines=list(_lines(found)))


def _draw(found: "Scheduled", out: Path, start: float | None, end: float | None) -> Path:
    from dataclasses import replace

    from orchestration.simulation.figures import gantt
    from orchestration.simulation.figures.style import SCREEN, save
    from orchestration.simulation.runs.arguments import window_within

    whole = gantt.default_window(found.timeline)
    window = (start or 0.0, found.until if end is None and start is not None else end or whole[1])
    window = window_within(window, found.until, f"--from {shown(window[0])} --to {shown(window[1])}")
    style = replace(SCREEN, formats=(out.suffix[1:],))
    with style.applied():
        figure = gantt.draw(found.timeline, style, window)
    return save({out.stem: figure}, out.parent, style)[0]


def _lines(found: "Scheduled") -> Iterator[str]:
    """A table for the tasks and one for the messages."""
    for kind, each in (("task", found.tasks), ("message", found.messages)):
        if each:
            rows = [(kind, *HEAD[1:]), *((name, *_row(one)) for name, one in each.items())]
            yield from in_columns(rows, right=True)
            yield ""
    for name, share in found.busy.items():
        yield f"{name}: busy {100.0 * share:.4g} % of {found.until:g} s"
    if any(each.skipped or each.aborted for each in found.tasks.values()):
        for name, task in found.tasks.items():
            if task.skipped or task.aborted:
                yield f"{name}: {task.skipped} releases skipped, {task.aborted} jobs aborted"


def _row(of: "Responses") -> Sequence[str]:
    def text_of(time: float | None) -> str:
        return "-" if time is None else quantity(time, "s")

    response, latency = of.response, of.latency
    times = (None,) * 4 if response is None else (response.min, response.mean, response.p99, response.max)
    return (
        str(of.jobs),
        f"{100.0 * of.utilisation:.4g} %",
        *map(text_of, times),
        text_of(of.bound),
        text_of(of.start_jitter),
        text_of(of.end_jitter),
        text_of(None if latency is None else latency.max),
        text_of(of.deadline),
        "-" if of.missed is None else f"{100.0 * of.missed:.4g} %",
        str(of.unfinished),
    )
