"""The largest good value of a quantity, measured by runs, and its local limit by linear theory."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

from orchestration.components.fmi.foreign_calls import LostError, isolated_call
from orchestration.experiments.limits.evaluation import RELIABILITY, Evaluator
from orchestration.experiments.limits.limit_result import ContinuousRun, Limit, LimitInterrupted
from orchestration.experiments.limits.notes import notes_of
from orchestration.foundation.basics.bisection import Bracket, Range, bisected, ends_of_good, first_failure
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.terminal import ShareProgress, inform_in_passing, share_reporter
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.requests.ranges import Varied, default_quantity, search_range
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.results.objectives import bound_of
from orchestration.simulation.runs.scheduling import schedule
from orchestration.simulation.workers.choice import single_run_execution
from orchestration.simulation.workers.executors import RunEvaluator
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.exact.examined_limit import local_limits
from orchestration.theory.exact.mean_square import mean_square_limit
from orchestration.theory.stability.known_loops import LinearLimit

PARTS_OF_STEP = 5
"""parts of the step of the scan within the bracket"""
BEYOND = 4
"""values of the scan that are evaluated beyond the first that fails"""
CONTINUOUS = 1e-4
"""Period of the flight that approximates continuous time [s]"""


@explains_missing
def limit(
    request: RequestLike,
    of: str | None = None,
    *,
    first: float | None = None,
    last: float | None = None,
    tolerance: float | None = None,
    scan: float | None = None,
    confidence: float = 0.95,
    continuous: bool = False,
    workers: int = 1,
    engine: Engine | Literal["auto"] = "auto",
    progress: ShareProgress = "bar",
    announce: Callable[[str], None] | None = inform_in_passing,
) -> Limit:
    """Find the largest value of a quantity of a system or a scenario at which it is still good.

    `of` is a path, or for the quadrotor `period`, `delay`, `jitter` or `loss`; default: the period of the only sampled
    component. The search lies between `first` and `last`: from the own value of the request up and down, or else from
    `first` up, in steps of `scan`, or over decades, without it and `tolerance`, by equal factors. `continuous` adds a
    run near continuous time (quadrotor only). The seeds of a random quantity are run by `workers` processes. The engine
    `auto` uses native twins of the FMUs if available. `progress` is called with the share done of a search in which
    nothing fails before the end of the scan, `announce` with the choice of the engine and a line for each evaluated
    value, by default beside the bar; None for silence.

    Raises `UsageError` for an invalid quantity, range, tolerance, step or confidence; `KeyboardInterrupt` after Ctrl-C:
    once all is measured, its `result` is the limit without what theory has not found yet.
    """
    loop, execution = single_run_execution(request_of(request), engine)
    of = of or default_quantity(loop)
    varied, files = _checked(loop, of, confidence)
    near = loop.near_continuous(CONTINUOUS) if continuous else None
    if continuous and near is None:
        raise UsageError("--continuous: for the quadrotor only")
    models = files.models_of(varied.system)
    span = search_range(varied, models, first=first, last=last, tolerance=tolerance, scan=scan)
    with errors_in_own_terms(loop):
        checks = [check_against_fmus(varied.at(value), models) for value in span.values()]
    units = checks[0].units
    random = varied.at(span.last).depends_on_seed
    seeds = math.ceil(math.log(1.0 - confidence) / math.log(RELIABILITY)) if random else 1
    with share_reporter(progress, "longest search") as report, RunEvaluator(files, workers, execution.engine) as pool:
        announce = announce or (lambda line: None)
        if engine == "auto":
            execution.tell(announce)
        trials = Evaluator(
            varied=varied, span=span, seeds=seeds, confidence=confidence if random else None, units=units, pool=pool,
            announce=announce, progress=report,
        )  # fmt: skip
        values = span.values()
        lower, bracket = ends_of_good(
            trials.fails,
            values,
            span.own,
            span.tolerance,
            geometric=span.geometric,
            parts=PARTS_OF_STEP,
            remaining=lambda most: trials.expect_remaining(most + BEYOND),
        )
        above = [value for value in values if bracket is not None and value >= bracket.bad]
        refuted = _refuted(trials, bracket, above) if random else None
        if not random:
            beyond = [value for value in above if value not in trials.tried][:BEYOND]
            for i, value in enumerate(beyond, start=1):
                trials.expect_remaining(len(beyond) - i)
                trials.fails(value)
        ideal = _continuous_run(near, pool) if near is not None else None
        report(1.0)
    failed = tuple(value for value, one in trials.tried.items() if not one.is_good)
    local, mean_square = (
        LinearLimit(reason="no local limit: interrupted before the limits by linear theory"),
        LinearLimit(),
    )
    is_interrupted = False
    try:
        shown: Literal["bar"] | None = (
            "bar" if progress == "bar" else None
        )  # no other can be called from the process of the FMUs
        local = _by_theory("local", files, local_limits, varied, replace(span, also=failed), models, shown)
        if random:
            mean_square = LinearLimit(reason="no mean-square limit: interrupted before it was found")
            with share_reporter(shown, "mean-square limit"):
                mean_square = _mean_square(varied, span, files, local)
    except KeyboardInterrupt:
        is_interrupted = True
    missed_from = _missed_from(varied, span, trials.scheduled)
    metric = trials.judged_at(next((one.bad for one in (bracket, lower) if one is not None), None))
    tried = trials.measuring(metric)
    found = Limit(
        of=of, unit=span.unit, judged=metric, judged_unit=units.get(metric or ""),
        judged_bound=None if metric is None else bound_of(varied.system, metric),
        local_limit=local.limit, local_limit_outside=local.outside, local_method=local.method,
        local_accuracy=local.accuracy, local_lower_limit=local.lower, mean_square_limit=mean_square.limit,
        large_signal_limit=None if bracket is None else bracket.good,
        large_signal_lower_limit=None if lower is None else lower.good,
        refuted_limit=refuted, missed_deadlines_from=missed_from,
        missed_by=() if missed_from is None else tuple(schedule(varied.at(missed_from)).missed),
        follows=checks[0].follows, horizon=varied.system.stop_time, tolerance=span.tolerance,
        scan=span.step, geometric=span.geometric, confidence=confidence if random else None, seeds=seeds,
        flies_above=tuple(
            one.value for one in tried if bracket is not None and one.value > bracket.bad and one.flew == seeds
        ),
        continuous=ideal, tried=tried,
        notes=tuple(notes_of(trials, models, bracket, refuted, local, mean_square, missed_from, metric)),
    )  # fmt: skip
    if is_interrupted:
        raise LimitInterrupted("before all limits by linear theory were found", found)
    return found


def _missed_from(varied: Varied, span: Range, values: Sequence[float]) -> float | None:
    """The lowest value, of some rising ones and to the tolerance, at which the schedule misses deadlines."""
    missed = first_failure(
        lambda value: bool(schedule(varied.at(value)).missed), values, span.tolerance, geometric=span.geometric
    )
    return None if missed is None else missed.bad


def _checked(request: Request, of: str, confidence: float) -> tuple[Varied, Files]:
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"--confidence {confidence}: expected a number between 0 and 1")
    varied = Varied(request=request, of=of)
    if varied.system.criterion.good is None:
        raise UsageError("criterion.good: expected in the system file, since it defines the limit")
    return varied, files_of(varied.system)


def _by_theory(kind: str, files: Files, find: Callable[..., LinearLimit], *arguments: object) -> LinearLimit:
    """A limit that a process of its own finds."""
    try:
        return isolated_call(files.fmus.values(), find, *arguments)
    except LostError as error:
        return LinearLimit(reason=f"no {kind} limit: {error}")


def _mean_square(varied: Varied, span: Range, files: Files, local: LinearLimit) -> LinearLimit:
    """The mean-square limit; with additive noise alone, which does not change the loop, it is the local limit."""
    if local.limit is not None and not varied.at(span.last).has_random_timing:
        return LinearLimit(limit=local.limit)
    return _by_theory("mean-square", files, mean_square_limit, varied, span, files.models_of(varied.system))


def _refuted(trials: Evaluator, bracket: Bracket | None, above: list[float]) -> float | None:
    """The lowest evaluated value at which it is refuted that `RELIABILITY` of the seeds are good."""
    if bracket is None:
        return None
    below = bracket.good
    for i, value in enumerate(above, start=1):
        trials.expect_remaining(len(above) - i)
        if trials.is_refuted(value):
            if below is None:
                return value
            return bisected(
                trials.is_refuted, below, value, trials.span.tolerance, geometric=trials.span.geometric,
                remaining=trials.expect_remaining,
            ).bad  # fmt: skip
        below = value
    return None


def _continuous_run(near: Request, pool: RunEvaluator) -> ContinuousRun:
    """The result of a run near continuous time."""
    (metrics,) = pool.run_until([system_of(near)], stop=lambda metrics: False)
    return ContinuousRun(period=CONTINUOUS, outcome=metrics["outcome"], settling_time=metrics["settling_time"])
