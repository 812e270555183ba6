"""The largest good value of a quantity, measured by runs, and its local limit by linear theory."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

from orchestration.components.fmi.foreign_calls import LostError, isolated_call
from orchestration.components.fmi.read_description import Model
from orchestration.experiments.limits.evaluation import RELIABILITY, Evaluation, Evaluator, describe
from orchestration.experiments.limits.limit_result import ContinuousRun, Limit
from orchestration.foundation.basics.bisection import DIGITS, Bracket, Range, bisected, ends_of_good, first_failure
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.terminal import ShareProgress, inform_in_passing, share_reporter
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.engines.resolved import check_against_fmus, kept_periods_in_words, periods_in_words
from orchestration.simulation.requests.ranges import Varied, default_quantity, own_value, search_range
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.results.objectives import bound_of
from orchestration.simulation.runs.scheduling import schedule
from orchestration.simulation.workers.choice import single_run_execution
from orchestration.simulation.workers.executors import RunEvaluator
from orchestration.systems.schedule.overload import overloads_in_words
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.exact.examined_limit import local_limits
from orchestration.theory.exact.mean_square import mean_square_limit
from orchestration.theory.stability.known_loops import LinearLimit

GAP = 0.1
"""Share of the local limit: a larger difference to the large-signal limit is noted"""
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

    Raises `UsageError` for an invalid quantity, range, tolerance, step or confidence.
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
    with share_reporter(progress, "limits by linear theory"):  # without shares, as it ends where the limit is
        local = _by_theory("local", files, local_limits, varied, replace(span, also=failed), models)
        mean_square = _mean_square(varied, span, files, local) if random else LinearLimit()
    scheduled = sorted(trials.tried) if varied.system.computers or varied.system.networks else []
    missed_from = _missed_from(varied, span, scheduled)
    note = [*_note(span, bracket, trials, refuted, local), *_mean_square_note(mean_square, span)]
    note += _own_value_in_words(varied, span, models) if bracket is not None and bracket.good is None else []
    note += _starved(varied, span, scheduled) if local.limit is None else []
    note += _where_missed(missed_from, local, span)
    note += _overloaded(varied, span, scheduled)
    note += periods_in_words(varied.at(span.last), models, varied.at(values[0]))
    note += kept_periods_in_words(varied.system, varied.at(span.last), models)
    metric = trials.judged_at(next((one.bad for one in (bracket, lower) if one is not None), None))
    tried = trials.measuring(metric)
    note += _insensitive(tried, metric, units.get(metric or ""))
    return Limit(
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
        continuous=ideal, tried=tried, notes=tuple(note),
    )  # fmt: skip


def _missed_from(varied: Varied, span: Range, values: Sequence[float]) -> float | None:
    """The lowest value, of some rising ones and to the tolerance, at which the schedule misses deadlines."""
    missed = first_failure(
        lambda value: bool(schedule(varied.at(value)).missed), values, span.tolerance, geometric=span.geometric
    )
    return None if missed is None else missed.bad


def _own_value_in_words(varied: Varied, span: Range, models: Mapping[str, Model]) -> list[str]:
    """The note on the own value of a system, where the lowest value of the scan is not good."""
    own = own_value(varied, models)
    if own is None or own == span.values()[0]:
        return []
    if span.own is not None:
        return [f"the file's own value, {span.text(own)}, is not good either"]
    between = f"--from {min(own, span.first):g} --to {max(own, span.last):g}"
    return [f"with {between} the search would go up and down from the file's own value, {span.text(own)}"]


def _starved(varied: Varied, span: Range, values: Sequence[float]) -> list[str]:
    """The note on the lowest of some rising values at which a task or message is never done."""
    for value in values:
        if names := schedule(varied.at(value)).starved:
            return [f"at {span.text(value)} {some(names)} is never done: small deviations are of the loop without it"]
    return []


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


_ALWAYS = ("local_limit", "large_signal_limit")
"""Fields that are shown also where they have no value"""
_IN_ITS_UNIT = (
    *_ALWAYS, "local_limit_outside", "local_accuracy", "local_lower_limit", "mean_square_limit",
    "large_signal_lower_limit", "refuted_limit", "missed_deadlines_from",
)  # fmt: skip
"""Fields in the unit of the quantity"""
_HIDDEN = ("unit", "judged_unit", "geometric", "notes")


def as_text(limit: Limit) -> dict[str, str]:
    """The applicable fields of a limit as text; of the evaluated values their number."""
    units = {**dict.fromkeys(_IN_ITS_UNIT, limit.unit), "judged_bound": limit.judged_unit, "horizon": "s"}
    known = {name: value for name, value in vars(limit).items() if value not in (None, "", ())}
    texts = dict.fromkeys((name for name in vars(limit) if name in (*known, *_ALWAYS) and name not in _HIDDEN), "-")
    for name in texts.keys() & known.keys():
        value = known[name]
        texts[name] = quantity(value, units.get(name), DIGITS) if isinstance(value, float) else str(value)
    texts |= dict(zip(("scan", "tolerance"), limit.resolution))
    if limit.flies_above:
        texts["flies_above"] = ", ".join(quantity(value, limit.unit, DIGITS) for value in limit.flies_above)
    if limit.missed_by:
        texts["missed_by"] = ", ".join(limit.missed_by)
    if (ideal := limit.continuous) is not None:
        settles = "" if ideal.settling_time is None else f", within 5 cm from {ideal.settling_time:.6g} s on"
        texts["continuous"] = f"{ideal.outcome} at a period of {quantity(ideal.period, 's')}{settles}"
    texts["tried"] = f"{len(limit.tried)} values"
    return texts


def shares_as_text(limit: Limit) -> list[list[str]]:
    """A table of the evaluated values with their good seeds, and the share with its interval where all were run.

    Empty where nothing is random.
    """
    if limit.confidence is None:
        return []
    rows = []
    for one in limit.tried:
        good, share = f"{one.flew} of the first {one.runs}", "-"
        if one.share is not None:
            low, high = one.share
            good, share = f"{one.flew}", f"{one.flew / one.runs:.2f} [{low:.2f}, {high:.2f}]"
        rows.append([quantity(one.value, limit.unit, DIGITS), good, share])
    return [[limit.of, f"good of {limit.seeds}", f"share [{100.0 * limit.confidence:g} % Wilson interval]"], *rows]


def _mean_square_note(found: LinearLimit, span: Range) -> list[str]:
    """The note on the mean-square limit."""
    if found.limit is None:
        return [found.reason] if found.reason else []
    further = f"; {found.reason}" if found.reason else ""
    return [f"just above {span.text(found.limit)} means of squares have no finite expectation{further}"]


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


def _note(
    span: Range, bracket: Bracket | None, trials: Evaluator, refuted: float | None, found: LinearLimit
) -> list[str]:
    local = found.limit
    parts = []
    if refuted is not None:
        parts.append(
            f"that nine seeds in ten are good is refuted at {span.text(refuted)}: {describe(trials.tried[refuted])}"
        )
    parts.append(f"what is narrower than the scan, {span.step_text}, is not seen")
    least, most = min(trials.tried), max(trials.tried)
    if least > span.values()[0] or most < span.values()[-1]:
        where = f"from {span.text(least)} to {span.text(most)}" if least < most else f"only {span.text(least)}"
        parts.append(f"scanned {where}, as a search ends soon after what fails: beyond that nothing is known")
    if found.lower is not None:
        parts.append(f"below {span.text(found.lower)} small deviations grow, too")
    if found.reason:
        parts.append(found.reason)
    if local is None:
        return parts
    accuracy = found.accuracy or 0.0
    where = span.text(local) + (f" ± {span.text(accuracy)}" if accuracy > span.tolerance else "")
    if bracket is None or bracket.good is None:
        return [*parts, f"the local limit is {where}"]
    measured, failed, gap = bracket.good, bracket.bad, max(GAP * abs(local), accuracy)
    slowly = f"a run of {quantity(trials.varied.system.stop_time, 's')} does not show slow growth"
    if measured > local + gap:
        return [
            *parts,
            f"more than a tenth beyond the local limit of {where}, from which on small motions grow: it "
            f"may oscillate, and what is judged is good still; {slowly}",
        ]
    if failed < local - gap:
        return [
            *parts,
            f"more than a tenth below the local limit of {where}: what is judged fails earlier, by large "
            "signals or as small ones decay too slowly for the horizon, which a longer --stop-time tells",
        ]
    if abs(measured - local) <= accuracy:
        return [*parts, f"not told apart from the local limit, which is {where}"]
    beyond = f", from which on small motions grow: {slowly}" if measured - local > failed - measured else ""
    coarsely = ", to the tolerance" if max(local - measured, failed - local) > gap else ""
    return [*parts, f"within a tenth of the local limit of {where}{coarsely}{beyond}"]


def _overloaded(varied: Varied, span: Range, values: Sequence[float]) -> list[str]:
    """The notes on processors that are overloaded at some of these rising values."""
    over = [value for value in values if overloads_in_words([varied.at(value)])]
    if not over:
        return []
    where = " to ".join(dict.fromkeys(map(span.text, (over[0], over[-1]))))
    return [f"at {where}: {text}" for text in overloads_in_words([varied.at(value) for value in over])]


def _insensitive(tried: Sequence[Evaluation], metric: str | None, unit: str | None) -> list[str]:
    """The note where the judged objective is the same at all of several values, as where nothing moves."""
    first = tried[0].measured
    if first is None or len(tried) == 1 or any(one.measured != first for one in tried):
        return []
    same = quantity(first, unit)
    return [f"{metric} is {same} at each value tried, as where nothing moves: this says nothing of the limit"]


def _where_missed(missed_from: float | None, local: LinearLimit, span: Range) -> list[str]:
    """The note on a local limit among values at which deadlines are missed."""
    if missed_from is None or local.limit is None or local.limit < missed_from:
        return []
    return [
        f"where deadlines are missed, from {span.text(missed_from)} on, stability need not be an interval: others "
        "below the local limit may be unstable, and others above it stable"
    ]
