"""Local limits: where small deviations from an operating point cease to decay."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from functools import cache
from itertools import groupby, takewhile

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.bisection import Bracket, Ends, Range, ends_of_good
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.terminal import Share
from orchestration.foundation.basics.unit_algebra import some
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.schedule.overload import overloads
from orchestration.systems.system.model import System
from orchestration.theory.stability.excitation import ImpreciseError
from orchestration.theory.stability.in_double import are_in_double, of_code
from orchestration.theory.stability.known_loops import LOOPS, LinearLimit
from orchestration.theory.stability.loop_at_rest import KnownTangents, keep_start
from orchestration.theory.stability.operating_point import (
    NotAnEquilibriumError,
    deterministic,
)
from orchestration.theory.stability.period_map import OTHER_PULSE, growth_of_loop
from orchestration.theory.stability.perturbed_runs import growth_of, repeating_period
from orchestration.theory.stability.several_rates import Commensurate, commensurate, narrowed
from orchestration.theory.stability.sign_changes import short, uncertainty, zero_between

LOOP = "spectral radius of the sampled loop about the operating point, by differences through saved states"
LOOP_ZERO, TWINS_TOLERANCE = 1e-6, 0.2
"""Growth that counts as 0, as a share of that beyond the limit; tolerance as a share of that of the measured limit"""
TWINS = "growth of the difference of twin runs from the operating point, one with a pulse"
OTHER_SIZE = 100.0
"""Factor of the second pulse of twin runs, which has to confirm growth and decay"""
DITHERED = 1.37
"""Factor of a third, whose growth has to be the same"""
AGREE = 0.1
"""Difference of it allowed, as a share of how much growth changes from one side of the limit to the other"""
NEAR = 0.1
"""Distance from the limit at which it has to, relative"""

NARROWING = 6
"""Values that it takes to narrow a bracket of several rates, about"""

Growth = Callable[[float], float]
"""Growth rate of small deviations by the value of the quantity [1/s]"""
Examined = Callable[[Callable[[float], System], Range], LinearLimit | None]
"""Another way to the limit of a system with computers or networks; None: it has no value there, either"""


def local_limits(
    varied: Varied, span: Range, examined: Examined | None = None, report: Share = lambda share: None
) -> LinearLimit:
    """The local limit of a quantity, through saved states where the FMUs have them, else by perturbed twin runs.

    With computers or networks by `examined` before twin runs, which a schedule that repeats late misleads. A kind of
    request in `LOOPS` has its own method. `report` is called where the share that is done is known.
    """
    known = LOOPS.of(varied.request.kind)
    if known is not None:
        return known.local_limits(varied, span)
    if not varied.system.operating_point:
        return LinearLimit(reason="no local limit: the system file names no operating_point")
    return about_rest(varied.at, span, examined, report)


def about_rest(
    at: Callable[[float], System],
    span: Range,
    examined: Examined | None = None,
    report: Share = lambda share: None,
) -> LinearLimit:
    """The local limit of any system; `at` makes the system for a value of the quantity."""
    try:
        if deterministic(at(span.first)) == deterministic(at(span.last)):
            return LinearLimit(
                reason="no local limit: small deviations are judged at the operating point, without randomness and "
                "quantisation, where this quantity changes nothing"
            )
        with closing(Instances()) as instances:
            return _through_saved_states(at, span, instances, report)
    except (NotAnEquilibriumError, ImpreciseError) as error:
        return LinearLimit(reason=f"no local limit: {error}")
    except (UsageError, SimulatorError) as error:
        why = str(error)
    if examined is not None and at(span.last).uses_scheduler and (known := examined(at, span)) is not None:
        return replace(known, method=f"{known.method} (no spectral radius: {why})")
    if commensurate(at, span.values()) is not None:
        return LinearLimit(reason=f"no local limit: several rates, and no spectral radius: {why}")
    try:
        found = _by_twins(at, span)
    except (UsageError, SimulatorError) as error:
        return LinearLimit(reason=f"no local limit: {error}")
    code = of_code(are_in_double(deterministic(at(span.first)).components))
    return replace(found, method=f"{TWINS}{code} (no spectral radius: {why})")


def _through_saved_states(
    at: Callable[[float], System], span: Range, instances: Instances, report: Share
) -> LinearLimit:
    """Its accuracy includes the effect of another pulse size."""
    growths, known = dict[float, float](), _known_at_own(at, span, instances)

    def growth(value: float) -> float:
        growths[value] = found = growth_of_loop(at(value), instances, known=known)
        return found

    rates = commensurate(at, replace(span, also=()).values(), also=span.also)
    found = _first_growth(growth, span, LOOP, None) if rates is None else _first_tried(growth, span, rates, report)
    code = of_code(are_in_double({name: one for name, (one, _, _) in known.items()}))
    found = replace(found, method=f"{LOOP}{code}")
    limit = found.limit
    if limit is None or found.accuracy is None:
        return found
    near = min(growths if rates is None else rates.scan, key=lambda value: abs(value - limit))
    difference = abs(growth_of_loop(at(near), instances, OTHER_PULSE, known) - growths[near])
    return replace(found, accuracy=found.accuracy + uncertainty(growths, limit, difference))


def _by_twins(at: Callable[[float], System], span: Range) -> LinearLimit:
    """By perturbed twin runs; none where growth depends on the size of the pulse, as of code that rounds coarsely.

    Rounding grows and decays as rounding does, whatever the limit: two pulses of about one size have to agree, too.
    """
    with closing(Instances()) as instances:
        known, growths = _known_at_own(at, span, instances), dict[float, float]()

        def growth(value: float) -> float:
            if value not in growths:
                growths[value] = _rate(at, instances, known, 1.0, value)
            return growths[value]

        found = _first_growth(growth, span, TWINS, TWINS_TOLERANCE)
        if found.limit is None:
            return found
        end = found.limit
        near = _beside(end, growth, growths, span, (False, True))
        first, alike = [growth(value) for value in near], [_rate(at, instances, known, DITHERED, v) for v in near]
        if max(abs(a - b) for a, b in zip(first, alike)) <= AGREE * abs(first[1] - first[0]) and all(
            (_rate(at, instances, known, OTHER_SIZE, value) > 0.0) == grows
            for end, both in ((found.limit, (False, True)), (found.lower, (True, False)))
            if end is not None
            for value, grows in zip(_beside(end, growth, growths, span, both), both)
        ):
            return replace(found, limit=_as_accurate(found.limit, found), lower=_as_accurate(found.lower, found))

        def repeats(value: float) -> bool:
            return not at(value).uses_scheduler or repeating_period(deterministic(at(value))) is not None

        unknown = next((v for v in sorted(near, key=lambda v: abs(v - end)) if not repeats(v)), None)
        if unknown is not None:
            before = filter(repeats, sorted((v for v in growths if v < end), reverse=True))
            decays = list(takewhile(lambda v: growths[v] < 0.0, before))
            if decays and _rate(at, instances, known, OTHER_SIZE, decays[0]) > 0.0:
                decays.clear()
            return LinearLimit(
                reason=f"no local limit: {_tried_before(decays, span)}at {span.text(unknown)} {_load(at(unknown))}the "
                "schedule of computers and networks is not known to repeat, so that no law of one period says whether "
                "small deviations grow: expected values at which it repeats soon, as expect tells"
            )
    return LinearLimit(
        reason="no local limit: whether small deviations grow depends on how small they are, as of code in single "
        "precision, or that switches"
    )


def _load(system: System) -> str:
    """Its overloaded processors, in words before what follows from them; empty without one."""
    return "".join(f"{one.text()}; " for one in overloads(system))


def _as_accurate(end: float | None, found: LinearLimit) -> float | None:
    """An end without the digits that its accuracy does not bear."""
    return end if end is None or not found.accuracy else round(end, -math.floor(math.log10(found.accuracy)))


def _beside(
    end: float, growth: Growth, growths: Mapping[float, float], span: Range, grows: tuple[bool, bool]
) -> tuple[float, float]:
    """A value below an end and one above it, `NEAR` it; nearer where the loop is another one there.

    As that of a computer which has no time left for one of its tasks.
    """
    low, high = max(min(span.values()), (1.0 - NEAR) * end), min(span.last, (1.0 + NEAR) * end)

    def like(far: float, grows: bool) -> float:
        if (growth(far) > 0.0) == grows:
            return far
        between = sorted((v for v in growths if min(end, far) < v < max(end, far)), key=lambda v: abs(v - end))
        return max(takewhile(lambda v: (growths[v] > 0.0) == grows, between), key=lambda v: abs(v - end), default=far)

    return like(low, grows[0]), like(high, grows[1])


def _rate(
    at: Callable[[float], System], instances: Instances, known: KnownTangents, factor: float, value: float
) -> float:
    return growth_of(at(value), instances, factor, known).rate


def _known_at_own(at: Callable[[float], System], span: Range, instances: Instances) -> KnownTangents:
    """Where the system itself comes to rest, if it runs to rest; else, as where it is unstable, that of an end."""
    known = KnownTangents()
    for value in (span.own, span.values()[0], span.last):
        if value is not None and known.start is None:
            with suppress(UsageError):
                keep_start(at(value), instances, known)
    return known


def _tried_before(decays: Sequence[float], span: Range) -> str:
    """What small deviations do at values at which they decay, in words; empty without such values."""
    ends = dict.fromkeys(map(span.text, (min(decays), max(decays)))) if decays else ()
    return f"small deviations decay at what was tried before, {' to '.join(ends)}; " if ends else ""


def _naming_values(growth: Growth, span: Range) -> Growth:
    """The same, whose errors say at which value there is no loop at rest, and what has been found before."""
    decays = list[float]()

    def named(value: float) -> float:
        try:
            found = growth(value)
        except (NotAnEquilibriumError, ImpreciseError) as error:
            raise type(error)(f"{_tried_before(decays, span)}at {span.text(value)}: {error}") from error
        decays.extend([value] if found < 0.0 else [])
        return found

    return named


def _first_tried(growth: Growth, span: Range, rates: Commensurate, report: Share) -> LinearLimit:
    """The first value at which small deviations grow, up and down from the system's own, and all that were found."""
    if not rates.scan:
        return LinearLimit(reason="no local limit: several rates, which repeat together at no value of the scan")
    tried = dict[float, float]()

    def kept(value: float) -> float:
        if value not in tried:
            tried[value] = growth(value)
            report(min(1.0, len(tried) / (len(rates.scan) + NARROWING)))
        return tried[value]

    for value in rates.longest_first:
        with suppress(UsageError):  # a loop that is unstable need not come to rest
            kept(value)
    named = _naming_values(kept, span)

    def grows(value: float) -> bool:
        return named(value) > 0.0

    ends = ends_of_good(grows, rates.scan, span.own, span.last)
    lower, upper = (None if end is None or end.good is None else narrowed(grows, end, rates) for end in ends)
    runs = [
        [value for value, _ in run]
        for is_bad, run in groupby(sorted(tried.items()), key=lambda one: one[1] > 0.0)
        if is_bad
    ]
    each = [" to ".join(map(span.text, dict.fromkeys((run[0], run[-1])))) for run in runs]
    reason = (
        f"local: small deviations grow at {some(each) if each else 'none'}, of {len(tried)} values "
        f"from {span.text(rates.scan[0])} to {span.text(rates.scan[-1])} at which the several rates repeat together: "
        "stability need not be an interval, and others between may be unstable"
    )
    limit = _middle(upper)
    accuracy = None if upper is None or upper.good is None else 0.5 * (upper.bad - upper.good)
    return LinearLimit(limit=limit, lower=_middle(lower), method=LOOP, accuracy=accuracy, reason=reason)


