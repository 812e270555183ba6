"""Limits by exact radii at values that can be examined, as those at which a schedule repeats soon."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.bisection import Bracket, Range
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.terminal import ShareProgress, share_reporter
from orchestration.foundation.basics.unit_algebra import some
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.model import System
from orchestration.theory.exact.loops import Loops
from orchestration.theory.stability import local_limit
from orchestration.theory.stability.known_loops import LinearLimit
from orchestration.theory.stability.operating_point import deterministic

METHOD = "radius of the loop without chance over one period of its schedule"
RADIUS_TOLERANCE = 1e-6
"""Difference of a radius allowed from order to order"""
WIDTH = 0.2
"""Width of the last bracket, as a share of the tolerance of the measured limit"""
DIGITS = 6
"""Digits of a value at most: those of few digits have the shortest hyperperiods"""


class Moving(NamedTuple):
    """Moving quantities of a loop, whose radius it is, in words."""

    what: str
    below: str
    """Verb for them where the radius is below 1"""
    above: str
    """Verb for them else"""


DEVIATIONS = Moving("small deviations", "decay", "grow")


def local_limits(
    varied: Varied, span: Range, models: Mapping[str, Model], progress: ShareProgress = None
) -> LinearLimit:
    """As in `stability`; where the loop has no fixed periods, by exact radii instead of twin runs."""

    def examined(at: Callable[[float], System], span: Range) -> LinearLimit | None:
        loops = Loops({one.fmu: models[name] for name, one in varied.system.components.items()})

        def radius(value: float) -> float:
            return loops.radius(deterministic(at(value)), agree=RADIUS_TOLERANCE)

        return by_examined(radius, span)

    with share_reporter(progress, "limits by linear theory") as report:
        return local_limit.local_limits(varied, span, examined, report)


def by_examined(
    radius: Callable[[float], float], span: Range, moving: Moving = DEVIATIONS, *, lower_too: bool = True
) -> LinearLimit | None:
    """The limit, between the values that can be examined; None: none of the scan can.

    It is the upper end of the values from the system's own on, and the lower one, too, if asked for. A value for which
    `radius` raises `UsageError`, as of a schedule that does not repeat soon, or of too many messages in transit, is
    neither below 1 nor above: another is sought, or the bracket remains as it is.
    """
    tried, refused = dict[float, float](), dict[float, str]()

    def is_known(value: float) -> bool:
        if value not in tried and value not in refused:
            try:
                tried[value] = radius(value)
            except (UsageError, SimulatorError) as error:
                refused[value] = str(error)
        return value in tried

    def grows(value: float) -> bool:
        return tried[value] >= 1.0

    def first_in(values: list[float]) -> Bracket | None:
        """Up or down from the first, which decays, to the first that grows."""
        good = None
        for value in filter(is_known, values):
            if grows(value):
                return Bracket(good, value)
            good = value
        return None

    def bisected(good: float, bad: float) -> tuple[float, float]:
        while abs(bad - good) > WIDTH * span.tolerance_at(bad):
            value = next((one for one in _between(good, bad) if is_known(one)), None)
            if value is None:
                break
            good, bad = (good, value) if grows(value) else (value, bad)
        return good, bad

    def narrowed(bracket: Bracket | None) -> Bracket | None:
        """Until what is just before the good end is good, too: one of a short hyperperiod may be stable by itself."""
        if bracket is None or bracket.good is None:
            return bracket
        begin = min(tried) if own is None else own
        good, bad = bisected(bracket.good, bracket.bad)
        while True:
            near = _before(good, begin, WIDTH * span.tolerance_at(bad))
            before = next((one for one in near if is_known(one)), None)
            if before is None or not grows(before):
                break
            within = [one for one in tried if not grows(one) and min(begin, before) <= one <= max(begin, before)]
            good, bad = bisected(max(within, key=lambda one: abs(one - begin)), before)
        return Bracket(good, bad)

    values = span.values()
    own = span.own if span.own is not None and is_known(span.own) and not grows(span.own) else None
    upper = narrowed(first_in([value for value in values if own is None or value >= own]))
    lower = (
        None
        if own is None or not lower_too
        else narrowed(first_in([value for value in reversed(values) if value <= own]))
    )
    if not tried:
        return None
    ends = [end for end in (lower, upper) if end is not None]
    said = [_end_in_words(end, refused, span, moving) for end in ends]
    if upper is None:
        decays = [value for value in sorted(tried) if not grows(value)]
        ends_examined = f"{span.text(decays[0])} to {span.text(decays[-1])}"
        said.append(f"{moving.what} {moving.below} at each value examined, {ends_examined}")
    if refused:
        value, why = next(iter(refused.items()))
        said.append(f"not examined: {some(map(span.text, sorted(refused)))}, as {span.text(value)} for: {why}")
    limit = _middle(upper)
    return LinearLimit(
        limit=limit,
        lower=_middle(lower),
        method=METHOD,
        accuracy=None if limit is None or upper is None else abs(upper.bad - limit),
        reason="; ".join(said),
    )


def _between(good: float, bad: float) -> list[float]:
    """Values near the middle of two others, those of few digits first."""
    low, high = sorted((good, bad))
    middle, quarter = 0.5 * (low + high), 0.25 * (high - low)
    rounded = (float(f"{middle:.{digits}g}") for digits in range(1, DIGITS + 1))
    return [*dict.fromkeys(value for value in rounded if abs(value - middle) <= quarter)]


def _before(good: float, begin: float, width: float) -> Iterator[float]:
    """Values between `begin` and a good one, from a width before it on by doubled distances."""
    while width < abs(good - begin):
        away = math.copysign(width, begin - good)
        yield from _between(good + 0.5 * away, good + 1.5 * away)
        width *= 2.0


def _middle(bracket: Bracket | None) -> float | None:
    return None if bracket is None or bracket.good is None else 0.5 * (bracket.good + bracket.bad)


def _end_in_words(bracket: Bracket, refused: Mapping[float, str], span: Range, moving: Moving) -> str:
    good, bad = bracket
    if good is None:
        return f"{moving.what} {moving.above} at {span.text(bad)}, the lowest value that could be examined"
    ends = f"{moving.what} {moving.below} at {span.text(good)} and {moving.above} at {span.text(bad)}"
    between = any(min(good, bad) < value < max(good, bad) for value in refused)
    if between and abs(bad - good) > WIDTH * span.tolerance_at(bad):
        return f"{ends}, between which no value was found that can be examined: others may differ"
    return f"{ends}, of values that can be examined: others may differ"
