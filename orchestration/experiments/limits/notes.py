"""The notes of a limit: what its search does not see, how it lies to the limits by theory, and what else is odd."""

from collections.abc import Mapping, Sequence

from orchestration.components.fmi.read_description import Model
from orchestration.experiments.limits.evaluation import Evaluation, Evaluator, describe
from orchestration.foundation.basics.bisection import Bracket, Range
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.simulation.engines.resolved import varied_periods_in_words
from orchestration.simulation.requests.ranges import Varied, own_value
from orchestration.simulation.runs.scheduling import schedule
from orchestration.systems.schedule.overload import overloads_in_words
from orchestration.theory.stability.known_loops import LinearLimit

GAP = 0.1
"""Share of the local limit: a larger difference to the large-signal limit is noted"""


def notes_of(
    trials: Evaluator,
    models: Mapping[str, Model],
    bracket: Bracket | None,
    refuted: float | None,
    local: LinearLimit,
    mean_square: LinearLimit,
    missed_from: float | None,
    metric: str | None,
) -> list[str]:
    """Remarks beyond the verdict, a line each; `metric` is what is judged."""
    varied, span = trials.varied, trials.span
    return [
        *_of_search(trials, refuted),
        *_of_local_limit(trials, bracket, local),
        *_of_mean_square_limit(mean_square, span),
        *(_own_value_in_words(varied, span, models) if bracket is not None and bracket.good is None else []),
        *(_starved(varied, span, trials.scheduled) if local.limit is None else []),
        *_where_missed(missed_from, local, span),
        *_overloaded(varied, span, trials.scheduled),
        *varied_periods_in_words(varied.system, varied.at(span.values()[0]), varied.at(span.last), models),
        *_insensitive(trials.measuring(metric), metric, trials.units.get(metric or "")),
    ]


def _of_search(trials: Evaluator, refuted: float | None) -> list[str]:
    """The notes on what was found to be refuted, and on what the search does not see."""
    span, parts = trials.span, list[str]()
    if refuted is not None:
        parts.append(
            f"that nine seeds in ten are good is refuted at {span.text(refuted)}: {describe(trials.tried[refuted])}"
        )
    parts.append(f"what is narrower than the scan, {span.step_text}, is not seen")
    least, most = min(trials.tried), max(trials.tried)
    if least > span.values()[0] or most < span.values()[-1]:
        where = f"from {span.text(least)} to {span.text(most)}" if least < most else f"only {span.text(least)}"
        parts.append(f"scanned {where}, as a search ends soon after what fails: beyond that nothing is known")
    return parts


def _of_local_limit(trials: Evaluator, bracket: Bracket | None, found: LinearLimit) -> list[str]:
    """The notes on the local limit, and on how the one that was measured lies to it."""
    span, local, parts = trials.span, found.limit, list[str]()
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


def _of_mean_square_limit(found: LinearLimit, span: Range) -> list[str]:
    """The note on the mean-square limit."""
    if found.limit is None:
        return [found.reason] if found.reason else []
    further = f"; {found.reason}" if found.reason else ""
    return [f"just above {span.text(found.limit)} means of squares have no finite expectation{further}"]


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
