"""Terms of expressions about jobs and frames: numbers of a run that do not depend on signals."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from orchestration.foundation.basics.errors import UsageError, expected_name, prefixed
from orchestration.foundation.basics.times import seconds
from orchestration.systems.computers.timeline import Frames, Jobs, Timeline
from orchestration.systems.expressions import syntax
from orchestration.systems.expressions.over_run import Recorded, evaluate, job_terms
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.model import System, expressions

_JOBS = "jobs"


def job_numbers(system: System) -> dict[str, float]:
    """The values of terms about jobs in the expressions of a system, by the text of the term; NaN without a value.

    Raises `UsageError` for an unknown task, and for a term with jobs of several tasks.
    """
    terms = {term: place for place, expression in reversed(expressions(system)) for term in job_terms([expression])}
    if not terms:
        return {}
    timeline = timeline_of(system)
    values = {}
    for name, place in terms.items():
        call = syntax.parse_job_measures(name)
        assert isinstance(call, syntax.Call)
        with prefixed(f"{place}: "):
            value = evaluate({name: _at_jobs(call)}, lambda call=call: iter([_recorded(timeline, call)]))[name]  # type: ignore[misc]
        values[name] = np.nan if value is None else value
    return values


def _at_jobs(call: syntax.Call) -> syntax.Call:
    """The same term of a signal that has a value for each job."""
    argument, *rest = call.arguments
    return syntax.Call(call.function, (syntax.Sampled(_JOBS, _named(argument)), *rest))


def _named(node: syntax.Node) -> syntax.Node:
    match node:
        case syntax.JobMeasure():
            return syntax.Name(syntax.text(node))
        case syntax.Operation(sign, operands):
            return syntax.Operation(sign, tuple(map(_named, operands)))
        case syntax.Call(function, arguments):
            return syntax.Call(function, tuple(map(_named, arguments)))
    return node


def _recorded(timeline: Timeline, call: syntax.Call) -> Recorded:
    quantities = [*dict.fromkeys(_of_jobs(call))]
    if len(quantities) > 1:
        both = " and ".join(map(syntax.text, quantities))
        raise UsageError(f"{syntax.text(call)}: expected jobs of one task in one way, not {both}")
    (of,) = quantities
    jobs = _jobs(timeline, of)
    if of.what == "response":
        times, values = jobs.ended[jobs.done], seconds(jobs.responses)
    else:
        times, values = jobs.deadline[jobs.due], jobs.missed[jobs.due].astype(np.float64)
    return Recorded(
        time=seconds(times),
        signals={syntax.text(of): values},
        arrivals={_JOBS: np.ones(len(times), dtype=np.bool_)},
        stop_time=seconds(timeline.stop),
    )


def _of_jobs(node: syntax.Node) -> Iterable[syntax.JobMeasure]:
    if isinstance(node, syntax.JobMeasure):
        yield node
    for child in syntax.children(node):
        yield from _of_jobs(child)


def _jobs(timeline: Timeline, of: syntax.JobMeasure) -> Jobs | Frames:
    """The jobs of a task, or the frames of a message, by its name alone where that is unique."""
    every: dict[str, Jobs | Frames] = {**timeline.jobs, **timeline.frames}
    matching = [name for name in every if of.task in (name, name.partition(".")[2])]
    if of.task in every or len(matching) == 1:
        return every[of.task if of.task in every else matching[0]]
    if not matching:
        raise UsageError(f"{syntax.text(of)}: {expected_name(of.task, list(every))}")
    kinds = (f"{'task' if name in timeline.jobs else 'message'} {name}" for name in matching)
    wanted = " or ".join(syntax.text(replace(of, task=name)) for name in matching)
    raise UsageError(f"{syntax.text(of)}: {' and '.join(kinds)} have that name; expected {wanted}")