def _by_secants(growth: Growth, span: Range, bracket: Bracket | None) -> Bracket | None:
    """The bracket narrowed to where growth is 0, or jumps."""
    if bracket is None or bracket.good is None:
        return bracket
    low, high = sorted((value, growth(value)) for value in bracket if value is not None)
    zero = LOOP_ZERO * growth(bracket.bad)
    return Bracket(*zero_between(growth, lambda value: short(value, span.unit), low, high, zero))


def _middle(bracket: Bracket | None) -> float | None:
    return None if bracket is None or bracket.good is None else 0.5 * (bracket.good + bracket.bad)


def _first_growth(growth: Growth, span: Range, method: str, finer: float | None) -> LinearLimit:
    """The values between which small deviations decay, by a scan and bisection; without `finer` by secants."""
    values, growth = span.values(), cache(_naming_values(growth, span))
    share = 1.0 if finer is None else finer
    ends = ends_of_good(
        lambda value: growth(value) > 0.0, values, span.own, share * span.tolerance, geometric=span.geometric
    )
    if finer is None:
        ends, share = Ends(*(_by_secants(growth, span, end) for end in ends)), LOOP_ZERO
    lower, upper = map(_middle, ends)
    reason = ""
    if ends.upper is None:
        start, end = span.text(values[0] if lower is None else lower), span.text(values[-1])
        reason = f"small deviations decay at each value tried from {start} to {end}, where the scan ends"
    elif upper is None:
        reason = f"small deviations grow at {span.text(values[0])}, where the scan begins"
    return LinearLimit(
        limit=upper,
        lower=lower,
        method=method,
        reason=reason,
        accuracy=None if upper is None else share * span.tolerance_at(upper),
    )
