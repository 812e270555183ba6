"""What expressions say of jobs and frames: numbers of a run that no signal decides."""

from collections.abc import Iterable

import numpy as np

from orchestration.basics.errors import UsageError, expected_name
from orchestration.computers.results import Frames, Jobs, Timeline
from orchestration.expressions.over_run import evaluate
from orchestration.expressions.recorded import Recorded
from orchestration.expressions.syntax import (
    Call,
    JobMeasure,
    Name,
    Node,
    Operation,
    Sampled,
    children,
    names,
    names_job_measure,
    parse,
    parse_job_measures,
    text,
)
from orchestration.schedule.resources import timeline_of
from orchestration.system.model import System, expressions
from orchestration.system.times import NANOSECONDS

_JOBS = "jobs"


def job_numbers(system: System) -> dict[str, float]:
    """What the expressions of a system say of jobs, by its text as they name it; NaN where it has no value.

    Raises `UsageError` for a task that there is not, and for jobs of several tasks in one.
    """
    wanted = dict.fromkeys(
        name for _, expression in expressions(system) for name in names(parse(expression)) if names_job_measure(name)
    )
    if not wanted:
        return {}
    timeline = timeline_of(system)
    found = {}
    for name in wanted:
        call = parse_job_measures(name)
        assert isinstance(call, Call)
        value = evaluate({name: _at_jobs(call)}, lambda call=call: iter([_recorded(timeline, call)]))[name]  # type: ignore[misc]
        found[name] = np.nan if value is None else value
    return found


def _at_jobs(call: Call) -> Call:
    """The same of a signal that has a value for each job."""
    argument, *rest = call.arguments
    return Call(call.function, (Sampled(_JOBS, _named(argument)), *rest))


def _named(node: Node) -> Node:
    match node:
        case JobMeasure():
            return Name(text(node))
        case Operation(sign, operands):
            return Operation(sign, tuple(map(_named, operands)))
        case Call(function, arguments):
            return Call(function, tuple(map(_named, arguments)))
    return node


def _recorded(timeline: Timeline, call: Call) -> Recorded:
    said = [*dict.fromkeys(_of_jobs(call))]
    if len(said) > 1:
        both = " and ".join(map(text, said))
        raise UsageError(f"{text(call)}: expected jobs of one task in one way, not {both}")
    (of,) = said
    jobs = _jobs(timeline, of)
    if of.what == "response":
        times, values = jobs.ended[jobs.done], jobs.responses / NANOSECONDS
    else:
        times, values = jobs.deadline[jobs.due], jobs.missed[jobs.due].astype(np.float64)
    return Recorded(
        time=times / NANOSECONDS,
        signals={text(of): values},
        arrivals={_JOBS: np.ones(len(times), dtype=np.bool_)},
        stop_time=timeline.stop / NANOSECONDS,
    )


def _of_jobs(node: Node) -> Iterable[JobMeasure]:
    if isinstance(node, JobMeasure):
        yield node
    for child in children(node):
        yield from _of_jobs(child)


def _jobs(timeline: Timeline, of: JobMeasure) -> Jobs | Frames:
    """Those of a task, or the frames of a message, by its name alone where no other has it."""
    every: dict[str, Jobs | Frames] = {**timeline.jobs, **timeline.frames}
    found = [name for name in every if of.task in (name, name.partition(".")[2])]
    if of.task in every or len(found) == 1:
        return every[of.task if of.task in every else found[0]]
    expected = f"one of {', '.join(found)}" if found else expected_name(of.task, list(every))
    raise UsageError(f"{text(of)}: {expected}")
